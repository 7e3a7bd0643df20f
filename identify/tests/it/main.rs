//! Tests of the public interface: verdicts, remarks and estimates as values that programs depend on.

#![expect(
    clippy::unwrap_used,
    reason = "the lint does not recognise helper functions as parts of tests"
)]

mod checks;
mod forces;
mod instrument;
mod lags;
mod names;
mod outcomes;
mod rest;
mod steps;
mod unstable;
