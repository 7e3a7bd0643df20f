//! Gains to parameters of a firmware: the changes of a loop, within the ranges of the firmware, and the files that make them.
//!
//! | firmware | parameters | file |
//! |---|---|---|
//! | PX4 1.9 and later | `MC_ROLLRATE_P`, `_I`, `_D` (divided by `_K`), `MC_ROLL_P` | `.params` |
//! | ArduCopter 4.0 and later | `ATC_RAT_RLL_P`, `_I`, `_D`, `ATC_ANG_RLL_P` | `.param` |
//! | Betaflight 4.0 and later | `p_roll`, `i_roll`, `d_roll`, `d_min_roll` or `d_max_roll` | commands of the CLI |
//!
//! Feed-forward is left alone. Ranges: PX4 parameter reference, ArduPilot parameter list, Betaflight CLI.

use crate::log::{Axis, ControlLoop, Firmware, FirmwareKind, Flight, Gain, Term};

/// Gains of a loop in SI units, as [`Gain::si`] has them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LoopGains {
    /// Proportional gain.
    pub proportional: f64,
    /// Integral gain; 0 without one.
    pub integral: f64,
    /// Derivative gain; 0 without one.
    pub derivative: f64,
}

/// A parameter with its old and its new value.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Change {
    /// Name in the firmware, as its file has it.
    pub name: String,
    /// Term of the controller.
    pub term: Term,
    /// Value in the log.
    pub old: f64,
    /// New value: an integer where the firmware has integers.
    pub new: f64,
    /// Gain in SI units of a value of one.
    pub si_per_unit: f64,
}

/// How names begin of the lower end of a derivative gain that Betaflight moves.
const LOWER_END: &str = "d_min";

/// Why gains cannot become parameters.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GainsError {
    /// The names and scales of this firmware are not known.
    #[error("the parameters of this firmware are not known: {0}")]
    Firmware(String),
    /// The version is older than the names and scales, or the log does not tell it.
    #[error("the version of the firmware, {0:?}, is not one whose parameters are known")]
    Version(String),
    /// The log has no parameter for the gains of this loop.
    #[error("the log has no gains of the {0} loop")]
    NoGains(ControlLoop),
    /// A gain is not a number, or the firmware has no parameter for this term.
    #[error("the {0} loop of this firmware has no gain for {1:?}")]
    NoTerm(ControlLoop, Term),
    /// Outside of the range of the firmware.
    #[error("{name} {value} is outside of the range {low} to {high} of the firmware")]
    Range {
        /// Name of the parameter.
        name: String,
        /// Value that it would get.
        value: f64,
        /// Least value.
        low: f64,
        /// Largest value.
        high: f64,
    },
}

impl LoopGains {
    /// Gains in SI units.
    pub fn new(proportional: f64, integral: f64, derivative: f64) -> Self {
        Self {
            proportional,
            integral,
            derivative,
        }
    }

    /// The gains in force of a loop: of a derivative that the firmware moves with the sticks, the lower one. `None`: the
    /// log has none, or their scale is not known.
    pub fn in_force(flight: &Flight, of: ControlLoop) -> Option<Self> {
        let gains = &flight.logged_loop(of)?.gains;
        let si = |term| gains.iter().find(|gain| gain.term == term)?.si;
        Some(Self {
            proportional: si(Term::Proportional)?,
            integral: si(Term::Integral).unwrap_or(0.0),
            derivative: base_derivative(flight, of).map_or(0.0, |(_, si)| si),
        })
    }

    /// The gains that parameters would make: those in force with the changes.
    #[must_use]
    pub fn changed(mut self, changes: &[Change]) -> Self {
        // Where the firmware lowers the derivative, its lower end is the one in force.
        let lowered = changes
            .iter()
            .any(|change| change.name.starts_with(LOWER_END));
        for change in changes.iter() {
            let moved = |from: f64| match change.old {
                0.0 => change.new * change.si_per_unit,
                old => from * (change.new / old),
            };
            match change.term {
                Term::Proportional => self.proportional = moved(self.proportional),
                Term::Integral => self.integral = moved(self.integral),
                Term::Derivative if !lowered => self.derivative = moved(self.derivative),
                _ if change.name.starts_with(LOWER_END) => {
                    self.derivative = moved(self.derivative);
                }
                _ => {}
            }
        }
        self
    }

