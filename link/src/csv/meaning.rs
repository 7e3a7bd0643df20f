//! What columns mean where no usual name tells: by the words of their names, by their values, by the columns beside them.

use std::collections::HashSet;

use super::error::ReadError;
use super::names::{Name, key};
use super::preview::Preview;
use super::tags::Signal;
use crate::recording::{ChosenBy, Note, Role};

/// Maximum number of different values of a relay: two levels, and some for start, end and bias.
const MOST_LEVELS: usize = 8;

/// The output must take at least this many times the values of the input.
const MORE_VALUES: usize = 3;

/// A column of times agrees with dates if both are as long within this many seconds, or this share.
const DATES_AGREE_S: f64 = 2.0;
const DATES_AGREE: f64 = 0.02;

/// Names of a process value, beside which an output is that of the controller.
const PROCESS_VALUES: [&str; 4] = ["pv", "process_value", "process_variable", "pv_value"];

/// A set-point that is this many times nearer to a column named `Input` than to `Output` contradicts these names.
const NEARER: f64 = 2.0;

/// Input and output from the columns that are left, as far as they are missing; what told them.
///
/// # Errors
/// Two columns are left, and nothing tells them apart.
pub(super) fn complete(
    preview: &Preview,
    left: &[usize],
    [input, output]: [&mut Option<usize>; 2],
) -> Result<Option<ChosenBy>, ReadError> {
    let names = preview.names.as_deref().unwrap_or_default();
    match (*input, *output, left) {
        (Some(_), Some(_), _) => Ok(None),
        (None, Some(_), &[one]) => {
            *input = Some(one);
            Ok(None)
        }
        (Some(_), None, &[one]) => {
            *output = Some(one);
            Ok(None)
        }
        (None, None, &[a, b]) => {
            let (pair, by) = match (told(names, left), tell_apart(preview, a, b)) {
                (Some(pair), _) => (pair, ChosenBy::Word),
                (None, Ok(pair)) => (pair, ChosenBy::Values),
                (None, Err(error)) => (one_told(names, [a, b]).ok_or(error)?, ChosenBy::Word),
            };
            (*input, *output) = (Some(pair.0), Some(pair.1));
            Ok(Some(by))
        }
        _ => {
            let one = |signal| only(names, left, signal);
            *input = input.or_else(|| one(Signal::Input));
            *output = output.or_else(|| one(Signal::Output));
            Ok(Some(ChosenBy::Word))
        }
    }
}

/// The columns `out` and `pv` of a table without another input or output: beside a process value, the output is that of the
/// controller.
pub(super) fn out_beside_pv(
    names: &[Name],
    by_name: &dyn Fn(Role) -> Vec<usize>,
) -> Option<(usize, usize)> {
    let is = |column: usize, wanted: &[&str]| wanted.contains(&key(&names[column].bare).as_str());
    match *by_name(Role::Output) {
        [a, b] if by_name(Role::Input).is_empty() => [(a, b), (b, a)]
            .into_iter()
            .find(|(out, pv)| is(*out, &["out", "output"]) && is(*pv, &PROCESS_VALUES)),
        _ => None,
    }
}

/// The only one of these columns whose words tell this signal.
pub(super) fn only(names: &[Name], columns: &[usize], signal: Signal) -> Option<usize> {
    let is_one = |column: &&usize| names.get(**column).and_then(Name::told) == Some(signal);
    let mut all = columns.iter().filter(is_one);
    all.next().filter(|_| all.next().is_none()).copied()
}

/// Input and output of these columns, if the words of one name tell each.
fn told(names: &[Name], columns: &[usize]) -> Option<(usize, usize)> {
    only(names, columns, Signal::Input).zip(only(names, columns, Signal::Output))
}

/// Input and output of two columns of which the words of one name tell.
fn one_told(names: &[Name], [a, b]: [usize; 2]) -> Option<(usize, usize)> {
    let told = |column: usize| names.get(column).and_then(Name::told);
    match (told(a), told(b)) {
        (Some(Signal::Input), None) | (None, Some(Signal::Output)) => Some((a, b)),
        (Some(Signal::Output), None) | (None, Some(Signal::Input)) => Some((b, a)),
        _ => None,
    }
}

/// The columns named as times that agree with the dates of the table, or else the column of the dates. A column of
/// numbers agrees if it states its unit and is as long within 2 s or 2 %.
pub(super) fn by_dates(preview: &Preview, named: Vec<usize>, notes: &mut Vec<Note>) -> Vec<usize> {
    let Some(dates) = preview.date.filter(|dates| !named.contains(dates)) else {
        return named;
    };
    let Some(length_s) = preview.length_s(dates) else {
        return named;
    };
    let agrees = |column: &usize| {
        let unit = preview
            .names
            .as_ref()
            .and_then(|names| names[*column].time_unit());
        let mut stamps = preview
            .shape_column(*column)
            .filter(|stamp| !stamp.is_nan());
        let first = stamps.next();
        let length = first.map(|first| stamps.last().unwrap_or(first) - first);
        unit.zip(length).is_some_and(|(unit, length)| {
            (unit.seconds(length) - length_s).abs() <= DATES_AGREE_S.max(DATES_AGREE * length_s)
        })
    };
    let (agreeing, others): (Vec<usize>, Vec<usize>) = named.into_iter().partition(agrees);
    notes.extend(others.into_iter().map(|column| Note::TimeDisagrees {
        column: preview.label(column),
        dates: preview.label(dates),
    }));
    if agreeing.is_empty() {
        vec![dates]
    } else {
        agreeing
    }
}

