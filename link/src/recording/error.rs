//! Why samples do not make a recording.

use thiserror::Error;

use super::note::counted;
use super::{Position, Role};

/// Why samples do not make a recording. Each says what to do in one sentence.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RecordingError {
    /// The vectors of a simulator have different lengths.
    #[error(
        "time, input and output have {time}, {input} and {output} values; give as many of each"
    )]
    LengthsDiffer {
        /// Number of time stamps.
        time: usize,
        /// Number of inputs.
        input: usize,
        /// Number of outputs.
        output: usize,
    },
    /// A simulator gave NaN or an infinity.
    #[error("the {role} at {at} is not a finite number; cut the recording before it")]
    NotFinite {
        /// Where.
        at: Position,
        /// Which signal.
        role: Role,
    },
    /// A number no experiment yields, and too large to calculate with.
    #[error("the {role} at {at} is {value:e}, beyond 1e300; check the units or cut that row")]
    TooLarge {
        /// Where.
        at: Position,
        /// Which signal.
        role: Role,
        /// The number, in the unit of the column; time in seconds.
        value: f64,
    },
    /// Time goes back (or, in vectors, stands still).
    #[error(
        "time does not increase at {at}: {after_s:?} s follows {before_s:?} s; \
         keep one run and cut the rest"
    )]
    TimeGoesBack {
        /// Where.
        at: Position,
        /// Time before, in seconds.
        before_s: f64,
        /// Time at `at`, in seconds.
        after_s: f64,
    },
    /// All rows have the same stamp.
    #[error(
        "time does not change: all {rows} rows have the same stamp; \
         choose another column with --time or give the sample rate with --sample-rate"
    )]
    TimeConstant {
        /// Number of rows.
        rows: u64,
    },
    /// Fewer than two rows.
    #[error("only {} with numbers; a recording needs at least 2", counted(*.rows, "row"))]
    TooShort {
        /// Number of rows with numbers.
        rows: u64,
    },
    /// More than 1 % of the rows have no number in a column.
    #[error(
        "{count} of {rows} rows have no number in {column}, the first at {first}; \
         at most 1 % may be missing: choose another column or cut the recording"
    )]
    TooManyMissing {
        /// Rows without a number in any column.
        count: u64,
        /// All rows.
        rows: u64,
        /// The column that lacks most, by role and name.
        column: String,
        /// First row where it does.
        first: Position,
    },
    /// More than 5 % of the rows repeat the stamp before.
    #[error(
        "{count} of {rows} rows repeat the stamp of the row before, the first at {first}; \
         at most 5 % may: the time column is too coarse, so give the sample rate with --sample-rate"
    )]
    TooManyDuplicates {
        /// Rows that repeat a stamp.
        count: u64,
        /// All rows.
        rows: u64,
        /// The first of them.
        first: Position,
    },
    /// Stamps so large that their increment is rounded by more than 1 %.
    #[error(
        "stamps as large as {largest_s:e} s cannot resolve a sample period of {period_s:e} s; \
         subtract the first stamp before writing the file, or give the sample rate with --sample-rate"
    )]
    StampsTooCoarse {
        /// Largest stamp in seconds.
        largest_s: f64,
        /// Sample period in seconds.
        period_s: f64,
    },
    /// A recording too long to keep, and too broken up to average.
    #[error(
        "the recording must be averaged in groups of {samples_per_point}, but gaps break up the \
         groups of {dropped} of its {samples} samples; cut it to one stretch without gaps"
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
