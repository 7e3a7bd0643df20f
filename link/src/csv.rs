//! CSV reader: text tables of any dialect to recordings.
//!
//! ```text
//! bytes -> text      byte order marks, UTF-16; refuses what is not text     text.rs
//! text -> lines      line endings, comments, runs of blanks                 lines.rs
//! lines -> rows      quotes, separators                                     records.rs
//! first rows         separator, header, units, which column is which        dialect.rs, preview.rs,
//!                                                                           names.rs, columns.rs
//! rows -> samples    numbers, stamps                                        number.rs, clock.rs, unit.rs, date.rs
//! ```

mod clock;
mod columns;
mod date;
mod dialect;
mod error;
mod lines;
mod names;
mod number;
mod options;
mod preview;
mod records;
mod separator;
mod text;
mod unit;
mod write;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use ::csv::ByteRecord;

use self::clock::{Clock, Stamp};
use self::columns::Choice;
use self::date::Fault;
use self::error::quoted;
use self::number::{Cell, Mark};
use self::preview::Preview;
use self::records::{Records, Row};
use self::text::Text;
use crate::recording::{
    Column, ColumnLabel, Columns, Note, Position, Recording, RecordingBuilder, RecordingError,
};
use crate::time_unit::TimeUnit;

pub use error::ReadError;
pub use options::{ColumnRef, CsvOptions};
pub use write::{CsvWriter, write_csv};

/// Range of sample rates that a caller may give, in hertz.
pub const SAMPLE_RATES_HZ: std::ops::RangeInclusive<f64> = 1e-6..=1e9;

/// Reads a recording from a file.
///
/// # Errors
/// [`ReadError`] says why the file does not make a recording, and where.
pub fn read(path: impl AsRef<Path>, options: &CsvOptions) -> Result<Recording, ReadError> {
    let path = path.as_ref();
    let unopened = |reason| ReadError::Open {
        path: path.to_owned(),
        reason,
    };
    let file = File::open(path).map_err(unopened)?;
    match read_from(file, options) {
        // On Unix a folder can be opened but not read.
        Err(ReadError::Interrupted { line: 0, reason }) => Err(unopened(reason)),
        result => result,
    }
}

/// Reads a recording from bytes, in one pass and in bounded memory. `bytes` need not be buffered.
///
/// # Errors
/// As [`read`].
pub fn read_from(bytes: impl Read, options: &CsvOptions) -> Result<Recording, ReadError> {
    if let Some(rate_hz) = options
        .sample_rate_hz
        .filter(|rate| !SAMPLE_RATES_HZ.contains(rate))
    {
        return Err(ReadError::BadSampleRate { rate_hz });
    }
    let text = Text::open(bytes)?;
    let separator = dialect::detect(&text.head, text.whole)?;
    let preview = Preview::of(&text, separator)?;
    let choice = columns::choose(&preview, options)?;
    let mut table = Table::new(&preview, choice, options);
    if text.utf16 {
        table.builder.note(Note::Utf16);
    }

    let mut records = Records::new(text.head.as_slice().chain(text.rest), separator);
    while let Some(row) = records.next()? {
        if row.line < preview.first_line {
            continue;
        }
        let line = row.line;
        if let Err(fault) = table.add(&row) {
            forgive_last_line(&mut records, line, fault)?;
            table.builder.note(Note::LastLineIncomplete { line });
        }
    }
    if let Some(line) = records.state().cut_line {
        table.builder.note(Note::LastLineIncomplete { line });
    }
    let recording = table.builder.finish()?.with_relay_beta(preview.relay_beta);
    match table.doubt {
        Some(doubt) => Err(doubt),
        None => Ok(recording),
    }
}

/// Accepts a last line that lacks cells, or whose last cell was cut off.
fn forgive_last_line(
    records: &mut Records<impl Read>,
    line: u64,
    fault: ReadError,
) -> Result<(), ReadError> {
    let is_last = records.next()?.is_none();
    let ends_open = records.state().ends_open && records.state().lines == line;
    match fault {
        ReadError::RaggedRow {
            expected, found, ..
        } if is_last && found < expected => Ok(()),
        ReadError::NotANumber { .. } if is_last && ends_open => Ok(()),
        _ => Err(fault),
    }
}

/// Turns rows into samples.
struct Table<'a> {
    preview: &'a Preview,
    choice: Choice,
    builder: RecordingBuilder,
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
}

impl<'a> Table<'a> {
    fn new(preview: &'a Preview, choice: Choice, options: &CsvOptions) -> Self {
        let column = |column: usize| match &preview.names {
            Some(names) => names[column].column(),
            None => Column::named(&preview.label(column).to_string()),
        };
        let mut builder = RecordingBuilder::new(Columns::new(
            choice.time.map_or_else(|| Column::named("row"), column),
            column(choice.input),
            column(choice.output),
        ))
        .with_max_points(options.max_points);

        builder.note(choice.note(preview));
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
        Self {
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
    fn add(&mut self, row: &Row<'_>) -> Result<(), ReadError> {
        let width = self.preview.width;
        if row.cells.len() != width && !fits(row.cells, width) {
            let (line, found) = (row.line, row.cells.len());
            return Err(ReadError::RaggedRow {
                line,
                expected: width,
                found,
            });
        }
        let input = self.number(row, self.choice.input)?;
        let output = self.number(row, self.choice.output)?;
        let (stamp, time_s) = match self.choice.time {
            Some(column) => self.time(row, column)?,
            None => (Stamp::Whole(0), self.rows as f64 / self.sample_rate_hz),
        };
        self.rows += 1;
        match self
            .builder
            .push(Position::Line(row.line), time_s, input, output)
        {
            Ok(()) => {}
            Err(RecordingError::TimeGoesBack { .. }) => {
                let (before, after) = (self.last_stamp.to_string(), stamp.to_string());
                return Err(ReadError::TimeGoesBack {
                    line: row.line,
                    before,
                    after,
                });
            }
            Err(error) => return Err(error.into()),
        }
        if (time_s + input + output).is_finite() {
            self.last_stamp = stamp;
        }
        Ok(())
    }

    /// The time stamp in a column, as in the file and in seconds.
    fn time(&mut self, row: &Row<'_>, column: usize) -> Result<(Stamp, f64), ReadError> {
        let cell = &row.cells[column];
        let Some((stamp, mark)) = clock::parse(cell) else {
            let (line, column) = (row.line, self.preview.label(column));
            let text = quoted(cell);
            return Err(match number::is_clock_time(cell) {
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
        match number::parse(&row.cells[column]) {
            Cell::Number(value, mark) => {
                self.check_mark(mark, row, column)?;
                Ok(value)
            }
            Cell::Missing => Ok(f64::NAN),
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
