//! CSV reader: text tables of any dialect to recordings.
//!
//! ```text
//! bytes -> text      byte order marks, UTF-16; refuses what is not text     text.rs
//!                    arrays of MATLAB files (feature `matlab`)              matlab.rs
//! text -> lines      line endings, comments, runs of blanks                 lines.rs
//! lines -> rows      quotes, separators                                     records.rs
//! first rows         separator, header, units, which column is which        dialect.rs, preview.rs,
//!                                                                           names.rs, columns.rs
//!                                                                           tags.rs
//! rows -> samples    numbers, stamps, status; signals with their own stamps table.rs, number.rs, clock.rs, unit.rs,
//!                                                                           date.rs, weave.rs, long.rs
//! ```

mod clock;
mod columns;
mod date;
mod dialect;
mod error;
mod lines;
mod long;
#[cfg(feature = "matlab")]
mod matlab;
mod names;
mod number;
mod options;
mod preview;
mod records;
mod separator;
mod table;
mod tags;
mod text;
mod unit;
mod weave;
mod write;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use self::preview::Preview;
use self::records::Records;
use self::table::Table;
use self::text::Text;
use crate::recording::{Note, Recording};

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
/// With the feature `matlab` the bytes may be those of a MATLAB file of version 5 (`save -v7`): the columns of matrices, and the
/// fields of structures, of one length are the columns of the table. Line 1 then stands for the names, line 2 for the first row.
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
    #[cfg(feature = "matlab")]
    let (bytes, mat) = opened(bytes)?;
    let text = Text::open(bytes)?;
    let separator = dialect::detect(&text.head, text.whole)?;
    let preview = Preview::of(&text, separator)?;
    let choice = match preview.tags {
        Some(tags) => columns::choose_long(&preview, tags)?,
        None => columns::choose(&preview, options)?,
    };
    let mut table = Table::new(&preview, choice, options);
    if text.utf16 {
        table.builder.note(Note::Utf16);
    }

    #[cfg(feature = "matlab")]
    mat.into_iter().for_each(|note| table.builder.note(note));

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
    table.finish(options)
}

/// The bytes of a table of text; a MATLAB file as such, with a note about it.
#[cfg(feature = "matlab")]
fn opened<'a>(mut bytes: impl Read + 'a) -> Result<(Box<dyn Read + 'a>, Option<Note>), ReadError> {
    let mut head = Vec::new();
    (bytes.by_ref().take(matlab::MAGIC.len() as u64))
        .read_to_end(&mut head)
        .map_err(|reason| ReadError::Interrupted { line: 0, reason })?;
    let is_mat = head == matlab::MAGIC;
    let bytes = std::io::Cursor::new(head).chain(bytes);
    if !is_mat {
        return Ok((Box::new(bytes), None));
    }
    let table = matlab::read(bytes)?;
    let note = Note::MatFile {
        columns: table.columns,
        rows: table.rows,
    };
    Ok((table.text, Some(note)))
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
