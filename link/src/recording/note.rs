//! What a reader chose, assumed or dropped.

use std::borrow::Cow;
use std::fmt;

use thiserror::Error;

use super::{ColumnLabel, Position, Role};
use crate::time_unit::TimeUnit;

/// What a reader chose, assumed or dropped; `Display` states the fact.
///
/// A note is not an error. It derives `Error` only so that each clause stands at its variant.
#[derive(Debug, Clone, PartialEq, Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Note {
    /// Which columns were read, and how they were chosen.
    #[error(
        "time is {}, input is {input}, output is {output}, {by}",
        time.as_ref().map_or("counted by rows".to_owned(), ToString::to_string)
    )]
    ColumnsChosen {
        /// Time column; `None` if the caller gave the sample rate.
        time: Option<ColumnLabel>,
        /// Input column.
        input: ColumnLabel,
        /// Output column.
        output: ColumnLabel,
        /// What decided.
        by: ChosenBy,
    },
    /// The table is that of a MATLAB file.
    #[error("the MATLAB file has {columns} columns of {rows} rows; line 2 is the first row")]
    MatFile {
        /// Number of columns of this length.
        columns: usize,
        /// Number of rows.
        rows: usize,
    },
    /// The names of the columns were taken from a comment.
    #[error("the names of the columns come from the comment on line {line}")]
    HeaderInComment {
        /// Line of the comment.
        line: u64,
    },
    /// Lines of text before the header were skipped.
    #[error("skipped {} before the header", counted(*.count as u64, "line"))]
    LinesSkipped {
        /// Number of lines.
        count: usize,
    },
    /// The file was UTF-16.
    #[error("the file is UTF-16 text")]
    Utf16,
    /// The time column is not in seconds, as its header or the caller says.
    #[error("the time column is in {}", .unit.symbol())]
    TimeUnit {
        /// Its unit.
        unit: TimeUnit,
    },
    /// The header gives no unit of time, so it was guessed from the time stamps.
    #[error("the time column gives no unit; its time stamps were read in {}", .unit.symbol())]
    TimeUnitGuessed {
        /// The unit assumed.
        unit: TimeUnit,
    },
    /// Time starts so far from zero that it is counted from the first time stamp.
    #[error("time is counted from the first time stamp, {first}")]
    CountedFromFirst {
        /// First time stamp as in the file, with its unit.
        first: String,
    },
    /// The time stamps are times of day without a date.
    #[error(
        "time is counted from {first}, a time of day; a step back by more than half a day is midnight"
    )]
    TimeOfDay {
        /// First time of day.
        first: String,
    },
    /// A column of times was not read, because it disagrees with the dates beside it.
    #[error("did not read {column} as the time: it disagrees with the dates in {dates}")]
    TimeDisagrees {
        /// The column that was not read.
        column: ColumnLabel,
        /// The column of dates, which is the time.
        dates: ColumnLabel,
    },
    /// The columns `Input` and `Output` are those of the controller, as Arduino's PID libraries name them.
    #[error(
        "{measurement} is the measurement and {action} what the controller does, as Arduino's PID libraries name them: the \
         set-point is nearer to the first"
    )]
    NamesOfController {
        /// `Input`: the output of the process.
        measurement: ColumnLabel,
        /// `Output`: the input of the process.
        action: ColumnLabel,
    },
    /// The file is not a table of text but was read as one.
    #[error("the file is {format}, read as {}", counted(*.columns as u64, "column"))]
    Format {
        /// What it is, with an article.
        format: Cow<'static, str>,
        /// Number of columns.
        columns: usize,
    },
    /// The caller gave the sample rate, so the time column was not read.
    #[error("did not read {column} because the sample rate is given: {sample_rate_hz} Hz")]
    TimeIgnored {
        /// The time column.
        column: ColumnLabel,
        /// Sample rate in hertz.
        sample_rate_hz: f64,
    },
    /// The last line was cut off and was dropped.
    #[error("dropped the last line, {line}, because it is incomplete")]
    LastLineIncomplete {
        /// Its number.
        line: u64,
    },
    /// The samples are those of a control loop in a flight log.
    #[error("{control_loop} loop of flight {flight}: input is {input}, output is {output}")]
    LogSignals {
        /// Flight, from 1.
        flight: usize,
        /// Its name, such as `roll rate`.
        control_loop: String,
        /// Input as the firmware names it.
        input: String,
        /// Output as the firmware names it.
        output: String,
    },
    /// Rows of a flight log that lack the input or the set-point were dropped.
    #[error("dropped {} without input or set-point", counted(*.count, "row"))]
    LogRowsDropped {
        /// Number of rows.
        count: u64,
    },
    /// Rows that lack a number were dropped.
    #[error(
        "dropped {} whose {role} is not a number, the first at {first}",
        counted(*.count, "row")
    )]
    RowsDropped {
        /// The signal that is not a number.
        role: Role,
        /// Number of rows.
        count: u64,
        /// The first of them.
        first: Position,
    },
    /// Samples that their source marks as bad, not measured or interpolated were left out.
    #[error(
        "left out {} by their status, the first at {first}: \"{fault}\"",
        counted(*.count, "sample")
    )]
    BadLeftOut {
        /// Number of samples.
        count: u64,
        /// The first of them.
        first: Position,
        /// What the source says about the first.
        fault: String,
    },
    /// The set-point was read from a column too.
    #[error("set-point is {column}")]
    SetPoint {
        /// The column.
        column: ColumnLabel,
    },
    /// A table of one value a row, each with its tag, was read as signals with stamps of their own.
    #[error("one value a row: input is tag \"{input}\", output is tag \"{output}\"{}", set_point_tag(.set_point))]
    TagsChosen {
        /// Tag of the input.
        input: String,
        /// Tag of the output.
        output: String,
        /// Tag of the set-point, if there is one.
        set_point: Option<String>,
    },
    /// Input and output have stamps of their own: the points are at those of the output, and the input of each is the mean
    /// of the held input until the next.
    #[error(
        "input and output are sampled at different times: the rows are the {} of the output, the input is held between \
         its own {} and averaged over each row",
        counted(*.outputs, "sample"), counted(*.inputs, "sample")
    )]
    Woven {
        /// Samples of the input.
        inputs: u64,
        /// Samples of the output.
        outputs: u64,
    },
    /// The output was stored by exception or compression.
    #[error(
        "the output was stored by exception or compression (swinging door): 90 % of its samples are {} to {} s apart; what \
         the historian left out is lost, and with it fast dynamics and the noise",
        rounded(*.least_s), rounded(*.most_s)
    )]
    Compressed {
        /// 5 % of the increments of time are shorter (s).
        least_s: f64,
        /// 5 % of the increments of time are longer (s).
        most_s: f64,
    },
    /// The output consists of straight lines: it was interpolated from few stored samples.
    #[error(
        "the output consists of straight lines through {knots} of its {samples} samples: a historian interpolated \
         compressed data (swinging door), and fast dynamics and the noise are lost"
    )]
    Interpolated {
        /// Samples at which the slope changes.
        knots: usize,
        /// All samples.
        samples: usize,
    },
    /// Rows that repeat the time stamp of the row before were dropped.
    #[error("dropped {} that repeated a time stamp, the first at {first}", counted(*.count, "row"))]
    DuplicatesDropped {
        /// Number of rows.
        count: u64,
        /// The first of them.
        first: Position,
    },
    /// The recording was too long to keep every sample and was averaged.
    #[error(
        "averaged the recording in groups of {samples_per_point} samples; dropped {} in \
         incomplete groups before gaps and at the end",
        counted(*.dropped, "sample")
    )]
    Averaged {
        /// Samples in a point.
        samples_per_point: usize,
        /// Samples dropped because their group was incomplete, before gaps and at the end.
        dropped: u64,
    },
    /// The recording has gaps.
    #[error(
        "found {}, the longest of {} s from {at_s:?} s",
        counted(*.count as u64, "gap"), rounded(*.longest_s)
    )]
    Gaps {
        /// Number of gaps.
        count: usize,
        /// Length of the longest gap in seconds.
        longest_s: f64,
        /// Start of the longest gap in seconds.
        at_s: f64,
    },
    /// Single values of the input between two samples of one level of a relay, at neither of its levels; or peaks of one
    /// sample in the output. They were replaced by the level, or by the line between the neighbours.
    #[error("replaced {}, the first at {first}: {} by {}", replaced(*.count, .first.role), rounded(.first.value), rounded(*.by))]
    CellsReplaced {
        /// Number of cells.
        count: u64,
        /// The first of them.
        first: Cell,
        /// The value that it has now.
        by: f64,
    },
    /// Rows whose input is outside both levels of a relay, several in a row or beside a switch: the true level is unknown.
    /// They were dropped, with a gap in their place.
    #[error(
        "dropped {} whose input is at neither of its two levels, the first at {first}: {}",
        counted(*.count, "row"), rounded(.first.value)
    )]
    OffLevelDropped {
        /// Number of rows.
        count: u64,
        /// The first of them.
        first: Cell,
    },
    /// A value of the input far outside the range of all others. It was kept.
    #[error("the input at {cell} is {}, far outside the range of all other values, {} to {}",
        rounded(.cell.value), rounded(*.least), rounded(*.most))]
    CellInDoubt {
        /// The cell.
        cell: Cell,
        /// Least of the other values.
        least: f64,
        /// Largest of the other values.
        most: f64,
    },
    /// The output is held over several rows: its sensor is slower than the log.
    #[error(
        "the output changes at every {rows}{} row only: its sample period is {} s{}",
        ending(*.rows), rounded(*.period_s),
        if *.is_kept { "" } else { "; kept only the rows with a new output" }
    )]
    OutputHeld {
        /// Rows for each new value.
        rows: usize,
        /// Time between two new values (s).
        period_s: f64,
        /// Whether all rows were kept, because the input changes in between.
        is_kept: bool,
    },
    /// The sample period varies by more than 10 %.
    #[error(
        "the sample period varies by {:.0} % (standard deviation) around {} s",
        100.0 * .jitter, rounded(*.sample_period_s)
    )]
    Jitter {
        /// Standard deviation of the increments of time over the sample period.
        jitter: f64,
        /// Sample period in seconds.
        sample_period_s: f64,
    },
}

