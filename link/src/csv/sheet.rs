//! Files that are no text as tables of text: what the readers of JSON, TDMS and WPILOG make.

use std::io;

use super::text::Text;

/// Names of the columns of a table of one value a row.
const LONG: [&str; 3] = ["time [s]", "tag", "value"];

/// A table of text that grows row by row.
#[derive(Debug)]
pub(super) struct Sheet {
    names: Vec<String>,
    is_long: bool,
    text: Vec<u8>,
}

impl Sheet {
    /// A table of these columns; the time comes first.
    pub(super) fn wide(names: Vec<String>) -> Self {
        Self {
            names,
            is_long: false,
            text: vec![],
        }
    }

    /// A table of one value a row.
    pub(super) fn long() -> Self {
        Self {
            names: LONG.map(str::to_owned).to_vec(),
            is_long: true,
            text: vec![],
        }
    }

    /// Number of columns.
    pub(super) fn columns(&self) -> usize {
        self.names.len()
    }

    /// Whether it has no row.
    pub(super) fn is_empty(&self) -> bool {
        self.text.is_empty()
    }

    /// Adds a row; cells without a value are empty.
    pub(super) fn row<T: AsRef<str>>(&mut self, cells: impl IntoIterator<Item = T>) {
        for (at, cell) in cells.into_iter().enumerate() {
            if at > 0 {
                self.text.push(b'\t');
            }
            // A mark of a table within a name would be a cell or a line of its own.
            let plain = |&byte: &u8| {
                if matches!(byte, b'\t' | b'\n' | b'\r' | b'"') {
                    b' '
                } else {
                    byte
                }
            };
            // A line that begins with one of these is a comment.
            let is_comment = at == 0 && cell.as_ref().starts_with(['#', '%', '/', ';']);
            let quote: &[u8] = if is_comment { b"\"" } else { b"" };
            self.text.extend_from_slice(quote);
            self.text.extend(cell.as_ref().as_bytes().iter().map(plain));
            self.text.extend_from_slice(quote);
        }
        self.text.push(b'\n');
    }

    /// Adds a value of a table of one value a row.
    pub(super) fn value(&mut self, time_s: f64, name: &str, value: f64) {
        self.row([&*format!("{time_s:?}"), name, &*format!("{value:?}")]);
    }

    /// The table as text.
    pub(super) fn text<'a>(self) -> Text<'a> {
        Text {
            head: self.text,
            rest: Box::new(io::empty()),
            whole: true,
            utf16: false,
            names: Some(self.names),
            is_sparse: false,
            is_long: self.is_long,
            is_labelled: false,
        }
    }
}
