//! Tables of one value a row: time, tag, value. Their rows may be in any order.

use std::collections::HashMap;

use super::error::{ReadError, decoded, quoted};
use super::names::{Name, key};
use super::options::{ColumnRef, CsvOptions};
use super::tags::Signal;
use super::weave::{Weave, Woven};
use crate::recording::{Note, Role};

/// Most values that are kept: 2^22, of 24 bytes each.
const MOST_VALUES: usize = 1 << 22;
/// Most tags of which values are kept.
const MOST_TAGS: usize = 1 << 12;

/// Values of tags.
#[derive(Debug, Default)]
pub(super) struct Values {
    index_of: HashMap<Vec<u8>, usize>,
    tags: Vec<Tagged>,
    count: usize,
}

#[derive(Debug)]
struct Tagged {
    name: String,
    values: Vec<(f64, f64, u64)>,
}

/// The rows of a loop, and what they are.
pub(super) struct Rows {
    pub(super) rows: Vec<Woven>,
    pub(super) notes: Vec<Note>,
    pub(super) input: Name,
    pub(super) output: Name,
    pub(super) set_point: Option<Name>,
}

/// The tags of the signals of a loop.
#[derive(Debug, Clone, Copy)]
struct Chosen {
    input: usize,
    output: usize,
    set_point: Option<usize>,
}

impl Values {
    pub(super) fn add(
        &mut self,
        tag: &[u8],
        line: u64,
        time_s: f64,
        value: f64,
    ) -> Result<(), ReadError> {
        let index = match self.index_of.get(tag) {
            Some(&index) => index,
            None => {
                self.index_of.insert(tag.to_vec(), self.tags.len());
                self.tags.push(Tagged {
                    name: decoded(tag),
                    values: vec![],
                });
                self.tags.len() - 1
            }
        };
        self.count += 1;
        if self.count > MOST_VALUES || self.tags.len() > MOST_TAGS {
            return Err(ReadError::TooManyValues { limit: MOST_VALUES });
        }
        self.tags[index].values.push((time_s, value, line));
        Ok(())
    }

    /// The rows of the chosen loop in order of time, and what was chosen.
    pub(super) fn rows(mut self, options: &CsvOptions) -> Result<Rows, ReadError> {
        let chosen = self.choose(options)?;
        let times = |tag: usize| self.tags[tag].values.iter().map(|value| value.0);
        let is_shared = times(chosen.input).eq(times(chosen.output));
        let mut events: Vec<(f64, u8, f64, u64)> = Vec::new();
        // At one time the input comes before the output.
        let signals = [
            (Some(chosen.input), 0),
            (chosen.set_point, 1),
            (Some(chosen.output), 2),
        ];
        for (tag, order) in signals {
            let Some(tag) = tag else { continue };
            let values = std::mem::take(&mut self.tags[tag].values);
            events.extend(
                values
                    .into_iter()
                    .map(|(time_s, value, line)| (time_s, order, value, line)),
            );
        }
        events.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut weave = Weave::default();
        let mut rows = vec![];
        for (time_s, order, value, line) in events {
            match order {
                0 => weave.input(time_s, value),
                1 => weave.set_point(value),
                _ => rows.extend(weave.output(line, time_s, value)),
            }
        }
        rows.extend(weave.finish());
        let name = |tag: usize| quoted(self.tags[tag].name.as_bytes());
        let mut notes = vec![Note::TagsChosen {
            input: name(chosen.input),
            output: name(chosen.output),
            set_point: chosen.set_point.map(name),
        }];
        if !is_shared {
            notes.push(Note::Woven {
                inputs: weave.inputs,
                outputs: weave.outputs,
            });
        }
        let name = |tag: usize| Name::parse(&self.tags[tag].name);
        Ok(Rows {
            rows,
            notes,
            input: name(chosen.input),
            output: name(chosen.output),
            set_point: chosen.set_point.map(name),
        })
    }

    fn choose(&self, options: &CsvOptions) -> Result<Chosen, ReadError> {
        let names: Vec<Name> = self.tags.iter().map(|tag| Name::parse(&tag.name)).collect();
        let given = |wanted: &Option<ColumnRef>, role| match wanted {
            Some(ColumnRef::Name(wanted)) => (names.iter())
                .position(|name| name.full == *wanted)
                .or_else(|| names.iter().position(|name| key(&name.full) == key(wanted)))
                .or_else(|| names.iter().position(|name| key(&name.bare) == key(wanted)))
                .map(Some)
                .ok_or_else(|| self.unknown(role)),
            // Tags have no numbers.
            Some(ColumnRef::Number(_)) => Err(self.unknown(role)),
            None => Ok(None),
        };
        let input = given(&options.input_column, Role::Input)?;
        let output = given(&options.output_column, Role::Output)?;
        let set_point = given(&options.set_point_column, Role::Output)?;
        let activity =
            |tag: usize| Activity::of(self.tags[tag].values.iter().map(|(_, value, _)| *value));
        let found = Loop::choose(&names, [input, output], options, &activity)?;
        let free = |tag: &usize| ![input, output, set_point].contains(&Some(*tag));
        let only = |is: &dyn Fn(usize) -> bool| {
            let mut all = (0..names.len()).filter(free).filter(|tag| is(*tag));
            all.next().filter(|_| all.next().is_none())
        };
        let single = |signal| {
            only(&|tag| names[tag].signal() == Some(signal))
                .or_else(|| only(&|tag| names[tag].told() == Some(signal)))
        };
        let of = |given: Option<usize>, signal| {
            let of_loop = || found.as_ref().and_then(|of| of.of(signal));
            given.or_else(of_loop).or_else(|| single(signal))
        };
        let set_point = of(set_point, Signal::SetPoint);
        let (input, output) = (of(input, Signal::Input), of(output, Signal::Output));
        // If one signal and one tag are left, they belong together.
        let left = |known: Option<usize>| {
            let is_left = |tag: usize| Some(tag) != known && Some(tag) != set_point;
            let is_told = |tag: usize| names[tag].told().is_some();
            known
                .and_then(|_| only(&is_left))
                .filter(|tag| !is_told(*tag))
        };
        let (input, output) = (
            input.or_else(|| left(output)),
            output.or_else(|| left(input)),
        );
        if let (Some(input), Some(output), None) = (input, output, options.input_column.as_ref())
            && names[input].may_be_crossed(&names[output])
        {
            return Err(self.unknown(Role::Input));
        }
        Ok(Chosen {
            input: input.ok_or_else(|| self.unknown(Role::Input))?,
            output: output.ok_or_else(|| self.unknown(Role::Output))?,
            set_point,
        })
    }

