//! `onecycle log`: what a flight log holds.

use std::process::ExitCode;

use onecycle::{LogFile, Source};

use crate::args::Log;
use crate::failure::{Failure, exit};
use crate::output::print;
use crate::reading::Input;
use crate::report::log as report;

pub(crate) fn run(arguments: &Log) -> Result<ExitCode, Failure> {
    let source = Input::new(&arguments.file)?;
    let file = LogFile::scan(&source)?;
    let flights = 1..=file.log.flights.len();
    let checks = match arguments.check {
        true => Some(
            flights
                .map(|number| file.read_back(number))
                .collect::<Result<Vec<_>, _>>()?,
        ),
        false => None,
    };
    let (name, moved) = (source.name(), file.movements());
    print(&match arguments.json {
        true => report::json(&name, &file.log, &moved, checks.as_deref()),
        false => report::text(&name, &file.log, &moved, checks.as_deref()),
    })?;
    Ok(ExitCode::from(exit::DONE))
}
