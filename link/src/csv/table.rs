//! Rows of a table to samples of a recording.

use std::borrow::Cow;

use ::csv::ByteRecord;

use super::clock::{self, Clock, Stamp};
use super::columns::Choice;
use super::date::{self, Fault};
use super::error::{ReadError, quoted};
use super::long::Values;
use super::names::key;
use super::number::{self, Cell, Mark};
use super::options::CsvOptions;
use super::preview::Preview;
use super::records::Row;
use super::unit;
use super::weave::{Weave, Woven};
use crate::recording::{
    Column, ColumnLabel, Columns, Note, Position, Recording, RecordingBuilder, RecordingError,
};
use crate::time_unit::TimeUnit;

/// Share of empty cells from which a signal is taken to have stamps of its own.
const SPARSE: f64 = 0.01;

/// Least good quality of OPC, and the value that a column of such qualities must hold: good.
const OPC_GOOD: (f64, f64) = (64.0, 192.0);

/// Turns rows into samples.
pub(super) struct Table<'a> {
    preview: &'a Preview,
    choice: Choice,
    pub(super) builder: RecordingBuilder,
    clock: Clock,
    /// Why the unit of time is not known, if it is not.
    doubt: Option<ReadError>,
    sample_rate_hz: f64,
    /// Number of rows so far.
    rows: u64,
    /// The last time stamp as in the file, for an error that says time goes back.
    last_stamp: Stamp,
    /// The decimal mark of the file: point or comma.
    mark: Mark,
    /// Of a table whose signals have stamps of their own.
    weave: Option<Weave>,
    /// Of a table of one value a row, or of groups of columns.
    values: Option<Values>,
    /// Whether units stand behind the numbers of a column.
    has_units: bool,
}

impl<'a> Table<'a> {
    pub(super) fn new(preview: &'a Preview, choice: Choice, options: &CsvOptions) -> Self {
        let column = |column: usize| match &preview.names {
            Some(names) => {
                let name = names[column].clone();
                name.with_unit(preview.unit(column).unwrap_or_default())
                    .column()
            }
            None => Column::named(&preview.label(column).to_string()),
        };
        let mut columns = Columns::new(
            choice.time.map_or_else(|| Column::named("row"), column),
            column(choice.input),
            column(choice.output),
        );
        if let Some(set_point) = choice.set_point {
            columns = columns.with_set_point(column(set_point));
        }
        let mut builder = RecordingBuilder::new(columns).with_max_points(options.max_points);
        let has_own_stamps = preview.has_own_stamps();
        if !has_own_stamps {
            builder.note(choice.note(preview));
        }
        (choice.notes.iter().cloned()).for_each(|note| builder.note(note));
        if let Some(column) = choice.set_point {
            let column = preview.label(column);
            builder.note(Note::SetPoint { column });
        }
        if let Some(line) = preview.comment_line {
            builder.note(Note::HeaderInComment { line });
        }
        if preview.skipped > 0 {
            builder.note(Note::LinesSkipped {
                count: preview.skipped,
            });
        }
        let (mut unit, mut doubt) = (TimeUnit::Seconds, None);
        if let Some(time) = choice.time.filter(|_| preview.ramp.is_none()) {
            let found = unit::find(preview, time, options.time_unit);
            (unit, doubt) = (found.unit, found.doubt);
            found.note.into_iter().for_each(|note| builder.note(note));
        }
        let sample_rate_hz = options.sample_rate_hz.unwrap_or(1.0);
        if let Some(time) = choice.ignored {
            let column = preview.label(time);
            builder.note(Note::TimeIgnored {
                column,
                sample_rate_hz,
            });
        }
        let is_sparse = |column| preview.empty_share(column) > SPARSE;
        let weave = is_sparse(choice.input) || is_sparse(choice.output);
        Self {
            weave: (weave && !has_own_stamps).then(Weave::default),
            values: has_own_stamps.then(Values::default),
            has_units: (0..preview.width).any(|column| preview.unit(column).is_some()),
            preview,
            choice,
            builder,
            clock: Clock::new(unit),
            doubt,
            sample_rate_hz,
            rows: 0,
            last_stamp: Stamp::Whole(0),
            mark: Mark::None,
        }
    }

