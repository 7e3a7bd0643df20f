//! Axes and control loops of a vehicle.

use std::fmt;

/// Axis of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Axis {
    /// About the longitudinal axis.
    Roll,
    /// About the lateral axis.
    Pitch,
    /// About the vertical axis.
    Yaw,
}

impl Axis {
    /// All axes, in the order of firmware.
    pub const ALL: [Self; 3] = [Self::Roll, Self::Pitch, Self::Yaw];

    /// 0, 1 or 2.
    pub fn index(self) -> usize {
        self as usize
    }

    /// `roll`, `pitch` or `yaw`.
    pub fn name(self) -> &'static str {
        ["roll", "pitch", "yaw"][self.index()]
    }
}

/// A control loop of a vehicle, named by what it controls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ControlLoop {
    /// Torque command to angular rate (rad/s).
    Rate(Axis),
    /// Set-point of the rate (rad/s) to angle (rad).
    Attitude(Axis),
    /// Thrust command to climb rate (m/s, up).
    Altitude,
}

impl ControlLoop {
    /// Every loop, the inner ones first.
    pub const ALL: [Self; 7] = [
        Self::Rate(Axis::Roll),
        Self::Rate(Axis::Pitch),
        Self::Rate(Axis::Yaw),
        Self::Attitude(Axis::Roll),
        Self::Attitude(Axis::Pitch),
        Self::Attitude(Axis::Yaw),
        Self::Altitude,
    ];

    /// The axis; `None` for the altitude.
    pub fn axis(self) -> Option<Axis> {
        match self {
            Self::Rate(axis) | Self::Attitude(axis) => Some(axis),
            Self::Altitude => None,
        }
    }
}

impl fmt::Display for ControlLoop {
    /// `roll rate`, `pitch attitude`, `altitude`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rate(axis) => write!(f, "{} rate", axis.name()),
            Self::Attitude(axis) => write!(f, "{} attitude", axis.name()),
            Self::Altitude => f.write_str("altitude"),
        }
    }
}
