//! Chooses the columns of time, input and output.
//!
//! 1. As the options say.
//! 2. By name: `t`, `time`, ...; `u`, `input`, `relay`, ...; `y`, `pv`, `output`, ...
//!    With tags such as `LIC101.PV` and `LIC101.OP`, those of the only loop, or of the loop that the options name.
//!    Dates win over a column of numbers named `time` that disagrees with them.
//! 3. Else, time is the column of dates; without a header, it is the first column.
//! 4. If one signal and one column are left, they belong together.
//! 5. By a word of the name, if one column only has one of each: `heater_percent`, `bed temperature`.
//! 6. If input, output and two columns are left, the input is the column with 2 to 8 different
//!    values, provided that the other column has at least three times as many.

use super::error::{ReadError, quoted};
use super::long::Loop;
use super::meaning;
use super::names::{Name, key};
use super::options::{ColumnRef, CsvOptions};
use super::preview::Preview;
use super::tags::{self, Signal};
use crate::recording::{ChosenBy, ColumnLabel, Note, Role};

/// The columns to read, from 0.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Choice {
    /// `None` if the sample rate is given.
    pub(super) time: Option<usize>,
    pub(super) input: usize,
    pub(super) output: usize,
    pub(super) set_point: Option<usize>,
    /// Time of day, if the time column has dates only.
    pub(super) time_of_day: Option<usize>,
    /// Status of the samples of the chosen columns.
    pub(super) status: Vec<usize>,
    /// A time column that is not read because the sample rate is given.
    pub(super) ignored: Option<usize>,
    /// What else was chosen.
    pub(super) notes: Vec<Note>,
    by: ChosenBy,
}

impl Choice {
    pub(super) fn note(&self, preview: &Preview) -> Note {
        Note::ColumnsChosen {
            time: self.time.map(|column| preview.label(column)),
            input: preview.label(self.input),
            output: preview.label(self.output),
            by: self.by,
        }
    }
}

/// Chooses the columns.
pub(super) fn choose(preview: &Preview, options: &CsvOptions) -> Result<Choice, ReadError> {
    let timed = options.sample_rate_hz.is_none();
    let by_option = |wanted: &Option<ColumnRef>, role| {
        let found = wanted.as_ref().map(|wanted| find(wanted, role, preview));
        found.transpose()
    };
    let mut notes = vec![];
    let time_column = options.time_column.clone().filter(|_| timed);
    let mut time = by_option(&time_column, Role::Time)?;
    let mut input = by_option(&options.input_column, Role::Input)?;
    let mut output = by_option(&options.output_column, Role::Output)?;
    let (date, time_of_day) = preview.split.filter(|_| timed && time.is_none()).unzip();
    time = time.or(date);
    check_distinct(time, input, output, preview)?;
    let all_given = input.is_some() && output.is_some() && (time.is_some() || !timed);

    let names = preview.names.as_deref().unwrap_or_default();
    let activity = |column| preview.activity(column);
    let found = Loop::choose(names, [input, output], options, &activity)?;
    let of_loop = |signal| found.as_ref().and_then(|found| found.of(signal));
    input = input.or_else(|| of_loop(Signal::Input));
    output = output.or_else(|| of_loop(Signal::Output));

    let given = [time, input, output, time_of_day];
    let by_name = &|role| named(preview, role, &given, found.is_none());
    if let (None, None, Some((out, pv))) = (input, output, meaning::out_beside_pv(names, by_name)) {
        (input, output) = (Some(out), Some(pv));
    }
    let one = |role| single(by_name(role), role, preview);
    input = input.map_or_else(|| one(Role::Input), |input| Ok(Some(input)))?;
    output = output.map_or_else(|| one(Role::Output), |output| Ok(Some(output)))?;
    let unnamed = unnamed_time(preview, input, output);
    let mut ignored = None;
    if !timed {
        ignored = by_name(Role::Time).first().copied().or(unnamed);
    } else if time.is_none() {
        let named = meaning::by_dates(preview, by_name(Role::Time), &mut notes);
        time = single(named, Role::Time, preview)?.or(unnamed);
        check_clock_time(preview, time)?;
    }

    let taken = [time, input, output, ignored, time_of_day];
    let left = free(preview, &taken);
    let mut by = None;
    match (timed && time.is_none(), input.and(output), left.as_slice()) {
        (true, Some(_), &[only]) => time = Some(only),
        (true, ..) => {}
        (false, ..) => by = meaning::complete(preview, &left, [&mut input, &mut output])?,
    }
    let unknown = |role| unknown(role, preview);
    let is_bare = preview.width == 2 && preview.names.is_none();
    if timed && (time.is_none() || is_bare) {
        return Err(unknown(Role::Time));
    }
    let set_point = by_option(&options.set_point_column, Role::Output)?
        .or_else(|| of_loop(Signal::SetPoint))
        .or_else(|| only_set_point(names))
        .or_else(|| meaning::only(names, &left, Signal::SetPoint));
    let is_free = options.input_column.is_none() && options.output_column.is_none();
    if is_free && let Some(note) = meaning::of_controller(preview, [input, output], set_point)? {
        notes.push(note);
        std::mem::swap(&mut input, &mut output);
    }
    Ok(Choice {
        time,
        input: input.ok_or_else(|| unknown(Role::Input))?,
        output: output.ok_or_else(|| unknown(Role::Output))?,
        set_point: set_point.filter(|column| !taken.contains(&Some(*column))),
        time_of_day,
        status: status_of(names, &[time, input, output]),
        ignored,
        notes,
        by: chosen_by(preview, all_given, by),
    })
}

