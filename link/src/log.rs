//! Flight logs: PX4 ULog and MCAP, ArduPilot DataFlash, Betaflight and INAV blackbox.
//!
//! ```text
//! bytes -> tables     flights, topics, parameters; only the chosen columns     ulog.rs, dataflash.rs, blackbox.rs, mcap.rs
//! tables -> flight    firmware, loops, gains, filters, marks                   firmware.rs, flight.rs
//! tables -> signals   set-point, input and output of a loop on one clock       plan.rs
//! signals -> gains    recovered by least squares, beside the parameters        law.rs, readback.rs
//! ```

mod blackbox;
mod dataflash;
mod error;
mod firmware;
mod flight;
mod law;
mod loops;
#[cfg(feature = "mcap")]
mod mcap;
mod plan;
mod readback;
mod scalar;
mod source;
mod stretches;
mod tables;
mod ulog;

use std::io::Read;

pub use error::LogError;
pub use firmware::gain_names;
pub use flight::{
    Firmware, FirmwareKind, Flight, Gain, LoggedLoop, LoggedSignal, Mark, MarkKind, Setting, Span,
    Term,
};
pub use law::{LowPassSetting, RateLaw};
pub use loops::{Axis, ControlLoop};
pub use plan::Signals;
pub use readback::{Agreement, ReadBack, ReadTerm};
pub use tables::{FlightTables, LogFormat, LogParameter, LogTables, Loss, Topic, Wanted};

use self::source::Source;
use crate::recording::{
    Column, Columns, Note, Position, Recording, RecordingBuilder, RecordingError,
};

/// What a flight log holds.
///
/// ```no_run
/// use std::fs::File;
/// use onecycle_link::{Axis, ControlLoop, FlightLog};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let log = FlightLog::scan(File::open("flight.ulg")?)?;
/// let signals = log.signals(File::open("flight.ulg")?, 1, ControlLoop::Rate(Axis::Roll))?;
/// let recording = signals.recording()?;
/// println!("{} rows", recording.len());
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FlightLog {
    /// Format of the file.
    pub format: LogFormat,
    /// The flights, in order.
    pub flights: Vec<Flight>,
    /// What was lost.
    pub loss: Loss,
}

impl FlightLog {
    /// Reads what a log holds, but no signals. `bytes` need not be buffered.
    ///
    /// # Errors
    /// The format is unknown, reading stopped, or no flight has data.
    pub fn scan(bytes: impl Read) -> Result<Self, LogError> {
        let tables = read_tables(bytes, &firmware::wanted())?;
        let format = tables.format;
        let flights = tables
            .flights
            .into_iter()
            .map(|flight| describe(format, flight))
            .collect();
        let log = Self {
            format,
            flights,
            loss: tables.loss,
        };
        let is_empty = log
            .flights
            .iter()
            .all(|flight| flight.tables.topics.iter().all(|topic| topic.rows == 0));
        if is_empty {
            Err(LogError::Empty)
        } else {
            Ok(log)
        }
    }

    /// Reads the signals of a loop of a flight (from 1) out of the same bytes.
    ///
    /// # Errors
    /// There is no such flight, its signals were not logged, or reading stopped.
    pub fn signals(
        &self,
        bytes: impl Read,
        flight: usize,
        control_loop: ControlLoop,
    ) -> Result<Signals, LogError> {
        let no_flight = LogError::NoSuchFlight {
            wanted: flight,
            flights: self.flights.len(),
        };
        let Some(about) = flight.checked_sub(1).and_then(|at| self.flights.get(at)) else {
            return Err(no_flight);
        };
        let kind = about.firmware.kind;
        let Some(plan) = firmware::plan(kind, &about.tables, control_loop) else {
            let missing = firmware::plans(kind, &about.tables, control_loop);
            let needed = missing
                .iter()
                .flat_map(|plan| plan.needed().map(|q| q.name()));
            let mut missing: Vec<String> = needed.collect();
            missing.dedup();
            return Err(LogError::NotLogged {
                control_loop,
                missing,
            });
        };
        let tables = read_tables(bytes, &plan.wanted())?;
        match tables.flights.get(flight - 1) {
            Some(tables) => Ok(Signals {
                output_filter_hz: firmware::output_filter_hz(kind, &about.tables, control_loop),
                ..plan.join(flight, tables)
            }),
            None => Err(no_flight),
        }
    }
}

