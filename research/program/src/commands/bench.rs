//! `onecycle-lab bench`: make the public benchmark and run methods on it.

mod folder;
mod make;
mod recordings;
mod run;
mod traces;

use std::process::ExitCode;

use onecycle_cli::failure::Failure;

use crate::args::{Bench, BenchAction};

pub(crate) fn run(arguments: &Bench) -> Result<ExitCode, Failure> {
    match &arguments.action {
        BenchAction::Make(make) => make::run(make),
        BenchAction::Run(run) => run::run(run),
    }
}