fn chosen_by(preview: &Preview, all_given: bool, by: Option<ChosenBy>) -> ChosenBy {
    match (preview.names.is_some(), by) {
        _ if all_given => ChosenBy::Caller,
        (_, Some(by)) => by,
        (true, None) => ChosenBy::Name,
        (false, None) => ChosenBy::Position,
    }
}

/// The columns that can be a signal: with numbers, neither taken, nor a set-point, nor a status.
fn free(preview: &Preview, taken: &[Option<usize>]) -> Vec<usize> {
    let is_other = |column: &usize| {
        let name = preview.names.as_ref().and_then(|names| names.get(*column));
        name.is_some_and(|name| {
            name.signal() == Some(Signal::SetPoint) || tags::status_of(&name.full).is_some()
        })
    };
    (0..preview.width)
        .filter(|column| !taken.contains(&Some(*column)) && !is_other(column))
        .filter(|&column| preview.column(column).any(f64::is_finite))
        .collect()
}

/// The only set-point that is not one of a loop.
fn only_set_point(names: &[Name]) -> Option<usize> {
    let is_one = |name: &Name| name.signal() == Some(Signal::SetPoint) && name.tag().is_none();
    let mut all = (0..names.len()).filter(|&column| is_one(&names[column]));
    all.next().filter(|_| all.next().is_none())
}

/// The columns with the status of the chosen ones: of the same name, or the next to the right.
fn status_of(names: &[Name], chosen: &[Option<usize>]) -> Vec<usize> {
    let is_status = |column: &usize| tags::status_of(&names[*column].full).is_some();
    let of = |column: usize| match tags::status_of(&names[column].full)? {
        Some(stem) => names
            .iter()
            .position(|name| key(&name.full) == key(stem) || key(&name.bare) == key(stem)),
        None => (0..column).rev().find(|column| !is_status(column)),
    };
    (0..names.len())
        .filter(|&column| of(column).is_some_and(|of| chosen.contains(&Some(of))))
        .filter(|column| !chosen.contains(&Some(*column)))
        .collect()
}

/// The columns of a table of one value a row: time, value, and the status; of groups of columns: the first time and value.
pub(super) fn choose_long(preview: &Preview) -> Result<Choice, ReadError> {
    let names = preview.names.as_deref().unwrap_or_default();
    let is_status = |column: usize| {
        names
            .get(column)
            .is_some_and(|name| tags::status_of(&name.full).is_some())
    };
    let mut notes = vec![];
    let tags: Vec<Option<usize>> = preview.tags.iter().copied().map(Some).collect();
    let (time, time_of_day) = match (preview.groups.first(), preview.split) {
        (Some(group), _) => (Some(group.time), None),
        (None, Some((date, of_day))) => (Some(date), Some(of_day)),
        (None, None) => {
            let named = named(preview, Role::Time, &tags, false);
            let named = meaning::by_dates(preview, named, &mut notes)
                .first()
                .copied();
            let first_tag = preview.tags.first().copied();
            (
                named.or_else(|| unnamed_time(preview, first_tag, None)),
                None,
            )
        }
    };
    check_clock_time(preview, time)?;
    let free = |column: &usize| {
        ![time, time_of_day].contains(&Some(*column))
            && !preview.tags.contains(column)
            && !is_status(*column)
    };
    let by_name = (0..preview.width).filter(free).find(|&column| {
        names
            .get(column)
            .is_some_and(|name| name.role() == Some(Role::Output))
    });
    let has_numbers = |column: &usize| preview.column(*column).any(f64::is_finite);
    let first = || (0..preview.width).filter(free).find(has_numbers);
    let unknown = |role| unknown(role, preview);
    let value = preview.value.or(by_name).or_else(first);
    let value = value.ok_or_else(|| unknown(Role::Output))?;
    let status = (0..preview.width).filter(|&column| is_status(column));
    Ok(Choice {
        time: Some(time.ok_or_else(|| unknown(Role::Time))?),
        input: value,
        output: value,
        set_point: None,
        time_of_day,
        status: if preview.groups.is_empty() {
            status.collect()
        } else {
            vec![]
        },
        ignored: None,
        notes,
        by: ChosenBy::Name,
    })
}

/// Refuses times of day without a date, and the reverse, in the time column, or in any column if there is no time column.
fn check_clock_time(preview: &Preview, time: Option<usize>) -> Result<(), ReadError> {
    match &preview.clock_time {
        Some((column, text)) if time.is_none_or(|time| time == *column) => {
            let (line, column) = (preview.first_line, preview.label(*column));
            Err(ReadError::ClockTime {
                line,
                column,
                text: text.clone(),
            })
        }
        _ => Ok(()),
    }
}