impl Signals {
    /// The signals as a recording, with the set-point if it is logged.
    ///
    /// # Errors
    /// There are too few rows, or they make no recording.
    pub fn recording(&self) -> Result<Recording, RecordingError> {
        let column = |at: usize| Column::named(&self.names[at]).with_unit(self.units[at]);
        let mut columns = Columns::new(Column::named("time").with_unit("s"), column(0), column(1));
        if self.set_point.is_some() {
            let unit = self.units[1];
            columns = columns.with_set_point(Column::named("set-point").with_unit(unit));
        }
        let mut builder = RecordingBuilder::new(columns);
        let [input, output] = self.names.clone();
        builder.note(Note::LogSignals {
            flight: self.flight,
            control_loop: self.control_loop.to_string(),
            input,
            output,
        });
        if self.rows_dropped > 0 {
            let count = self.rows_dropped;
            builder.note(Note::LogRowsDropped { count });
        }
        for (row, &time_s) in self.time_s.iter().enumerate() {
            let at = Position::Sample(row as u64);
            let set_point = self.set_point.as_ref().map(|values| values[row]);
            builder.push_with(at, time_s, [self.input[row], self.output[row]], set_point)?;
        }
        let recording = builder.finish()?;
        Ok(recording.with_output_filter_hz(self.output_filter_hz))
    }
}

/// Reads the tables of a flight log, in one pass. `bytes` need not be buffered.
///
/// Damage is skipped and counted in [`LogTables::loss`].
///
/// # Errors
/// The first bytes are those of no log that is known, or reading stopped.
pub fn read_tables(bytes: impl Read, wanted: &Wanted) -> Result<LogTables, LogError> {
    let mut source = Source::new(bytes);
    match LogFormat::detect(source.peek(LogFormat::HEAD_BYTES)?) {
        Some(LogFormat::ULog) => ulog::read(source, wanted),
        Some(LogFormat::DataFlash) => dataflash::read(source, wanted),
        Some(LogFormat::DataFlashText) => dataflash::read_text(source, wanted),
        Some(LogFormat::Blackbox) => blackbox::read(source, wanted),
        #[cfg(feature = "mcap")]
        Some(LogFormat::Mcap) => mcap::read(source, wanted),
        #[cfg(not(feature = "mcap"))]
        Some(format @ LogFormat::Mcap) => Err(LogError::NotBuilt(format)),
        None => Err(LogError::UnknownFormat),
    }
}

/// What a flight's tables tell.
fn describe(format: LogFormat, flight: FlightTables) -> Flight {
    let firmware = firmware::firmware(format, &flight);
    let kind = firmware.kind;
    let span = span_of(&flight);
    let [filters, mixer] = firmware::settings(kind, &flight);
    let [armed, airborne] = firmware::armed_and_airborne(kind, &flight, span);
    Flight {
        firmware,
        span,
        loops: ControlLoop::ALL
            .map(|of| firmware::logged_loop(kind, &flight, of))
            .to_vec(),
        filters,
        mixer,
        marks: firmware::marks(kind, &flight),
        armed,
        airborne,
        tables: flight.without_rows(),
    }
}

/// Start and end of the topic with the most rows: others have stray rows long before or after the flight. Topics without a
/// clock do not count.
fn span_of(flight: &FlightTables) -> Span {
    let clocked = flight
        .topics
        .iter()
        .filter(|topic| topic.end_s > topic.start_s);
    let longest = clocked.max_by_key(|topic| topic.rows);
    Span {
        from_s: longest.map_or(0.0, |topic| topic.start_s),
        to_s: longest.map_or(0.0, |topic| topic.end_s),
    }
}
