//! What excited the process while it was recorded.

use crate::relay::reading::Reading;

/// The excitation that was found in a recording, and what was measured of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Excitation {
    /// A two-level relay that keeps the process oscillating steadily.
    Relay {
        /// The oscillation.
        oscillation: Oscillation,
        /// The network's estimate from the last cycle alone; `None` without a pack or where the pack has no answer.
        last_cycle: Option<Reading>,
    },
}

impl Excitation {
    /// Short name, the same in JSON.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Relay { .. } => "relay",
        }
    }
}

/// A steady relay oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Oscillation {
    /// Mean period of the cycles used (s).
    pub period_s: f64,
    /// Half the peak-to-peak output, mean over the cycles used (output unit).
    pub amplitude: f64,
    /// Number of cycles used for the fit.
    pub cycles_used: usize,
    /// Number of cycles in the steady run that they end.
    pub cycles_steady: usize,
    /// Start of the cycles used (s).
    pub start_s: f64,
    /// End of the cycles used (s).
    pub end_s: f64,
    /// Share of the period with the relay high, mean.
    pub duty: f64,
    /// Half the distance between the relay's levels (input unit).
    pub relay_amplitude: f64,
    /// Middle between the relay's levels (input unit).
    pub relay_centre: f64,
    /// Standard deviation of the noise of one sample (output unit).
    pub noise_sigma: f64,
    /// Sample period (s).
    pub sample_s: f64,
}
