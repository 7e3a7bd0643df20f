//! How a tuner works, and what is out of range.

use core::fmt;

use crate::control::PdLaw;
use crate::guard::Limits;
use crate::identification::MOST_CYCLES;
use crate::relay::{Relay, RelayError, RelaySettings};
use crate::take_off::TakeOffSettings;

/// How an axis is tuned. Start from [`TunerSettings::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TunerSettings {
    /// The relay of the test. Its amplitude adds to the offset that holds the process at rest. Its noise
    /// should be the sensor's or be measured in a pre-roll: with none it switches on what is none, and takes
    /// the least distance from the reference for one to return from.
    pub relay: RelaySettings,
    /// Time between ticks (s).
    pub sample_s: f32,
    /// Cycles that are refined together, 1 to 4; the last one is also read.
    pub cycles: u8,
    /// Looks at cycles that may be refused before the test ends.
    pub attempts: u8,
    /// Slices of the identification in a tick, each of up to 2,700 operations in double precision; some 2,000 to
    /// 9,000 make one. Where those are emulated, 1.
    pub slices: u16,
    /// The integrator that lifts the vehicle from the ground; `None` where the test begins in the air.
    pub take_off: Option<TakeOffSettings>,
    /// What must never happen.
    pub limits: Limits,
    /// Least output (input unit).
    pub output_lowest: f32,
    /// Largest output (input unit).
    pub output_highest: f32,
    /// The controller before the test and after one that was aborted; [`PdLaw::ZERO`] for zero output.
    pub safe: PdLaw,
    /// Time constant of the means under the safe controller (s): its output is what the relay is then offset
    /// by, against a drift under a constant bias, and the process's what it oscillates about; zero for no such
    /// compensation.
    pub bias_filter_s: f32,
    /// Lag of a rate that is found from differences (s).
    pub rate_lag_s: f32,
}

impl TunerSettings {
    /// A noise-protected relay of this amplitude at the distinguishing phase, with trim, from two cycles;
    /// no take-off, no limits, nothing safe but zero: set what the vehicle needs.
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
            slices: 10,
            take_off: None,
            limits: Limits::NONE,
            output_lowest: f32::MIN,
            output_highest: f32::MAX,
            safe: PdLaw::ZERO,
            bias_filter_s: 0.0,
            rate_lag_s: 0.0,
        }
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// Names the first that is out of range.
    pub fn checked(&self) -> Result<CheckedSettings, TunerError> {
        let positive = [("the sample period", self.sample_s)];
        let not_negative = [
            ("the bias filter's time constant", self.bias_filter_s),
            ("the rate's lag", self.rate_lag_s),
        ];
        let wrong = (positive
            .into_iter()
            .find(|(_, v)| !(v.is_finite() && *v > 0.0)))
        .or(not_negative
            .into_iter()
            .find(|(_, v)| !(v.is_finite() && *v >= 0.0)))
        .or(self.limits.out_of_range())
        .or(self.take_off.and_then(|take_off| take_off.out_of_range()));
        if let Some((name, value)) = wrong {
            return Err(TunerError::Setting(name, value));
        }
        if !(1..=MOST_CYCLES).contains(&self.cycles) {
            return Err(TunerError::Cycles(self.cycles));
        }
        if self.attempts == 0 || self.slices == 0 {
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

/// Settings that are in their ranges.
#[derive(Clone, Debug)]
pub struct CheckedSettings {
    pub(super) settings: TunerSettings,
    pub(super) relay: Relay,
}

/// A setting out of its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TunerError {
    /// Of the relay.
    Relay(RelayError),
    /// A time, a gain or a limit: its name and value.
    Setting(&'static str, f32),
    /// The number of cycles.
    Cycles(u8),
    /// There are no attempts, or no slices.
    NoWork,
    /// The least output is not below the largest, or one is no number.
    OutputLimits(f32, f32),
    /// The safe controller has a gain or an offset that is no finite number.
    Safe,
    /// The pack that is built in cannot be read.
    Pack,
}

impl fmt::Display for TunerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Relay(error) => error.fmt(f),
            Self::Setting(name, value) => write!(f, "{name} must be positive, but is {value}"),
            Self::Cycles(cycles) => {
                write!(f, "the cycles must be 1 to {MOST_CYCLES}, but are {cycles}")
            }
            Self::NoWork => write!(f, "there must be at least one attempt and one slice a tick"),
            Self::OutputLimits(lowest, highest) => write!(
                f,
                "the least output must be below the largest, but they are {lowest} and {highest}"
            ),
            Self::Safe => write!(f, "the safe controller's numbers must be finite"),
            Self::Pack => write!(f, "the pack cannot be read"),
        }
    }
}

impl core::error::Error for TunerError {}

impl From<RelayError> for TunerError {
    fn from(error: RelayError) -> Self {
        Self::Relay(error)
    }
}
