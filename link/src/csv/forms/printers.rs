//! Temperatures of printers.
//!
//! ```text
//! pwm: 1000.200 1.000
//! Stats 1001.5: gcodein=0 mcu: ... heater_bed: target=0 temp=22.1 pwm=0.000 ... extruder: target=100 temp=79.9 pwm=0.300
//! 2024-03-12 08:00:00,123 - Recv: ok T:148.1 /200.0 B:60.0 /60.0 @:127 B@:30
//! ```
//! Klipper writes one line `Stats` a second with the reactor's clock (s) and the power from 0 to 1 (`klippy/extras/heaters.py`,
//! `get_status` and `stats`). Marlin's power is half of its PWM, 0 to 127 (`Temperature::print_heater_states`); RepRapFirmware
//! writes no power.

use super::fields::{Fields, field, stamp};

/// Fields of a heater in a line of Klipper.
const OF_HEATER: [&str; 3] = ["temp", "target", "pwm"];

/// A line of the file that `PID_CALIBRATE ... WRITE_FILE=1` writes: first all changes of the power, `pwm: time value`, then all
/// temperatures, `time temperature` (`klippy/extras/pid_calibrate.py`, `write_file`).
pub(super) fn relay_test(line: &str, has_power: &mut bool) -> Fields {
    let power = line.strip_prefix("pwm:");
    *has_power |= power.is_some();
    let name = if power.is_some() {
        "heater.pwm"
    } else {
        "heater.temp"
    };
    let words: Vec<&str> = power.unwrap_or(line).split_whitespace().collect();
    match words.as_slice() {
        [time, value] if *has_power => {
            let fields = field("time [s]", time).zip(field(name, value));
            fields.map_or_else(Vec::new, |(time, value)| vec![time, value])
        }
        _ => vec![],
    }
}

/// A line of Klipper's statistics.
pub(super) fn stats(line: &str) -> Fields {
    let Some((time, values)) = line
        .strip_prefix("Stats ")
        .and_then(|rest| rest.split_once(": "))
    else {
        return vec![];
    };
    let mut section = "";
    let mut fields: Fields = field("time [s]", time).into_iter().collect();
    for word in values.split_whitespace() {
        match (word.strip_suffix(':'), word.split_once('=')) {
            (Some(name), _) => section = name,
            (None, Some((key, value))) if OF_HEATER.contains(&key) && !section.is_empty() => {
                fields.extend(field(format!("{section}.{key}"), value));
            }
            _ => {}
        }
    }
    if fields.len() < 2 { vec![] } else { fields }
}

/// A report of temperatures of Marlin or RepRapFirmware, with the stamp of the host in front.
pub(super) fn temperatures(line: &str) -> Fields {
    let (time, rest) = stamp(line);
    let mut fields: Fields = Vec::new();
    let mut heater: Option<&str> = None;
    let mut has_target = false;
    for word in rest.split_whitespace() {
        let target = word.strip_prefix('/').zip(heater);
        if let Some((value, heater)) = target {
            fields.extend(field(format!("{heater}.target"), value));
            has_target = true;
        }
        heater = None;
        let Some((name, value)) = word.split_once(':') else {
            continue;
        };
        let (value, target) = value.split_once('/').unwrap_or((value, ""));
        match name.split_once('@') {
            Some(("", "")) => fields.extend(field("T.power", value)),
            Some(("", tool)) if is_number(tool) => {
                fields.extend(field(format!("T{tool}.power"), value));
            }
            Some((name, "")) if is_heater(name) => {
                fields.extend(field(format!("{name}.power"), value));
            }
            None if is_heater(name) => {
                fields.extend(field(format!("{name}.temp"), value));
                fields.extend(field(format!("{name}.target"), target));
                heater = Some(name);
            }
            _ => {}
        }
    }
    let has_tools = fields.iter().any(|(name, _)| name == "T0.power");
    if has_tools {
        // `T` and `@` repeat the tool in use.
        fields.retain(|(name, _)| !name.starts_with("T."));
    }
    let is_report = has_target && fields.iter().any(|(name, _)| name.ends_with(".temp"));
    match is_report {
        true => time.into_iter().chain(fields).collect(),
        false => vec![],
    }
}

/// `T`, `T0`, `B` (bed), `C` (chamber), `P` (probe), `L` (cooler).
fn is_heater(name: &str) -> bool {
    let mut letters = name.chars();
    letters
        .next()
        .is_some_and(|letter| "TBCPL".contains(letter))
        && is_number_or_empty(letters.as_str())
}

fn is_number_or_empty(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}

fn is_number(text: &str) -> bool {
    !text.is_empty() && is_number_or_empty(text)
}

#[cfg(test)]
mod tests {
    use super::super::fields::joined;
    use super::*;

    #[test]
    fn lines_of_klipper() {
        let line = "Stats 7.5: gcodein=0  mcu: freq=72000312 heater_bed: target=0 temp=22.1 pwm=0.000 sysload=0.3 \
                    extruder: target=100 temp=79.9 pwm=0.300";
        let expected = "time [s]=7.5 heater_bed.target=0 heater_bed.temp=22.1 heater_bed.pwm=0.000 extruder.target=100 \
                        extruder.temp=79.9 extruder.pwm=0.300";
        assert_eq!(joined(stats(line)), expected);
        for line in ["Stats 7.5: gcodein=0", "Stats", "extruder: temp=1"] {
            assert_eq!(stats(line), []);
        }
    }

    #[test]
    fn reports_of_marlin() {
        for (line, expected) in [
            (
                "ok T:148.1 /200.0 @:127",
                "T.temp=148.1 T.target=200.0 T.power=127",
            ),
            (
                "2024-03-12 08:00:00,123 - Recv:  T:21.8 /0.00 (244.63) B:47.7 /60.0 (36.7) @:101 B@:3",
                "time=2024-03-12 08:00:00,123 T.temp=21.8 T.target=0.00 B.temp=47.7 B.target=60.0 T.power=101 B.power=3",
            ),
            (
                "T:20.1 /0.0 T0:20.1 /0.0 T1:28.8 /0.0 @:0 @0:5 @1:6",
                "T0.temp=20.1 T0.target=0.0 T1.temp=28.8 T1.target=0.0 T0.power=5 T1.power=6",
            ),
            ("T:20.1/0.0 B:21.0/0.0", ""),
            ("bias: 94 d: 94 min: 197.58 max: 202.73", ""),
            ("X:0.00 Y:0.00 Z:0.00 E:0.00", ""),
        ] {
            assert_eq!(joined(temperatures(line)), expected, "{line}");
        }
    }
}
