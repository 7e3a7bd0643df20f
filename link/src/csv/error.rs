//! Why a file does not make a recording.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::recording::{RecordingError, Role};

/// Why a file does not make a recording. Each says what is wrong, where, and what to do, in one
/// sentence.
#[derive(Debug, Error)]
pub enum ReadError {
    /// The operating system does not open the file.
    #[error("cannot open {}: {reason}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        #[source]
        reason: io::Error,
    },
    /// Reading broke off.
    #[error("reading stopped after line {line}: {reason}")]
    Interrupted {
        /// Last line that was read.
        line: u64,
        /// What the operating system says.
        #[source]
        reason: io::Error,
    },
    /// There is nothing in the file.
    #[error("the file is empty; expected rows of time, output and input")]
    Empty,
    /// The file is not text.
    #[error("this is not a text table but {looks_like}; export the recording as CSV first")]
    NotText {
        /// What it looks like.
        looks_like: &'static str,
    },
    /// A NUL byte in the middle of the text.
    #[error("line {line} holds a NUL byte, so the file is damaged; cut it before that line")]
    NulByte {
        /// Where.
        line: u64,
    },
    /// A line beyond any table.
    #[error("line {line} is longer than {limit} bytes; a recording has one short row a line")]
    LineTooLong {
        /// Where.
        line: u64,
        /// Longest line accepted, in bytes.
        limit: usize,
    },
    /// A quote that opens and does not close on its line.
    #[error("line {line} opens a quote that it does not close; remove the quote")]
    UnclosedQuote {
        /// Where.
        line: u64,
    },
    /// Only a header, only comments, or no numbers at all.
    #[error(
        "there is no row of numbers in the first {lines} line(s); \
         expected rows of time, output and input"
    )]
    NoData {
        /// Lines looked at.
        lines: u64,
    },
    /// One column only.
    #[error(
        "line {line} has a single column; separate time, output and input by comma, semicolon, \
         tab, | or blanks"
    )]
    OneColumn {
        /// First line of numbers.
        line: u64,
    },
    /// A row with more or fewer cells than the others.
    #[error(
        "line {line} has {found} cells where {expected} are expected; correct the line, or \
         separate the columns by semicolons if they hold decimal commas"
    )]
    RaggedRow {
        /// Where.
        line: u64,
        /// Cells of the header, or of the first row.
        expected: usize,
        /// Cells on this line.
        found: usize,
    },
    /// A cell that is not a number.
    #[error(
        "line {line}, column {}: \"{text}\" is not a number; correct it or leave it empty \
         (thousands separators are not supported)",
        without_word(.column)
    )]
    NotANumber {
        /// Where.
        line: u64,
        /// Column as name and number.
        column: String,
        /// The cell, shortened.
        text: String,
    },
    /// Both decimal points and decimal commas.
    #[error(
        "line {line}, column {}: \"{text}\" mixes decimal comma and decimal point with \
         earlier cells; use one of them (thousands separators are not supported)",
        without_word(.column)
    )]
    MixedDecimals {
        /// Where.
        line: u64,
        /// Column as name and number.
        column: String,
        /// The cell, shortened.
        text: String,
    },
    /// Time as a time of day or a date.
    #[error(
        "line {line}, column {}: \"{text}\" is a date or a time of day; \
         export seconds from the start instead, or give the sample rate with --sample-rate",
        without_word(.column)
    )]
    ClockTime {
        /// Where.
        line: u64,
        /// Column as name and number.
        column: String,
        /// The cell, shortened.
        text: String,
    },
    /// Time goes back.
    #[error(
        "time goes back on line {line}: {after} follows {before}; \
         keep one run and cut the rest"
    )]
    TimeGoesBack {
        /// Where.
        line: u64,
        /// Stamp before, as in the file.
        before: String,
        /// Stamp on the line, as in the file.
        after: String,
    },
    /// The column that the caller named does not exist.
    #[error("there is no column {wanted} for the {role}; the columns are {}", listed(.columns))]
    NoSuchColumn {
        /// For which signal.
        role: Role,
        /// What the caller gave.
        wanted: String,
        /// Columns there are.
        columns: Vec<String>,
    },
    /// No column looks like this signal.
    #[error(
        "no column is known to be the {role}; choose it with --{role}{}: \
         the columns are {}",
        if *.role == Role::Time { ", or give the sample rate with --sample-rate" } else { "" },
        listed(.columns)
    )]
    UnknownColumn {
        /// Which signal.
        role: Role,
        /// Columns there are.
        columns: Vec<String>,
    },
    /// Several columns may be this signal.
    #[error(
        "{} may all be the {role}; choose one with --{role}",
        listed(.candidates)
    )]
    AmbiguousColumn {
        /// Which signal.
        role: Role,
        /// Columns that may be it.
        candidates: Vec<String>,
    },
    /// Input and output cannot be told apart by their values.
    #[error(
        "{} and {} cannot be told apart by their values; choose them with \
         --input and --output",
        .columns[0], .columns[1]
    )]
    InputOrOutput {
        /// The two columns.
        columns: [String; 2],
    },
    /// One column for two signals.
    #[error("{column} cannot be both the {first} and the {second}; choose another column")]
    SameColumn {
        /// The column.
        column: String,
        /// One signal.
        first: Role,
        /// The other.
        second: Role,
    },
    /// A sample rate that is not one.
    #[error("a sample rate of {rate_hz} Hz is not usable; give one between 1e-6 and 1e9 Hz")]
    BadSampleRate {
        /// What was given, in hertz.
        rate_hz: f64,
    },
    /// The rows do not make a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// Most columns that an error lists.
const MOST_LISTED: usize = 12;

/// A column's label behind the word `column`, which one without a name begins with.
fn without_word(label: &str) -> &str {
    label.strip_prefix("column ").unwrap_or(label)
}

fn listed(columns: &[String]) -> String {
    let mut list = columns[..columns.len().min(MOST_LISTED)].join(", ");
    if columns.len() > MOST_LISTED {
        list += &format!(" and {} more", columns.len() - MOST_LISTED);
    }
    list
}

/// Longest text that an error or a note quotes, in characters.
const MOST_QUOTED: usize = 32;

/// Text from the file as a sentence may quote it: short, on one line, printable.
pub(super) fn quoted(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(&text[..text.len().min(4 * MOST_QUOTED)]).into_owned();
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
