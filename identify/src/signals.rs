//! Columns of a recording.

/// A recording as columns of equal length, at least two points, time increasing, all finite.
#[derive(Clone, Copy, Debug)]
pub struct Signals<'a> {
    /// Beginning of each point (s).
    pub time_s: &'a [f64],
    /// Input held from each point to the next (input unit).
    pub input: &'a [f64],
    /// Output: mean of the point's samples (output unit).
    pub output: &'a [f64],
    /// Samples averaged into a point, 1 for a plain recording.
    pub samples_per_point: u32,
    /// Sample period (s).
    pub sample_period_s: f64,
    /// Index of the first point behind each gap, in order.
    pub breaks: &'a [usize],
}