    /// From these gains a share of the way, 0 to 1, to others: of a ratio for gains that rise, of a difference for those
    /// that fall. Each is the smaller of both moves.
    #[must_use]
    pub fn toward(self, other: Self, share: f64) -> Self {
        let between = |from: f64, to: f64| match from > 0.0 && to > from {
            true => from * (to / from).powf(share),
            false => from + share * (to - from),
        };
        Self {
            proportional: between(self.proportional, other.proportional),
            integral: between(self.integral, other.integral),
            derivative: between(self.derivative, other.derivative),
        }
    }
}

/// The gain that acts as derivative without stick movement, and its value in SI units: Betaflight up to 4.5 lowers `d` to
/// `d_min`, if that is not zero; later versions raise `d` to `d_max`.
fn base_derivative(flight: &Flight, of: ControlLoop) -> Option<(&Gain, f64)> {
    let gains = &flight.logged_loop(of)?.gains;
    let own = gains.iter().find(|gain| gain.term == Term::Derivative)?;
    let least = (gains.iter())
        .filter(|gain| {
            gain.name.starts_with(LOWER_END) && gain.value > 0.0 && gain.value < own.value
        })
        .min_by(|a, b| a.value.total_cmp(&b.value));
    let base = least.unwrap_or(own);
    Some((base, base.si?))
}

/// The parameters of a loop that change, with their new values.
///
/// # Errors
/// The firmware or its version is not known, the log has no gains, or a value is outside of the firmware's range.
pub fn changes(
    flight: &Flight,
    of: ControlLoop,
    gains: LoopGains,
) -> Result<Vec<Change>, GainsError> {
    check_version(&flight.firmware)?;
    let stated = flight.logged_loop(of).map_or(&[][..], |of| &of.gains);
    let in_force = LoopGains::in_force(flight, of).ok_or(GainsError::NoGains(of))?;
    let wanted = [
        (
            Term::Proportional,
            in_force.proportional,
            gains.proportional,
        ),
        (Term::Integral, in_force.integral, gains.integral),
        (Term::Derivative, in_force.derivative, gains.derivative),
    ];
    let mut changes = Vec::new();
    for (term, from, to) in wanted {
        let mut own = stated.iter().filter(|gain| gain.term == term).peekable();
        if own.peek().is_none() && to != 0.0 || !to.is_finite() {
            return Err(GainsError::NoTerm(of, term));
        }
        // The limits of a derivative that moves keep their ratio to it.
        let limits = stated
            .iter()
            .filter(|gain| term == Term::Derivative && gain.term == Term::DerivativeLimit)
            .filter(|gain| gain.value > 0.0);
        for gain in own.chain(limits) {
            let Some(scale) = gain.si_per_unit else {
                continue;
            };
            let new = if from != 0.0 {
                gain.value * (to / from)
            } else {
                to / scale
            };
            let (name, range) = parameter(flight, of, gain);
            let new = stored(&flight.firmware, new);
            if !(range[0]..=range[1]).contains(&new) {
                let [low, high] = range;
                let value = new;
                return Err(GainsError::Range {
                    name,
                    value,
                    low,
                    high,
                });
            }
            if new != stored(&flight.firmware, gain.value) {
                changes.push(Change {
                    name,
                    term: gain.term,
                    old: gain.value,
                    new,
                    si_per_unit: scale,
                });
            }
        }
    }
    Ok(changes)
}

