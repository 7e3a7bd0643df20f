//! `onecycle log`: what a flight log holds; and the recording of one of its control loops.

use std::io::{self, Read};
use std::path::Path;
use std::process::ExitCode;

use onecycle::Recording;
use onecycle_link::{Axis, ControlLoop, Flight, FlightLog, LogError, LogFormat, ReadBack, Signals};

use crate::args::{Log, LogArguments};
use crate::failure::{Failure, exit};
use crate::output::{Waiting, print};
use crate::reading::{head, open_with_bar};
use crate::report::log as report;
use crate::words::log::refusal;

/// Largest flight log on the standard input, in bytes: it is read twice, so it is kept.
const MOST_PIPED: u64 = 1 << 29;

/// What the standard input holds.
pub(super) enum Piped {
    /// An entire flight log.
    Log(Vec<u8>),
    /// The first bytes of anything else; the others are still to be read.
    Other(Vec<u8>),
}

/// Where a flight log comes from.
pub(crate) struct Source<'a> {
    pub(crate) path: &'a Path,
    /// The log, if it came from the standard input.
    pub(crate) bytes: Option<&'a [u8]>,
}

impl Source<'_> {
    fn open(&self) -> Result<Box<dyn Read + '_>, Failure> {
        match self.bytes {
            Some(bytes) => Ok(Box::new(bytes)),
            None => match open_with_bar(self.path) {
                Ok(file) => Ok(Box::new(file)),
                Err(error) => Err(Failure::unreadable(self.path, error)),
            },
        }
    }

    pub(crate) fn scan(&self) -> Result<FlightLog, Failure> {
        FlightLog::scan(self.open()?).map_err(|error| unreadable(self.path, &error))
    }
}

/// Reads the standard input if it is a flight log, or else its first bytes.
pub(super) fn piped() -> Result<Piped, Failure> {
    let failed = |error: io::Error| Failure::unreadable(Path::new("-"), error);
    let mut bytes = Vec::new();
    let mut input = io::stdin().lock();
    let most = LogFormat::HEAD_BYTES as u64;
    input
        .by_ref()
        .take(most)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    if LogFormat::detect(&bytes).is_none() {
        return Ok(Piped::Other(bytes));
    }
    let _waiting = Waiting::on("reading the standard input");
    input
        .take(MOST_PIPED)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    if bytes.len() as u64 > MOST_PIPED {
        let reason =
            format!("the log has more than {MOST_PIPED} bytes: write it to a file and name that");
        return Err(Failure::unreadable(Path::new("-"), reason));
    }
    Ok(Piped::Log(bytes))
}

pub(crate) fn run(arguments: &Log) -> Result<ExitCode, Failure> {
    let bytes = match arguments.file == Path::new("-") {
        true => Some(match piped()? {
            Piped::Log(bytes) | Piped::Other(bytes) => bytes,
        }),
        false => None,
    };
    let path = arguments.file.as_path();
    let source = Source {
        path,
        bytes: bytes.as_deref(),
    };
    let log = source.scan()?;
    let name = arguments.file.display().to_string();
    let checks = if arguments.check {
        let of = |number| read_back(&source, &log, number);
        let checks: Result<Vec<_>, Failure> = (1..=log.flights.len()).map(of).collect();
        Some(checks?)
    } else {
        None
    };
    let moved = movements(&source, &log);
    print(&if arguments.json {
        report::json(&name, &log, &moved, checks.as_deref())
    } else {
        report::text(&name, &log, &moved, checks.as_deref())
    })?;
    Ok(ExitCode::from(exit::DONE))
}

/// Largest movement (rad/s) of the rate loops of each flight. `None`: no rate loop can be read.
pub(crate) fn movements(source: &Source<'_>, log: &FlightLog) -> Vec<Option<f64>> {
    let of = |(at, flight): (usize, &Flight)| {
        let loops = Axis::ALL.into_iter().filter_map(|axis| {
            let signals = signals(source, log, at + 1, ControlLoop::Rate(axis)).ok()?;
            flight.movement(&signals)
        });
        loops.max_by(f64::total_cmp)
    };
    log.flights.iter().enumerate().map(of).collect()
}

/// Whether a file begins like a flight log.
pub(crate) fn is_log(path: &Path) -> bool {
    let head = head(path, LogFormat::HEAD_BYTES as u64);
    head.is_some_and(|head| LogFormat::detect(&head).is_some())
}

/// Whether a file has the name of a flight log.
pub(super) fn is_named_log(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    ["ulg", "bin", "bbl", "bfl", "mcap"]
        .iter()
        .any(|own| ending == *own)
}

/// The recording of signals.
pub(super) fn recording(source: &Source<'_>, signals: &Signals) -> Result<Recording, Failure> {
    let recording = signals.recording();
    recording.map_err(|error| unreadable(source.path, &LogError::from(error)))
}

/// The signals of a loop of a flight (from 1).
pub(crate) fn signals(
    source: &Source<'_>,
    log: &FlightLog,
    flight: usize,
    of: ControlLoop,
) -> Result<Signals, Failure> {
    let signals = log.signals(source.open()?, flight, of);
    signals.map_err(|error| unreadable(source.path, &error))
}

/// What a log holds, and which flight (from 1) is meant.
pub(crate) fn scan_flight(
    source: &Source<'_>,
    asked: &LogArguments,
) -> Result<(FlightLog, usize), Failure> {
    let log = source.scan()?;
    let flight = longest(&log, asked);
    Ok((log, flight))
}

/// The flight (from 1) that is meant: without a choice the longest.
pub(crate) fn longest(log: &FlightLog, asked: &LogArguments) -> usize {
    let longest = log.flights.iter().enumerate().max_by(|(_, a), (_, b)| {
        let length_s = |flight: &Flight| flight.span.to_s - flight.span.from_s;
        length_s(a).total_cmp(&length_s(b))
    });
    asked.flight.unwrap_or(1 + longest.map_or(0, |(at, _)| at))
}

fn unreadable(path: &Path, error: &LogError) -> Failure {
    Failure::unreadable(path, refusal(error))
}

/// The gains of every rate loop of a flight, read back.
pub(super) fn read_back(
    source: &Source<'_>,
    log: &FlightLog,
    flight: usize,
) -> Result<Vec<ReadBack>, Failure> {
    log.read_back(source.open()?, flight)
        .map_err(|error| unreadable(source.path, &error))
}
