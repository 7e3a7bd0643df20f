//! The recording of an experiment: what every reader returns.
//!
//! A recording is a sequence of points. Point `i` starts at `time_s[i]`; `input[i]` is held from
//! `time_s[i]` until `time_s[i + 1]`; `output[i]` is measured at `time_s[i]`. A recording with more
//! than [`MAX_POINTS`] samples is averaged in groups of `n = samples_per_point` consecutive samples
//! as it is read: `output[i]` is then the mean of `n` samples, so it belongs to the time
//! `time_s[i] + (n - 1) / 2 * T` with `T = sample_period_s`, and `input[i]` is the mean over time
//! of the held input.
//!
//! Single corrupt cells of the input or of the output are replaced or dropped, and of an output that is held over several
//! rows only the rows with a new value are kept, if no other row tells anything. Notes say so.
//!
//! No group reaches across a gap. The samples of an incomplete group, before a gap or at the end,
//! are dropped and counted in a note, so that every point has exactly `n` samples. During a gap
//! the input is unknown.

mod builder;
mod clean;
mod corrupt;
mod error;
mod held;
mod note;
mod places;
mod rhythm;

use std::fmt;

pub(crate) use builder::FAR_START_S;
pub use builder::RecordingBuilder;
pub use error::RecordingError;
pub(crate) use note::counted;
pub use note::{Cell, ChosenBy, Note};

/// Maximum number of points in a recording: 2^22; three columns of `f64` then take 96 MiB.
pub const MAX_POINTS: usize = 1 << 22;

/// An increment of time longer than this many median increments is a gap.
///
/// With five, one or two lost samples in a row count as jitter. A longer loss, as when a logger
/// flushes to its card, hides part of the cycle.
pub const GAP_PERIODS: f64 = 5.0;

/// Which signal a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Role {
    /// Time stamps.
    Time,
    /// Input of the process: the command of the relay.
    Input,
    /// Output of the process: the measurement.
    Output,
}

impl Role {
    /// All roles, in the order of a sample.
    pub const ALL: [Self; 3] = [Self::Time, Self::Input, Self::Output];
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Time => "time",
            Self::Input => "input",
            Self::Output => "output",
        })
    }
}

/// Position of a sample in its source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Position {
    /// Line of a text file, counted from 1.
    Line(u64),
    /// Index in a vector or in a log, counted from 0.
    Sample(u64),
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Sample(index) => write!(f, "sample {index}"),
        }
    }
}

/// A column of a table as errors and notes name it.
///
/// `Display` gives `"pv" (column 2)`, or `column 2` if the column has no name.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct ColumnLabel {
    /// Name in the header, shortened to 32 printable characters; `None` without a header.
    pub name: Option<String>,
    /// Number, counted from 1.
    pub number: usize,
}

impl fmt::Display for ColumnLabel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.name {
            Some(name) => write!(f, "\"{name}\" (column {})", self.number),
            None => write!(f, "column {}", self.number),
        }
    }
}

/// Name and unit of a column as the source gives them.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Column {
    /// Name, without the unit.
    pub name: String,
    /// Unit, if the source gives one. Time is converted to seconds; other values are not converted.
    pub unit: Option<String>,
}

impl Column {
    /// A column of this name, without a unit.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            unit: None,
        }
    }

    /// The column with this unit.
    #[must_use]
    pub fn with_unit(mut self, unit: &str) -> Self {
        self.unit = Some(unit.to_owned());
        self
    }
}

/// The columns of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Columns {
    /// Column of the time stamps.
    pub time: Column,
    /// Column of the input.
    pub input: Column,
    /// Column of the output.
    pub output: Column,
    /// Column of the set-point of the output, if it was recorded.
    pub set_point: Option<Column>,
}

impl Columns {
    /// The columns of time, input and output.
    pub fn new(time: Column, input: Column, output: Column) -> Self {
        Self {
            time,
            input,
            output,
            set_point: None,
        }
    }

    /// The columns with that of the set-point.
    #[must_use]
    pub fn with_set_point(mut self, set_point: Column) -> Self {
        self.set_point = Some(set_point);
        self
    }

    /// The column of a signal.
    pub fn of(&self, role: Role) -> &Column {
        match role {
            Role::Time => &self.time,
            Role::Input => &self.input,
            Role::Output => &self.output,
        }
    }
}

/// A gap in the recording: no samples for longer than [`GAP_PERIODS`] median increments of time, and for longer than chance makes
/// the longest of increments that differ.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Gap {
    /// Index of the first point after the gap; at least 1.
    pub index: usize,
    /// Time of the last sample before the gap, in seconds. In an averaged recording: time of the
    /// first sample that was dropped because the gap left its group incomplete.
    pub start_s: f64,
    /// Time of the first sample after the gap, in seconds.
    pub end_s: f64,
}

