//! The unit of a time column that does not state it.
//!
//! A reading of the stamps is possible if its sample period lies between 0.2 ms and 60 s and it starts within 115 days
//! of zero; steps such as 1/60 may be minutes or hours. Stamps of the years 2000 to 2100, counted from 1970, show their unit by their size. If more than one reading
//! is possible, or none, the unit is in doubt: a unit that is wrong makes every time constant wrong by its factor.

use std::ops::{Range, RangeInclusive};

use super::error::ReadError;
use super::preview::Preview;
use crate::recording::{FAR_START_S, Note};
use crate::time_unit::TimeUnit;

/// Sample periods of recordings of control loops (s).
const PERIODS_S: RangeInclusive<f64> = 2e-4..=60.0;
/// The years 2000 to 2100 in seconds since 1970.
const EPOCH_S: Range<f64> = 946_684_800.0..4_102_444_800.0;
/// The years 2000 to 2100 in days, as Excel (since 1900) and MATLAB (since year 0) count them.
const SERIAL_DAYS: [Range<f64>; 2] = [36_526.0..73_051.0, 730_486.0..767_011.0];
/// The years 2000 to 2100 in 100 ns since 1601, as Windows counts (FILETIME).
const WINDOWS_TICKS: Range<f64> = 1.259_115_84e17..1.574_691_84e17;
/// Units of stamps that count from a start nearby, each with the sample period from which it is the usual one (in units):
/// logs of 1 Hz to 1 kHz.
const COUNTED: [(TimeUnit, f64); 4] = [
    (TimeUnit::Nanoseconds, 1e6),
    (TimeUnit::Microseconds, 1e3),
    (TimeUnit::Milliseconds, 2.0),
    (TimeUnit::Seconds, 0.0),
];

/// Unit of a time column.
pub(super) struct Found {
    pub(super) unit: TimeUnit,
    pub(super) note: Option<Note>,
    /// Refusal of a recording that is sound but for its unit of time.
    pub(super) doubt: Option<ReadError>,
}

/// The unit of a time column: as the caller says, else as its header says, else by its stamps.
pub(super) fn find(preview: &Preview, column: usize, forced: Option<TimeUnit>) -> Found {
    let name = preview.names.as_ref().and_then(|names| names.get(column));
    let in_cells = || preview.unit(column).and_then(TimeUnit::from_name);
    let stated = forced.or_else(|| name.and_then(|name| name.time_unit()).or_else(in_cells));
    if let Some(unit) = stated {
        let note = (unit != TimeUnit::Seconds).then_some(Note::TimeUnit { unit });
        return Found {
            unit,
            note,
            doubt: None,
        };
    }
    let stamps = preview.column(column).filter(|stamp| !stamp.is_nan());
    let Some((first, step)) = first_and_step(stamps) else {
        return Found {
            unit: TimeUnit::Seconds,
            note: None,
            doubt: None,
        };
    };
    let (usual, possible) = readings(first, step, preview.is_whole(column));
    let note = Some(Note::TimeUnitGuessed { unit: usual });
    let doubt = (possible.len() != 1).then(|| ReadError::AmbiguousTime {
        column: preview.label(column),
        step,
        usual: (!possible.is_empty()).then_some(usual),
        possible,
    });
    Found {
        unit: usual,
        note,
        doubt,
    }
}

/// First stamp and median of the positive increments; `None` if no increment is positive.
fn first_and_step(stamps: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let first = stamps.clone().next()?;
    let increments = stamps.clone().zip(stamps.skip(1)).map(|(a, b)| b - a);
    let mut increments: Vec<f64> = increments.filter(|&increment| increment > 0.0).collect();
    let middle = increments.len() / 2;
    if increments.is_empty() {
        return None;
    }
    let (_, step, _) = increments.select_nth_unstable_by(middle, f64::total_cmp);
    Some((first, *step))
}

/// The usual unit of stamps, and all units that are possible.
fn readings(first: f64, step: f64, is_whole: bool) -> (TimeUnit, Vec<TimeUnit>) {
    let counted = COUNTED.map(|(unit, _)| unit);
    if let Some(unit) = counted
        .into_iter()
        .find(|unit| EPOCH_S.contains(&unit.seconds(first)))
        && unit.seconds(step) <= *PERIODS_S.end()
    {
        return (unit, vec![unit]);
    }
    if WINDOWS_TICKS.contains(&first) {
        return (TimeUnit::Ticks, vec![TimeUnit::Ticks]);
    }
    if step < 1.0 && !is_whole {
        return fractions(first, step);
    }
    let is_possible = |unit: &TimeUnit| {
        PERIODS_S.contains(&unit.seconds(step)) && unit.seconds(first).abs() <= FAR_START_S
    };
    let possible: Vec<TimeUnit> = counted.into_iter().filter(is_possible).collect();
    let mut usual = COUNTED
        .into_iter()
        .filter(|(unit, from)| possible.contains(unit) && step >= *from && is_whole);
    let usual = usual.next().map(|(unit, _)| unit);
    let usual = usual
        .or(possible.last().copied())
        .unwrap_or(TimeUnit::Seconds);
    (usual, possible)
}

