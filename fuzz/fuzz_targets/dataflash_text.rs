//! `cargo +nightly fuzz run --features libfuzzer dataflash_text`, from the root.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| onecycle_fuzz::run("dataflash_text", bytes));
