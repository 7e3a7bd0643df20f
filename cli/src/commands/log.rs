//! `onecycle log`: what a flight log holds; and the recording of one of its control loops.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::process::ExitCode;

use onecycle::Recording;
use onecycle_link::{FlightLog, LogError, LogFormat, ReadBack};

use crate::args::{Log, LogArguments};
use crate::failure::{Failure, exit};
use crate::output::print;
use crate::reading::open_with_bar;
use crate::report::log as report;
use crate::words::log::refusal;

pub(crate) fn run(arguments: &Log) -> Result<ExitCode, Failure> {
    let log = scan(&arguments.file)?;
    let name = arguments.file.display().to_string();
    let checks = if arguments.check {
        let of = |number| read_back(&arguments.file, &log, number);
        let checks: Result<Vec<_>, Failure> = (1..=log.flights.len()).map(of).collect();
        Some(checks?)
    } else {
        None
    };
    print(&if arguments.json {
        report::json(&name, &log, checks.as_deref())
    } else {
        report::text(&name, &log, checks.as_deref())
    })?;
    Ok(ExitCode::from(exit::DONE))
}

/// Whether a file begins like a flight log.
pub(super) fn is_log(path: &Path) -> bool {
    // A pipe must not be read twice.
    if !path.is_file() {
        return false;
    }
    let mut head = Vec::new();
    let most = LogFormat::HEAD_BYTES as u64;
    let read = File::open(path).and_then(|file| file.take(most).read_to_end(&mut head));
    read.is_ok() && LogFormat::detect(&head).is_some()
}

/// The recording of a control loop.
pub(super) fn recording(path: &Path, asked: &LogArguments) -> Result<Recording, Failure> {
    let (log, flight) = scan_flight(path, asked)?;
    let signals = log.signals(open(path)?, flight, asked.control_loop());
    let recording = signals.and_then(|signals| Ok(signals.recording()?));
    recording.map_err(|error| unreadable(path, &error))
}

/// What a log holds, and which flight (from 1) is meant.
pub(super) fn scan_flight(
    path: &Path,
    asked: &LogArguments,
) -> Result<(FlightLog, usize), Failure> {
    let log = scan(path)?;
    let longest = log.flights.iter().enumerate().max_by(|(_, a), (_, b)| {
        let length_s = |flight: &onecycle_link::Flight| flight.span.to_s - flight.span.from_s;
        length_s(a).total_cmp(&length_s(b))
    });
    let flight = asked.flight.unwrap_or(1 + longest.map_or(0, |(at, _)| at));
    Ok((log, flight))
}

fn scan(path: &Path) -> Result<FlightLog, Failure> {
    FlightLog::scan(open(path)?).map_err(|error| unreadable(path, &error))
}

fn open(path: &Path) -> Result<impl Read, Failure> {
    open_with_bar(path).map_err(|error| Failure::unreadable(path, error))
}

fn unreadable(path: &Path, error: &LogError) -> Failure {
    Failure::unreadable(path, refusal(error))
}

/// The gains of every rate loop of a flight, read back.
pub(super) fn read_back(
    path: &Path,
    log: &FlightLog,
    flight: usize,
) -> Result<Vec<ReadBack>, Failure> {
    log.read_back(open(path)?, flight)
        .map_err(|error| unreadable(path, &error))
}
