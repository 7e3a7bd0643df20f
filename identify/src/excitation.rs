//! Excitation of the process during a recording.

use crate::innovations::Hold;
use crate::reading::Reading;

/// Excitation found in a recording, and its measured properties.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one a result; a box would cost it Copy"
)]
#[non_exhaustive]
pub enum Excitation {
    /// Two-level relay that keeps the process in a steady oscillation.
    Relay {
        /// Measured properties of the oscillation.
        oscillation: Oscillation,
        /// Estimate from the last cycle alone, by the network of the pack. `None` without a pack, or if the pack
        /// returns no estimate.
        last_cycle: Option<Reading>,
    },
    /// Any other input: chirp, steps, normal operation, an oscillation that is not steady.
    Recorded(Recorded),
}

/// What a record of any input holds.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Recorded {
    /// Start of the part used (s).
    pub start_s: f64,
    /// End of the part used (s).
    pub end_s: f64,
    /// Sample period of the grid, or median increment of uneven time stamps (s).
    pub sample_s: f64,
    /// Number of samples used.
    pub samples: usize,
    /// Number of samples of the grid without a usable output: lost or stale.
    pub absent: usize,
    /// Number of outputs left out as outliers.
    pub outliers: usize,
    /// Number of samples summed into one row of the fit.
    pub samples_per_row: usize,
    /// Input between two samples.
    pub hold: Hold,
    /// Standard deviation of the input (input unit).
    pub input_deviation: f64,
    /// Standard deviation of the output (output unit).
    pub output_deviation: f64,
    /// Band of frequencies (rad/s) that holds the central 90 % of the information on the gain. `None` if nothing was
    /// fitted.
    pub informative_rad_per_s: Option<(f64, f64)>,
    /// Highest frequency (rad/s) up to which the recording shows the response without a break: in each half octave the
    /// deviation of the gain is at most 20 %. `None` if nothing was fitted.
    pub excited_rad_per_s: Option<f64>,
}

impl Excitation {
    /// Highest frequency that the recording excites (rad/s): that of the relay's oscillation, or up to which any other
    /// recording shows the response. `None` if nothing was fitted.
    #[must_use]
    pub fn highest_rad_per_s(&self) -> Option<f64> {
        match self {
            Self::Relay { oscillation, .. } => Some(std::f64::consts::TAU / oscillation.period_s),
            Self::Recorded(recorded) => recorded.excited_rad_per_s,
        }
    }

    /// Name in JSON.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Relay { .. } => "relay",
            Self::Recorded(_) => "recorded",
        }
    }
}

/// Measured properties of a steady relay oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Oscillation {
    /// Mean period of the cycles used (s).
    pub period_s: f64,
    /// Amplitude: half the peak-to-peak output, mean over the cycles used (output unit).
    pub amplitude: f64,
    /// Number of cycles used for the fit.
    pub cycles_used: usize,
    /// Number of cycles in the steady run that the cycles used belong to.
    pub cycles_steady: usize,
    /// Start of the cycles used (s).
    pub start_s: f64,
    /// End of the cycles used (s).
    pub end_s: f64,
    /// Share of the period with the relay high, 0 to 1, mean over the cycles used.
    pub duty: f64,
    /// Half the distance between the levels of the relay (input unit).
    pub relay_amplitude: f64,
    /// Middle between the levels of the relay (input unit).
    pub relay_centre: f64,
    /// Standard deviation of the white noise of one sample (output unit).
    pub noise_sigma: f64,
    /// Sample period (s).
    pub sample_s: f64,
}

/// Ratio at which the relay of a recording switched, if its switches follow such a law.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Switching {
    /// Mean over the cycles of `beta`, as in [`onecycle_onboard::relay`]: minus the output at a switch over the extreme
    /// before it, both from the reference. An input that is logged late shows a larger one.
    pub beta: f64,
    /// Standard error of the mean.
    pub deviation: f64,
    /// Number of cycles.
    pub cycles: usize,
}
