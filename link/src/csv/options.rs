//! What the caller knows about a file before it is read.

use std::fmt;

use crate::recording::MAX_POINTS;
use crate::time_unit::TimeUnit;

/// What the caller knows about a file; by default nothing.
///
/// ```
/// use onecycle_link::CsvOptions;
///
/// let file = "throttle,roll\n1,0.00\n1,0.02\n-1,0.05\n";
/// let options = CsvOptions::default()
///     .input_column("throttle")
///     .output_column("roll")
///     .sample_rate_hz(500.0);
/// let recording = onecycle_link::read_from(file.as_bytes(), &options)?;
/// assert_eq!(recording.time_s(), [0.0, 0.002, 0.004]);
/// # Ok::<(), onecycle_link::ReadError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CsvOptions {
    /// Column of the time stamps.
    pub time_column: Option<ColumnRef>,
    /// Column of the input.
    pub input_column: Option<ColumnRef>,
    /// Column of the output.
    pub output_column: Option<ColumnRef>,
    /// Column of the set-point of the output.
    pub set_point_column: Option<ColumnRef>,
    /// Control loop of which the columns are taken: `LIC101` of `LIC101.PV` and `LIC101.OP`.
    pub control_loop: Option<String>,
    /// Sample rate in hertz; time is then counted by rows, and no time column is read.
    pub sample_rate_hz: Option<f64>,
    /// Unit of the time column; overrules the header.
    pub time_unit: Option<TimeUnit>,
    /// Text of the DBC file that describes the frames of a log of candump.
    pub dbc: Option<String>,
    /// Maximum number of points to keep; a longer recording is averaged. Default [`MAX_POINTS`].
    pub max_points: usize,
}

impl Default for CsvOptions {
    fn default() -> Self {
        Self {
            time_column: None,
            input_column: None,
            output_column: None,
            set_point_column: None,
            control_loop: None,
            sample_rate_hz: None,
            time_unit: None,
            dbc: None,
            max_points: MAX_POINTS,
        }
    }
}

impl CsvOptions {
    /// Reads the time stamps from this column.
    #[must_use]
    pub fn time_column(mut self, column: impl Into<ColumnRef>) -> Self {
        self.time_column = Some(column.into());
        self
    }

    /// Reads the input from this column.
    #[must_use]
    pub fn input_column(mut self, column: impl Into<ColumnRef>) -> Self {
        self.input_column = Some(column.into());
        self
    }

    /// Reads the output from this column.
    #[must_use]
    pub fn output_column(mut self, column: impl Into<ColumnRef>) -> Self {
        self.output_column = Some(column.into());
        self
    }

    /// Reads the set-point of the output from this column.
    #[must_use]
    pub fn set_point_column(mut self, column: impl Into<ColumnRef>) -> Self {
        self.set_point_column = Some(column.into());
        self
    }

    /// Takes the columns of this control loop: `LIC101` of `LIC101.PV` and `LIC101.OP`.
    #[must_use]
    pub fn control_loop(mut self, name: &str) -> Self {
        self.control_loop = Some(name.to_owned());
        self
    }

    /// Counts time by rows at this sample rate in hertz, and reads no time column.
    #[must_use]
    pub fn sample_rate_hz(mut self, rate_hz: f64) -> Self {
        self.sample_rate_hz = Some(rate_hz);
        self
    }

    /// Reads the time stamps in this unit, whatever the header says.
    #[must_use]
    pub fn time_unit(mut self, unit: TimeUnit) -> Self {
        self.time_unit = Some(unit);
        self
    }

    /// Keeps at most this many points (at least 4, rounded down to an even number).
    #[must_use]
    pub fn max_points(mut self, max_points: usize) -> Self {
        self.max_points = max_points;
        self
    }
}

/// A column as the caller names it; `Display` gives `"pv"` or `number 2`.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum ColumnRef {
    /// By name, with or without its unit, in any case.
    Name(String),
    /// By number, from 1.
    Number(usize),
}

impl From<&str> for ColumnRef {
    /// A text of digits is a number, any other text is a name.
    fn from(text: &str) -> Self {
        text.trim()
            .parse()
            .map_or_else(|_| Self::Name(text.trim().to_owned()), Self::Number)
    }
}

impl fmt::Display for ColumnRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(name) => write!(f, "\"{name}\""),
            Self::Number(number) => write!(f, "number {number}"),
        }
    }
}
