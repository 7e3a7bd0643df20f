//! Where a recording comes from.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use onecycle_link::{
    Axis, ControlLoop, CsvOptions, Flight, FlightLog, LogError, LogFormat, ReadBack, ReadError,
    Recording, Signals,
};

use crate::error::Error;

/// Bytes of a recording, which are read from their start as often as they are needed: twice for a flight log.
pub trait Source: Sync {
    /// Its name in reports and messages.
    fn name(&self) -> String;

    /// Its bytes from the start.
    ///
    /// # Errors
    /// The error of the system.
    fn open(&self) -> io::Result<Box<dyn Read + '_>>;

    /// Its first bytes, at most `most`; none if they cannot be read, or only once.
    fn head(&self, most: u64) -> Vec<u8> {
        let mut head = Vec::new();
        let read = self
            .open()
            .map(|file| file.take(most).read_to_end(&mut head));
        match read {
            Ok(Ok(_)) => head,
            _ => vec![],
        }
    }
}

/// A path as text for people: control characters, which would command a terminal, are replaced.
pub fn shown(path: &Path) -> String {
    let text = path.display().to_string();
    text.replace(char::is_control, "\u{fffd}")
}

impl Source for PathBuf {
    fn name(&self) -> String {
        shown(self)
    }

    fn open(&self) -> io::Result<Box<dyn Read + '_>> {
        let file = File::open(self)?;
        // On Unix a folder can be opened but not read.
        match file.metadata()?.is_dir() {
            true => Err(io::Error::new(ErrorKind::IsADirectory, "Is a directory")),
            false => Ok(Box::new(file)),
        }
    }

    fn head(&self, most: u64) -> Vec<u8> {
        let mut head = Vec::new();
        // A pipe must not be read twice.
        let file = File::open(self).ok().filter(|_| self.is_file());
        let read = file.map(|file| file.take(most).read_to_end(&mut head));
        match read {
            Some(Ok(_)) => head,
            _ => vec![],
        }
    }
}

/// Whether a source begins like a flight log. An MCAP log must have signals of PX4: others are tables.
pub fn is_flight_log(source: &dyn Source) -> bool {
    match LogFormat::detect(&source.head(LogFormat::HEAD_BYTES as u64)) {
        Some(LogFormat::Mcap) => {
            let has_loop = |flight: &Flight| {
                (flight.loops.iter()).any(|one| one.input.is_some() || one.output.is_some())
            };
            match source.open().map(FlightLog::scan) {
                Ok(Ok(log)) => log.flights.iter().any(has_loop),
                // Other messages than those of ROS 2.
                Ok(Err(LogError::Empty)) => false,
                _ => true,
            }
        }
        found => found.is_some(),
    }
}

/// Whether a source has the name of a flight log.
pub(crate) fn is_named_log(source: &dyn Source) -> bool {
    let name = PathBuf::from(source.name());
    let ending = name.extension().unwrap_or_default().to_ascii_lowercase();
    ["ulg", "bin", "bbl", "bfl", "mcap"]
        .iter()
        .any(|own| ending == *own)
}

/// Reads a table.
pub(crate) fn table(source: &dyn Source, options: &CsvOptions) -> Result<Recording, Error> {
    let name = source.name();
    let recording = match source.open() {
        Ok(file) => onecycle_link::read_from(file, options),
        Err(reason) => Err(ReadError::Open {
            path: PathBuf::from(&name),
            reason,
        }),
    };
    recording.map_err(|reason| match reason {
        ReadError::NotText { .. } if is_named_log(source) => {
            Error::of_log(&name, &LogError::UnknownFormat)
        }
        reason => Error::Recording {
            name,
            reason: Box::new(reason),
        },
    })
}

/// A flight log, and what it holds.
pub struct LogFile<'a> {
    source: &'a dyn Source,
    /// What it holds.
    pub log: FlightLog,
    /// The gains read back of one flight: all axes of a survey ask for them.
    read_back: Mutex<Option<(usize, Vec<ReadBack>)>>,
}

impl<'a> LogFile<'a> {
    /// Reads what a flight log holds.
    ///
    /// # Errors
    /// It cannot be read, or is no flight log.
    pub fn scan(source: &'a dyn Source) -> Result<Self, Error> {
        let log = FlightLog::scan(opened(source)?);
        let log = log.map_err(|error| Error::of_log(&source.name(), &error))?;
        Ok(Self::new(source, log))
    }

    /// A flight log that was scanned before.
    pub fn new(source: &'a dyn Source, log: FlightLog) -> Self {
        Self {
            source,
            log,
            read_back: Mutex::default(),
        }
    }

    /// Name of the file.
    #[must_use]
    pub fn name(&self) -> String {
        self.source.name()
    }

    /// The flight (from 1) that is meant: without a choice the longest.
    pub fn flight(&self, asked: Option<usize>) -> usize {
        let longest = self
            .log
            .flights
            .iter()
            .enumerate()
            .max_by(|(_, a), (_, b)| {
                let length_s = |flight: &Flight| flight.span.to_s - flight.span.from_s;
                length_s(a).total_cmp(&length_s(b))
            });
        asked.unwrap_or(1 + longest.map_or(0, |(at, _)| at))
    }

    /// The signals of a loop of a flight (from 1).
    ///
    /// # Errors
    /// There is no such flight, or the loop is not logged.
    pub fn signals(&self, flight: usize, of: ControlLoop) -> Result<Signals, Error> {
        let signals = self.log.signals(opened(self.source)?, flight, of);
        signals.map_err(|error| Error::of_log(&self.source.name(), &error))
    }

    /// Largest movement (rad/s) of the rate loops of each flight. `None`: no rate loop can be read.
    #[must_use]
    pub fn movements(&self) -> Vec<Option<f64>> {
        let of = |(at, flight): (usize, &Flight)| {
            let loops = Axis::ALL.into_iter().filter_map(|axis| {
                let signals = self.signals(at + 1, ControlLoop::Rate(axis)).ok()?;
                flight.movement(&signals)
            });
            loops.max_by(f64::total_cmp)
        };
        self.log.flights.iter().enumerate().map(of).collect()
    }

    /// The gains of every rate loop of a flight, read back from its signals. The file is read once for the same flight.
    ///
    /// # Errors
    /// The log cannot be read any more.
    pub fn read_back(&self, flight: usize) -> Result<Vec<ReadBack>, Error> {
        let mut kept = self
            .read_back
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        match &*kept {
            Some((number, read)) if *number == flight => Ok(read.clone()),
            _ => {
                let read = self.log.read_back(opened(self.source)?, flight);
                let read = read.map_err(|error| Error::of_log(&self.source.name(), &error))?;
                *kept = Some((flight, read.clone()));
                Ok(read)
            }
        }
    }

    /// The recording of signals.
    pub(crate) fn recording(&self, signals: &Signals) -> Result<Recording, Error> {
        let recording = signals.recording();
        recording.map_err(|error| Error::of_log(&self.source.name(), &LogError::from(error)))
    }
}

fn opened(source: &dyn Source) -> Result<Box<dyn Read + '_>, Error> {
    source.open().map_err(|error| Error::Unreadable {
        name: source.name(),
        reason: error.to_string(),
    })
}