/// A recording of an experiment: time, held input, measured output.
///
/// At least two points; time strictly increasing; every number finite and at most 1e300 in size.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Recording {
    time_s: Vec<f64>,
    input: Vec<f64>,
    output: Vec<f64>,
    /// Empty if it was not recorded.
    set_point: Vec<f64>,
    samples_per_point: usize,
    sample_period_s: f64,
    jitter: f64,
    gaps: Vec<Gap>,
    columns: Columns,
    notes: Vec<Note>,
    relay_beta: Option<f64>,
    output_filter_hz: Option<f64>,
}

impl Recording {
    /// Makes a recording from three vectors of equal length, as a simulator has them.
    ///
    /// Unlike a reader it refuses samples that are not finite or repeat a time stamp. As in every recording, corrupt cells
    /// are replaced, rows of a held output are dropped ([`Note`] says which), more than [`MAX_POINTS`] samples
    /// are averaged, and a time that starts beyond 1e7 s is counted from its first time stamp.
    ///
    /// # Errors
    /// The lengths differ, there are fewer than two samples, a number is not finite or beyond
    /// 1e300, time does not increase, or the time stamps are too large to resolve the sample period.
    pub fn from_samples(
        time_s: &[f64],
        input: &[f64],
        output: &[f64],
    ) -> Result<Self, RecordingError> {
        Self::of_samples(time_s, input, output, None)
    }

    /// As [`from_samples`](Self::from_samples), with the set-point of a closed loop (output unit).
    ///
    /// # Errors
    /// As there; also if the set-point has another length.
    pub fn from_closed_loop(
        time_s: &[f64],
        input: &[f64],
        output: &[f64],
        set_point: &[f64],
    ) -> Result<Self, RecordingError> {
        if set_point.len() != time_s.len() {
            return Err(RecordingError::SetPointLength {
                time: time_s.len(),
                set_point: set_point.len(),
            });
        }
        Self::of_samples(time_s, input, output, Some(set_point))
    }

    fn of_samples(
        time_s: &[f64],
        input: &[f64],
        output: &[f64],
        set_point: Option<&[f64]>,
    ) -> Result<Self, RecordingError> {
        if input.len() != time_s.len() || output.len() != time_s.len() {
            return Err(RecordingError::LengthsDiffer {
                time: time_s.len(),
                input: input.len(),
                output: output.len(),
            });
        }
        let mut columns = Columns::new(
            Column::named("time").with_unit("s"),
            Column::named("input"),
            Column::named("output"),
        );
        if set_point.is_some() {
            columns = columns.with_set_point(Column::named("set-point"));
        }
        let mut builder = RecordingBuilder::new(columns);
        let mut before_s = f64::NEG_INFINITY;
        for (index, ((&time_s, &input), &output)) in (0..).zip(time_s.iter().zip(input).zip(output))
        {
            let at = Position::Sample(index);
            for (role, value) in Role::ALL.into_iter().zip([time_s, input, output]) {
                if !value.is_finite() {
                    return Err(RecordingError::NotFinite { at, role });
                }
            }
            if time_s <= before_s {
                return Err(RecordingError::TimeGoesBack {
                    at,
                    before_s,
                    after_s: time_s,
                });
            }
            before_s = time_s;
            let set_point = set_point.map(|values| values[index as usize]);
            builder.push_with(at, time_s, [input, output], set_point)?;
        }
        builder.finish()
    }

    /// Number of points; at least 2.
    #[expect(clippy::len_without_is_empty, reason = "a recording is never empty")]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Start of each point, in seconds, strictly increasing.
    pub fn time_s(&self) -> &[f64] {
        &self.time_s
    }

    /// Input of each point, held until the next point starts, in the unit of its column.
    pub fn input(&self) -> &[f64] {
        &self.input
    }

    /// Measurement of each point, in the unit of its column.
    pub fn output(&self) -> &[f64] {
        &self.output
    }

    /// Set-point of the output at each point, held until the next point starts, in the unit of its column. `None`: it
    /// was not recorded. A sample without a number keeps the set-point before it.
    pub fn set_point(&self) -> Option<&[f64]> {
        (!self.set_point.is_empty()).then_some(&*self.set_point)
    }

    /// Consecutive samples averaged into each point: 1, or a power of two in a long recording.
    pub fn samples_per_point(&self) -> usize {
        self.samples_per_point
    }

