//! Why a file does not make a recording.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::options::ColumnRef;
use crate::recording::{ColumnLabel, RecordingError, Role, counted};
use crate::time_unit::TimeUnit;

/// Why a file does not make a recording. `Display` states what is wrong and where; what to do
/// about it is up to the caller. Text from the file is shortened to 32 printable characters.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system cannot open the file.
    #[error("cannot open {}: {reason}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        reason: io::Error,
    },
    /// The operating system stopped reading.
    #[error("reading stopped after line {line}: {reason}")]
    Interrupted {
        /// Last line that was read.
        line: u64,
        /// Error of the operating system.
        #[source]
        reason: io::Error,
    },
    /// The file is empty.
    #[error("the file is empty")]
    Empty,
    /// The file is not text.
    #[error("this is not a text table but {looks_like}")]
    NotText {
        /// What the content looks like, with an article: `a PNG image`.
        looks_like: &'static str,
    },
    /// A MATLAB file has more than 2^28 bytes, or more than 2^24 numbers in columns.
    #[error("the MATLAB file is larger than 268 MB, or has more than 16.7 million numbers")]
    MatTooLarge,
    /// A MATLAB file has no two columns of numbers of the same length.
    #[error(
        "the MATLAB file has no two columns of numbers of the same length; its variables are {}", found.join(", ")
    )]
    MatNoTable {
        /// Names of its first variables.
        found: Vec<String>,
    },
    /// A file that is read as a whole is too large.
    #[error("the file is larger than {limit_mb} MB")]
    TooLarge {
        /// Largest size, in megabytes.
        limit_mb: usize,
    },
    /// The text begins like JSON, but is not JSON.
    #[error("line {line} is no JSON{}", if *.is_cut { ": the file is cut off" } else { "" })]
    BadJson {
        /// Line in the file, from 1.
        line: u64,
        /// Whether the text ends too early.
        is_cut: bool,
    },
    /// JSON without rows or lists of numbers.
    #[error(
        "the JSON has no table: neither rows as objects, nor lists of one length, nor a history that is known"
    )]
    JsonNoTable,
    /// A log of a printer with temperatures only.
    #[error(
        "the log has the temperatures and not the power of the heaters (`@:`), as RepRapFirmware writes it"
    )]
    NoPower,
    /// A log or a measurement file without numbers.
    #[error("the {format} has no channel of numbers")]
    NoNumbers {
        /// What the file is.
        format: &'static str,
    },
    /// A NUL byte in the middle of the text.
    #[error("line {line} holds a NUL byte, so the file is damaged")]
    NulByte {
        /// Line in the file, from 1.
        line: u64,
    },
    /// A line is too long for a table.
    #[error("line {line} is longer than {limit} bytes")]
    LineTooLong {
        /// Line in the file, from 1.
        line: u64,
        /// Longest line accepted, in bytes.
        limit: usize,
    },
    /// A quote is not closed on its line.
    #[error("line {line} opens a quote and does not close it")]
    UnclosedQuote {
        /// Line in the file, from 1.
        line: u64,
    },
    /// The file has only a header, only comments, or no numbers at all.
    #[error("found no row of numbers in {}", counted(*.lines, "line"))]
    NoData {
        /// Number of lines searched.
        lines: u64,
    },
    /// The table has only one column.
    #[error("line {line} has a single column")]
    OneColumn {
        /// First line of numbers.
        line: u64,
    },
    /// A row has more or fewer cells than the header or the first row.
    #[error("line {line} has {} where {expected} are expected", counted(*.found as u64, "cell"))]
    RaggedRow {
        /// Line in the file, from 1.
        line: u64,
        /// Cells of the header, or of the first row.
        expected: usize,
        /// Cells on this line.
        found: usize,
    },
    /// The column of a signal is empty, or holds text alone.
    #[error("{column} holds no number")]
    NoNumber {
        /// Column.
        column: ColumnLabel,
    },
    /// Frames of a CAN bus without a description, or with that of other frames.
    #[error(
        "{}", if *.is_given { "the DBC file describes no frame of this log of candump" } else { "a log of candump holds bytes, and no DBC file says what they are" }
    )]
    NoDbc {
        /// Whether there is a DBC file.
        is_given: bool,
    },
    /// The frames of a log of candump have no times, or times since the frame before.
    #[error("the frames of this log of candump have no times that count from one start")]
    NoCanTimes,
    /// A DBC file has a signal that cannot be read, or none.
    #[error("the DBC file has no signal that can be read on line {line}")]
    BadDbc {
        /// Line in the DBC file, from 1.
        line: usize,
    },
    /// A cell is not a number.
    #[error("line {line}, {column}: \"{text}\" is not a number")]
    NotANumber {
        /// Line in the file, from 1.
        line: u64,
        /// Column.
        column: ColumnLabel,
        /// The cell.
        text: String,
    },
    /// The file has both decimal points and decimal commas.
    #[error(
        "line {line}, {column}: \"{text}\" and earlier cells mix decimal commas and decimal points"
    )]
    MixedDecimals {
        /// Line in the file, from 1.
        line: u64,
        /// Column.
        column: ColumnLabel,
        /// The cell.
        text: String,
    },
    /// A time stamp is a time of day without a date, a date without a time of day, or of an unknown form.
    #[error("line {line}, {column}: \"{text}\" is not a date with a time of day")]
    ClockTime {
        /// Line in the file, from 1.
        line: u64,
        /// Column.
        column: ColumnLabel,
        /// The cell.
        text: String,
    },
    /// Neither the header nor the stamps show the unit of time. Nothing else is wrong with the file.
    #[error("{column} gives no unit of time: {}", possibilities(*.step, .possible))]
    AmbiguousTime {
        /// Time column.
        column: ColumnLabel,
        /// Median increment, in the unit that is unknown.
        step: f64,
        /// The units that give a possible sample period.
        possible: Vec<TimeUnit>,
        /// Which of the possible units such stamps usually have.
        usual: Option<TimeUnit>,
    },
    /// Day and month of a date can be taken in either order.
    #[error(
        "line {line}, {column}: \"{text}\" does not show which number is the day and which the month"
    )]
    AmbiguousDate {
        /// Line in the file, from 1.
        line: u64,
        /// Column.
        column: ColumnLabel,
        /// The cell.
        text: String,
    },
    /// A time stamp is smaller than the one before it.
    #[error("time goes back on line {line}: {after} follows {before}")]
    TimeGoesBack {
        /// Line in the file, from 1.
        line: u64,
        /// Time stamp before, as in the file.
        before: String,
        /// Time stamp on the line, as in the file.
        after: String,
    },
    /// The column that the caller named does not exist.
    #[error("there is no column {wanted} for the {role}; the columns are {}", listed(.columns))]
    NoSuchColumn {
        /// For which signal.
        role: Role,
        /// The column that the caller named.
        wanted: ColumnRef,
        /// All columns of the file.
        columns: Vec<ColumnLabel>,
    },
    /// No column is recognised as this signal.
    #[error("no column is known to be the {role}; the columns are {}", listed(.columns))]
    UnknownColumn {
        /// Which signal.
        role: Role,
        /// All columns of the file.
        columns: Vec<ColumnLabel>,
    },
    /// Several columns may be this signal.
    #[error("several columns may be the {role}: {}", listed(.candidates))]
    AmbiguousColumn {
        /// Which signal.
        role: Role,
        /// The columns.
        candidates: Vec<ColumnLabel>,
    },
    /// The file holds several control loops.
    #[error("the file holds several control loops: {}", names(.loops))]
    SeveralLoops {
        /// Their names.
        loops: Vec<String>,
    },
    /// The control loop that the caller named is not in the file.
    #[error("there is no control loop {wanted}; {}", loops_found(.loops))]
    NoSuchLoop {
        /// The name that the caller gave.
        wanted: String,
        /// The loops of the file.
        loops: Vec<String>,
    },
    /// No tag of a table of one value a row is recognised as this signal.
    #[error("no tag is known to be the {role}; the tags are {}", names(.tags))]
    UnknownTag {
        /// Which signal.
        role: Role,
        /// The tags of the file.
        tags: Vec<String>,
    },
    /// A table of one value a row has too many values to keep.
    #[error("the file has more than {limit} values of tags")]
    TooManyValues {
        /// Most values that are kept.
        limit: usize,
    },
    /// Input and output cannot be told apart by their values.
    #[error(
        "the values of {} and {} do not show which is the input and which the output",
        .columns[0], .columns[1]
    )]
    InputOrOutput {
        /// The two columns.
        columns: [ColumnLabel; 2],
    },
    /// A column named `Input` is the measurement for Arduino's PID libraries, and the input of the process elsewhere.
    #[error(
        "{} and {} may be input and output of the process, or of the controller, as Arduino's PID libraries name them",
        .columns[0], .columns[1]
    )]
    InputOfWhat {
        /// The columns `Input` and `Output`.
        columns: [ColumnLabel; 2],
    },
    /// The cells of a column have different units.
    #[error("line {line}, {column}: \"{text}\" has another unit than the cells before it")]
    MixedUnits {
        /// Line in the file, from 1.
        line: u64,
        /// Column.
        column: ColumnLabel,
        /// The cell.
        text: String,
    },
    /// The caller chose one column for two signals.
    #[error("{column} cannot be both the {first} and the {second}")]
    SameColumn {
        /// The column.
        column: ColumnLabel,
        /// One signal.
        first: Role,
        /// The other.
        second: Role,
    },
    /// The sample rate that the caller gave is out of range.
    #[error("a sample rate of {rate_hz} Hz is not between 1e-6 and 1e9 Hz")]
    BadSampleRate {
        /// The sample rate given, in hertz.
        rate_hz: f64,
    },
    /// The rows do not make a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// Maximum number of columns that an error lists.
