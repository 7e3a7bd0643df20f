//! Column names: their units and the signals they stand for.

use super::tags::{self, Signal, Tag};
use super::words;
use crate::recording::{Column, Role};
use crate::time_unit::TimeUnit;

/// Usual names of the time, in lower case, words joined by `_`, without unit.
const TIME: [&str; 33] = [
    "t",
    "time",
    "timestamp",
    "time_stamp",
    "datetime",
    "date_time",
    "date_and_time",
    "stamp",
    "ts",
    "tick",
    "ticks",
    "elapsed",
    "elapsed_time",
    "time_elapsed",
    "time_since_boot",
    "second",
    "seconds",
    "sec",
    "ms",
    "us",
    "x_axis",
    "x_value",
    "millis",
    "micros",
    "zeit",
    "zeitstempel",
    "datum",
    "uhrzeit",
    "temps",
    "horodatage",
    "tiempo",
    "fecha",
    "tempo",
];

/// Usual names of the input of the process.
const INPUT: [&str; 37] = [
    "u",
    "input",
    "relay",
    "relay_output",
    "relay_out",
    "control",
    "ctrl",
    "cmd",
    "command",
    "commanded",
    "actuator",
    "actuation",
    "actuator_command",
    "mv",
    "co",
    "op",
    "cv",
    "in",
    "u_cmd",
    "control_output",
    "controller_output",
    "control_signal",
    "control_input",
    "control_action",
    "controloutput",
    "manipulated_variable",
    "process_input",
    "plant_input",
    "plant_in",
    "torque",
    "thrust",
    "torque_cmd",
    "thrust_cmd",
    "pwm",
    "voltage_cmd",
    "drive",
    "excitation",
];

/// Usual names of the output of the process.
const OUTPUT: [&str; 25] = [
    "y",
    "pv",
    "output",
    "out",
    "measurement",
    "measured",
    "meas",
    "measured_output",
    "y_meas",
    "value",
    "process_variable",
    "process_value",
    "processvariable",
    "process_output",
    "plant_output",
    "plant_out",
    "response",
    "feedback",
    "sensor",
    "sensor_value",
    "reading",
    "state",
    "position",
    "controlled_variable",
    "pv_value",
];

/// Units other than those of time: at the end of a name after `_`, or in a row of units.
const UNITS: [&str; 91] = [
    "rad",
    "deg",
    "rad/s",
    "deg/s",
    "rad_s",
    "deg_s",
    "rads",
    "degs",
    "rpm",
    "m",
    "mm",
    "cm",
    "km",
    "m/s",
    "m_s",
    "m/s2",
    "m/s^2",
    "n",
    "nm",
    "n.m",
    "n*m",
    "kn",
    "v",
    "mv",
    "a",
    "ma",
    "w",
    "kw",
    "k",
    "c",
    "degc",
    "\u{b0}c",
    "\u{b0}",
    "f",
    "degf",
    "pa",
    "kpa",
    "mpa",
    "bar",
    "mbar",
    "psi",
    "kg",
    "g",
    "l",
    "l/min",
    "l/s",
    "l/h",
    "m3/h",
    "m\u{b3}/h",
    "m3/s",
    "kg/h",
    "kg/s",
    "t/h",
    "nm3/h",
    "gpm",
    "scfm",
    "mmh2o",
    "inh2o",
    "barg",
    "bara",
    "psig",
    "deg c",
    "deg f",
    "\u{b0}f",
    "\u{fffd}c",
    "ph",
    "hz",
    "khz",
    "%",
    "pct",
    "percent",
    "-",
    "1",
    "norm",
    "counts",
    "raw",
    "none",
    "volt",
    "volts",
    "mvolt",
    "amp",
    "amps",
    "ampere",
    "amperes",
    "watt",
    "watts",
    "celsius",
    "kelvin",
    "hpa",
    "degree",
    "degrees",
];

/// Words before a letter that is a label, not a unit.
const LABELLED: [&str; 6] = ["channel", "ch", "kanal", "canal", "voie", "probe"];

/// A name in a header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Name {
    /// As in the file.
    pub(super) full: String,
    /// Without the unit.
    pub(super) bare: String,
    /// The unit as in the file.
    pub(super) unit: Option<String>,
}

