//! Tests of the program as users run it, and of the structure of the workspace. All are modules of one test program, which
//! is linked once: `cargo test -p onecycle-cli --test it tune` runs those of `tune`.

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
mod colours;
mod commands;
mod common;
mod documentation;
mod flight_log_gains;
mod flight_logs;
mod fly;
mod heaters;
mod hostile_names;
mod imports;
mod json_schema;
mod library;
mod links;
mod live;
mod pages;
mod report;
mod simulate;
mod studio;
mod terminal;
mod tune;
mod tune_oscillation;

/// The program that has a command: here the only one.
fn path_of(_command: &str) -> &'static str {
    env!("CARGO_BIN_EXE_onecycle")
}
