//! Settings of the relay and their ranges.

use core::fmt;

/// Settings of the relay. Start from [`RelaySettings::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaySettings {
    /// Half the jump of the output, `h` (input unit), above zero.
    pub amplitude: f32,
    /// Sine of the phase of the oscillation, between -1 and 1, both excluded.
    pub beta: f32,
    /// Time during which the noise is measured with zero output (s); 0 starts at once.
    pub preroll_s: f32,
    /// Standard deviation of the measurement noise (output unit). With a pre-roll it is the lower limit of the
    /// measured value. For a quantised sensor set its quantum.
    ///
    /// At zero the relay chatters on sensor noise: it leaves the kick at the first error other than zero, be it
    /// 1e-13, and counts every reversal as an extremum. A noise-free simulation then starts its oscillation from
    /// rounding errors.
    pub noise_sigma: f32,
    /// Smoothing time of the error as a fraction of the half period; 0 switches it off.
    pub smoothing: f32,
    /// Minimum time between switches as a fraction of the half period; 0 switches it off.
    pub dwell: f32,
    /// Number of first switches made as a plain relay (`beta = 0`) when the error starts outside the noise.
    pub plain_switches: u16,
    /// Number of switches over which `beta` then grows from zero to its value.
    pub ramp_switches: u16,
    /// Share of the measured bias that the trim removes per cycle; 0 switches the trim off.
    pub trim_gain: f32,
    /// Asymmetry that the trim keeps: time high minus time low over the period, 0 to 1, on the side of the bias.
    /// Zero makes the oscillation symmetric. An asymmetric oscillation carries more information about the
    /// process.
    pub asymmetry: f32,
}

impl RelaySettings {
    /// `beta` of the paper's distinguishing phase: `asin(beta) = -46.89` degrees.
    pub const DISTINGUISHING_BETA: f32 = -0.73;

    /// Share of the bias removed per cycle: nearly all of it, without overshoot.
    pub const TRIM_GAIN: f32 = 0.8;

    /// Asymmetry that doubles the information of a cycle and is well below 0.3, where the least stable processes
    /// lose their limit cycle (`docs/decisions/0011-asymmetry.md`).
    pub const ASYMMETRY: f32 = 0.2;

    /// Limit of the trim as a fraction of the amplitude: at 1 the relay could no longer reverse the process.
    pub const TRIM_LIMIT: f32 = 0.9;

    /// Checks all settings.
    pub(super) fn validate(&self) -> Result<(), RelayError> {
        if !(self.amplitude.is_finite() && self.amplitude > 0.0) {
            return Err(RelayError::Amplitude(self.amplitude));
        }
        if !(self.beta > -1.0 && self.beta < 1.0) {
            return Err(RelayError::Beta(self.beta));
        }
        if !(0.0..1.0).contains(&self.asymmetry) {
            return Err(RelayError::Asymmetry(self.asymmetry));
        }
        for (name, value) in [
            ("the pre-roll", self.preroll_s),
            ("the noise sigma", self.noise_sigma),
            ("the smoothing", self.smoothing),
            ("the dwell", self.dwell),
            ("the trim gain", self.trim_gain),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(RelayError::Setting(name, value));
            }
        }
        Ok(())
    }

    /// Settings with noise protection, without pre-roll and without trim.
    #[must_use]
    pub fn new(amplitude: f32, beta: f32) -> Self {
        Self {
            amplitude,
            beta,
            preroll_s: 0.0,
            noise_sigma: 0.0,
            smoothing: 0.03,
            dwell: 0.3,
            plain_switches: 3,
            ramp_switches: 4,
            trim_gain: 0.0,
            asymmetry: 0.0,
        }
    }

    /// Settings of the bare switching rule without any protection, for noise-free comparisons.
    #[must_use]
    pub fn bare(amplitude: f32, beta: f32) -> Self {
        Self {
            smoothing: 0.0,
            dwell: 0.0,
            ..Self::new(amplitude, beta)
        }
    }
}

/// Setting out of range, with its value. Exhaustive, because the C interface has a code for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RelayError {
    /// The amplitude is not positive and finite.
    Amplitude(f32),
    /// `beta` is not between -1 and 1.
    Beta(f32),
    /// The asymmetry is not between 0 and 1.
    Asymmetry(f32),
    /// A time, a fraction or the noise is negative or not finite: name and value.
    Setting(&'static str, f32),
}

impl fmt::Display for RelayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Amplitude(v) => write!(f, "the relay amplitude must be positive, but is {v}"),
            Self::Beta(v) => write!(f, "beta must lie between -1 and 1, but is {v}"),
            Self::Asymmetry(v) => {
                write!(f, "the asymmetry must lie between 0 and 1, but is {v}")
            }
            Self::Setting(name, v) => write!(f, "{name} must be zero or positive, but is {v}"),
        }
    }
}

impl core::error::Error for RelayError {}