/// Finds the column that the caller names.
fn find(wanted: &ColumnRef, role: Role, preview: &Preview) -> Result<usize, ReadError> {
    let missing = |wanted| {
        Err(ReadError::NoSuchColumn {
            role,
            wanted,
            columns: all_labels(preview),
        })
    };
    match wanted {
        ColumnRef::Number(number) => match number.checked_sub(1) {
            Some(column) if column < preview.width => Ok(column),
            _ => missing(ColumnRef::Number(*number)),
        },
        ColumnRef::Name(wanted) => {
            let names = preview.names.as_deref().unwrap_or_default();
            let exact = |name: &Name| name.full == *wanted || name.bare == *wanted;
            let alike = |name: &Name| {
                [&name.full, &name.bare]
                    .map(|n| key(n))
                    .contains(&key(wanted))
            };
            let all = |is: &dyn Fn(&Name) -> bool| -> Vec<usize> {
                (0..names.len())
                    .filter(|&column| is(&names[column]))
                    .collect()
            };
            let found = Some(all(&exact)).filter(|found| !found.is_empty());
            let found = found.unwrap_or_else(|| all(&alike));
            match single(found, role, preview)? {
                Some(column) => Ok(column),
                None => missing(ColumnRef::Name(quoted(wanted.as_bytes()))),
            }
        }
    }
}

fn check_distinct(
    time: Option<usize>,
    input: Option<usize>,
    output: Option<usize>,
    preview: &Preview,
) -> Result<(), ReadError> {
    let pairs = [
        (time, Role::Time, input, Role::Input),
        (time, Role::Time, output, Role::Output),
        (input, Role::Input, output, Role::Output),
    ];
    for (a, first, b, second) in pairs {
        if let Some(column) = a.filter(|_| a == b) {
            let column = preview.label(column);
            return Err(ReadError::SameColumn {
                column,
                first,
                second,
            });
        }
    }
    Ok(())
}

/// Columns whose name stands for this signal and that are not chosen for another; of tags of any loop if no loop is chosen.
fn named(preview: &Preview, role: Role, given: &[Option<usize>], of_any_loop: bool) -> Vec<usize> {
    let names = preview.names.as_deref().unwrap_or_default();
    let signal = match role {
        Role::Input => Some(Signal::Input),
        Role::Output => Some(Signal::Output),
        _ => None,
    };
    let all = |is: &dyn Fn(&Name) -> bool| -> Vec<usize> {
        (0..names.len())
            .filter(|&column| is(&names[column]) && !given.contains(&Some(column)))
            .collect()
    };
    let usual = all(&|name| name.role() == Some(role));
    match (usual.is_empty(), signal) {
        (true, Some(signal)) if of_any_loop => all(&|name| name.signal() == Some(signal)),
        _ => usual,
    }
}

/// The only candidate, or `None` without candidates.
fn single(found: Vec<usize>, role: Role, preview: &Preview) -> Result<Option<usize>, ReadError> {
    match *found {
        [] => Ok(None),
        [only] => Ok(Some(only)),
        _ => {
            let candidates = found
                .into_iter()
                .map(|column| preview.label(column))
                .collect();
            Err(ReadError::AmbiguousColumn { role, candidates })
        }
    }
}

/// The column of dates, if it is free; else one that counts the rows; else the first column, if the file has no header, the column is free, and its
/// values never decrease.
fn unnamed_time(preview: &Preview, input: Option<usize>, output: Option<usize>) -> Option<usize> {
    let is_free = |column: &usize| ![input, output].contains(&Some(*column));
    if let Some(dates) = preview.date.filter(is_free) {
        return Some(dates);
    }
    if let Some(counter) =
        (0..preview.width).find(|column| is_free(column) && is_counter(preview, *column))
    {
        return Some(counter);
    }
    let free = preview.names.is_none() && input != Some(0) && output != Some(0);
    let stamps = preview.column(0).filter(|stamp| !stamp.is_nan());
    let rises = stamps.clone().is_sorted();
    let changes = preview.width > 2 || stamps.clone().min_by(f64::total_cmp) != stamps.last();
    (free && rises && changes).then_some(0)
}

/// Whether a column counts the rows: `Cycle` of a trace of CODESYS, which is a time if no other column is one.
fn is_counter(preview: &Preview, column: usize) -> bool {
    const NAMES: [&str; 5] = ["cycle", "index", "sample", "no", "nr"];
    let names = preview.names.as_deref().unwrap_or_default();
    let is_named =
        (names.get(column)).is_some_and(|name| NAMES.contains(&key(&name.bare).as_str()));
    let values = preview.column(column);
    is_named
        && values
            .clone()
            .zip(values.skip(1))
            .all(|(a, b)| b == a + 1.0)
}

fn unknown(role: Role, preview: &Preview) -> ReadError {
    let columns = all_labels(preview);
    ReadError::UnknownColumn { role, columns }
}

fn all_labels(preview: &Preview) -> Vec<ColumnLabel> {
    (0..preview.width)
        .map(|column| preview.label(column))
        .collect()
}
