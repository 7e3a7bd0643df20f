//! Settings of the tuner and their ranges.

use core::fmt;

use libm::roundf;

use crate::control::PdLaw;
use crate::guard::Limits;
use crate::identification::MOST_CYCLES;
use crate::integral::{MOST_PHASE_RAD, USUAL_PHASE_RAD};
use crate::relay::{Relay, RelayError, RelaySettings};
use crate::take_off::TakeOffSettings;

/// Second amplitudes as a part of the first: far enough from it to show a nonlinearity, and above the noise.
const SECOND_AMPLITUDES: core::ops::RangeInclusive<f32> = 0.3..=0.8;

/// Settings of a tuner. Start from [`TunerSettings::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TunerSettings {
    /// Relay of the test. Its output is added to the offset that holds the process at rest. Set its noise to
    /// that of the sensor, or let it be measured in a pre-roll: at zero the relay chatters on sensor noise.
    pub relay: RelaySettings,
    /// Time between ticks (s).
    pub sample_s: f32,
    /// Number of cycles that are fitted together, 1 to 4. The last one is also read by the pack.
    pub cycles: u8,
    /// Maximum number of identification attempts.
    pub attempts: u8,
    /// Slices of the identification per tick; each takes up to 2,700 operations in double precision, and an
    /// identification takes 2,000 to 9,000 slices. Use 1 where double precision is emulated. A [`TunerCore`](super::TunerCore)
    /// with its analysis elsewhere does not need them.
    pub slices: u16,
    /// Take-off from the ground; `None` if the test begins in the air.
    pub take_off: Option<TakeOffSettings>,
    /// Abort limits, to be set.
    pub limits: Limits,
    /// Lower limit of the output (input unit), to be set.
    pub output_lowest: f32,
    /// Upper limit of the output (input unit), to be set.
    pub output_highest: f32,
    /// Controller before a test and after an abort; [`PdLaw::ZERO`] for zero output.
    pub safe: PdLaw,
    /// Time constant of the means under the safe controller (s). The mean of its output becomes the offset of
    /// the relay, against a drift under a constant bias; the mean of the process's output becomes the reference
    /// of the test. Zero switches this off.
    pub bias_filter_s: f32,
    /// Time constant of the filter for a rate that is computed from differences (s).
    pub rate_lag_s: f32,
    /// Delay of the measured rate behind the value (s), as by the low-pass of a gyro beside an estimated angle. The controller
    /// is designed as if both came that much later.
    pub rate_delay_s: f32,
    /// Phase of the integral beside the controller found (rad), which sets its gain: see
    /// [`Integral`](crate::integral::Integral). Zero switches the integral off; at most [`MOST_PHASE_RAD`].
    pub integral_phase_rad: f32,
    /// Second amplitude of the relay as a part of the first, 0.3 to 0.8, usually
    /// [`SECOND_AMPLITUDE`](Self::SECOND_AMPLITUDE). The test goes on with one cycle there and is refused if the gain
    /// changes with the amplitude ([`amplitude`](crate::amplitude)). Zero, the default, ends the test after the first.
    pub second_amplitude: f32,
    /// What happens with a controller that has been found.
    pub consent: Consent,
}

/// What happens with a controller that has been found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consent {
    /// It is only proposed; the safe controller goes on.
    Never,
    /// It is put in force when [`TunerCore::accept`](super::TunerCore::accept) says so.
    Ask,
    /// It is put in force at once.
    Automatic,
}

impl TunerSettings {
    /// Usual second amplitude of the relay.
    pub const SECOND_AMPLITUDE: f32 = 0.6;

    /// A relay of this amplitude with noise protection and trim at the distinguishing phase, two cycles; an integral
    /// beside the controller found, which is put in force after consent; no take-off; the fallback output is zero. The abort
    /// limits and those of the output have no default: they must be set. Set a safe controller for a real vehicle. The slices
    /// per tick make ten thousand a second, with which an identification takes 0.2 to 0.9 s.
    #[must_use]
    pub fn new(amplitude: f32, sample_s: f32) -> Self {
        Self {
            relay: RelaySettings {
                trim_gain: RelaySettings::TRIM_GAIN,
                ..RelaySettings::new(amplitude, RelaySettings::DISTINGUISHING_BETA)
            },
            sample_s,
            cycles: 2,
            attempts: 4,
            slices: slices_per_tick(sample_s),
            take_off: None,
            limits: Limits::UNSET,
            output_lowest: f32::NAN,
            output_highest: f32::NAN,
            safe: PdLaw::ZERO,
            bias_filter_s: 0.0,
            rate_lag_s: 0.0,
            rate_delay_s: 0.0,
            integral_phase_rad: USUAL_PHASE_RAD,
            second_amplitude: 0.0,
            consent: Consent::Ask,
        }
    }