/// A cell of a recording; `Display` gives its place: `line 42 (3.97 s)`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Cell {
    /// Its signal.
    pub role: Role,
    /// Its position in the source; `None` in a recording that was averaged.
    pub at: Option<Position>,
    /// Its time (s).
    pub time_s: f64,
    /// Its value, in the unit of its column.
    pub value: f64,
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.at {
            Some(at) => write!(f, "{at} ({} s)", significant(self.time_s, 7)),
            None => write!(f, "{} s", significant(self.time_s, 7)),
        }
    }
}

/// What decided which column holds which signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ChosenBy {
    /// The caller named all of them.
    Caller,
    /// The names in the header.
    Name,
    /// The order of the columns: the file has no header.
    Position,
    /// A word of their names, such as `heater` or `temperature`.
    Word,
    /// The number of different values: few in the input of a relay test, many in its output.
    Values,
}

impl fmt::Display for ChosenBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Caller => "as chosen",
            Self::Name => "found by name",
            Self::Position => "found by position",
            Self::Word => "found by a word of the name",
            Self::Values => "found by how few values the input takes",
        })
    }
}

/// `1 row`, `2 rows`.
pub(crate) fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// What was replaced in a signal.
fn replaced(count: u64, role: Role) -> String {
    match role {
        Role::Output => {
            let peaks = counted(count, "single peak");
            format!("{peaks} of the output by the line between its neighbours")
        }
        _ => {
            let values = counted(count, "single value");
            let verb = if count == 1 { "is" } else { "are" };
            format!("{values} of the {role} that {verb} at neither of its two levels")
        }
    }
}

fn set_point_tag(tag: &Option<String>) -> String {
    tag.as_ref()
        .map_or_else(String::new, |tag| format!(", set-point is tag \"{tag}\""))
}

/// `nd` of `2nd`, `th` of `5th`.
fn ending(number: usize) -> &'static str {
    match (number % 10, number % 100) {
        (_, 11..=13) => "th",
        (1, _) => "st",
        (2, _) => "nd",
        (3, _) => "rd",
        _ => "th",
    }
}

/// Four significant digits.
fn rounded(value: f64) -> String {
    significant(value, 4)
}

/// A number of significant digits.
fn significant(value: f64, count: usize) -> String {
    let digits = format!("{value:.*e}", count - 1);
    digits
        .parse()
        .map_or(digits, |rounded: f64| format!("{rounded:?}"))
}
