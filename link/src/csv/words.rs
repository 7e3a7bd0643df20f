//! Words of names: the signals that they tell where no usual name does.

use super::tags::Signal;

/// Words of names that tell the input of a process: what acts. They count only where no usual name tells.
const ACTS: [&str; 34] = [
    "heater",
    "heating",
    "power",
    "duty",
    "pwm",
    "valve",
    "pump",
    "throttle",
    "volt",
    "volts",
    "voltage",
    "actuator",
    "relay",
    "switch",
    "cmd",
    "command",
    "burner",
    "effort",
    "op",
    "mv",
    "co",
    "dac",
    "ventil",
    "stellwert",
    "stellgr\u{f6}\u{df}e",
    "heizung",
    "heizleistung",
    "leistung",
    "vanne",
    "commande",
    "puissance",
    "v\u{e1}lvula",
    "valvola",
    "potencia",
];
/// Words of names that tell the output of a process: what is measured.
const MEASURED: [&str; 35] = [
    "temperature",
    "temp",
    "level",
    "pressure",
    "flow",
    "speed",
    "velocity",
    "position",
    "angle",
    "humidity",
    "thermocouple",
    "probe",
    "rpm",
    "height",
    "ph",
    "encoder",
    "pv",
    "adc",
    "measured",
    "actual",
    "feedback",
    "temperatur",
    "druck",
    "drehzahl",
    "istwert",
    "f\u{fc}llstand",
    "durchfluss",
    "temp\u{e9}rature",
    "pression",
    "niveau",
    "d\u{e9}bit",
    "temperatura",
    "presi\u{f3}n",
    "nivel",
    "caudal",
];
/// Words of names that tell a set-point.
const WANTED: [&str; 10] = [
    "setpoint",
    "target",
    "desired",
    "reference",
    "sp",
    "sollwert",
    "soll",
    "wanted",
    "consigne",
    "consigna",
];
/// Words of names that say that an `output` or `out` is that of a controller.
const CONTROLS: [&str; 6] = ["pid", "controller", "control", "ctrl", "regler", "loop"];

/// The signal that the words of a name tell: the last word that tells one, so that `heater_temperature` is a temperature; a
/// set-point in any place.
pub(super) fn told(name: &str) -> Option<Signal> {
    let words = words(name);
    let has = |known: &[&str]| words.iter().any(|word| known.contains(&word.as_str()));
    if has(&WANTED) || words.join("_").contains("set_point") {
        return Some(Signal::SetPoint);
    }
    if has(&["output", "out"]) && has(&CONTROLS) {
        return Some(Signal::Input);
    }
    let is_valve = has(&["valve", "damper", "ventil"]);
    words.iter().rev().find_map(|word| match word.as_str() {
        "position" if is_valve => Some(Signal::Input),
        word if ACTS.contains(&word) => Some(Signal::Input),
        word if MEASURED.contains(&word) => Some(Signal::Output),
        _ => None,
    })
}

/// Whether a word of a name is that of a controller.
pub(super) fn is_of_controller(name: &str) -> bool {
    words(name)
        .iter()
        .any(|word| CONTROLS.contains(&word.as_str()))
}

/// The words of a name in lower case, without digits at their ends: `fTemp` is `f` and `temp`.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut was_lower = false;
    for c in name.chars() {
        let is_new = !c.is_alphanumeric() || (was_lower && c.is_uppercase());
        if is_new {
            words.push(String::new());
        }
        was_lower = c.is_lowercase() || c.is_ascii_digit();
        if let Some(word) = words.last_mut().filter(|_| c.is_alphanumeric()) {
            word.extend(c.to_lowercase());
        }
    }
    let bare = words
        .iter()
        .map(|word| word.trim_end_matches(|c: char| c.is_ascii_digit()));
    bare.filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}