    /// Checks all settings.
    ///
    /// # Errors
    /// The first setting that is out of range.
    pub fn checked(&self) -> Result<CheckedSettings, TunerError> {
        let positive = [("the sample period", self.sample_s)];
        let not_negative = [
            ("the bias filter's time constant", self.bias_filter_s),
            ("the rate's lag", self.rate_lag_s),
            ("the rate's delay", self.rate_delay_s),
            ("the integral's phase", self.integral_phase_rad),
        ];
        let wrong = (positive
            .into_iter()
            .find(|(_, v)| !(v.is_finite() && *v > 0.0)))
        .or(not_negative
            .into_iter()
            .find(|(_, v)| !(v.is_finite() && *v >= 0.0)))
        .or(self.take_off.and_then(|take_off| take_off.out_of_range()));
        if let Some((name, value)) = wrong {
            return Err(TunerError::Setting(name, value));
        }
        if let Some((name, value)) = self.limits.out_of_range() {
            return Err(TunerError::Limit(name, value));
        }
        if self.integral_phase_rad > MOST_PHASE_RAD {
            return Err(TunerError::IntegralPhase(self.integral_phase_rad));
        }
        let second = self.second_amplitude;
        if second != 0.0 && !SECOND_AMPLITUDES.contains(&second) {
            return Err(TunerError::SecondAmplitude(second));
        }
        if !(1..=MOST_CYCLES).contains(&self.cycles) {
            return Err(TunerError::Cycles(self.cycles));
        }
        if self.attempts == 0 {
            return Err(TunerError::NoWork);
        }
        let (lowest, highest) = (self.output_lowest, self.output_highest);
        if !(lowest.is_finite() && highest.is_finite() && lowest < highest) {
            return Err(TunerError::OutputLimits(lowest, highest));
        }
        if !self.safe.is_finite() {
            return Err(TunerError::Safe);
        }
        Ok(CheckedSettings {
            settings: *self,
            relay: Relay::new(self.relay)?,
        })
    }
}

/// Slices in a tick for ten thousand a second.
fn slices_per_tick(sample_s: f32) -> u16 {
    const PER_S: f32 = 10_000.0;
    // A sample period out of range is found by the check.
    roundf(PER_S * sample_s).clamp(1.0, 500.0) as u16
}

/// Settings that have been checked.
#[derive(Clone, Debug)]
pub struct CheckedSettings {
    pub(super) settings: TunerSettings,
    pub(super) relay: Relay,
}

/// Setting out of range. Exhaustive, because the C interface has a code for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TunerError {
    /// A setting of the relay.
    Relay(RelayError),
    /// A time, a gain or a limit: name and value.
    Setting(&'static str, f32),
    /// An abort limit is not set or not positive: name and value.
    Limit(&'static str, f32),
    /// The phase of the integral exceeds [`MOST_PHASE_RAD`]: its value (rad).
    IntegralPhase(f32),
    /// The second amplitude of the relay: its part of the first.
    SecondAmplitude(f32),
    /// The number of cycles: its value.
    Cycles(u8),
    /// The number of attempts or of slices is zero.
    NoWork,
    /// The lower output limit is not below the upper one, or one is NaN.
    OutputLimits(f32, f32),
    /// A gain or the offset of the safe controller is not finite.
    Safe,
    /// The embedded pack cannot be read.
    Pack,
}

impl fmt::Display for TunerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Relay(error) => error.fmt(f),
            Self::Setting(name, value) => write!(f, "{name} must be positive, but is {value}"),
            Self::Limit(name, value) => write!(
                f,
                "{name} must be set to a positive number (infinity switches it off), but is {value}"
            ),
            Self::IntegralPhase(value) => write!(
                f,
                "the integral's phase must be 0 to {MOST_PHASE_RAD} rad, but is {value}"
            ),
            Self::SecondAmplitude(value) => write!(
                f,
                "the second amplitude must be 0 or 0.3 to 0.8, but is {value}"
            ),
            Self::Cycles(cycles) => {
                write!(
                    f,
                    "the number of cycles must be 1 to {MOST_CYCLES}, but is {cycles}"
                )
            }
            Self::NoWork => write!(
                f,
                "there must be at least one attempt and one slice per tick"
            ),
            Self::OutputLimits(lowest, highest) => write!(
                f,
                "the output limits must be set, the lower one below the upper one, but they are {lowest} and {highest}"
            ),
            Self::Safe => write!(
                f,
                "the gains and the offset of the safe controller must be finite"
            ),
            Self::Pack => write!(f, "the embedded pack cannot be read"),
        }
    }
}

impl core::error::Error for TunerError {}

impl From<RelayError> for TunerError {
    fn from(error: RelayError) -> Self {
        Self::Relay(error)
    }
}
