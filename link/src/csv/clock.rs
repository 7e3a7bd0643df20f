//! Converts time stamps to seconds.

use std::fmt;

use super::date::{self, Calendar, Date, Days};
use super::number::{self, Cell};
use crate::recording::{FAR_START_S, Note};
use crate::time_unit::TimeUnit;

const SECOND_NS: i64 = 1_000_000_000;

/// A time stamp as in the file. Integers stay exact: microseconds since 1970 need all digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stamp {
    Whole(i64),
    Real(f64),
    Date(Date),
    /// Time of day (ns).
    OfDay(i64),
}

impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(stamp) => write!(f, "{stamp}"),
            Self::Real(stamp) => write!(f, "{stamp:?}"),
            Self::Date(date) => write!(f, "{date}"),
            Self::OfDay(ns) => {
                let (seconds, ns) = (ns.div_euclid(SECOND_NS), ns.rem_euclid(SECOND_NS));
                let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
                write!(f, "{hours:02}:{minutes:02}:{:02}", seconds % 60)?;
                if ns > 0 {
                    write!(f, ".{}", format!("{ns:09}").trim_end_matches('0'))?;
                }
                Ok(())
            }
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
    /// Counts from the first date, if the stamps are dates.
    calendar: Option<Calendar>,
    /// Counts from the first time of day, if the stamps are these.
    days: Option<Days>,
}

impl Clock {
    pub(super) fn new(unit: TimeUnit) -> Self {
        Self {
            unit,
            started: false,
            origin: 0,
            calendar: None,
            days: None,
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
            Stamp::Date(date) => {
                self.calendar = Some(Calendar::new(date));
                let first = date.to_string();
                Some(Note::CountedFromFirst { first })
            }
            Stamp::OfDay(ns) => {
                self.days = Some(Days::new(ns));
                Some(Note::TimeOfDay {
                    first: first.to_string(),
                })
            }
            _ => None,
        }
    }

    /// Time of a stamp (s).
    ///
    /// # Errors
    /// A date that does not exist, a date in a column of numbers, or a number in a column of dates.
    pub(super) fn seconds(&mut self, stamp: Stamp) -> Result<f64, date::Fault> {
        if let (Stamp::OfDay(ns), Some(days)) = (stamp, &mut self.days) {
            return Ok(TimeUnit::Nanoseconds.seconds(days.since_first_ns(ns) as f64));
        }
        let time = match (stamp, &mut self.calendar) {
            (Stamp::Real(stamp), _) if stamp.is_nan() => stamp,
            _ if self.days.is_some() => return Err(date::Fault::NoSuchDay),
            (Stamp::Date(date), Some(calendar)) => {
                let since_ns = calendar.since_first_ns(&date)?;
                return Ok(TimeUnit::Nanoseconds.seconds(since_ns as f64));
            }
            (Stamp::Whole(stamp), None) => match stamp.checked_sub(self.origin) {
                Some(time) => time as f64,
                None => stamp as f64 - self.origin as f64,
            },
            (Stamp::Real(stamp), None) => stamp - self.origin as f64,
            (_, Some(_)) => return Err(date::Fault::NoSuchDay),
            (Stamp::Date(_) | Stamp::OfDay(_), None) => return Err(date::Fault::AmongNumbers),
        };
        Ok(self.unit.seconds(time))
    }
}

/// The time stamp in a cell; NaN if it is missing, `None` if it is text.
pub(super) fn parse(cell: &[u8]) -> Option<(Stamp, number::Mark)> {
    if let Some(stamp) = number::parse_whole(cell) {
        return Some((Stamp::Whole(stamp), number::Mark::None));
    }
    match number::parse(cell) {
        Cell::Number(_, number::Mark::Word) => None,
        Cell::Number(stamp, mark) => Some((Stamp::Real(stamp), mark)),
        Cell::Missing | Cell::Bad => Some((Stamp::Real(f64::NAN), number::Mark::None)),
        Cell::Text => {
            let of_day = || date::of_day(cell).map(Stamp::OfDay);
            let stamp = date::parse(cell).map(Stamp::Date).or_else(of_day);
            stamp.map(|stamp| (stamp, number::Mark::None))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integer_stamps_are_exact() {
        let mut clock = Clock::new(TimeUnit::Nanoseconds);
        let first = 1_700_000_000_123_456_789;
        assert!(clock.start(Stamp::Whole(first)).is_some());
        assert!(clock.start(Stamp::Whole(first + 1)).is_none());
        assert_eq!(clock.seconds(Stamp::Whole(first)), Ok(0.0));
        assert_eq!(clock.seconds(Stamp::Whole(first + 1)), Ok(1e-9));
        assert!(clock.seconds(Stamp::Whole(i64::MIN)).unwrap().is_finite());
    }

    #[test]
    fn stamps_near_zero_are_not_shifted() {
        let mut clock = Clock::new(TimeUnit::Microseconds);
        assert_eq!(clock.start(Stamp::Whole(12_345_678)), None);
        assert_eq!(clock.seconds(Stamp::Whole(12_345_678)), Ok(12.345678));
    }
}