impl Name {
    /// Splits `pv [rad]`, `time (ms)`, `t / s`, `u_N` or `TimeUS` into name and unit.
    pub(super) fn parse(cell: &str) -> Self {
        let trimmed = cell.trim();
        let quotes = |mark| trimmed.strip_prefix(mark)?.strip_suffix(mark);
        let full = quotes('"').or_else(|| quotes('\'')).unwrap_or(trimmed);
        let full = full.trim().to_owned();
        // In `LIC101.MV` the last word is no unit.
        let is_tag = tags::parse(&full).is_some();
        let marked = || after_mark(&full).filter(|_| !is_tag);
        let (bare, unit) = match in_brackets(&full).or_else(marked) {
            Some((bare, unit)) => (
                bare.to_owned(),
                Some(unit.to_owned()).filter(|u| !u.is_empty()),
            ),
            None => (full.clone(), None),
        };
        Self { full, bare, unit }
    }

    /// The name with the unit from a row of units.
    pub(super) fn with_unit(mut self, unit: &str) -> Self {
        let unit = unit
            .trim()
            .trim_matches(['"', '\'', '(', ')', '[', ']', '<', '>'])
            .trim();
        if self.unit.is_none() && !unit.is_empty() {
            self.unit = Some(unit.to_owned());
        }
        self
    }

    /// The signal that the name stands for, if it is a usual name.
    pub(super) fn role(&self) -> Option<Role> {
        let keys = [key(&self.full), key(&self.bare)];
        let is_one_of = |names: &[&str]| keys.iter().any(|key| names.contains(&key.as_str()));
        if is_one_of(&TIME) {
            Some(Role::Time)
        } else if is_one_of(&INPUT) {
            Some(Role::Input)
        } else if is_one_of(&OUTPUT) {
            Some(Role::Output)
        } else {
            None
        }
    }

    /// The loop and the signal of a tag such as `LIC101.PV`, unless the name is a usual one of a signal.
    pub(super) fn tag(&self) -> Option<Tag> {
        match self.role() {
            Some(_) => None,
            None => tags::parse(&self.bare),
        }
    }

    /// The signal that the name stands for: as a usual name, or as the end of a tag.
    pub(super) fn signal(&self) -> Option<Signal> {
        match self.role() {
            Some(Role::Input) => Some(Signal::Input),
            Some(Role::Output) => Some(Signal::Output),
            Some(_) => None,
            None if tags::is_set_point(&key(&self.bare)) => Some(Signal::SetPoint),
            None => self.tag().map(|tag| tag.signal),
        }
    }

    /// The signal that the words of the name tell, where it is no usual name: the last word that tells one, so
    /// that `heater_temperature` is a temperature; a set-point in any place.
    pub(super) fn told(&self) -> Option<Signal> {
        words::told(&self.bare)
    }

    /// Whether `motor.output` was taken for the input and `motor.input` for the output, though no word says that they are those of a
    /// controller.
    pub(super) fn may_be_crossed(&self, output: &Self) -> bool {
        self.is_pair(output) && !words::is_of_controller(&self.bare)
    }

    /// Whether this is the output of a block and the other name its input: `PID_1.Output` and `PID_1.Input`.
    pub(super) fn is_pair(&self, input: &Self) -> bool {
        let [own, other] = [self, input].map(|name| key(&name.bare));
        let stem = own.strip_suffix("_output");
        stem.is_some() && stem == other.strip_suffix("_input")
    }

    /// The unit of time that the name gives, also in names such as `seconds` or `millis`.
    pub(super) fn time_unit(&self) -> Option<TimeUnit> {
        match &self.unit {
            Some(unit) => TimeUnit::from_name(unit),
            None if self.bare.len() > 1 => TimeUnit::from_name(&self.bare),
            None => None,
        }
    }

    pub(super) fn column(&self) -> Column {
        Column {
            name: self.bare.clone(),
            unit: self.unit.clone(),
        }
    }
}

/// Whether a cell of a second header row is a unit.
pub(super) fn is_unit(cell: &str) -> bool {
    let cell = cell.trim().trim_matches(['"', '\'']).trim();
    let inner = cell.trim_matches(['(', ')', '[', ']', '<', '>']).trim();
    inner.len() < cell.len() || is_known_unit(inner)
}

/// Lower case, words joined by `_`.
pub(super) fn key(name: &str) -> String {
    let name = name.to_lowercase();
    let words = name
        .split(|c: char| !c.is_alphanumeric())
        .filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("_")
}

