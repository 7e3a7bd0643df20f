//! The program: from its command line to its exit code.

use std::process::ExitCode;

use clap::Parser;

use crate::args::{self, Arguments, Command};
use crate::commands::{self, PROGRAM};
use crate::failure::{Failure, exit};
use crate::output::complain;

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
