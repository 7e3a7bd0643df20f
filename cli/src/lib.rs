//! The program `onecycle`: identify a process from a relay test and design its optimal controller.
//!
//! Stages: `args` parses the command line, `commands` computes `results`, `report` shows them as text, JSON or HTML
//! (`pages`), and `failure` turns an error into one sentence and an exit code. `journal` keeps the work of interrupted runs.

mod args;
mod commands;
pub mod embed;
mod failure;
mod journal;
mod output;
mod pages;
mod reading;
mod report;
mod results;
mod settings;
mod style;
mod words;

use std::process::ExitCode;

use clap::Parser;

use crate::args::{Arguments, Command};
use crate::failure::exit;
use crate::output::complain;

/// Parses the command line, runs the command and returns its exit code.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = Arguments::parse();
    let result = match &arguments.command {
        Command::Identify(identify) => commands::identify::run(identify),
        Command::Log(log) => commands::log::run(log),
        #[cfg(not(target_family = "wasm"))]
        Command::Live(live) => commands::live::run(live),
        Command::Simulate(simulate) => commands::simulate::run(simulate),
        Command::Tune(tune) => commands::tune::run(tune),
        Command::Fly(fly) => commands::fly::run(fly),
        Command::Certify(certify) => commands::certify::run(certify),
        Command::Phase(phase) => commands::phase::run(phase),
        Command::Grid(grid) => commands::grid::run(grid),
        Command::Campaign(campaign) => commands::campaign::run(campaign),
        Command::Bench(bench) => commands::bench::run(bench),
        Command::Reproduce(reproduce) => commands::reproduce::run(reproduce),
        Command::Dataset(dataset) => commands::dataset::run(dataset),
        Command::Train(train) => commands::train::run(train),
        Command::Pack(pack) => commands::pack::run(pack),
        Command::Studio(studio) => commands::studio::run(studio),
        Command::Completions(completions) => commands::completions::run(completions),
        Command::Man(man) => commands::man::run(man),
    };
    match result {
        Ok(code) => code,
        Err(failure) if failure.is_closed_pipe() => ExitCode::from(exit::DONE),
        Err(failure) => {
            complain(&failure);
            ExitCode::from(failure.exit_code())
        }
    }
}