    fn unknown(&self, role: Role) -> ReadError {
        ReadError::UnknownTag {
            role,
            tags: self
                .tags
                .iter()
                .map(|tag| quoted(tag.name.as_bytes()))
                .collect(),
        }
    }
}

/// What a signal does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Activity {
    /// It is zero all the time.
    Off,
    /// It is not zero, and does not change.
    On,
    /// It changes.
    Moves,
}

impl Activity {
    pub(super) fn of(mut values: impl Iterator<Item = f64>) -> Self {
        match values.next() {
            Some(first) if values.any(|value| value != first) => Self::Moves,
            Some(first) if first != 0.0 => Self::On,
            _ => Self::Off,
        }
    }
}

/// The columns, or tags, of a control loop.
#[derive(Debug, Clone)]
pub(super) struct Loop {
    pub(super) name: String,
    signals: [Option<usize>; 3],
}

impl Loop {
    pub(super) fn of(&self, signal: Signal) -> Option<usize> {
        self.signals[signal as usize]
    }

    /// All loops, in the order of the names.
    fn all(names: &[Name]) -> Vec<Self> {
        let mut all: Vec<Self> = vec![];
        for (column, name) in names.iter().enumerate() {
            let Some(tag) = name.tag() else { continue };
            let is_same = |of: &&mut Self| of.name.eq_ignore_ascii_case(&tag.control_loop);
            let at = match all.iter_mut().find(is_same) {
                Some(found) => found,
                None => {
                    all.push(Self {
                        name: tag.control_loop,
                        signals: [None; 3],
                    });
                    let last = all.len() - 1;
                    &mut all[last]
                }
            };
            at.signals[tag.signal as usize].get_or_insert(column);
        }
        // `PID_1.Input` beside `PID_1.Output` is what the controller measures.
        for (column, name) in names.iter().enumerate() {
            let is_crossed = |of: &&mut Self| {
                (of.of(Signal::Input)).is_some_and(|output| names[output].is_pair(name))
            };
            if let Some(of) = all.iter_mut().find(is_crossed) {
                of.signals[Signal::Output as usize].get_or_insert(column);
            }
        }
        all
    }

    /// The loop that the caller names, or else the only one with input and output, or of several the only one whose input
    /// moves or is on. `None` if no name tells a loop.
    pub(super) fn choose(
        names: &[Name],
        [input, output]: [Option<usize>; 2],
        options: &CsvOptions,
        activity: &dyn Fn(usize) -> Activity,
    ) -> Result<Option<Self>, ReadError> {
        let all = Self::all(names);
        let is_complete =
            |of: &Self| of.of(Signal::Input).is_some() && of.of(Signal::Output).is_some();
        let named = |loops: &[Self]| loops.iter().map(|of| quoted(of.name.as_bytes())).collect();
        if let Some(wanted) = &options.control_loop {
            let found = all
                .iter()
                .find(|of| of.name.eq_ignore_ascii_case(wanted.trim()));
            return match found {
                Some(found) => Ok(Some(found.clone())),
                None => Err(ReadError::NoSuchLoop {
                    wanted: quoted(wanted.as_bytes()),
                    loops: named(&all),
                }),
            };
        }
        let has =
            |of: &Self, signal, given: Option<usize>| given.is_none() || of.of(signal) == given;
        let fits = |of: &Self| has(of, Signal::Input, input) && has(of, Signal::Output, output);
        let complete: Vec<Self> = all
            .into_iter()
            .filter(|of| is_complete(of) && fits(of))
            .collect();
        let is_plain = |role| names.iter().any(|name| name.role() == Some(role));
        match complete.as_slice() {
            [only] => Ok(Some(only.clone())),
            [] => Ok(None),
            _ if input.is_some() && output.is_some() => Ok(None),
            _ if is_plain(Role::Input) && is_plain(Role::Output) => Ok(None),
            loops => {
                // The only one whose input moves; else the only one that is on.
                let only = |least| {
                    let is = |of: &&Self| of.of(Signal::Input).map(activity) >= Some(least);
                    let mut found = loops.iter().filter(is);
                    found.next().filter(|_| found.next().is_none())
                };
                let found = only(Activity::Moves).or_else(|| only(Activity::On));
                found
                    .map(|found| Some(found.clone()))
                    .ok_or_else(|| ReadError::SeveralLoops {
                        loops: named(loops),
                    })
            }
        }
    }
}
