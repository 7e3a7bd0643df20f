//! The program `onecycle-lab`: simulated experiments, training, evaluation and the reproduction of the paper.
//!
//! Stages as in `onecycle-cli`, whose arguments, files, messages and pages it shares: `args` parses the command line,
//! `commands` computes `results`, `report` shows them. `journal` keeps the work of interrupted runs.

mod args;
mod commands;
pub mod embed;
mod journal;
mod output;
mod reading;
mod report;
mod results;
mod settings;
mod workers;

use std::process::ExitCode;

use clap::Parser;

use crate::args::{Arguments, Command};

/// The name before every message.
const PROGRAM: &str = "onecycle-lab";

/// Parses the command line, runs the command and returns its exit code.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = Arguments::parse();
    let result = match &arguments.command {
        Command::Certify(certify) => commands::certify::run(certify),
        Command::Phase(phase) => commands::phase::run(phase),
        Command::Grid(grid) => commands::grid::run(grid),
        Command::Campaign(campaign) => commands::campaign::run(campaign),
        Command::Bench(bench) => commands::bench::run(bench),
        Command::Reproduce(reproduce) => commands::reproduce::run(reproduce),
        Command::Dataset(dataset) => commands::dataset::run(dataset),
        Command::Train(train) => commands::train::run(train),
        Command::Classify(classify) => commands::classify::run(classify),
        Command::Pack(pack) => commands::pack::run(pack),
    };
    onecycle_cli::ended(PROGRAM, result)
}