pub(super) fn is_known_unit(unit: &str) -> bool {
    // In names such as `y_d` the letter stands for "desired" or "derivative".
    if unit.eq_ignore_ascii_case("d") {
        return false;
    }
    TimeUnit::from_name(unit).is_some() || UNITS.contains(&unit.to_lowercase().as_str())
}

/// `pv [rad]`, `time (ms)`.
fn in_brackets(name: &str) -> Option<(&str, &str)> {
    [('(', ')'), ('[', ']'), ('<', '>'), ('{', '}')]
        .into_iter()
        .find_map(|(open, close)| {
            let (bare, unit) = name.strip_suffix(close)?.rsplit_once(open)?;
            Some((bare.trim(), unit.trim())).filter(|(bare, _)| !bare.is_empty())
        })
}

/// `t / s`, `pv, rad`, `u_N`, `TimeUS`: only before a known unit.
fn after_mark(name: &str) -> Option<(&str, &str)> {
    let split =
        |(bare, unit): (&'_ str, &'_ str)| !bare.trim().is_empty() && is_known_unit(unit.trim());
    let marks = name
        .char_indices()
        .filter(|(_, c)| matches!(c, '/' | ',' | '_' | ' ' | '.'));
    for (at, mark) in marks {
        let parts = (&name[..at], &name[at + mark.len_utf8()..]);
        // `Channel A` is no current.
        let is_label = LABELLED.contains(&key(parts.0).as_str());
        if split(parts) && !is_label {
            return Some((parts.0.trim(), parts.1.trim()));
        }
    }
    ["us", "ms", "ns"].into_iter().find_map(|unit| {
        let at = name
            .len()
            .checked_sub(unit.len())
            .filter(|&at| name.is_char_boundary(at))?;
        let (bare, end) = name.split_at(at);
        let is_time = ["time", "timestamp"].contains(&bare.to_lowercase().as_str());
        (is_time && end.eq_ignore_ascii_case(unit)).then_some((bare, end))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_units_are_split() {
        for (text, bare, unit) in [
            ("time (ms)", "time", Some("ms")),
            ("t[s]", "t", Some("s")),
            ("u_N", "u", Some("N")),
            ("time_us", "time", Some("us")),
            ("pv [rad]", "pv", Some("rad")),
            ("\"pv [rad]\"", "pv", Some("rad")),
            ("rate_rad_s", "rate", Some("rad_s")),
            ("t / s", "t", Some("s")),
            ("rate / rad/s", "rate", Some("rad/s")),
            ("TimeUS", "Time", Some("US")),
            ("pv", "pv", None),
            ("y_meas", "y_meas", None),
            ("pv []", "pv", None),
            ("", "", None),
            ("(s)", "(s)", None),
            ("t [d]", "t", Some("d")),
            ("time_days", "time", Some("days")),
            ("y_d", "y_d", None),
        ] {
            let name = Name::parse(text);
            assert_eq!(
                (name.bare.as_str(), name.unit.as_deref()),
                (bare, unit),
                "{text}"
            );
        }
    }

    #[test]
    fn roles_by_name() {
        for (text, role) in [
            ("Time", Some(Role::Time)),
            ("TIMESTAMP_US", Some(Role::Time)),
            ("TimeUS", Some(Role::Time)),
            ("U", Some(Role::Input)),
            ("Controller Output [%]", Some(Role::Input)),
            ("mv", Some(Role::Input)),
            ("Process Variable (degC)", Some(Role::Output)),
            ("y_m", Some(Role::Output)),
            ("y_meas", Some(Role::Output)),
            ("setpoint", None),
        ] {
            assert_eq!(Name::parse(text).role(), role, "{text}");
        }
    }

    #[test]
    fn units_of_time() {
        assert_eq!(
            Name::parse("time (\u{b5}s)").time_unit(),
            Some(TimeUnit::Microseconds)
        );
        assert_eq!(
            Name::parse("millis").time_unit(),
            Some(TimeUnit::Milliseconds)
        );
        assert_eq!(Name::parse("t").time_unit(), None);
        assert_eq!(TimeUnit::Microseconds.seconds(1.0), 1e-6);
        assert_eq!(TimeUnit::Minutes.seconds(1.5), 90.0);
    }
}
