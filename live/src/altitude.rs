//! Relay test of the altitude from the ground station: PX4 in Offboard, ArduCopter in Guided.
//!
//! The vehicle hovers. Its thrust, attitude and heading are averaged. Then every sample of its height is answered with a
//! set-point of this attitude and of a thrust: that of the hover, plus or minus the amplitude of the relay.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | y | `height_m` | m, integral of the estimated climb rate: the estimated height itself wanders more than it oscillates |
//! | u | `thrust` | part of the full thrust, from 0 to 1, less that of the hover |
//! | h | `amplitude` | part of the full thrust |
//!
//! The test ends after its cycles, or at a limit, a change of the mode, a stick or lost messages. Then the vehicle holds its
//! position in the mode that it came from; if the pilot has changed the mode, nothing more is sent.

mod flight;
mod pilot;
mod samples;

use std::fmt;
use std::time::Duration;

use onecycle_link::FirmwareKind;
use onecycle_onboard::RelayError;

pub use self::samples::Sample;
use crate::error::LiveError;
use crate::write::{Cause, Refusal};

/// Settings of the test. All limits are checked at every sample.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct AltitudeTest {
    /// Half the jump of the thrust, as a part of the full thrust.
    pub amplitude: f64,
    /// Cycles after the relay has settled.
    pub cycles: u32,
    /// Largest distance from the height at the start (m).
    pub band_m: f64,
    /// Largest climb or sink rate (m/s).
    pub climb_m_per_s: f64,
    /// Largest horizontal distance from the start (m): the position is not held.
    pub drift_m: f64,
    /// Longest test (s).
    pub duration_s: f64,
}

impl Default for AltitudeTest {
    /// A tenth of the thrust, 10 cycles; 1 m, 2 m/s, 10 m, 60 s.
    fn default() -> Self {
        Self {
            amplitude: 0.1,
            cycles: 10,
            band_m: 1.0,
            climb_m_per_s: 2.0,
            drift_m: 10.0,
            duration_s: 60.0,
        }
    }
}

/// Why no test was begun. The vehicle was left as it is, or is back in its mode.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AltitudeRefusal {
    /// Only PX4 and ArduCopter are known.
    #[error("the altitude test is known for PX4 and ArduCopter only")]
    Firmware,
    /// The vehicle is not armed, or on the ground.
    #[error("the vehicle is not flying")]
    NotFlying,
    /// It is in another mode than the one that the test returns to.
    #[error("the vehicle is in mode {found}, not in {wanted}")]
    Mode {
        /// Mode in which the test may begin.
        wanted: &'static str,
        /// Mode of the vehicle.
        found: String,
    },
    /// The height comes too seldom, or not at all (Hz).
    #[error("the position comes at {0:.0} Hz; the test needs {LEAST_RATE_HZ:.0} Hz")]
    Rate(f64),
    /// The vehicle does not hover: it moves (m/s).
    #[error("the vehicle does not hover: it moves at {0:.1} m/s")]
    Moving(f64),
    /// The thrust of the hover is not known, or too near to the limits for this amplitude.
    #[error("the thrust of the hover, {0:.2}, leaves no room for the amplitude")]
    Thrust(f64),
    /// A setting of the relay.
    #[error("{0}")]
    Relay(RelayError),
    /// ArduCopter does not take the thrust as a thrust.
    #[error("GUID_OPTIONS cannot be set: {0}")]
    Options(String),
    /// The vehicle does not change into the mode of the test.
    #[error("the vehicle does not change into {0}")]
    NoMode(&'static str),
    /// The vehicle cannot be asked.
    #[error(transparent)]
    Live(#[from] LiveError),
}

/// Least rate of the position (Hz): some 15 samples in a cycle of a small vehicle.
pub(crate) const LEAST_RATE_HZ: f64 = 20.0;

impl From<RelayError> for AltitudeRefusal {
    fn from(error: RelayError) -> Self {
        Self::Relay(error)
    }
}

impl From<Refusal> for AltitudeRefusal {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Live(error) => Self::Live(error),
            refusal => Self::Options(refusal.to_string()),
        }
    }
}

impl From<Cause> for AltitudeRefusal {
    fn from(cause: Cause) -> Self {
        Self::Options(cause.to_string())
    }
}

/// Why a test ended before its cycles were complete.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum AltitudeAbort {
    /// Too far from the height at the start (m).
    Height(f64),
    /// Too fast (m/s).
    Climb(f64),
    /// Too far from the place of the start (m).
    Drift(f64),
    /// Too long (s).
    Duration(f64),
    /// The relay has not switched for this time (s).
    NoOscillation(f64),
    /// No position has come for this time (s).
    Stale(f64),
    /// The estimator has jumped, or the vehicle has restarted.
    Reset,
    /// The flight mode was changed to this one.
    Mode(String),
    /// The motors were disarmed.
    Disarmed,
    /// A stick was moved.
    Stick,
    /// The operator has asked for the end.
    Operator,
}

impl fmt::Display for AltitudeAbort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Height(m) => write!(f, "the height was {m:.2} m from the start"),
            Self::Climb(rate) => write!(f, "the vehicle moved up or down at {rate:.1} m/s"),
            Self::Drift(m) => write!(f, "the vehicle drifted {m:.1} m away"),
            Self::Duration(s) => write!(f, "the test took {s:.0} s"),
            Self::NoOscillation(s) => write!(f, "the relay did not switch for {s:.1} s"),
            Self::Stale(s) => write!(f, "no position came for {s:.2} s"),
            Self::Reset => f.write_str("the estimator was reset or the vehicle restarted"),
            Self::Mode(mode) => write!(f, "the flight mode was changed to {mode}"),
            Self::Disarmed => f.write_str("the vehicle was disarmed"),
            Self::Stick => f.write_str("a stick was moved"),
            Self::Operator => f.write_str("the operator ended the test"),
        }
    }
}

/// What the vehicle does after the test.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum HandBack {
    /// It holds its position, as before the test.
    Holds,
    /// Somebody else has it: the mode was changed, or the motors are off.
    NotOurs,
    /// It was told to hold its position, but did not confirm it.
    Unconfirmed,
}

/// Where the recorded thrust comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThrustSource {
    /// The vehicle reports it with its own time stamps (`ATTITUDE_TARGET`).
    Reported,
    /// It is what was sent: the dead time of the process contains the delay of the link.
    Commanded,
}

/// A test that was flown, complete or not.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct AltitudeFlight {
    /// Settings.
    pub test: AltitudeTest,
    /// Firmware.
    pub firmware: FirmwareKind,
    /// Samples of the relay, in the vehicle's time.
    pub samples: Vec<Sample>,
    /// Thrust of the hover, as a part of the full one.
    pub hover_thrust: f64,
    /// `beta` of the relay.
    pub beta: f64,
    /// Where the thrust of the samples comes from.
    pub source: ThrustSource,
    /// Why it ended early; `None`: complete.
    pub abort: Option<AltitudeAbort>,
    /// What the vehicle does now.
    pub hand_back: HandBack,
    /// Whether `GUID_OPTIONS` has its old value; `None`: it was not changed.
    pub is_restored: Option<bool>,
}

impl AltitudeFlight {
    /// Mean time between two samples (s); 0 without samples.
    pub fn sample_period_s(&self) -> f64 {
        match &self.samples[..] {
            [first, .., last] => (last.time_s - first.time_s) / (self.samples.len() - 1) as f64,
            _ => 0.0,
        }
    }
}

/// Time without a position after which the test ends.
const STALE: Duration = Duration::from_millis(500);
