//! Columns of a recording.

/// Recording as columns of equal length. The caller ensures at least two points, increasing time and finite values.
#[derive(Clone, Copy, Debug)]
pub struct Signals<'a> {
    /// Time at the beginning of each point (s).
    pub time_s: &'a [f64],
    /// Input held from each point to the next (input unit).
    pub input: &'a [f64],
    /// Output: mean of the samples of each point (output unit).
    pub output: &'a [f64],
    /// Number of samples averaged into a point; 1 for a recording that was not averaged.
    pub samples_per_point: u32,
    /// Sample period (s).
    pub sample_period_s: f64,
    /// Index of the first point after each gap, ascending.
    pub breaks: &'a [usize],
}
