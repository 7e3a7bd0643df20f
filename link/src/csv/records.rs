//! Splits clean lines into rows of cells with their line numbers.

use std::io::Read;

use ::csv::{ByteRecord, ErrorKind, ReaderBuilder, Terminator};

use super::error::ReadError;
use super::lines::{Lines, State};
use super::separator::Separator;

/// Buffer of the CSV splitter, in bytes.
const BUFFER_BYTES: usize = 1 << 15;

/// The rows of a text.
pub(super) struct Records<R> {
    reader: ::csv::Reader<Lines<R>>,
    record: ByteRecord,
}

/// One row.
pub(super) struct Row<'a> {
    /// Line in the file, from 1.
    pub(super) line: u64,
    /// Cells; quotes are removed, blanks are kept.
    pub(super) cells: &'a ByteRecord,
}

impl<R: Read> Records<R> {
    pub(super) fn new(text: R, separator: Separator) -> Self {
        let reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(separator.byte())
            .terminator(Terminator::Any(b'\n'))
            .buffer_capacity(BUFFER_BYTES)
            .from_reader(Lines::new(text, separator));
        Self {
            reader,
            record: ByteRecord::new(),
        }
    }

    /// The next row, or `None` at the end of the text.
    pub(super) fn next(&mut self) -> Result<Option<Row<'_>>, ReadError> {
        match self.reader.read_byte_record(&mut self.record) {
            // A clean line is one record and ends in LF, which the reader has just counted. (The
            // position of the record itself would be that of the empty lines before it.)
            Ok(true) => {
                let line = self.reader.position().line() - 1;
                Ok(Some(Row {
                    line,
                    cells: &self.record,
                }))
            }
            Ok(false) => Ok(None),
            Err(error) => Err(self.fault(error)),
        }
    }

    /// Facts about the lines read so far; the buffer makes them run ahead of the rows.
    pub(super) fn state(&mut self) -> &mut State {
        self.reader.get_mut().state()
    }

    fn fault(&mut self, error: ::csv::Error) -> ReadError {
        let line = self.reader.position().line() - 1;
        let reason = match error.into_kind() {
            ErrorKind::Io(reason) => reason,
            other => std::io::Error::other(format!("{other:?}")),
        };
        self.state()
            .fault
            .take()
            .unwrap_or(ReadError::Interrupted { line, reason })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_their_line_numbers() {
        let text = "# one\n\nt,u\r\n\"1\",2\n\n\n% six\n3,4,\n\n9";
        let mut records = Records::new(text.as_bytes(), Separator::Comma);
        let mut found = Vec::new();
        while let Some(row) = records.next().unwrap() {
            found.push((
                row.line,
                row.cells
                    .iter()
                    .map(<[u8]>::to_vec)
                    .collect::<Vec<_>>()
                    .concat(),
            ));
        }
        let expected: [(u64, &[u8]); 4] = [(3, b"tu"), (4, b"12"), (8, b"34"), (10, b"9")];
        assert_eq!(found, expected.map(|(line, cells)| (line, cells.to_vec())));
    }
}
