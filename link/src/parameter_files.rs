//! The files that set parameters: written and read.
//!
//! | firmware | line | comment | reference |
//! |---|---|---|---|
//! | PX4 | `system TAB component TAB name TAB value TAB type`, type 9: 32-bit float, 6: 32-bit integer (`MAV_PARAM_TYPE`) | a line that starts with `#` | QGroundControl, "Parameters", file format |
//! | ArduPilot | `name,value` | the same | MAVProxy, Mission Planner |
//! | Betaflight | commands `set name = value`, at the end `save` | the same | Betaflight CLI |

mod read;

use std::fmt::Write;

pub use self::read::{ParameterFile, ParameterFileError, read_parameters};
use crate::log::{FirmwareKind, Flight};

use crate::gains::{Change, version_numbers};

/// Two files: the new values, and the old ones.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct ParameterFiles {
    /// Sets the new values.
    pub apply: String,
    /// Sets the old values again.
    pub restore: String,
    /// Usual ending of the name: `params`, `param` or `txt`.
    pub ending: &'static str,
}

/// Files for the firmware of a flight. Old and new values stand in comments. `None` for a firmware without a known format.
pub fn files(flight: &Flight, changes: &[Change]) -> Option<ParameterFiles> {
    let ending = flight.firmware.kind.parameter_ending()?;
    let reversed: Vec<Change> = (changes.iter())
        .map(|change| Change {
            old: change.new,
            new: change.old,
            ..change.clone()
        })
        .collect();
    Some(ParameterFiles {
        apply: file(flight, changes, false),
        restore: file(flight, &reversed, true),
        ending,
    })
}

fn file(flight: &Flight, changes: &[Change], is_restore: bool) -> String {
    let mut text = String::new();
    for Change { name, old, new, .. } in changes {
        let _ = writeln!(text, "# {name}: {} -> {}", shown(*old), shown(*new));
    }
    match flight.firmware.kind {
        FirmwareKind::Px4 | FirmwareKind::ArduPilot => {
            let system = flight.tables.parameter("MAV_SYS_ID").unwrap_or(1.0);
            let lines: Vec<ParameterLine> = changes.iter().map(|of| line(flight, of)).collect();
            text += &parameter_text(flight.firmware.kind, system as u8, &lines);
        }
        FirmwareKind::Betaflight | FirmwareKind::Inav => {
            betaflight(&mut text, flight, changes, is_restore);
        }
    }
    text
}

/// Shortest decimals that give back the same number of single precision.
fn shown(value: f64) -> String {
    format!("{}", value as f32)
}

/// A parameter with its value, as a line of a file has it.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterLine {
    /// Name in the firmware.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Whether the firmware stores it as an integer.
    pub is_integer: bool,
}

fn line(flight: &Flight, change: &Change) -> ParameterLine {
    let of = flight.tables.parameters.get(&change.name);
    ParameterLine {
        name: change.name.clone(),
        value: change.new,
        is_integer: of.is_some_and(|of| of.is_integer),
    }
}

/// The lines of a file that sets parameters of PX4 (of the vehicle with the number `system`) or of ArduPilot. Empty for
/// firmware without such a file.
pub fn parameter_text(firmware: FirmwareKind, system: u8, lines: &[ParameterLine]) -> String {
    let mut text = String::new();
    match firmware {
        FirmwareKind::Px4 => {
            text.push_str("# Vehicle-Id Component-Id Name Value Type\n");
            for line in lines {
                let kind = if line.is_integer { 6 } else { 9 };
                let _ = writeln!(text, "{system}\t1\t{}\t{}\t{kind}", line.name, line.shown());
            }
        }
        FirmwareKind::ArduPilot => {
            for line in lines {
                let _ = writeln!(text, "{},{}", line.name, line.shown());
            }
        }
        FirmwareKind::Betaflight | FirmwareKind::Inav => {}
    }
    text
}

impl ParameterLine {
    /// The value in decimals. Single precision has no room for large integers.
    fn shown(&self) -> String {
        match self.is_integer {
            true => format!("{}", self.value),
            false => shown(self.value),
        }
    }
}

