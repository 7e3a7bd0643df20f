//! Why samples do not make a recording.

use thiserror::Error;

use super::note::counted;
use super::{Position, Role};

/// Why samples do not make a recording. `Display` states the fact; what to do about it is up to
/// the caller.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The three vectors have different lengths.
    #[error("time, input and output have {time}, {input} and {output} values")]
    LengthsDiffer {
        /// Number of time stamps.
        time: usize,
        /// Number of inputs.
        input: usize,
        /// Number of outputs.
        output: usize,
    },
    /// The set-point has another length than the time.
    #[error(
        "the set-point has {set_point} samples, but the time has {time}: give one set-point for each sample"
    )]
    SetPointLength {
        /// Samples of time.
        time: usize,
        /// Samples of the set-point.
        set_point: usize,
    },
    /// A value is NaN or infinite.
    #[error("the {role} at {at} is not a finite number")]
    NotFinite {
        /// Where.
        at: Position,
        /// Which signal.
        role: Role,
    },
    /// A value is too large to calculate with.
    #[error("the {role} at {at} is {value:e}, beyond 1e300")]
    TooLarge {
        /// Where.
        at: Position,
        /// Which signal.
        role: Role,
        /// The value, in the unit of the column; time in seconds.
        value: f64,
    },
    /// A time stamp is smaller than the one before it. In vectors, also one that is equal.
    #[error("time does not increase at {at}: {after_s:?} s follows {before_s:?} s")]
    TimeGoesBack {
        /// Where.
        at: Position,
        /// Time stamp before, in seconds.
        before_s: f64,
        /// Time stamp at `at`, in seconds.
        after_s: f64,
    },
    /// All rows have the same time stamp.
    #[error("time does not change: all {rows} rows have the same time stamp")]
    TimeConstant {
        /// Number of rows.
        rows: u64,
    },
    /// Fewer than two rows have numbers.
    #[error("only {} with numbers; a recording needs at least 2", counted(*.rows, "row"))]
    TooShort {
        /// Number of rows with numbers.
        rows: u64,
    },
    /// More than 1 % of the rows lack a number.
    #[error(
        "{count} of {rows} rows have no number in the {role} ({column}), the first at {first}; \
         at most 1 % may be missing"
    )]
    TooManyMissing {
        /// Rows that lack a number in any of the three columns.
        count: u64,
        /// All rows.
        rows: u64,
        /// The signal that lacks the most numbers.
        role: Role,
        /// Name of its column.
        column: String,
        /// First row that lacks a number in this column.
        first: Position,
    },
    /// More than half of the rows are marked as bad by their source.
    #[error("{count} of {rows} samples are bad by their status, the first at {first}: \"{fault}\"")]
    TooManyBad {
        /// Rows marked as bad.
        count: u64,
        /// All rows.
        rows: u64,
        /// The first of them.
        first: Position,
        /// What the source says about the first.
        fault: String,
    },
    /// More than 5 % of the rows repeat the time stamp of the row before.
    #[error(
        "{count} of {rows} rows repeat the time stamp of the row before, the first at {first}; \
         at most 5 % may"
    )]
    TooManyDuplicates {
        /// Rows that repeat a time stamp.
        count: u64,
        /// All rows.
        rows: u64,
        /// The first of them.
        first: Position,
    },
    /// Rounding of the largest time stamp exceeds 1 % of the sample period.
    #[error(
        "time stamps as large as {largest_s:.3e} s cannot resolve a sample period of {period_s:.3e} s"
    )]
    StampsTooCoarse {
        /// Largest time stamp in seconds.
        largest_s: f64,
        /// Sample period in seconds.
        period_s: f64,
    },
    /// The recording is too long to keep every sample and has too many gaps to be averaged.
    #[error(
        "the recording is so long that groups of {samples_per_point} samples are averaged, but \
         gaps leave {dropped} of its {samples} samples in incomplete groups"
    )]
    TooManyGaps {
        /// Samples in a group.
        samples_per_point: usize,
        /// Samples in groups that a gap left incomplete.
        dropped: u64,
        /// All samples.
        samples: u64,
    },
}
