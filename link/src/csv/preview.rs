//! Preview of a table: its header and its first rows.

use super::date;
use super::error::{ReadError, quoted};
use super::names::{Name, is_unit, key};
use super::number::{self, Cell};
use super::records::Records;
use super::separator::Separator;
use super::text::Text;
use crate::recording::ColumnLabel;

/// Maximum number of lines before the first row of numbers: the header and text before it.
const MOST_LEADING: usize = 100;

/// Usual names of the column of tags in a table of one value a row, as [`key`] writes them.
const TAGS: [&str; 14] = [
    "tag",
    "tagname",
    "tag_name",
    "tag_id",
    "tagid",
    "point",
    "point_name",
    "pointname",
    "item",
    "item_id",
    "signal",
    "variable",
    "name",
    "source",
];

/// Maximum number of rows kept: enough to see the relay switch.
const MOST_ROWS: usize = 50_000;

/// Header and first rows of a table.
pub(super) struct Preview {
    /// Names of the columns, `width` of them, if the file gives any.
    pub(super) names: Option<Vec<Name>>,
    /// Line of the names, if they come from a comment.
    pub(super) comment_line: Option<u64>,
    /// `beta` of the relay, if a comment states it.
    pub(super) relay_beta: Option<f64>,
    /// Number of lines of text before the header.
    pub(super) skipped: usize,
    /// Number of columns.
    pub(super) width: usize,
    /// First line of numbers.
    pub(super) first_line: u64,
    /// Column of the first cell on that line that is a date with a time of day, if any.
    pub(super) date: Option<usize>,
    /// Columns of the date and of the time of day, if they are two.
    pub(super) split: Option<(usize, usize)>,
    /// Column of the tags, in a table of one value a row.
    pub(super) tags: Option<usize>,
    /// The separator of thousands that a cell of the first rows proves.
    pub(super) thousands: Option<char>,
    /// Column and text of the first cell on that line that is another date or time of day, if any.
    pub(super) clock_time: Option<(usize, String)>,
    /// First rows, row by row; NaN where a cell is not a number.
    cells: Vec<f64>,
    /// For each column, whether all its numbers are integers.
    whole: Vec<bool>,
    /// For each column, number of empty cells.
    empty: Vec<usize>,
}

impl Preview {
    /// Reads the head of a text.
    pub(super) fn of(text: &Text<'_>, separator: Separator) -> Result<Self, ReadError> {
        let mut records = Records::new(text.head.as_slice(), separator);
        let mut leading: Vec<Leading> = Vec::new();
        // A first row that has another width than the header is refused, unless it stands in a title above it.
        let mut preview: Option<Result<Self, ReadError>> = None;
        let mut rows = 0;
        while let Some(row) = records.next()? {
            let is_data = rows > MOST_LEADING || is_data(row.cells.iter());
            if preview.is_some() {
                rows += 1;
                let knows_names = matches!(&preview, Some(Ok(preview)) if preview.knows_names());
                if !is_data && !knows_names && Leading::of(row.cells.iter()).is_header() {
                    preview = None;
                    leading.clear();
                    leading.push(Leading::of(row.cells.iter()));
                } else if let Some(Ok(preview)) = &mut preview
                    && preview.cells.len() < MOST_ROWS * preview.width
                {
                    // The end of the head may cut its last row.
                    preview.add(row.cells.iter());
                }
            } else if is_data {
                let cells: Vec<&[u8]> = row.cells.iter().collect();
                preview = Some(Self::start(row.line, &cells, &leading));
            } else if !fits(&row.cells.iter().collect::<Vec<_>>(), 0) {
                check_leading(row.line, row.cells.get(0))?;
                leading.push(Leading::of(row.cells.iter()));
                if leading.len() > MOST_LEADING {
                    break;
                }
            }
        }
        let lines = records.state().lines;
        let mut preview = preview.ok_or(ReadError::NoData { lines })??;
        preview.relay_beta = records.state().relay_beta;
        if preview.names.is_none()
            && let Some((line, comment)) = records.state().comment.take()
        {
            preview.take_comment(line, &comment, separator);
        }
        Ok(preview)
    }

