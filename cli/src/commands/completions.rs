//! `onecycle completions`: print the completion script of a shell.

use std::process::ExitCode;

use clap::CommandFactory;
use clap_complete::generate;

use crate::args::{Arguments, Completions};
use crate::failure::{Failure, exit};
use crate::output::print_data;

pub(crate) fn run(arguments: &Completions) -> Result<ExitCode, Failure> {
    let mut script = Vec::new();
    let mut command = Arguments::command();
    generate(arguments.shell, &mut command, "onecycle", &mut script);
    print_data(&script)?;
    Ok(ExitCode::from(exit::DONE))
}
