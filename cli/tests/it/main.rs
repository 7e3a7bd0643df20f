//! Tests of the program as users run it, and of the structure of the workspace. All are modules of one test program, which
//! is linked once: `cargo test -p onecycle-cli --test it bench` runs those of `bench`.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests are tests too, which the lint does not see"
)]

mod answer;
mod architecture;
mod attitude_gains;
mod bad_arguments;
mod bad_files;
mod bad_signals;
mod bench;
mod certify;
mod commands;
mod common;
mod dataset;
mod documentation;
mod flight_log_gains;
mod flight_logs;
mod fly;
mod grid;
mod honesty;
mod identifier;
mod imports;
mod json_schema;
mod library;
mod live;
mod pack;
mod phase;
mod report;
mod reproduce;
mod simulate;
mod studio;
mod terminal;
mod train;
mod tune;
mod tune_oscillation;
mod unknown;
