//! Sentences: what the facts mean, and what to do about them.
//!
//! A sentence names a setting of a [`Request`](crate::Request) in backticks, with its value where it has one: `` `style=calm` ``.
//! A program shows them as its own options by [`named`].

pub mod answer;
mod caution;
pub mod controllers;
pub mod flight;
pub mod limits;
pub mod log;
pub mod log_gains;
pub mod number;
pub mod oscillation;
pub mod recording;
pub mod remark;
pub mod units;
pub mod verdict;

use std::borrow::Cow;

/// Names of the settings in sentences: those of a request, and what a program makes of a report.
const SETTINGS: [&str; 47] = [
    "against",
    "amplitude",
    "axis",
    "below_limits",
    "beta",
    "controller",
    "cycles",
    "dbc",
    "dead_time_share",
    "design",
    "details",
    "flight",
    "from",
    "gain_margin",
    "hold",
    "hysteresis",
    "input",
    "input_amplitude",
    "input_before",
    "input_late",
    "input_peak",
    "input_range",
    "loop",
    "method",
    "ms",
    "noise",
    "output",
    "output_filter",
    "output_range",
    "overshoot",
    "pack",
    "phase_margin",
    "relay",
    "rule",
    "sample_period",
    "sample_rate",
    "set_point",
    "step",
    "structure",
    "style",
    "tag",
    "time",
    "time_unit",
    "to",
    "unstable",
    "vendor",
    "write",
];

/// What a sentence names in backticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Named<'a> {
    /// A setting, with a value or without.
    Setting(&'a str, Option<&'a str>),
    /// The identification of this file.
    Identify(&'a str),
    /// What this flight log holds.
    Log(&'a str),
}

impl<'a> Named<'a> {
    /// `None`: backticks of another meaning.
    fn read(text: &'a str) -> Option<Self> {
        if let Some(file) = text.strip_prefix("identify ") {
            return Some(Self::Identify(file));
        }
        if let Some(file) = text.strip_prefix("log ") {
            return Some(Self::Log(file));
        }
        let (name, value) = match text.split_once('=') {
            Some((name, value)) => (name, Some(value)),
            None => (text, None),
        };
        (SETTINGS.binary_search(&name).is_ok()).then_some(Self::Setting(name, value))
    }
}

/// A text with what its sentences name in backticks replaced by what `shown` makes of it.
pub fn named<'a>(text: &'a str, shown: impl Fn(Named<'_>) -> String) -> Cow<'a, str> {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('`') {
        out.push_str(before);
        let inside = after.split_once('`');
        match inside.and_then(|(inside, behind)| Some((Named::read(inside)?, behind))) {
            Some((found, behind)) => {
                out.push_str(&shown(found));
                rest = behind;
            }
            None => {
                out.push('`');
                rest = after;
            }
        }
    }
    match out.is_empty() {
        true => Cow::Borrowed(text),
        false => Cow::Owned(out + rest),
    }
}

/// With a capital letter at the start and a full stop at the end.
pub fn sentence(clause: &str) -> String {
    capital(clause.trim_end_matches('.')) + "."
}

/// With a capital letter at the start, unless that is the name of a file, as in `log.csv: ...`.
fn capital(clause: &str) -> String {
    let first = clause.split_whitespace().next().unwrap_or_default();
    if first.ends_with(':') && first.contains('.') {
        return clause.to_owned();
    }
    let mut letters = clause.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

/// `a`, `a and b`, `a, b and c`.
pub fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_listed_with_and() {
        assert_eq!(listed(&["a"]), "a");
        assert_eq!(listed(&["a", "b", "c"]), "a, b and c");
    }

    // Settings are replaced wherever they stand; other backticks stay.
    #[test]
    fn settings_are_shown_as_a_program_calls_them() {
        let shown = |text| {
            named(text, |of| match of {
                Named::Setting(name, Some(value)) => format!("<{name}: {value}>"),
                Named::Setting(name, None) => format!("<{name}>"),
                Named::Identify(file) => format!("<identify of {file}>"),
                Named::Log(file) => format!("<log of {file}>"),
            })
        };
        assert!(SETTINGS.is_sorted());
        assert_eq!(
            shown("`input_late=0` or `beta`."),
            "<input_late: 0> or <beta>."
        );
        assert_eq!(
            shown("`identify a b.csv` `write=t`"),
            "<identify of a b.csv> <write: t>"
        );
        assert_eq!(shown("a `column` and `beta`"), "a `column` and <beta>");
        assert_eq!(shown("a lone ` here"), "a lone ` here");
        assert_eq!(shown("`x` `"), "`x` `");
        assert_eq!(shown("nothing"), "nothing");
    }
}
