//! Rows of a table to samples of a recording.

use std::borrow::Cow;

use ::csv::ByteRecord;

use super::clock::{self, Clock, Stamp};
use super::columns::Choice;
use super::date::{self, Fault};
use super::error::{ReadError, quoted};
use super::long::Values;
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
    /// Of a table of one value a row.
    values: Option<Values>,
}

impl<'a> Table<'a> {
    pub(super) fn new(preview: &'a Preview, choice: Choice, options: &CsvOptions) -> Self {
        let column = |column: usize| match &preview.names {
            Some(names) => names[column].column(),
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
        if preview.tags.is_none() {
            builder.note(choice.note(preview));
        }
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
        if let Some(time) = choice.time {
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
            weave: (weave && preview.tags.is_none()).then(Weave::default),
            values: preview.tags.map(|_| Values::default()),
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
        if let Some(tag) = self.preview.tags.filter(|_| self.values.is_some()) {
            let value = self.number(row, self.choice.output)?;
            if let Some(values) = self
                .values
                .as_mut()
                .filter(|_| (value + time_s).is_finite())
            {
                values.add(number::bare(&row.cells[tag]), row.line, time_s, value)?;
            }
            return Ok(());
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
            let (rows, notes) = values.rows(options)?;
            notes.into_iter().for_each(|note| self.builder.note(note));
            self.builder.mark_own_stamps();
            for row in rows {
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
        let recording = self
            .builder
            .finish()?
            .with_relay_beta(self.preview.relay_beta);
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
                quality < good && self.preview.column(*column).any(|quality| quality == best)
            }
            _ => number::is_bad(&row.cells[*column]),
        };
        let found = values.clone().find(is_word);
        let found = found.or_else(|| self.choice.status.iter().copied().find(is_status));
        found.map(|column| quoted(&row.cells[column]))
    }

    /// The set-point in a column. `None` if it is no number.
    fn set_point(&self, row: &Row<'_>, column: usize) -> Option<f64> {
        match number::parse(&self.plain(&row.cells[column])) {
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
        let Some((stamp, mark)) = clock::parse(&cell) else {
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
            Cell::Number(value, mark) => {
                self.check_mark(mark, row, column)?;
                Ok(value)
            }
            Cell::Missing | Cell::Bad => Ok(f64::NAN),
            Cell::Text => {
                let (line, column, text) = self.place(row, column);
                Err(ReadError::NotANumber { line, column, text })
            }
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