/// The sliders of Betaflight 4.3 and later compute the gains anew, unless they are off. Restoring sets them as they were.
fn betaflight(text: &mut String, flight: &Flight, changes: &[Change], is_restore: bool) {
    let has_sliders = version_numbers(&flight.firmware.version).is_some_and(|v| v >= [4, 3]);
    let modes = ["OFF", "RP", "RPY"];
    let mode = flight.tables.parameter("simplified_pids_mode");
    let mode = mode
        .and_then(|mode| modes.get(mode as usize))
        .unwrap_or(&"OFF");
    // The header of a log has the gains of the active profile, but not its number.
    text.push_str(
        "# PID profile: the one selected. Select that of the flight first: profile 0, 1, 2 or 3\n",
    );
    if has_sliders && !is_restore {
        text.push_str("set simplified_pids_mode = OFF\n");
    }
    for Change { name, new, .. } in changes {
        let _ = writeln!(text, "set {name} = {}", shown(*new));
    }
    if has_sliders && is_restore {
        let _ = writeln!(text, "set simplified_pids_mode = {mode}");
    }
    text.push_str("save\n");
}

#[cfg(test)]
mod tests {
    use crate::gains::tests::flight;
    use crate::gains::{LoopGains, changes};
    use crate::log::{Axis, ControlLoop};

    use super::*;

    const ROLL: ControlLoop = ControlLoop::Rate(Axis::Roll);

    fn of(name: &str, edit: impl Fn(&mut Flight)) -> ParameterFiles {
        let mut flight = flight(name);
        edit(&mut flight);
        let old = LoopGains::in_force(&flight, ROLL).unwrap();
        let new = LoopGains::new(0.8 * old.proportional, old.integral, 0.5 * old.derivative);
        files(&flight, &changes(&flight, ROLL, new).unwrap()).unwrap()
    }

    #[test]
    fn px4() {
        let files = of("px4_chirps.ulg", |_| {});
        assert_eq!(
            files.apply,
            "# MC_ROLLRATE_P: 0.15 -> 0.12\n# MC_ROLLRATE_D: 0.003 -> 0.0015\n\
             # Vehicle-Id Component-Id Name Value Type\n\
             1\t1\tMC_ROLLRATE_P\t0.12\t9\n1\t1\tMC_ROLLRATE_D\t0.0015\t9\n"
        );
        assert_eq!(
            files.restore,
            "# MC_ROLLRATE_P: 0.12 -> 0.15\n# MC_ROLLRATE_D: 0.0015 -> 0.003\n\
             # Vehicle-Id Component-Id Name Value Type\n\
             1\t1\tMC_ROLLRATE_P\t0.15\t9\n1\t1\tMC_ROLLRATE_D\t0.003\t9\n"
        );
    }

    #[test]
    fn ardupilot() {
        let files = of("ap_sysid_roll.bin", |_| {});
        assert_eq!(
            files.apply,
            "# ATC_RAT_RLL_P: 0.135 -> 0.108\n# ATC_RAT_RLL_D: 0.0036 -> 0.0018\n\
             ATC_RAT_RLL_P,0.108\nATC_RAT_RLL_D,0.0018\n"
        );
        assert!(
            files
                .restore
                .ends_with("ATC_RAT_RLL_P,0.135\nATC_RAT_RLL_D,0.0036\n")
        );
    }

    #[test]
    fn betaflight() {
        let name = "betaflight_acro.bfl";
        let files = of(name, |_| {});
        let lines = "set p_roll = 62\nset d_roll = 42\nset d_min_roll = 28\n";
        assert_eq!(
            files.apply,
            format!(
                "# p_roll: 77 -> 62\n# d_roll: 83 -> 42\n# d_min_roll: 55 -> 28\n\
                 # PID profile: the one selected. Select that of the flight first: profile 0, 1, 2 or 3\n{lines}save\n"
            )
        );
        assert!(
            files
                .restore
                .ends_with("set p_roll = 77\nset d_roll = 83\nset d_min_roll = 55\nsave\n")
        );
        // From 4.3 on the sliders must be off, or the firmware computes the gains anew.
        let newer = of(name, |flight| {
            flight.firmware.version = "Betaflight 4.4.0 (a) X".to_owned();
        });
        assert!(
            newer
                .apply
                .ends_with(&format!("set simplified_pids_mode = OFF\n{lines}save\n"))
        );
        assert!(
            newer
                .restore
                .ends_with("set simplified_pids_mode = OFF\nsave\n")
        );
    }
}
