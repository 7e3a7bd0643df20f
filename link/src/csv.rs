//! CSV reader: text tables of any dialect to recordings.
//!
//! ```text
//! bytes -> text      byte order marks, UTF-16; refuses what is not text     text.rs
//!                    arrays of MATLAB files (feature `matlab`)              matlab.rs
//!                    logs whose lines name their values                     forms.rs
//!                    JSON, TDMS and WPILOG                                  json.rs, tdms.rs, wpilog.rs, sheet.rs
//!                    topics of MCAP (feature `mcap`)                        topics.rs
//! text -> lines      line endings, comments, runs of blanks                 lines.rs
//! lines -> rows      quotes, separators                                     records.rs
//! first rows         separator, header, units, which column is which        dialect.rs, preview.rs,
//!                                                                           names.rs, words.rs, columns.rs, shape.rs,
//!                                                                           meaning.rs, tags.rs
//! rows -> samples    numbers, stamps, status; signals with their own stamps table.rs, number.rs, clock.rs, unit.rs,
//!                                                                           date.rs, weave.rs, long.rs
//! ```

mod clock;
mod columns;
mod date;
mod dialect;
mod error;
mod forms;
mod json;
mod lines;
mod long;
#[cfg(feature = "matlab")]
mod matlab;
mod meaning;
mod names;
mod number;
mod options;
mod preview;
mod records;
mod separator;
mod shape;
mod sheet;
mod table;
mod tags;
mod tdms;
mod text;
#[cfg(feature = "mcap")]
mod topics;
mod unit;
mod weave;
mod words;
mod wpilog;
mod write;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use self::preview::Preview;
use self::records::Records;
use self::separator::Separator;
use self::sheet::Sheet;
use self::table::Table;
use self::text::Text;
use crate::recording::{Note, Recording};

pub use error::ReadError;
pub use options::{ColumnRef, CsvOptions};
pub use write::{CsvWriter, write_csv};

/// Bytes that tell the kind of a file: those of a MATLAB file.
const MAGIC_BYTES: u64 = 19;

/// Largest file that is read as a whole, in bytes.
const MOST_BYTES: usize = 1 << 28;

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
/// The bytes may also be those of a log of a printer, a thermostat or an Arduino, of JSON, TDMS, a log of WPILib or MCAP (feature `mcap`); lines are then those
/// of the log, or rows. With the feature `matlab` they may be those of a MATLAB file of version 5 (`save -v7`): the columns of matrices,
/// and the fields of structures, of one length are the columns of the table. Line 1 then stands for the names, line 2 for the first row.
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
    let (text, separator, note) = opened(bytes, options)?;
    let preview = Preview::of(&text, separator)?;
    let choice = match preview.has_own_stamps() {
        true => columns::choose_long(&preview)?,
        false => columns::choose(&preview, options)?,
    };
    let mut table = Table::new(&preview, choice, options);
    if text.utf16 {
        table.builder.note(Note::Utf16);
    }
    note.into_iter().for_each(|note| table.builder.note(note));

    let mut records = Records::new(text.head.as_slice().chain(text.rest), separator);
    while let Some(row) = records.next()? {
        if row.line < preview.first_line {
            continue;
        }
        let line = row.line;
        if let Err(fault) = table.add(&row) {
            // `EOF`, also with the separators behind it.
            let mut rest = row.cells.iter().skip(1);
            let is_word = rest.all(|cell| number::bare(cell).is_empty());
            forgive_last_line(&mut records, (line, is_word), fault)?;
            table.builder.note(Note::LastLineIncomplete { line });
        }
    }
    if let Some(line) = records.state().cut_line {
        table.builder.note(Note::LastLineIncomplete { line });
    }
    table.finish(options)
}

