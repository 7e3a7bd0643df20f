//! Headers of a blackbox: facts, settings, and the layout of the frames.

use std::collections::BTreeMap;

use super::frame::{Constants, Fields, Layout};
use crate::log::tables::{FlightTables, MOST_NAMES};

/// Headers by name.
#[derive(Debug, Default)]
pub(super) struct Headers {
    lines: BTreeMap<String, String>,
}

impl Headers {
    /// Adds `name:value`. False: this is no header.
    pub(super) fn add(&mut self, line: &str) -> bool {
        let Some((name, value)) = line.split_once(':') else {
            return false;
        };
        if self.lines.len() < MOST_NAMES {
            self.lines
                .insert(name.trim().to_owned(), value.trim().to_owned());
        }
        true
    }

    fn get(&self, name: &str) -> Option<&str> {
        self.lines.get(name).map(String::as_str)
    }

    /// Numbers of a list; text between them is 0.
    fn numbers(&self, name: &str) -> Vec<i32> {
        let list = self.get(name).unwrap_or_default();
        list.split([',', '/'])
            .map(|number| number.trim().parse().unwrap_or(0))
            .collect()
    }

    fn number(&self, name: &str) -> Option<i32> {
        self.numbers(name)
            .first()
            .copied()
            .filter(|_| self.get(name).is_some())
    }

    /// The layout of the frames. `None`: there are no main frames, or they need what is unknown.
    pub(super) fn layout(&self) -> Option<Layout> {
        let whole = self.fields('I', 'I')?;
        let difference = self.fields('I', 'P')?;
        let interval = self.numbers("P interval");
        let (shown, of) = match *interval.as_slice() {
            [shown, of, ..] => (shown, of),
            [of] if of > 0 => (1, of),
            _ => (1, 1),
        };
        let version = self.number("Data version").unwrap_or(2);
        let constants = Constants {
            min_throttle: self.number("minthrottle").unwrap_or(0),
            min_motor: self
                .number("motorOutput")
                .or(self.number("minthrottle"))
                .unwrap_or(0),
            battery: self.number("vbatref").unwrap_or(0),
        };
        let other = |kind| self.fields(kind, kind).unwrap_or_default();
        let mut layout = Layout {
            whole,
            difference,
            slow: other('S'),
            gps: other('G'),
            home: other('H'),
            constants,
            whole_interval: self.number("I interval").unwrap_or(32).max(1) as u32,
            shown: shown.max(1) as u32,
            of: of.max(1) as u32,
            iteration: None,
            time: 0,
        };
        layout.iteration = layout.whole.place("loopIteration");
        layout.time = layout.whole.place("time")?;
        for part in [&mut layout.whole, &mut layout.difference] {
            part.plan(version)?;
        }
        for part in [&mut layout.slow, &mut layout.gps, &mut layout.home] {
            if part.plan(version).is_none() {
                *part = Fields::default();
            }
        }
        Some(layout)
    }

    /// Fields named in `names`, encoded as frames of `kind`.
    fn fields(&self, names: char, kind: char) -> Option<Fields> {
        let name = self.get(&format!("Field {names} name"))?;
        let signed = self.numbers(&format!("Field {names} signed"));
        let predictors = self.numbers(&format!("Field {kind} predictor"));
        let encodings = self.numbers(&format!("Field {kind} encoding"));
        Fields::new(name, &signed, predictors, encodings)
    }

    /// Headers as facts, and their numbers as parameters.
    pub(super) fn tables(self) -> FlightTables {
        let mut flight = FlightTables::default();
        for (name, value) in self.lines {
            if name.starts_with("Field ") {
                continue;
            }
            let numbers: Option<Vec<f64>> = value
                .split(',')
                .map(|number| number.trim().parse().ok())
                .collect();
            match numbers.as_deref() {
                Some([number]) if number.is_finite() => flight.set(&name, *number, true, None),
                Some(list) => {
                    for (at, number) in list.iter().enumerate().filter(|(_, n)| n.is_finite()) {
                        flight.set(&format!("{name}[{at}]"), *number, true, None);
                    }
                }
                None => {}
            }
            flight.info.insert(name, value);
        }
        flight
    }
}
