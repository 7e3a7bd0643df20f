//! `cargo +nightly fuzz run --features libfuzzer estimator`, from the root.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| onecycle_fuzz::run("estimator", bytes));
