//! The program `onecycle`: identify a process from a relay test and design its optimal controller.
//!
//! Stages: `args` parses the command line, `commands` computes `results`, `report` shows them as text, JSON or HTML
//! (`pages`), and `failure` turns an error into one sentence and an exit code.
//!
//! [`embed`] is for other languages. The other public names are for the program `onecycle-lab`, so that both read arguments
//! and show results in the same way; nothing else may rely on them.

#[doc(hidden)]
pub mod args;
mod commands;
pub mod embed;
#[doc(hidden)]
pub mod failure;
#[doc(hidden)]
pub mod output;
#[doc(hidden)]
pub mod packs;
#[doc(hidden)]
pub mod pages;
#[doc(hidden)]
pub mod reading;
#[doc(hidden)]
pub mod report;
mod results;
#[doc(hidden)]
pub mod style;
mod words;
#[doc(hidden)]
pub mod workers;

use std::process::ExitCode;

use clap::Parser;

use crate::args::{Arguments, Command};
use crate::failure::{Failure, exit};
use crate::output::complain;

/// The name before every message.
const PROGRAM: &str = "onecycle";

/// Parses the command line, runs the command and returns its exit code.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => match args::refused_command(&error) {
            Some(refusal) => return ended(PROGRAM, Err(refusal)),
            None => error.exit(),
        },
    };
    let result = match &arguments.command {
        Command::Identify(identify) => commands::identify::run(identify),
        Command::Log(log) => commands::log::run(log),
        #[cfg(not(target_family = "wasm"))]
        Command::Live(live) => commands::live::run(live),
        Command::Simulate(simulate) => commands::simulate::run(simulate),
        Command::Tune(tune) => commands::tune::run(tune),
        Command::Fly(fly) => commands::fly::run(fly),
        Command::Studio(studio) => commands::studio::run(studio),
        Command::Completions(completions) => commands::completions::run(completions),
        Command::Man(man) => commands::man::run(man),
    };
    ended(PROGRAM, result)
}

/// The exit code of a program; a failure is told on the error output.
#[doc(hidden)]
pub fn ended(program: &str, result: Result<ExitCode, Failure>) -> ExitCode {
    match result {
        Ok(code) => code,
        Err(failure) if failure.is_closed_pipe() => ExitCode::from(exit::DONE),
        Err(failure) => {
            complain(program, &failure);
            ExitCode::from(failure.exit_code())
        }
    }
}
