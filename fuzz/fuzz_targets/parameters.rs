//! `cargo +nightly fuzz run --features libfuzzer parameters`, from the root.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| onecycle_fuzz::run("parameters", bytes));