/// Stamps that increase by less than one: seconds, or days in a spreadsheet.
fn fractions(first: f64, step: f64) -> (TimeUnit, Vec<TimeUnit>) {
    let (seconds, days) = (TimeUnit::Seconds, TimeUnit::Days);
    let period_s = days.seconds(step);
    let is_multiple = |of_s: f64| {
        let times = period_s / of_s;
        times >= 0.999 && (times - times.round()).abs() < 1e-3 * times
    };
    let is_date = SERIAL_DAYS.iter().any(|days| days.contains(&first));
    let days_are_usual = step < *PERIODS_S.start();
    let days_are_possible = if is_date {
        days_are_usual || PERIODS_S.contains(&period_s) || (period_s <= 3600.0 && is_multiple(60.0))
    } else {
        // A time of day, or a duration: 1 s of 86,400 s is no round number of seconds.
        days_are_usual && is_multiple(1.0)
    };
    // So is 1 s of 60 s or of 3600 s; 60 Hz is 1/60 s too.
    let is_odd = (step - format!("{step:.2e}").parse().unwrap_or(step)).abs() > 1e-4 * step;
    let counts_seconds = |unit: &TimeUnit| {
        let times = unit.seconds(step);
        is_odd && times >= 0.999 && (times - times.round()).abs() < 1e-4 * times
    };
    let longer: Vec<TimeUnit> = [TimeUnit::Minutes, TimeUnit::Hours]
        .into_iter()
        .filter(counts_seconds)
        .collect();
    match (days_are_possible, is_date && days_are_usual) {
        (true, true) => (days, vec![days]),
        (true, false) => (days, vec![days, seconds]),
        (false, _) => (seconds, [vec![seconds], longer].concat()),
    }
}

#[cfg(test)]
mod tests {
    use super::TimeUnit::{
        Days, Hours, Microseconds, Milliseconds, Minutes, Nanoseconds, Seconds, Ticks,
    };
    use super::*;

    #[track_caller]
    fn assert_units(first: f64, step: f64, expected: &[TimeUnit], usual: TimeUnit) {
        let is_whole = first.fract() == 0.0 && step.fract() == 0.0;
        let (found, mut possible) = readings(first, step, is_whole);
        possible.sort_by_key(|unit| unit.symbol());
        let mut expected = expected.to_vec();
        expected.sort_by_key(|unit| unit.symbol());
        assert_eq!((found, possible), (usual, expected));
    }

    #[test]
    fn decimals_below_one_are_seconds_or_days() {
        for step in [0.5, 0.01, 1e-3, 2.5e-4, 1e-4, 5e-5] {
            assert_units(0.0, step, &[Seconds], Seconds);
        }
        // 13:00 in seconds of the day, every 10 ms.
        assert_units(46_800.0, 0.01, &[Seconds], Seconds);
        // Excel's 2024-01-31, every second and every tenth of it.
        assert_units(45_322.5, 1.0 / 86_400.0, &[Days], Days);
        assert_units(45_322.5, 0.1 / 86_400.0, &[Days], Days);
        // Every minute: 0.69 ms if they were seconds.
        assert_units(45_322.5, 1.0 / 1440.0, &[Days, Seconds], Days);
        assert_units(739_282.5, 1.0 / 86_400.0, &[Days], Days);
        // A duration in days.
        assert_units(0.0, 1.0 / 86_400.0, &[Days, Seconds], Days);
    }

    // 1 s in minutes is 60 Hz in seconds; 0.1 min is no sign of minutes.
    #[test]
    fn minutes_and_hours_are_doubted() {
        assert_units(0.0, 1.0 / 60.0, &[Minutes, Hours, Seconds], Seconds);
        assert_units(0.0, 0.016667, &[Minutes, Hours, Seconds], Seconds);
        assert_units(0.0, 1.0 / 7.0, &[Seconds], Seconds);
        assert_units(0.0, 1.0 / 3600.0, &[Hours, Seconds], Seconds);
        assert_units(0.0, 0.1, &[Seconds], Seconds);
        assert_units(0.0, 1.0 / 70.0, &[Seconds], Seconds);
    }

    #[test]
    fn whole_numbers_from_a_start_nearby() {
        assert_units(0.0, 1.0, &[Milliseconds, Seconds], Seconds);
        assert_units(0.0, 20.0, &[Milliseconds, Seconds], Milliseconds);
        assert_units(7000.0, 100.0, &[Milliseconds], Milliseconds);
        assert_units(0.0, 500.0, &[Microseconds, Milliseconds], Milliseconds);
        assert_units(5e6, 2500.0, &[Microseconds, Milliseconds], Microseconds);
        assert_units(0.0, 1e5, &[Microseconds], Microseconds);
        assert_units(0.0, 1e6, &[Microseconds, Nanoseconds], Nanoseconds);
        assert_units(0.0, 1e8, &[Nanoseconds], Nanoseconds);
        // Decimals do not show whether a step of 2.5 is in s or ms.
        assert_units(0.5, 2.5, &[Milliseconds, Seconds], Seconds);
    }

    #[test]
    fn stamps_since_1970() {
        assert_units(1.7e9, 1.0, &[Seconds], Seconds);
        assert_units(1.7e12, 1.0, &[Milliseconds], Milliseconds);
        assert_units(1.7e15, 1000.0, &[Microseconds], Microseconds);
        assert_units(1.7e18, 1e6, &[Nanoseconds], Nanoseconds);
        // 1500 s after power-up in us or 17 days in ms, not the year 2017 with a sample period of 42 min.
        assert_units(1.5e9, 2500.0, &[Microseconds, Milliseconds], Microseconds);
        assert_units(1.33e17, 1e5, &[Ticks], Ticks);
    }
}