    /// Adds a row.
    pub(super) fn add(&mut self, row: &Row<'_>) -> Result<(), ReadError> {
        let width = self.preview.width;
        if row.cells.len() != width && !fits(row.cells, width) {
            let (line, found) = (row.line, row.cells.len());
            return Err(ReadError::RaggedRow {
                line,
                expected: width,
                found,
            });
        }
        if !self.preview.groups.is_empty() {
            return self.add_groups(row);
        }
        let (stamp, time_s) = match self.choice.time {
            Some(column) => self.time(row, column)?,
            None => (Stamp::Whole(0), self.rows as f64 / self.sample_rate_hz),
        };
        self.rows += 1;
        let at = Position::Line(row.line);
        if let Some(fault) = self.fault(row) {
            self.builder.leave_out(at, &fault);
            return Ok(());
        }
        if self.values.is_some() {
            let value = self.number(row, self.choice.output)?;
            let tags = self
                .preview
                .tags
                .iter()
                .map(|&tag| number::bare(&row.cells[tag]));
            return self.add_value(
                &tags.collect::<Vec<_>>().join(&b'.'),
                row.line,
                time_s,
                value,
            );
        }
        let input = self.number(row, self.choice.input)?;
        let output = self.number(row, self.choice.output)?;
        let set_point = match self.choice.set_point {
            Some(column) => self.set_point(row, column),
            None => None,
        };
        let Some(weave) = self.weave.as_mut().filter(|_| time_s.is_finite()) else {
            return self.push(at, (stamp, time_s), [input, output], set_point);
        };
        if let Some(set_point) = set_point {
            weave.set_point(set_point);
        }
        if input.is_finite() {
            weave.input(time_s, input);
        }
        match output
            .is_finite()
            .then(|| weave.output(row.line, time_s, output))
        {
            Some(Some(woven)) => self.push_woven(&woven, stamp),
            _ => Ok(()),
        }
    }

    /// Adds the values of groups of columns, each with the time of its group.
    fn add_groups(&mut self, row: &Row<'_>) -> Result<(), ReadError> {
        let preview = self.preview;
        for group in &preview.groups {
            let (_, time_s) = self.time(row, group.time)?;
            for column in group.values.clone() {
                let value = self.number(row, column)?;
                let name = preview
                    .names
                    .as_ref()
                    .map(|names| names[column].full.clone());
                let name = name.unwrap_or_else(|| (column + 1).to_string());
                self.add_value(name.as_bytes(), row.line, time_s, value)?;
            }
        }
        Ok(())
    }

    fn add_value(
        &mut self,
        tag: &[u8],
        line: u64,
        time_s: f64,
        value: f64,
    ) -> Result<(), ReadError> {
        let is_sample = (value + time_s).is_finite();
        match self.values.as_mut().filter(|_| is_sample) {
            Some(values) => values.add(tag, line, time_s, value),
            None => Ok(()),
        }
    }

    fn push_woven(&mut self, row: &Woven, stamp: Stamp) -> Result<(), ReadError> {
        let at = Position::Line(row.line);
        self.push(
            at,
            (stamp, row.time_s),
            [row.input, row.output],
            row.set_point,
        )
    }

    fn push(
        &mut self,
        at: Position,
        (stamp, time_s): (Stamp, f64),
        [input, output]: [f64; 2],
        set_point: Option<f64>,
    ) -> Result<(), ReadError> {
        match self
            .builder
            .push_with(at, time_s, [input, output], set_point)
        {
            Err(RecordingError::TimeGoesBack {
                at: Position::Line(line),
                ..
            }) => {
                let (before, after) = (self.last_stamp.to_string(), stamp.to_string());
                Err(ReadError::TimeGoesBack {
                    line,
                    before,
                    after,
                })
            }
            Err(error) => Err(error.into()),
            Ok(()) => {
                if (time_s + input + output).is_finite() {
                    self.last_stamp = stamp;
                }
                Ok(())
            }
        }
    }