/// A value as the firmware stores it: an integer, or a number of single precision with four digits.
fn stored(firmware: &Firmware, value: f64) -> f64 {
    match firmware.kind {
        FirmwareKind::Betaflight | FirmwareKind::Inav => value.round(),
        _ if value == 0.0 => 0.0,
        _ => {
            let digits = (3.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as i32;
            let unit = 10_f64.powi(digits);
            (value * unit).round() / unit
        }
    }
}

/// Numbers of a version: `1.15.4`, `ArduCopter V4.5.7 (...)`, `Betaflight 4.2.8 (...) STM32F7X2`, `2025.12.1`.
pub(crate) fn version_numbers(version: &str) -> Option<[u32; 2]> {
    let word = version
        .split([' ', '_', 'V', 'v'])
        .find(|word| word.starts_with(|c: char| c.is_ascii_digit()) && word.contains('.'))?;
    let mut numbers = word.split(|c: char| !c.is_ascii_digit()).map(str::parse);
    Some([numbers.next()?.ok()?, numbers.next()?.ok()?])
}

fn check_version(firmware: &Firmware) -> Result<(), GainsError> {
    let least = match firmware.kind {
        FirmwareKind::Px4 => [1, 9],
        FirmwareKind::ArduPilot => [4, 0],
        FirmwareKind::Betaflight => [4, 0],
        FirmwareKind::Inav => return Err(GainsError::Firmware("INAV".to_owned())),
    };
    match version_numbers(&firmware.version) {
        Some(version) if version >= least => Ok(()),
        _ => Err(GainsError::Version(firmware.version.clone())),
    }
}

/// Name of the parameter in the firmware's file, and its range.
fn parameter(flight: &Flight, of: ControlLoop, gain: &Gain) -> (String, [f64; 2]) {
    let axis = of.axis().unwrap_or(Axis::Roll);
    let is_rate = matches!(of, ControlLoop::Rate(_));
    let is_yaw = axis == Axis::Yaw;
    let largest: f64 = match (flight.firmware.kind, gain.term) {
        (FirmwareKind::Betaflight | FirmwareKind::Inav, term) => {
            let letter = match (term, gain.name.split('[').next()) {
                (Term::Proportional, _) => "p",
                (Term::Integral, _) => "i",
                (Term::Derivative, _) => "d",
                (_, Some(name)) => name,
                _ => "d",
            };
            return (format!("{letter}_{}", axis.name()), [0.0, 250.0]);
        }
        (_, Term::Proportional) if !is_rate => 12.0,
        (FirmwareKind::Px4, Term::Proportional) if is_yaw => 0.6,
        (FirmwareKind::Px4, Term::Proportional) => 0.5,
        (FirmwareKind::Px4, Term::Derivative) if !is_yaw => 0.01,
        (FirmwareKind::Px4, _) => 10.0,
        (FirmwareKind::ArduPilot, Term::Proportional) if is_yaw => 2.5,
        (FirmwareKind::ArduPilot, Term::Proportional) => 0.5,
        (FirmwareKind::ArduPilot, Term::Integral) if is_yaw => 1.0,
        (FirmwareKind::ArduPilot, Term::Integral) => 2.0,
        (FirmwareKind::ArduPilot, Term::Derivative) if is_yaw => 0.02,
        (FirmwareKind::ArduPilot, _) => 0.05,
    };
    // A value that the user flies already is allowed.
    (gain.name.clone(), [0.0, largest.max(gain.value)])
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::log::FlightLog;

    pub(crate) fn flight(name: &str) -> Flight {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/logs/");
        let bytes = std::fs::read(format!("{folder}{name}")).unwrap();
        FlightLog::scan(&bytes[..]).unwrap().flights.remove(0)
    }

    const ROLL: ControlLoop = ControlLoop::Rate(Axis::Roll);

    pub(super) const LOGS: [&str; 3] =
        ["px4_chirps.ulg", "ap_sysid_roll.bin", "betaflight_acro.bfl"];

    // Gains to parameters and back: exact but for the digits that a firmware stores (4, or integers).
    #[test]
    fn gains_return() {
        for name in LOGS {
            let flight = flight(name);
            let old = LoopGains::in_force(&flight, ROLL).unwrap();
            let asked = LoopGains::new(
                0.8 * old.proportional,
                1.1 * old.integral,
                0.7 * old.derivative,
            );
            let changes = changes(&flight, ROLL, asked).unwrap();
            let new = old.changed(&changes);
            let digits = if name.contains("betaflight") {
                0.02
            } else {
                1e-3
            };
            let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < digits, "{name} {a} {b}");
            close(new.proportional, asked.proportional);
            close(new.integral, asked.integral);
            close(new.derivative, asked.derivative);
            assert_eq!(super::changes(&flight, ROLL, old).unwrap(), []);
        }
    }

    // Half-way up from 1 to 4 is 2, down from 4 to 1 it is 2.5; from zero it is the half. All the way is exact.
    #[test]
    fn steps_by_hand() {
        let [a, b] = [LoopGains::new(1.0, 4.0, 0.0), LoopGains::new(4.0, 1.0, 3.0)];
        assert_eq!(a.toward(b, 0.5), LoopGains::new(2.0, 2.5, 1.5));
        assert_eq!(a.toward(b, 1.0), b);
        assert_eq!(a.toward(a, 0.3), a);
    }

    // By hand. Betaflight 4.2: P 77, I 119, D 83 with d_min 55. P = 544.9 Kp: Kp 0.1 is 54.49; Ki 1.4 is 99.99; Kd 0.001 is
    // 32.99 as the lower end, and the upper one keeps the ratio 83/55: 49.79. PX4 divides by MC_ROLLRATE_K.
    #[test]
    fn parameters_by_hand() {
        let gains = LoopGains::new(0.1, 1.4, 0.001);
        let of = |flight: &Flight| -> Vec<(String, f64)> {
            let changes = changes(flight, ROLL, gains).unwrap();
            changes.into_iter().map(|of| (of.name, of.new)).collect()
        };
        let own = |pairs: &[(&str, f64)]| -> Vec<(String, f64)> {
            pairs
                .iter()
                .map(|(name, value)| ((*name).to_owned(), *value))
                .collect()
        };
        assert_eq!(
            of(&flight("betaflight_acro.bfl")),
            own(&[
                ("p_roll", 54.0),
                ("i_roll", 100.0),
                ("d_roll", 50.0),
                ("d_min_roll", 33.0)
            ])
        );
        let mut px4 = flight("px4_chirps.ulg");
        let expected = [
            ("MC_ROLLRATE_P", 0.05),
            ("MC_ROLLRATE_I", 0.7),
            ("MC_ROLLRATE_D", 0.0005),
        ];
        for gain in px4.loops.iter_mut().flat_map(|of| &mut of.gains) {
            // As if MC_ROLLRATE_K were 2.
            (gain.si, gain.si_per_unit) = (gain.si.map(|si| 2.0 * si), Some(2.0));
        }
        assert_eq!(of(&px4), own(&expected));
    }

    // Angle gains are in 1/s in both firmwares. Betaflight's loop is in other units: nothing is written.
    #[test]
    fn attitude_gains() {
        let of = ControlLoop::Attitude(Axis::Pitch);
        let gains = LoopGains::new(5.0, 0.0, 0.0);
        for (log, name) in [
            ("px4_chirps.ulg", "MC_PITCH_P"),
            ("ap_sysid_roll.bin", "ATC_ANG_PIT_P"),
        ] {
            let changes = changes(&flight(log), of, gains).unwrap();
            assert_eq!((changes.len(), changes[0].new), (1, 5.0), "{log}");
            assert_eq!(changes[0].name, name);
            let refused = super::changes(&flight(log), of, LoopGains::new(5.0, 1.0, 0.0));
            assert_eq!(refused, Err(GainsError::NoTerm(of, Term::Integral)));
        }
        let refused = changes(&flight("betaflight_acro.bfl"), of, gains);
        assert_eq!(refused, Err(GainsError::NoGains(of)));
    }

    #[test]
    fn what_cannot_be_written() {
        let mut flight = flight("px4_chirps.ulg");
        let gains = LoopGains::new(0.1, 0.1, 0.001);
        let range = changes(&flight, ROLL, LoopGains::new(5.0, 0.1, 0.0)).unwrap_err();
        assert_eq!(
            range.to_string(),
            "MC_ROLLRATE_P 5 is outside of the range 0 to 0.5 of the firmware"
        );
        let negative = changes(&flight, ROLL, LoopGains::new(-0.1, 0.1, 0.0)).unwrap_err();
        assert!(matches!(negative, GainsError::Range { .. }));
        let nan = changes(&flight, ROLL, LoopGains::new(f64::NAN, 0.1, 0.0)).unwrap_err();
        assert_eq!(nan, GainsError::NoTerm(ROLL, Term::Proportional));
        assert_eq!(
            changes(&flight, ControlLoop::Altitude, gains).unwrap_err(),
            GainsError::NoGains(ControlLoop::Altitude)
        );
        flight.firmware.version = "fd483321".to_owned();
        assert!(matches!(
            changes(&flight, ROLL, gains),
            Err(GainsError::Version(_))
        ));
        flight.firmware.kind = FirmwareKind::Inav;
        assert!(matches!(
            changes(&flight, ROLL, gains),
            Err(GainsError::Firmware(_))
        ));
        assert_eq!(crate::parameter_files::files(&flight, &[]), None);
    }

    #[test]
    fn versions() {
        let cases = [
            ("1.15.4", Some([1, 15])),
            ("ArduCopter V4.7.0-dev (807fd61e)", Some([4, 7])),
            ("Betaflight 4.2.8 (101738d8e) STM32F7X2", Some([4, 2])),
            ("Betaflight 2025.12.1 (abc) AT32", Some([2025, 12])),
            ("fd483321", None),
            ("", None),
        ];
        for (text, numbers) in cases {
            assert_eq!(version_numbers(text), numbers, "{text}");
        }
    }
}