/// The note that the columns `Input` and `Output` are those of a controller: `Input` the measurement, near the set-point. `None` if they
/// are not.
///
/// # Errors
/// They may be, and nothing tells: the lines are those of an Arduino without a set-point, or the set-point is nearer to the other
/// column than the names say.
pub(super) fn of_controller(
    preview: &Preview,
    columns: [Option<usize>; 2],
    set_point: Option<usize>,
) -> Result<Option<Note>, ReadError> {
    let [Some(input), Some(output)] = columns else {
        return Ok(None);
    };
    let is = is_of_controller(preview, [input, output], set_point)?;
    Ok(is.then(|| Note::NamesOfController {
        measurement: preview.label(input),
        action: preview.label(output),
    }))
}

fn is_of_controller(
    preview: &Preview,
    columns: [usize; 2],
    set_point: Option<usize>,
) -> Result<bool, ReadError> {
    let names = preview.names.as_deref().unwrap_or_default();
    let is_named = |column: usize, wanted| {
        names
            .get(column)
            .is_some_and(|name| key(&name.bare) == wanted)
    };
    let doubt = || ReadError::InputOfWhat {
        columns: columns.map(|column| preview.label(column)),
    };
    if let (Some(input), Some(output)) = (names.get(columns[0]), names.get(columns[1]))
        && input.may_be_crossed(output)
    {
        // `Output` of a block is what acts, if it is that of a controller: its `Input` follows the set-point.
        let near = |column| set_point.map(|set_point| Nearness::of(preview, column, set_point));
        return match (near(columns[1]), near(columns[0])) {
            (Some(measured), Some(acts)) if measured.is_near_unlike(&acts) => Ok(false),
            _ => Err(doubt()),
        };
    }
    if !(is_named(columns[0], "input") && is_named(columns[1], "output")) {
        return Ok(false);
    }
    let Some(set_point) = set_point else {
        return if preview.is_labelled {
            Err(doubt())
        } else {
            Ok(false)
        };
    };
    let near = |column| Nearness::of(preview, column, set_point);
    let (input, output) = (near(columns[0]), near(columns[1]));
    match preview.is_labelled {
        true if input.is_nearer(&output) => Ok(true),
        true => Err(doubt()),
        false if input.is_near_unlike(&output) => Err(doubt()),
        false => Ok(false),
    }
}

/// How near a signal is to the set-point, in the second half of the first rows.
struct Nearness {
    distance: f64,
    set_point: f64,
    least: f64,
    most: f64,
}

impl Nearness {
    fn of(preview: &Preview, column: usize, set_point: usize) -> Self {
        let all: Vec<(f64, f64)> = (preview.column(column).zip(preview.column(set_point)))
            .filter(|(value, wanted)| (value + wanted).is_finite())
            .collect();
        let mut near = Self {
            distance: 0.0,
            set_point: 0.0,
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        };
        for (index, (value, wanted)) in all.iter().enumerate() {
            near.least = near.least.min(*value);
            near.most = near.most.max(*value);
            if 2 * index >= all.len() {
                near.distance += (value - wanted).abs();
                near.set_point = *wanted;
            }
        }
        near
    }

    fn is_nearer(&self, other: &Self) -> bool {
        self.distance <= other.distance
    }

    /// Whether this signal is that of the set-point and the other is not: much nearer, or the only one that comes
    /// to it. A set-point of zero tells nothing: signals without a bias are near it too.
    fn is_near_unlike(&self, other: &Self) -> bool {
        let reaches = |of: &Self| (of.least..=of.most).contains(&of.set_point);
        self.set_point != 0.0
            && (NEARER * self.distance < other.distance || (reaches(self) && !reaches(other)))
    }
}

/// Tells input and output of two columns apart by their number of different values.
fn tell_apart(preview: &Preview, a: usize, b: usize) -> Result<(usize, usize), ReadError> {
    let values = |column| {
        let bits = preview
            .column(column)
            .filter(|value| !value.is_nan())
            .map(f64::to_bits);
        bits.collect::<HashSet<u64>>().len()
    };
    let (values_a, values_b) = (values(a), values(b));
    let is_relay = |few, many| (2..=MOST_LEVELS).contains(&few) && many >= MORE_VALUES * few;
    if is_relay(values_a, values_b) {
        Ok((a, b))
    } else if is_relay(values_b, values_a) {
        Ok((b, a))
    } else {
        Err(ReadError::InputOrOutput {
            columns: [preview.label(a), preview.label(b)],
        })
    }
}