    /// The recording.
    pub(super) fn finish(mut self, options: &CsvOptions) -> Result<Recording, ReadError> {
        if let Some(values) = self.values.take() {
            let of = values.rows(options)?;
            of.notes
                .into_iter()
                .for_each(|note| self.builder.note(note));
            self.builder.mark_own_stamps();
            // A unit behind the numbers is that of all tags.
            let unit = self.preview.unit(self.choice.output).unwrap_or_default();
            let signals = [Some(of.input), Some(of.output), of.set_point];
            let [input, output, set_point] =
                signals.map(|name| Some(name?.with_unit(unit).column()));
            if let (Some(input), Some(output)) = (input, output) {
                self.builder.name_signals(input, output, set_point);
            }
            for row in of.rows {
                self.push_woven(&row, Stamp::Real(row.time_s))?;
            }
        }
        if let Some(mut weave) = self.weave.take() {
            self.builder.mark_own_stamps();
            if let Some(last) = weave.finish() {
                self.push_woven(&last, Stamp::Real(last.time_s))?;
            }
            self.builder.note(Note::Woven {
                inputs: weave.inputs,
                outputs: weave.outputs,
            });
        }
        let recording = match self.builder.finish() {
            Err(error @ RecordingError::TooShort { .. }) => {
                // A column without a number is the better reason.
                let mut chosen = [self.choice.input, self.choice.output]
                    .into_iter()
                    .filter(|_| !self.preview.has_own_stamps());
                let empty = chosen.find(|column| !self.preview.column(*column).any(f64::is_finite));
                return Err(match empty {
                    Some(column) => ReadError::NoNumber {
                        column: self.preview.label(column),
                    },
                    None => error.into(),
                });
            }
            finished => finished?.with_relay_beta(self.preview.relay_beta),
        };
        match self.doubt {
            Some(doubt) => Err(doubt),
            None => Ok(recording),
        }
    }

    /// Why the sample of a row is bad: its status, or words in place of a value.
    fn fault(&self, row: &Row<'_>) -> Option<String> {
        let values = [self.choice.input, self.choice.output].into_iter();
        let is_word = |column: &usize| number::parse(&row.cells[*column]) == Cell::Bad;
        let is_status = |column: &usize| match number::parse(&row.cells[*column]) {
            Cell::Number(quality, _) => {
                let (good, best) = OPC_GOOD;
                let has = |best| self.preview.column(*column).any(|quality| quality == best);
                (quality < good && has(best))
                    || (quality == 0.0 && has(1.0) && self.is_validity(*column))
            }
            _ => number::is_bad(&row.cells[*column]),
        };
        let found = values.clone().find(is_word);
        let found = found.or_else(|| self.choice.status.iter().copied().find(is_status));
        found.map(|column| quoted(&row.cells[column]))
    }

    /// Whether a status is 1 where a sample is valid, by its name.
    fn is_validity(&self, column: usize) -> bool {
        let name = self
            .preview
            .names
            .as_ref()
            .and_then(|names| names.get(column));
        name.is_some_and(|name| key(&name.bare).starts_with("valid"))
    }

    /// The set-point in a column. `None` if it is no number.
    fn set_point(&self, row: &Row<'_>, column: usize) -> Option<f64> {
        let cell = self.plain(&row.cells[column]);
        match number::parse(number::with_unit(&cell).map_or(&cell, |(number, _)| number)) {
            Cell::Number(value, _) => Some(value),
            _ => None,
        }
    }

