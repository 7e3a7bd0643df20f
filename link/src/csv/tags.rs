//! Tags of process control: the loop and the signal that a name such as `LIC101.PV` stands for.
//!
//! ```text
//! LIC101.PV   FIC-12/OP   TIC_101_OUT     loop, then the signal
//! LIC101.PIDA.OP   LIC101.DACA.PV         with the block between them (Honeywell)
//! LIC101/PID1/OUT.CV                      with the field of the value behind it (DeltaV)
//! ```

/// Signal of a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Signal {
    /// Output of the controller: input of the process.
    Input,
    /// Measurement: output of the process.
    Output,
    /// Set-point of the measurement.
    SetPoint,
}

/// A name split into its loop and its signal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Tag {
    /// As in the file.
    pub(super) control_loop: String,
    pub(super) signal: Signal,
}

const INPUT: [&str; 9] = [
    "op", "out", "mv", "co", "cv", "output", "pwm", "power", "duty",
];
const OUTPUT: [&str; 6] = ["pv", "me", "meas", "measurement", "temp", "temperature"];
const SET_POINT: [&str; 6] = ["sp", "sv", "spt", "setpoint", "wsp", "target"];
/// Names of a set-point without a loop.
const ALONE: [&str; 8] = [
    "sp",
    "sv",
    "setpoint",
    "set_point",
    "reference",
    "setpt",
    "target",
    "desired",
];
/// Fields behind the signal that hold its value.
const FIELDS: [&str; 4] = ["cv", "f_cv", "value", "val"];
/// Blocks between the loop and the signal.
const BLOCKS: [&str; 7] = ["pid", "pida", "pid1", "daca", "dataacqa", "loop", "ctl"];
/// Names of a column with the status of the samples beside it.
const STATUS: [&str; 9] = [
    "status",
    "quality",
    "st",
    "sts",
    "qual",
    "opcquality",
    "good",
    "valid",
    "validity",
];

/// Marks that end a loop of any name; after the other marks, it must hold a digit: `TIC_101_OUT`, not `pump_out`.
const STRONG: [char; 5] = ['.', '/', '\\', ':', '|'];
const WEAK: [char; 3] = ['_', '-', ' '];

/// The loop and the signal of a name; `None` if it does not end in a usual signal.
pub(super) fn parse(name: &str) -> Option<Tag> {
    let (stem, last) = split(name)?;
    if is_one(last, &FIELDS)
        && let Some(tag) = signal_of(stem)
    {
        return Some(tag);
    }
    signal_of(name)
}

/// Whether the name is that of a set-point without a loop.
pub(super) fn is_set_point(key: &str) -> bool {
    ALONE.contains(&key)
}

/// Whether the name is that of a column with the status of samples, and which column these are in: `None` for any.
pub(super) fn status_of(name: &str) -> Option<Option<&str>> {
    if is_one(name.trim(), &STATUS) {
        return Some(None);
    }
    let (stem, last) = split(name)?;
    is_one(last, &STATUS).then_some(Some(stem))
}

/// Splits off the last word of a name.
fn split(name: &str) -> Option<(&str, &str)> {
    let at = name.rfind(|c| STRONG.contains(&c) || WEAK.contains(&c))?;
    let (stem, last) = (name[..at].trim(), name.get(at + 1..)?.trim());
    (!stem.is_empty() && !last.is_empty()).then_some((stem, last))
}

fn signal_of(name: &str) -> Option<Tag> {
    let (stem, last) = split(name)?;
    let signal = if is_one(last, &INPUT) {
        Signal::Input
    } else if is_one(last, &OUTPUT) {
        Signal::Output
    } else if is_one(last, &SET_POINT) {
        Signal::SetPoint
    } else {
        return None;
    };
    let is_strong = name[stem.len()..].trim_start().starts_with(STRONG);
    if !is_strong && !stem.bytes().any(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let control_loop = match split(stem) {
        Some((before, block)) if is_one(block, &BLOCKS) => before,
        _ => stem,
    };
    Some(Tag {
        control_loop: control_loop.to_owned(),
        signal,
    })
}

fn is_one(word: &str, words: &[&str]) -> bool {
    words.iter().any(|known| word.eq_ignore_ascii_case(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_loops_and_signals() {
        use Signal::{Input, Output, SetPoint};
        for (name, control_loop, signal) in [
            ("LIC101.PV", "LIC101", Output),
            ("LIC101.OP", "LIC101", Input),
            ("LIC101.MV", "LIC101", Input),
            ("FIC-12/PV", "FIC-12", Output),
            ("FIC-12/CV", "FIC-12", Input),
            ("TIC_101_OUT", "TIC_101", Input),
            ("TIC 101 SP", "TIC 101", SetPoint),
            ("Reactor level.sp", "Reactor level", SetPoint),
            ("LIC101.DACA.PV", "LIC101", Output),
            ("LIC101.PIDA.OP", "LIC101", Input),
            ("LIC101/PID1/OUT.CV", "LIC101", Input),
            ("LIC101/PID1/PV.CV", "LIC101", Output),
            ("\\\\SRV\\FIC12.ME", "\\\\SRV\\FIC12", Output),
        ] {
            let tag = parse(name).unwrap_or_else(|| panic!("{name}"));
            assert_eq!(
                (tag.control_loop.as_str(), tag.signal),
                (control_loop, signal),
                "{name}"
            );
        }
        for name in [
            "",
            "PV",
            ".PV",
            "pump_out",
            "plant out",
            "speed",
            "a.b",
            "PV.",
            "y_meas",
        ] {
            assert_eq!(parse(name), None, "{name}");
        }
    }

    #[test]
    fn status_columns() {
        assert_eq!(status_of("Quality"), Some(None));
        assert_eq!(status_of("LIC101.PV Status"), Some(Some("LIC101.PV")));
        assert_eq!(status_of("LIC101.PV"), None);
    }
}
