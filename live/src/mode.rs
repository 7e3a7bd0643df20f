//! Flight modes by name, and the numbers of those that this crate sets.
//!
//! PX4 has a main and a sub mode in bytes 2 and 3 of the number, ArduCopter one number. Reference: PX4 and ArduPilot
//! documentation, "Flight Modes".

use mavlink::dialects::common::{HEARTBEAT_DATA, MavAutopilot, MavType};

/// PX4: offboard, and hold (`AUTO_LOITER`).
pub(crate) const PX4_OFFBOARD: Px4Mode = Px4Mode { main: 6, sub: 0 };
pub(crate) const PX4_HOLD: Px4Mode = Px4Mode { main: 4, sub: 3 };

/// ArduCopter: guided.
pub(crate) const COPTER_GUIDED: u32 = 4;

/// A mode of PX4.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Px4Mode {
    pub(crate) main: u8,
    pub(crate) sub: u8,
}

impl Px4Mode {
    /// The mode of a heartbeat's number.
    pub(crate) fn of(custom_mode: u32) -> Self {
        let [_, _, main, sub] = custom_mode.to_le_bytes();
        Self { main, sub }
    }

    /// The number that a heartbeat has.
    pub(crate) const fn number(self) -> u32 {
        u32::from_le_bytes([0, 0, self.main, self.sub])
    }

    fn name(self) -> Option<&'static str> {
        Some(match (self.main, self.sub) {
            (1, _) => "Manual",
            (2, _) => "Altitude",
            (3, _) => "Position",
            (4, 1) => "Ready",
            (4, 2) => "Takeoff",
            (4, 3) => "Hold",
            (4, 4) => "Mission",
            (4, 5) => "Return",
            (4, 6) => "Land",
            (4, 8) => "Follow",
            (4, 9) => "Precision land",
            (5, _) => "Acro",
            (6, _) => "Offboard",
            (7, _) => "Stabilized",
            _ => return None,
        })
    }
}

/// Name of the flight mode; a number where it is not known.
pub(crate) fn name(heartbeat: &HEARTBEAT_DATA) -> String {
    let number = heartbeat.custom_mode;
    let known = match heartbeat.autopilot {
        MavAutopilot::MAV_AUTOPILOT_PX4 => Px4Mode::of(number).name(),
        MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA if is_copter(heartbeat.mavtype) => copter(number),
        _ => None,
    };
    known.map_or_else(|| format!("mode {number}"), str::to_owned)
}

/// Whether ArduPilot flies this type as a copter.
pub(crate) fn is_copter(kind: MavType) -> bool {
    matches!(
        kind,
        MavType::MAV_TYPE_QUADROTOR
            | MavType::MAV_TYPE_HEXAROTOR
            | MavType::MAV_TYPE_OCTOROTOR
            | MavType::MAV_TYPE_TRICOPTER
            | MavType::MAV_TYPE_DODECAROTOR
            | MavType::MAV_TYPE_DECAROTOR
            | MavType::MAV_TYPE_COAXIAL
            | MavType::MAV_TYPE_HELICOPTER
    )
}

fn copter(number: u32) -> Option<&'static str> {
    Some(match number {
        0 => "Stabilize",
        1 => "Acro",
        2 => "AltHold",
        3 => "Auto",
        4 => "Guided",
        5 => "Loiter",
        6 => "RTL",
        7 => "Circle",
        9 => "Land",
        11 => "Drift",
        13 => "Sport",
        14 => "Flip",
        15 => "AutoTune",
        16 => "PosHold",
        17 => "Brake",
        18 => "Throw",
        19 => "Avoid_ADSB",
        20 => "Guided_NoGPS",
        21 => "Smart_RTL",
        22 => "FlowHold",
        23 => "Follow",
        24 => "ZigZag",
        25 => "SystemID",
        26 => "Autorotate",
        27 => "Auto RTL",
        28 => "Turtle",
        _ => return None,
    })
}

/// `MAV_TYPE_QUADROTOR` as `quadrotor`.
pub(crate) fn word(name: &str, prefix: &str) -> String {
    let name = name.strip_prefix(prefix).unwrap_or(name);
    name.to_lowercase().replace('_', " ")
}
