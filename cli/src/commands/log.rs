//! `onecycle log`: what a flight log holds.

use std::process::ExitCode;

use onecycle::source::is_flight_log;
use onecycle::{LogFile, Source};
use onecycle_link::LogFormat;

use crate::args::Log;
use crate::failure::{Failure, exit};
use crate::output::print;
use crate::reading::Input;
use crate::report::log as report;

pub(crate) fn run(arguments: &Log) -> Result<ExitCode, Failure> {
    let source = Input::new(&arguments.file)?;
    let file = LogFile::scan(&source)?;
    if file.log.format == LogFormat::Mcap && !is_flight_log(&source) {
        return Err(Failure::unreadable(
            &arguments.file,
            "it has no signals of PX4; onecycle identify reads its topics as a table",
        ));
    }
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
