//! MATLAB MAT-files of version 5 (`save -v6` and `-v7`; GNU Octave and SciPy write them too) as tables.
//!
//! ```text
//! bytes -> elements    tags, sizes, padding, byte order, compression      elements.rs
//! elements -> arrays   numbers of a variable, of a matrix by columns,     arrays.rs
//!                      of a structure by fields
//! arrays -> table      columns of the same length as lines of text        columns.rs
//! ```
//!
//! The rules for names, tags, units and bad samples are those of tables of text: the columns pass through the same reader.
//! Reference: MathWorks, "MAT-File Format" (version 5), chapter 1.

mod arrays;
mod columns;
mod elements;

use std::io::Read;

use self::arrays::Arrays;
use self::columns::Columns;
use self::elements::Elements;
use crate::csv::error::ReadError;

/// How a file of version 5 begins.
pub(crate) const MAGIC: &[u8] = b"MATLAB 5.0 MAT-file";

/// Largest file, in bytes.
const MOST_BYTES: u64 = 1 << 28;

/// Bytes before the first variable.
const HEAD_BYTES: usize = 128;

/// The file as lines of text, with the number of its columns and rows.
pub(crate) struct MatTable {
    /// Names, then one line for each row.
    pub(crate) text: Box<dyn Read>,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
}

/// Reads a file whose first bytes are those of version 5. What follows after damage is lost.
///
/// # Errors
/// The file cannot be read, is too large, or holds no numbers of the same length.
pub(crate) fn read(bytes: impl Read) -> Result<MatTable, ReadError> {
    let mut file = Vec::new();
    bytes
        .take(MOST_BYTES + 1)
        .read_to_end(&mut file)
        .map_err(|reason| ReadError::Interrupted { line: 0, reason })?;
    if file.len() as u64 > MOST_BYTES {
        return Err(ReadError::MatTooLarge);
    }
    let mut arrays = Arrays::default();
    // The two last bytes of the head are `IM` if the least significant byte of a number comes first.
    let is_big_endian = file.get(HEAD_BYTES - 2) == Some(&b'M');
    let variables = file.get(HEAD_BYTES..).unwrap_or_default();
    arrays.read(Elements::new(variables, is_big_endian))?;
    let found = arrays.names();
    let columns = Columns::choose(arrays.columns).ok_or(ReadError::MatNoTable { found })?;
    Ok(MatTable {
        columns: columns.count(),
        rows: columns.rows(),
        text: Box::new(columns),
    })
}
