//! What a reader chose, forgave or dropped.

use thiserror::Error;

use super::{Position, Role};

/// What a reader chose, forgave or dropped; `Display` gives one plain sentence.
///
/// A note is no error; it is derived as one so that each sentence stands at its variant.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Note {
    /// Which columns were read, and why these.
    #[error(
        "time is {}, input is {input}, output is {output}, found {how}",
        time.as_deref().unwrap_or("counted by rows")
    )]
    ColumnsChosen {
        /// Time column as `"t" (column 1)`, or nothing when the sample rate was given.
        time: Option<String>,
        /// Input column.
        input: String,
        /// Output column.
        output: String,
        /// How they were found: "by name", ...
        how: &'static str,
    },
    /// The names of the columns were taken from a comment.
    #[error("took the names of the columns from the comment on line {line}")]
    HeaderInComment {
        /// Line of the comment.
        line: u64,
    },
    /// Lines of words were skipped.
    #[error("skipped {} before the header", counted(*.count as u64, "line"))]
    LinesSkipped {
        /// How many.
        count: usize,
    },
    /// The file was UTF-16.
    #[error("the file is UTF-16 text")]
    Utf16,
    /// The time column says that it is not in seconds, or the caller said so.
    #[error("the time column is in {unit}")]
    TimeUnit {
        /// Its unit.
        unit: &'static str,
    },
    /// The time column says nothing of its unit, so it was guessed from the stamps.
    #[error("the time column gives no unit: took its stamps to be in {unit}")]
    TimeUnitGuessed {
        /// The unit assumed.
        unit: &'static str,
    },
    /// Time starts so far from zero that it is counted from the first stamp.
    #[error("time is counted from the first stamp, {first}")]
    CountedFromFirst {
        /// First stamp as in the file.
        first: String,
    },
    /// The sample rate was given, so the time column was not read.
    #[error("did not read {name}, for the sample rate is given: {sample_rate_hz} Hz")]
    TimeIgnored {
        /// The time column, as `"t" (column 1)`.
        name: String,
        /// Sample rate in hertz.
        sample_rate_hz: f64,
    },
    /// The last line was cut off.
    #[error("dropped the last line, {line}, which is incomplete")]
    LastLineIncomplete {
        /// Its number.
        line: u64,
    },
    /// Rows without a number were dropped.
    #[error(
        "dropped {} whose {role} is not a number, the first at {first}",
        counted(*.count, "row")
    )]
    RowsDropped {
        /// The column that is not a number.
        role: Role,
        /// How many rows.
        count: u64,
        /// The first of them.
        first: Position,
    },
    /// Rows that repeat a stamp were dropped.
    #[error("dropped {} that repeated a stamp, the first at {first}", counted(*.count, "row"))]
    DuplicatesDropped {
        /// How many rows.
        count: u64,
        /// The first of them.
        first: Position,
    },
    /// The recording was too long to keep and was averaged.
    #[error(
        "averaged the recording in groups of {samples_per_point} samples, \
         {dropped} left over before gaps and at the end"
    )]
    Averaged {
        /// Samples in a point.
        samples_per_point: usize,
        /// Samples left over before gaps and at the end.
        dropped: u64,
    },
    /// There are gaps.
    #[error(
        "found {}, the longest of {} s at {at_s:?} s",
        counted(*.count as u64, "gap"), rounded(*.longest_s)
    )]
    Gaps {
        /// How many.
        count: usize,
        /// Longest gap in seconds.
        longest_s: f64,
        /// Where the longest gap starts, in seconds.
        at_s: f64,
    },
    /// The increments of time vary by more than 10 % of the sample period.
    #[error(
        "the increments of time vary by {:.0} % around {} s",
        100.0 * .jitter, rounded(*.sample_period_s)
    )]
    Jitter {
        /// Standard deviation of the increments over the sample period.
        jitter: f64,
        /// Sample period in seconds.
        sample_period_s: f64,
    },
}

/// `1 row`, `2 rows`.
pub(super) fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Four significant digits.
fn rounded(value: f64) -> String {
    let digits = format!("{value:.3e}");
    digits
        .parse()
        .map_or(digits, |rounded: f64| format!("{rounded:?}"))
}
