//! Lines of names and values: the serial plotter of Arduino, sTune, QuickPID; states in the log of ESPHome.

use super::fields::{Fields, field, stamp};
use crate::csv::number;

/// Longest name, in characters.
const LONGEST_NAME: usize = 40;

/// Fields of a line such as `Setpoint:100.00,Input:80.10` or ` sec: 1.5  out: 30.00  pv: 80.1`, with a stamp in front. Lines with
/// anything but names and numbers hold no values, except for words at the end, after which sTune counts down.
pub(super) fn labels(line: &str) -> Fields {
    let (time, rest) = stamp(line);
    let mut rest = rest.trim_start_matches(|c: char| !c.is_alphanumeric());
    let mut fields: Fields = Vec::new();
    while let Some((name, after)) = rest.split_once([':', '=']) {
        let name = name.trim();
        let after = after.trim_start();
        let end = after.find([',', ';', '\t', ' ']).unwrap_or(after.len());
        let value = number_of(&after[..end]);
        let begins = name.starts_with(|c: char| c.is_alphabetic() || c == '_');
        let (true, Some(value), true) = (begins, value, name.chars().count() <= LONGEST_NAME)
        else {
            return vec![];
        };
        fields.extend(field(name, value));
        rest = after[end..].trim_start_matches([',', ';', '\t', ' ']);
    }
    if fields.len() < 2 {
        return vec![];
    }
    if rest.starts_with("settling") {
        // The time until the test begins, at which it starts from zero.
        if let Some((_, value)) = fields.iter_mut().find(|(name, _)| name == "sec") {
            value.insert(0, '-');
        }
    }
    time.into_iter().chain(fields).collect()
}

/// The number of a word, without a unit behind it.
fn number_of(word: &str) -> Option<&str> {
    match number::parse(word.as_bytes()) {
        number::Cell::Number(..) => Some(word),
        _ => std::str::from_utf8(number::with_unit(word.as_bytes())?.0).ok(),
    }
}

/// The state in a line such as `[08:00:01][D][sensor:094]: 'Boiler': Sending state 79.9 °C with 1 decimals of accuracy`, or
/// `'Boiler' >> 79.9 °C`; temperatures of a climate.
pub(super) fn states(line: &str) -> Fields {
    let plain = without_colours(line);
    let (time, rest) = stamp(&plain);
    let Some(time) = time else { return vec![] };
    let climate = |key: &str| rest.split_once(key).map(|(_, value)| value);
    let found = if let Some((name, value)) = rest.split_once("': Sending state ") {
        quoted(name).map(|name| (name.to_owned(), value))
    } else if let Some((name, value)) = rest.split_once("' >> ") {
        quoted(name).map(|name| (name.to_owned(), value))
    } else if rest.contains("[climate:") {
        (climate("Current Temperature: ").map(|value| ("climate temperature".to_owned(), value)))
            .or_else(|| {
                climate("Target Temperature: ").map(|value| ("climate target".to_owned(), value))
            })
    } else {
        None
    };
    let Some((name, value)) = found else {
        return vec![];
    };
    let (value, _) = value.split_once(' ').unwrap_or((value, ""));
    let state = number_of(value).and_then(|value| field(name, value));
    state.map_or_else(Vec::new, |state| vec![time, state])
}

/// The name behind the last opening quote.
fn quoted(text: &str) -> Option<&str> {
    text.rsplit_once('\'')
        .map(|(_, name)| name)
        .filter(|name| !name.is_empty())
}

/// The text without the colours of a terminal (`ESC [ ... m`).
fn without_colours(line: &str) -> String {
    let mut parts = line.split("\u{1b}[");
    let first = parts.next().unwrap_or_default().to_owned();
    let rest = parts.map(|part| part.split_once('m').map_or(part, |(_, text)| text));
    rest.fold(first, |text, part| text + part)
}

#[cfg(test)]
mod tests {
    use super::super::fields::joined;
    use super::*;

    #[test]
    fn lines_of_labels() {
        for (line, expected) in [
            (
                "Setpoint:100.00,Input:80.10,Output:30.00",
                "Setpoint=100.00 Input=80.10 Output=30.00",
            ),
            (
                "08:00:01.123 -> a:1\tb:-2.5e3",
                "time=08:00:01.123 a=1 b=-2.5e3",
            ),
            (
                " sec: 1.5000  out: 30.00  pv: 80.125",
                "sec=1.5000 out=30.00 pv=80.125",
            ),
            (
                "sec: 4.0  out: 0.0  pv: 25.0  settling  >>",
                "sec=-4.0 out=0.0 pv=25.0",
            ),
            ("t=0.1; u=1; y = 2", "t=0.1 u=1 y=2"),
            ("temp:79.9\u{b0}C,duty:30%", "temp=79.9 duty=30"),
            ("only:1", ""),
            ("a:1,b:word", ""),
            ("0:1,2:3", ""),
            ("Loading: 3 files, 4 MB", ""),
        ] {
            assert_eq!(joined(labels(line)), expected, "{line}");
        }
    }

    #[test]
    fn lines_of_esphome() {
        for (line, expected) in [
            (
                "[08:00:01][D][sensor:094]: 'Boiler temperature': Sending state 79.90000 \u{b0}C with 1 decimals of accuracy",
                "time=08:00:01 Boiler temperature=79.90000",
            ),
            (
                "\u{1b}[0;36m[08:00:01.250][D][sensor:131]: 'Heater' >> 31.5 %\u{1b}[0m",
                "time=08:00:01.250 Heater=31.5",
            ),
            (
                "[08:00:01][D][switch:055]: 'Heater': Sending state ON",
                "time=08:00:01 Heater=ON",
            ),
            (
                "[08:00:01][D][climate:396]:   Current Temperature: 79.90\u{b0}C",
                "time=08:00:01 climate temperature=79.90",
            ),
            ("[08:00:01][I][app:102]: ESPHome version 2024.6", ""),
            ("'Boiler': Sending state 79.9", ""),
        ] {
            assert_eq!(joined(states(line)), expected, "{line}");
        }
    }
}
