//! Converts time stamps to seconds.

use std::fmt;

use super::number::{self, Cell};
use super::preview::Preview;
use crate::recording::{FAR_START_S, Note};
use crate::time_unit::TimeUnit;

/// A time stamp as in the file. Integers stay exact: microseconds since 1970 need all digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stamp {
    Whole(i64),
    Real(f64),
}

impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(stamp) => write!(f, "{stamp}"),
            Self::Real(stamp) => write!(f, "{stamp:?}"),
        }
    }
}

/// Converts time stamps to seconds.
#[derive(Debug)]
pub(super) struct Clock {
    unit: TimeUnit,
    started: bool,
    /// Subtracted from all time stamps: the first one if it is an integer far from zero, else 0.
    origin: i64,
}

impl Clock {
    pub(super) fn new(unit: TimeUnit) -> Self {
        Self {
            unit,
            started: false,
            origin: 0,
        }
    }

    /// Starts at the first time stamp; returns a note if time is counted from it.
    pub(super) fn start(&mut self, first: Stamp) -> Option<Note> {
        if std::mem::replace(&mut self.started, true) {
            return None;
        }
        match first {
            Stamp::Whole(stamp) if self.unit.seconds(stamp as f64).abs() > FAR_START_S => {
                self.origin = stamp;
                let first = format!("{stamp} {}", self.unit.symbol());
                Some(Note::CountedFromFirst { first })
            }
            _ => None,
        }
    }

    pub(super) fn seconds(&self, stamp: Stamp) -> f64 {
        let time = match stamp {
            Stamp::Whole(stamp) => match stamp.checked_sub(self.origin) {
                Some(time) => time as f64,
                None => stamp as f64 - self.origin as f64,
            },
            Stamp::Real(stamp) => stamp - self.origin as f64,
        };
        self.unit.seconds(time)
    }
}

/// The time stamp in a cell; NaN if it is missing, `None` if it is text.
pub(super) fn parse(cell: &[u8]) -> Option<(Stamp, number::Mark)> {
    if let Some(stamp) = number::parse_whole(cell) {
        return Some((Stamp::Whole(stamp), number::Mark::None));
    }
    match number::parse(cell) {
        Cell::Number(stamp, mark) => Some((Stamp::Real(stamp), mark)),
        Cell::Missing => Some((Stamp::Real(f64::NAN), number::Mark::None)),
        Cell::Text => None,
    }
}

/// The unit of a time column: as the caller says, else as its header says, else guessed.
pub(super) fn unit_of(
    preview: &Preview,
    column: usize,
    forced: Option<TimeUnit>,
) -> (TimeUnit, Option<Note>) {
    let name = preview.names.as_ref().and_then(|names| names.get(column));
    match forced.or_else(|| name.and_then(|name| name.time_unit())) {
        Some(TimeUnit::Seconds) => (TimeUnit::Seconds, None),
        Some(unit) => (unit, Some(Note::TimeUnit { unit })),
        None => {
            let unit = guess(preview.column(column), preview.is_whole(column));
            (unit, Some(Note::TimeUnitGuessed { unit }))
        }
    }
}

/// Guesses the unit of the time stamps.
///
/// Time stamps with decimals are in seconds. Integers that start at 1e17, 1e14, 1e11 or 1e8 and
/// more count ns, us, ms or s since 1970 (1.7e9 s ago). For other integers the median increment
/// decides: ns from 1e6, us from 1000, else ms. This fits sample rates from 1 Hz to 1 kHz.
fn guess(stamps: impl Iterator<Item = f64> + Clone, whole: bool) -> TimeUnit {
    let stamps = stamps.filter(|stamp| !stamp.is_nan());
    let first = stamps.clone().next().unwrap_or(0.0).abs();
    if !whole {
        return TimeUnit::Seconds;
    }
    let increments = stamps.clone().zip(stamps.skip(1)).map(|(a, b)| b - a);
    let mut increments: Vec<f64> = increments.filter(|&increment| increment > 0.0).collect();
    increments.sort_unstable_by(f64::total_cmp);
    let typical = increments.get(increments.len() / 2).copied().unwrap_or(0.0);
    if first >= 1e17 || (first < 1e8 && typical >= 1e6) {
        TimeUnit::Nanoseconds
    } else if first >= 1e14 || (first < 1e8 && typical >= 1e3) {
        TimeUnit::Microseconds
    } else if (1e8..1e11).contains(&first) {
        TimeUnit::Seconds
    } else {
        TimeUnit::Milliseconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guess_of(first: f64, increment: f64) -> TimeUnit {
        guess((0..10).map(|i| first + f64::from(i) * increment), true)
    }

    #[test]
    fn the_guess_of_a_unit() {
        assert_eq!(guess([0.0, 0.001].into_iter(), false), TimeUnit::Seconds);
        assert_eq!(guess_of(0.0, 1.0), TimeUnit::Milliseconds);
        assert_eq!(guess_of(0.0, 20.0), TimeUnit::Milliseconds);
        assert_eq!(guess_of(5e6, 2500.0), TimeUnit::Microseconds);
        assert_eq!(guess_of(0.0, 1e6), TimeUnit::Nanoseconds);
        assert_eq!(guess_of(1.7e9, 1.0), TimeUnit::Seconds);
        assert_eq!(guess_of(1.7e12, 1.0), TimeUnit::Milliseconds);
        assert_eq!(guess_of(1.7e15, 1000.0), TimeUnit::Microseconds);
        assert_eq!(guess_of(1.7e18, 1e6), TimeUnit::Nanoseconds);
    }

    #[test]
    fn integer_stamps_are_exact() {
        let mut clock = Clock::new(TimeUnit::Nanoseconds);
        let first = 1_700_000_000_123_456_789;
        assert!(clock.start(Stamp::Whole(first)).is_some());
        assert!(clock.start(Stamp::Whole(first + 1)).is_none());
        assert_eq!(clock.seconds(Stamp::Whole(first)), 0.0);
        assert_eq!(clock.seconds(Stamp::Whole(first + 1)), 1e-9);
        assert!(clock.seconds(Stamp::Whole(i64::MIN)).is_finite());
    }

    #[test]
    fn stamps_near_zero_are_not_shifted() {
        let mut clock = Clock::new(TimeUnit::Microseconds);
        assert_eq!(clock.start(Stamp::Whole(12_345_678)), None);
        assert_eq!(clock.seconds(Stamp::Whole(12_345_678)), 12.345678);
    }
}