const MOST_LISTED: usize = 12;

fn listed(columns: &[ColumnLabel]) -> String {
    let shown = columns.iter().take(MOST_LISTED).map(ToString::to_string);
    let mut list = shown.collect::<Vec<_>>().join(", ");
    if columns.len() > MOST_LISTED {
        list += &format!(" and {} more", columns.len() - MOST_LISTED);
    }
    list
}

fn names(all: &[String]) -> String {
    let mut list = all[..all.len().min(MOST_LISTED)].join(", ");
    if all.len() > MOST_LISTED {
        list += &format!(" and {} more", all.len() - MOST_LISTED);
    }
    list
}

fn loops_found(loops: &[String]) -> String {
    match loops {
        [] => {
            "no two columns have the names of one loop, such as LIC101.PV and LIC101.OP".to_owned()
        }
        loops => format!("the loops are {}", names(loops)),
    }
}

/// What a step of time stamps may be in each unit: `a step of 1 is 1 ms or 1 s`.
fn possibilities(step: f64, units: &[TimeUnit]) -> String {
    // Four significant digits.
    let step = format!("{step:.3e}").parse().unwrap_or(step);
    let shown: Vec<String> = (units.iter())
        .map(|unit| format!("{step} {}", unit.symbol()))
        .collect();
    match shown.as_slice() {
        [] => format!("a step of {step} is no usual sample period in any unit"),
        all => format!("a step of {step} is {}", all.join(" or ")),
    }
}

/// Longest text that an error or a note quotes, in characters.
const MOST_QUOTED: usize = 32;

/// Text of a cell: UTF-8, or else Latin-1. The end may be cut within a letter.
pub(super) fn decoded(text: &[u8]) -> String {
    match std::str::from_utf8(text) {
        Err(error) if error.error_len().is_some() => text.iter().copied().map(char::from).collect(),
        _ => String::from_utf8_lossy(text).into_owned(),
    }
}

/// Text from the file as an error may quote it: short, on one line, printable.
pub(super) fn quoted(text: &[u8]) -> String {
    let text = decoded(&text[..text.len().min(4 * MOST_QUOTED)]);
    let mut short: String = text
        .chars()
        .filter(|c| !c.is_control())
        .take(MOST_QUOTED)
        .collect();
    if text.chars().count() > MOST_QUOTED {
        short += "...";
    }
    short
}