/// The text of a table, its separator, and what the file was before.
fn opened<'a>(
    mut bytes: impl Read + 'a,
    options: &CsvOptions,
) -> Result<(Text<'a>, Separator, Option<Note>), ReadError> {
    let unread = |reason| ReadError::Interrupted { line: 0, reason };
    let mut head = Vec::new();
    (bytes.by_ref().take(MAGIC_BYTES))
        .read_to_end(&mut head)
        .map_err(unread)?;
    #[cfg(feature = "matlab")]
    let is_mat = head == matlab::MAGIC;
    let begins = |magic| head.starts_with(magic);
    let (is_tdms, is_wpilog) = (begins(tdms::MAGIC), begins(wpilog::MAGIC));
    #[cfg(feature = "mcap")]
    let is_mcap = begins(topics::MAGIC);
    let bytes = std::io::Cursor::new(head).chain(bytes);
    #[cfg(feature = "matlab")]
    if is_mat {
        let table = matlab::read(bytes)?;
        let text = Text::open(table.text)?;
        let separator = dialect::detect(&text.head, text.whole)?;
        let (columns, rows) = (table.columns, table.rows);
        return Ok((text, separator, Some(Note::MatFile { columns, rows })));
    }
    #[cfg(feature = "mcap")]
    if is_mcap {
        let sheet = topics::read(&whole(bytes, MOST_BYTES)?, &wanted(options))?;
        return Ok(of_sheet(sheet, "an MCAP log of ROS 2"));
    }
    if is_tdms || is_wpilog {
        let file = whole(bytes, MOST_BYTES)?;
        let (sheet, format) = match is_tdms {
            true => (tdms::read(&file)?, "a TDMS file"),
            false => (wpilog::read(&file, &wanted(options))?, "a log of WPILib"),
        };
        return Ok(of_sheet(sheet, format));
    }
    let text = Text::open(bytes)?;
    if json::begins(&text.head) {
        let file = whole(text.head.as_slice().chain(text.rest), json::MOST_BYTES)?;
        let (sheet, format) = json::read(&file)?;
        return Ok(of_sheet(sheet, format));
    }
    let (text, format) = forms::table(text, options.dbc.as_deref())?;
    let separator = match format {
        Some(_) => Separator::Tab,
        None => dialect::detect(&text.head, text.whole)?,
    };
    Ok((text, separator, format))
}

/// A file of at most this many bytes.
fn whole(bytes: impl Read, most: usize) -> Result<Vec<u8>, ReadError> {
    let mut file = Vec::new();
    (bytes.take(most as u64 + 1).read_to_end(&mut file))
        .map_err(|reason| ReadError::Interrupted { line: 0, reason })?;
    match file.len() > most {
        true => Err(ReadError::TooLarge {
            limit_mb: most / 1_000_000,
        }),
        false => Ok(file),
    }
}

fn of_sheet<'a>(sheet: Sheet, format: &'static str) -> (Text<'a>, Separator, Option<Note>) {
    let columns = sheet.columns();
    let note = Note::Format {
        format: format.into(),
        columns,
    };
    (sheet.text(), Separator::Tab, Some(note))
}

/// The names of the signals, if the caller gives both.
fn wanted(options: &CsvOptions) -> Vec<&str> {
    let (input, output) = (
        name_of(&options.input_column),
        name_of(&options.output_column),
    );
    match (input, output) {
        (Some(input), Some(output)) => [input, output]
            .into_iter()
            .chain(name_of(&options.set_point_column))
            .collect(),
        _ => vec![],
    }
}

fn name_of(column: &Option<ColumnRef>) -> Option<&str> {
    match column {
        Some(ColumnRef::Name(name)) => Some(name),
        _ => None,
    }
}

/// Accepts a last line that lacks cells, holds nothing behind a word, or whose last cell was cut off.
fn forgive_last_line(
    records: &mut Records<impl Read>,
    (line, is_word): (u64, bool),
    fault: ReadError,
) -> Result<(), ReadError> {
    let is_last = records.next()?.is_none();
    let ends_open = records.state().ends_open && records.state().lines == line;
    match fault {
        ReadError::RaggedRow {
            expected, found, ..
        } if is_last && found < expected => Ok(()),
        ReadError::NotANumber { .. } if is_last && (ends_open || is_word) => Ok(()),
        _ => Err(fault),
    }
}