    /// Sample period of the source in seconds: the mean of all increments that are not gaps.
    ///
    /// A point of an averaged recording spans [`Self::samples_per_point`] sample periods.
    pub fn sample_period_s(&self) -> f64 {
        self.sample_period_s
    }

    /// Delay from the start of a point to the mean time of its measurements, in seconds:
    /// `(samples_per_point - 1) / 2 * sample_period_s`; 0 if the recording is not averaged.
    pub fn output_delay_s(&self) -> f64 {
        (self.samples_per_point - 1) as f64 / 2.0 * self.sample_period_s
    }

    /// Standard deviation of the increments of time, without gaps, divided by the sample period.
    pub fn jitter(&self) -> f64 {
        self.jitter
    }

    /// Gaps in order of time.
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// Names and units of the columns as found.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// What the reader chose, assumed or dropped.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// `beta` of the relay that made the recording, if the source states it: a comment of a table with the word `beta` and
    /// a number between -1 and 1, such as `# relay: amplitude 1, beta -0.73`.
    pub fn relay_beta(&self) -> Option<f64> {
        self.relay_beta
    }

    /// The recording of a relay with this `beta`.
    #[must_use]
    pub fn with_relay_beta(self, relay_beta: Option<f64>) -> Self {
        Self { relay_beta, ..self }
    }

    /// Cutoff (Hz) of the second-order Butterworth low-pass through which the output was recorded, if the parameters of a
    /// flight log state one.
    pub fn output_filter_hz(&self) -> Option<f64> {
        self.output_filter_hz
    }

    /// Sets [`Recording::output_filter_hz`].
    #[must_use]
    pub fn with_output_filter_hz(self, output_filter_hz: Option<f64>) -> Self {
        Self {
            output_filter_hz,
            ..self
        }
    }

    /// Whether it was read from a log or a file of a tool, and not from a table.
    pub fn is_of_a_tool(&self) -> bool {
        (self.notes.iter()).any(|note| matches!(note, Note::Format { .. }))
    }

    /// Whether it is a control loop of a flight log.
    pub fn is_of_a_flight_log(&self) -> bool {
        (self.notes.iter()).any(|note| matches!(note, Note::LogSignals { .. }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_samples_keeps_every_bit() {
        let time_s = [0.1, 0.2, 0.4];
        let recording =
            Recording::from_samples(&time_s, &[1.0, -1.0, 1.0], &[-0.0, 5e-324, 1e300]).unwrap();
        assert_eq!(recording.time_s(), time_s);
        assert_eq!(recording.output()[0].to_bits(), (-0.0_f64).to_bits());
        assert_eq!(recording.output()[1..], [5e-324, 1e300]);
        assert_eq!(recording.samples_per_point(), 1);
        assert_eq!(recording.output_delay_s(), 0.0);
    }

    #[test]
    fn from_samples_refuses_what_it_cannot_keep() {
        let refusal = |time: &[f64], input: &[f64], output: &[f64]| {
            Recording::from_samples(time, input, output)
                .unwrap_err()
                .to_string()
        };
        let ones = [1.0; 3];
        assert!(refusal(&[0.0, 1.0], &ones, &ones).contains("2, 3 and 3"));
        assert!(refusal(&[0.0, 2.0, 1.0], &ones, &ones).contains("sample 2"));
        assert!(refusal(&[0.0, 1.0, 1.0], &ones, &ones).contains("sample 2"));
        assert!(refusal(&[0.0, f64::NAN, 1.0], &ones, &ones).contains("time at sample 1"));
        assert!(refusal(&[0.0, 1.0, 2.0], &[1.0, f64::INFINITY, 1.0], &ones).contains("input"));
        assert!(refusal(&[0.0, 1.0, 2.0], &ones, &[1.0, 2.0, 1e301]).contains("1e301"));
        assert!(refusal(&[0.0], &[1.0], &[1.0]).contains("only 1 row"));
        assert!(refusal(&[], &[], &[]).contains("only 0 rows"));
        // At 1e15 s neighbouring numbers are 0.125 s apart: 12.5 % of the increment.
        assert!(refusal(&[1e15, 1e15 + 1.0, 1e15 + 2.0], &ones, &ones).contains("resolve"));
    }

    #[test]
    fn a_far_start_is_counted_from_the_first_stamp() {
        let time_s = [1.7e9, 1.7e9 + 0.5, 1.7e9 + 1.0];
        let recording = Recording::from_samples(&time_s, &[1.0; 3], &[1.0; 3]).unwrap();
        assert_eq!(recording.time_s(), [0.0, 0.5, 1.0]);
        assert!(recording.notes()[0].to_string().contains("1700000000"));
    }
}