    /// A cell without separators of thousands, if the file has any.
    fn plain<'c>(&self, cell: &'c [u8]) -> Cow<'c, [u8]> {
        let known = self.preview.thousands;
        known
            .and_then(|mark| number::ungrouped(cell, Some(mark)))
            .map_or(Cow::Borrowed(cell), Cow::Owned)
    }

    /// The time stamp in a column, as in the file and in seconds.
    fn time(&mut self, row: &Row<'_>, column: usize) -> Result<(Stamp, f64), ReadError> {
        let cell = match self.choice.time_of_day {
            Some(of_day) => Cow::Owned(date::joined(&row.cells[column], &row.cells[of_day])),
            None => self.plain(&row.cells[column]),
        };
        if let Some((start, step)) = self.preview.ramp {
            let count = self.number(row, column)?;
            let time_s = start + step * count;
            return Ok((Stamp::Real(time_s), time_s));
        }
        // `0.5 s`, as dashboards write it.
        let in_unit = || {
            let (number, unit) = number::with_unit(&cell)?;
            clock::parse(number).filter(|_| self.preview.unit(column) == Some(unit))
        };
        let Some((stamp, mark)) = clock::parse(&cell).or_else(in_unit) else {
            let (line, column) = (row.line, self.preview.label(column));
            let text = quoted(&cell);
            return Err(match number::is_clock_time(&cell) {
                true => ReadError::ClockTime { line, column, text },
                false => ReadError::NotANumber { line, column, text },
            });
        };
        self.check_mark(mark, row, column)?;
        let missing = matches!(stamp, Stamp::Real(stamp) if stamp.is_nan());
        if !missing && let Some(note) = self.clock.start(stamp) {
            self.builder.note(note);
        }
        let time_s = self.clock.seconds(stamp).map_err(|fault| {
            let (line, column, text) = self.place(row, column);
            match fault {
                Fault::NoSuchDay => ReadError::ClockTime { line, column, text },
                Fault::AmongNumbers => ReadError::NotANumber { line, column, text },
                Fault::EitherOrder => ReadError::AmbiguousDate { line, column, text },
            }
        })?;
        Ok((stamp, time_s))
    }

    /// The number in a column; NaN if it is missing.
    fn number(&mut self, row: &Row<'_>, column: usize) -> Result<f64, ReadError> {
        match number::parse(&self.plain(&row.cells[column])) {
            Cell::Number(value, Mark::Word) if self.preview.has_switches(column) => Ok(value),
            Cell::Number(_, Mark::Word) => {
                let (line, column, text) = self.place(row, column);
                Err(ReadError::NotANumber { line, column, text })
            }
            Cell::Number(value, mark) => {
                self.check_mark(mark, row, column)?;
                if self.has_units && value != 0.0 && self.preview.unit(column).is_some() {
                    let (line, column, text) = self.place(row, column);
                    return Err(ReadError::MixedUnits { line, column, text });
                }
                Ok(value)
            }
            Cell::Missing | Cell::Bad => Ok(f64::NAN),
            Cell::Text => self.number_with_unit(row, column),
        }
    }

    /// The number in a cell such as `79.9 C`. All cells of the column must have this unit, or a dashboard has scaled some.
    fn number_with_unit(&mut self, row: &Row<'_>, column: usize) -> Result<f64, ReadError> {
        let (line, label, text) = self.place(row, column);
        let not_a_number = ReadError::NotANumber {
            line,
            column: label.clone(),
            text: text.clone(),
        };
        let (number, unit) = number::with_unit(&row.cells[column]).ok_or(not_a_number)?;
        if self.preview.unit(column) != Some(unit) {
            return Err(ReadError::MixedUnits {
                line,
                column: label,
                text,
            });
        }
        match number::parse(number) {
            Cell::Number(value, mark) => {
                self.check_mark(mark, row, column)?;
                Ok(value)
            }
            _ => Ok(f64::NAN),
        }
    }

    /// Refuses a file with both decimal points and decimal commas: one of them separates thousands.
    fn check_mark(&mut self, mark: Mark, row: &Row<'_>, column: usize) -> Result<(), ReadError> {
        if mark == Mark::None || mark == self.mark {
            return Ok(());
        }
        if self.mark == Mark::None {
            self.mark = mark;
            return Ok(());
        }
        let (line, column, text) = self.place(row, column);
        Err(ReadError::MixedDecimals { line, column, text })
    }

    /// Line, column and cell as an error names them.
    fn place(&self, row: &Row<'_>, column: usize) -> (u64, ColumnLabel, String) {
        (
            row.line,
            self.preview.label(column),
            quoted(&row.cells[column]),
        )
    }
}

/// Whether a row has `width` cells, not counting empty cells at its end.
fn fits(cells: &ByteRecord, width: usize) -> bool {
    cells.len() > width
        && cells
            .iter()
            .skip(width)
            .all(|cell| number::bare(cell).is_empty())
}
