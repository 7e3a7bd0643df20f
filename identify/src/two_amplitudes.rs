//! Result of a relay test at two amplitudes.

/// Result of a test at two amplitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct TwoAmplitudes {
    /// Amplitudes of the relay in order of time (input unit).
    pub amplitudes: [f64; 2],
    /// Gain of the process at the smaller amplitude over that at the larger one, at the crossover of the controller.
    pub gain_ratio: f64,
    /// Phase at the smaller amplitude less that at the larger one (rad).
    pub phase_rad: f64,
    /// Whether the difference is within the uncertainty of both.
    pub is_alike: bool,
}
