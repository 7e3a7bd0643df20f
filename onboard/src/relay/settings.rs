//! How the relay switches, and what is out of range.

use core::fmt;

/// How the relay switches. Start from [`RelaySettings::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaySettings {
    /// Half the jump of the output, `h` (input unit).
    pub amplitude: f32,
    /// Sine of the phase of the oscillation, between -1 and 1, both excluded.
    pub beta: f32,
    /// Time for which the noise is measured with zero output (s); 0 starts at once.
    pub preroll_s: f32,
    /// Standard deviation of the measurement noise (output unit); with a pre-roll the lower limit of the measured
    /// one. For a quantised sensor give its quantum.
    ///
    /// At zero no distance is too small for the relay: it leaves the kick at the first error other than zero, be it
    /// 1e-13, and counts any reversal as an extremum. A noise-free simulation then builds its oscillation up from
    /// rounding size; a real sensor makes the relay chatter.
    pub noise_sigma: f32,
    /// Smoothing of the error: fraction of the half period; 0 switches it off.
    pub smoothing: f32,
    /// Least time between switches: fraction of the half period; 0 switches it off.
    pub dwell: f32,
    /// From an offset outside the noise: switches made as a plain relay (`beta = 0`) at first.
    pub plain_switches: u16,
    /// From such an offset: switches over which `beta` then goes from zero to its value.
    pub ramp_switches: u16,
    /// Share of the measured bias that the trim takes up each cycle; 0 switches it off.
    pub trim_gain: f32,
    /// What the trim leaves between the parts of a cycle that the output is high and low, to whichever
    /// side the bias is. Zero makes the oscillation symmetric; some asymmetry tells more of the process.
    pub asymmetry: f32,
}

impl RelaySettings {
    /// Phase of the paper's distinguishing oscillation, `asin(beta) = -46.89` degrees.
    pub const DISTINGUISHING_BETA: f32 = -0.73;

    /// Share of the bias that a trim takes up each cycle: near all of it, short of overshooting.
    pub const TRIM_GAIN: f32 = 0.8;

    /// An asymmetry that tells twice as much of a process as none and is well short of the 0.3 at which
    /// the least stable ones lose their limit cycle (`docs/decisions/0011-asymmetry.md`).
    pub const ASYMMETRY: f32 = 0.2;

    /// The trim stays within this part of the relay's amplitude: at the whole of it no switching could
    /// hold the process.
    pub const TRIM_LIMIT: f32 = 0.9;

    /// Checks every setting.
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

    /// Noise-protected, without pre-roll and without trim.
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

    /// Equation 4 as meant, with no protection: for noise-free comparisons.
    #[must_use]
    pub fn bare(amplitude: f32, beta: f32) -> Self {
        Self {
            smoothing: 0.0,
            dwell: 0.0,
            ..Self::new(amplitude, beta)
        }
    }
}

/// A setting out of its range, with its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RelayError {
    /// The amplitude is not positive and finite.
    Amplitude(f32),
    /// `beta` is not between -1 and 1.
    Beta(f32),
    /// The asymmetry is not between 0 and 1.
    Asymmetry(f32),
    /// A time, a fraction or the noise is negative or not finite: its name and value.
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
