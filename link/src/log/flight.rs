//! What a flight log tells about the vehicle: the types.

use super::loops::{Axis, ControlLoop};
use super::tables::FlightTables;

/// Firmware that wrote the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FirmwareKind {
    /// PX4.
    Px4,
    /// ArduPilot.
    ArduPilot,
    /// Betaflight, or Cleanflight.
    Betaflight,
    /// INAV.
    Inav,
}

impl FirmwareKind {
    /// Usual ending of a file with parameters, which ground stations look for. `None` for a firmware without a known format.
    #[must_use]
    pub fn parameter_ending(self) -> Option<&'static str> {
        match self {
            Self::Px4 => Some("params"),
            Self::ArduPilot => Some("param"),
            Self::Betaflight => Some("txt"),
            Self::Inav => None,
        }
    }
}

/// Firmware and board.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Firmware {
    /// Which firmware.
    pub kind: FirmwareKind,
    /// Its version as the log tells it; empty if it does not.
    pub version: String,
    /// Board; empty if the log does not tell.
    pub board: String,
}

impl Firmware {
    /// Vehicle and release that ArduPilot names: `ArduCopter` and 4, 5 of `ArduCopter V4.5.7 (2a3dc4b7)`. `None`: the log does
    /// not name them.
    #[must_use]
    pub fn release(&self) -> Option<(&str, [u32; 2])> {
        let mut words = self.version.split_whitespace();
        let (vehicle, release) = (words.next()?, words.next()?.strip_prefix('V')?);
        let mut numbers = release.split(|c: char| !c.is_ascii_digit());
        let mut number = || numbers.next()?.parse().ok();
        Some((vehicle, [number()?, number()?]))
    }
}

/// A stretch of time, in seconds of the log's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Span {
    /// Start.
    pub from_s: f64,
    /// End.
    pub to_s: f64,
}

impl Span {
    /// A part of a flight between two times (s).
    #[must_use]
    pub fn new(from_s: f64, to_s: f64) -> Self {
        Self { from_s, to_s }
    }

    /// The longest span within it from one tenth of a second to another: a span that is printed is one that can be typed in.
    pub(super) fn in_tenths(self) -> Self {
        Self {
            from_s: (10.0 * self.from_s).ceil() / 10.0,
            to_s: (10.0 * self.to_s).floor() / 10.0,
        }
    }

    /// The span from the earlier start to the later end of both.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            from_s: self.from_s.min(other.from_s),
            to_s: self.to_s.max(other.to_s),
        }
    }
}

/// What makes a deliberate excitation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MarkKind {
    /// PX4 multicopter autotune.
    Px4Autotune,
    /// ArduPilot flight mode SYSTEMID.
    ArduPilotSystemId,
    /// ArduPilot AutoTune.
    ArduPilotAutotune,
    /// Betaflight chirp.
    BetaflightChirp,
}

/// A stretch of deliberate excitation.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Mark {
    /// What made it.
    pub kind: MarkKind,
    /// The axis, if the log tells.
    pub axis: Option<Axis>,
    /// When.
    pub span: Span,
}

/// Term of a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Term {
    /// Factor of all terms.
    Factor,
    /// Proportional.
    Proportional,
    /// Integral.
    Integral,
    /// Derivative.
    Derivative,
    /// Upper limit of a derivative gain that rises with the stick (Betaflight), or lower one.
    DerivativeLimit,
    /// Feed-forward of the set-point.
    FeedForward,
    /// Mix of the motors.
    Mixer,
}

/// A gain in force.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Gain {
    /// Which term.
    pub term: Term,
    /// Name of the parameter.
    pub name: String,
    /// Value of the parameter at the end of the flight.
    pub value: f64,
    /// Time (s) of its last change in flight. `None`: it was not changed.
    pub changed_s: Option<f64>,
    /// The gain in SI units: input of the process per rad/s, rad, rad/s^2 (P, I, D of a rate) or 1/s (attitude).
    /// `None`: the conversion is not known.
    pub si: Option<f64>,
    /// The gain in SI units of a parameter of one.
    pub si_per_unit: Option<f64>,
}

/// A parameter with its value.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Setting {
    /// Name in the firmware.
    pub name: String,
    /// Value.
    pub value: f64,
}

/// A signal of a loop.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LoggedSignal {
    /// Topic and columns.
    pub name: String,
    /// Rows per second, without pauses of the log.
    pub rate_hz: f64,
}

/// A control loop as it was logged.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LoggedLoop {
    /// Which loop.
    pub control_loop: ControlLoop,
    /// Input of the process. `None`: not logged.
    pub input: Option<LoggedSignal>,
    /// Output. `None`: not logged.
    pub output: Option<LoggedSignal>,
    /// Set-point. `None`: not logged.
    pub set_point: Option<LoggedSignal>,
    /// Gains in force at the end.
    pub gains: Vec<Gain>,
}

impl LoggedLoop {
    /// Time (s) of the last change of a gain in flight. `None`: none was changed.
    pub fn gains_changed_s(&self) -> Option<f64> {
        let changes = self.gains.iter().filter_map(|gain| gain.changed_s);
        changes.max_by(f64::total_cmp)
    }

    /// Whether input and output are there, so that a process can be identified.
    pub fn is_complete(&self) -> bool {
        self.input.is_some() && self.output.is_some()
    }
}

/// One flight of a log.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Flight {
    /// Firmware and board.
    pub firmware: Firmware,
    /// First and last row of the topic with the most rows, in seconds of the firmware's clock.
    pub span: Span,
    /// Every loop, also those that were not logged.
    pub loops: Vec<LoggedLoop>,
    /// Topics with their rates, parameters, facts and messages.
    pub tables: FlightTables,
    /// Filters of gyro and derivative that are in force.
    pub filters: Vec<Setting>,
    /// Geometry of the motors as far as parameters tell.
    pub mixer: Vec<Setting>,
    /// Deliberate excitation.
    pub marks: Vec<Mark>,
    /// When the motors were armed. `None`: the log does not tell.
    pub armed: Option<Vec<Span>>,
    /// When the vehicle was in the air. `None`: the log does not tell.
    pub airborne: Option<Vec<Span>>,
}

impl Flight {
    /// A loop as it was logged.
    pub fn logged_loop(&self, of: ControlLoop) -> Option<&LoggedLoop> {
        self.loops.iter().find(|own| own.control_loop == of)
    }
}