    /// Starts the preview with its first row of numbers, after lines of text.
    fn start(line: u64, cells: &[&[u8]], leading: &[Leading]) -> Result<Self, ReadError> {
        let fitting = |row: &Leading| row.width() > 1 && fits(cells, row.width());
        let is_named = |row: &Leading| fitting(row) && !row.is_units();
        let header = leading
            .iter()
            .rposition(|row| is_named(row) && row.is_header())
            .or_else(|| leading.iter().rposition(is_named))
            .or_else(|| leading.iter().rposition(fitting));
        let width = match (header, leading.last()) {
            (Some(at), _) => leading[at].width(),
            (None, Some(row)) if row.width() > 1 => {
                let (expected, found) = (row.width(), cells.len());
                return Err(ReadError::RaggedRow {
                    line,
                    expected,
                    found,
                });
            }
            _ => cells.len(),
        };
        let names = header.map(|at| {
            let above = at.checked_sub(1).and_then(|above| leading.get(above));
            let mut units = leading[at + 1..].iter().chain(above);
            leading[at].names(width, units.find(|row| row.is_units()))
        });
        let skipped = header.unwrap_or(leading.len());
        if width < 2 {
            return Err(ReadError::OneColumn { line });
        }
        let mut preview = Self {
            names,
            comment_line: None,
            relay_beta: None,
            skipped,
            width,
            first_line: line,
            date: cells[..width]
                .iter()
                .position(|cell| date::parse(cell).is_some()),
            split: split(&cells[..width]),
            tags: None,
            thousands: None,
            clock_time: cells[..width]
                .iter()
                .position(|cell| number::is_clock_time(cell) && date::parse(cell).is_none())
                .map(|column| (column, quoted(cells[column]))),
            cells: Vec::new(),
            whole: vec![true; width],
            empty: vec![0; width],
        };
        preview.clock_time.take_if(|_| preview.split.is_some());
        preview.tags = preview.tag_column(&cells[..width]);
        preview.add(cells.iter().copied());
        Ok(preview)
    }

    fn add<'a>(&mut self, cells: impl Iterator<Item = &'a [u8]>) {
        let mut column = 0;
        for cell in cells.take(self.width) {
            let value = match number::parse(cell) {
                Cell::Number(value, _) => value,
                Cell::Missing | Cell::Bad | Cell::Text => f64::NAN,
            };
            self.thousands = self.thousands.or_else(|| number::thousands(cell));
            self.empty[column] += usize::from(number::bare(cell).is_empty());
            self.whole[column] &= value.is_nan() || number::parse_whole(cell).is_some();
            self.cells.push(value);
            column += 1;
        }
        self.cells.truncate(self.cells.len() - column % self.width);
    }

    /// Takes the names from a comment if it has one word for each column.
    fn take_comment(&mut self, line: u64, comment: &[u8], separator: Separator) {
        let comment = comment.trim_ascii();
        let cells: Vec<&[u8]> = match separator {
            Separator::Blanks => comment
                .split(u8::is_ascii_whitespace)
                .filter(|cell| !cell.is_empty())
                .collect(),
            _ => comment.split(|&byte| byte == separator.byte()).collect(),
        };
        if cells.len() != self.width || cells.iter().any(|cell| is_number(cell)) {
            return;
        }
        let names: Vec<Name> = cells.iter().map(|cell| Name::parse(&words(cell))).collect();
        if names.iter().any(|name| name.role().is_some()) {
            self.names = Some(names);
            self.comment_line = Some(line);
        }
    }

    /// Name and number of a column as errors and notes give them.
    pub(super) fn label(&self, column: usize) -> ColumnLabel {
        let name = self.names.as_ref().and_then(|names| names.get(column));
        ColumnLabel {
            name: name
                .filter(|name| !name.full.is_empty())
                .map(|name| quoted(name.full.as_bytes())),
            number: column + 1,
        }
    }

    /// Whether the header has two usual names of signals.
    fn knows_names(&self) -> bool {
        let names = self.names.as_deref().unwrap_or_default();
        let is_known = |name: &&Name| name.role().is_some() || name.signal().is_some();
        names.iter().filter(is_known).count() >= 2
    }

    /// Column of the tags, if the table has one value a row: text beside a time and a value.
    fn tag_column(&self, cells: &[&[u8]]) -> Option<usize> {
        let is_text = |column: &usize| {
            number::parse(cells[*column]) == Cell::Text && !is_stamp(cells[*column])
        };
        let texts: Vec<usize> = (0..self.width).filter(is_text).collect();
        match &self.names {
            Some(names) => (texts.into_iter())
                .find(|&column| TAGS.contains(&key(&names[column].bare).as_str())),
            None => (self.width <= 4 && is_stamp(cells[0])).then(|| texts.first().copied())?,
        }
    }

    /// Share of the cells of a column in the first rows that are empty.
    pub(super) fn empty_share(&self, column: usize) -> f64 {
        self.empty[column] as f64 / (self.cells.len() / self.width).max(1) as f64
    }

    /// Numbers of a column in the first rows; NaN where a cell is not a number.
    pub(super) fn column(&self, column: usize) -> impl Iterator<Item = f64> + Clone {
        self.cells.iter().skip(column).step_by(self.width).copied()
    }

    /// Whether the numbers of a column are integers.
    pub(super) fn is_whole(&self, column: usize) -> bool {
        self.whole[column]
    }
}

/// Columns of a date without a time of day and of a time of day without a date.
fn split(cells: &[&[u8]]) -> Option<(usize, usize)> {
    let joined = |date: &[u8], of_day: &[u8]| date::parse(&date::joined(date, of_day)).is_some();
    let date = cells.iter().position(|cell| joined(cell, b"00:00"))?;
    let of_day = cells.iter().position(|cell| joined(b"2000-01-01", cell))?;
    Some((date, of_day))
}

/// Whether a cell is a date, a time of day, or both.
fn is_stamp(cell: &[u8]) -> bool {
    date::parse(cell).is_some() || number::is_clock_time(cell)
}

/// Whether a row has `width` cells, not counting empty cells at its end.
pub(super) fn fits<T: AsRef<[u8]>>(cells: &[T], width: usize) -> bool {
    cells.len() >= width
        && cells[width..]
            .iter()
            .all(|cell| number::bare(cell.as_ref()).is_empty())
}

/// A line of text before the numbers.
struct Leading {
    cells: Vec<String>,
}

impl Leading {
    fn of<'a>(cells: impl Iterator<Item = &'a [u8]>) -> Self {
        Self {
            cells: cells.map(words).collect(),
        }
    }

    /// The names in the first cells, with the units of a row of units.
    fn names(&self, width: usize, units: Option<&Self>) -> Vec<Name> {
        let unit = |column| units.and_then(|units| units.cells.get(column));
        let names = self.cells.iter().take(width).map(|cell| Name::parse(cell));
        let with_units = names.enumerate().map(|(column, name)| match unit(column) {
            Some(unit) => name.with_unit(unit),
            None => name,
        });
        with_units.collect()
    }

    /// Whether two of the cells are usual names of signals or tags.
    fn is_header(&self) -> bool {
        let is_known = |cell: &&String| {
            let name = Name::parse(cell);
            name.role().is_some()
                || name.signal().is_some()
                || TAGS.contains(&key(&name.bare).as_str())
        };
        self.cells.iter().filter(is_known).count() >= 2
    }

    /// Number of cells up to the last that is not empty.
    fn width(&self) -> usize {
        self.cells
            .iter()
            .rposition(|cell| !cell.trim().is_empty())
            .map_or(0, |last| last + 1)
    }

    /// Whether it is a row of units: every cell is a unit or empty, and one is a unit.
    fn is_units(&self) -> bool {
        let mut cells = self
            .cells
            .iter()
            .filter(|cell| !cell.trim().is_empty())
            .peekable();
        cells.peek().is_some() && cells.all(|cell| is_unit(cell))
    }
}

fn words(cell: &[u8]) -> String {
    String::from_utf8_lossy(cell).into_owned()
}

fn is_number(cell: &[u8]) -> bool {
    matches!(number::parse(cell), Cell::Number(..))
}

/// Whether a row is data: it holds a number, or only words for a missing number such as NaN.
fn is_data<'a>(cells: impl Iterator<Item = &'a [u8]> + Clone) -> bool {
    let filled = cells
        .filter(|cell| !number::bare(cell).is_empty())
        .map(number::parse);
    let words = filled.clone().filter(|cell| *cell == Cell::Text).count();
    filled.clone().any(|cell| matches!(cell, Cell::Number(..)))
        || (words == 0 && filled.count() > 0)
}

/// Refuses a line that starts with a date or a time of day. Such a file may have no row that counts
/// as data, so this is found before the columns are chosen.
fn check_leading(line: u64, first: Option<&[u8]>) -> Result<(), ReadError> {
    match first {
        Some(cell) if number::is_clock_time(cell) && date::parse(cell).is_none() => {
            let column = ColumnLabel {
                name: None,
                number: 1,
            };
            let text = quoted(cell);
            Err(ReadError::ClockTime { line, column, text })
        }
        _ => Ok(()),
    }
}
