//! The shape of a table: where its numbers begin, which columns hold tags, which groups of columns have stamps of their own.
//!
//! ```text
//! Model,MSO24                    the first cell is a word: header of an instrument, whatever numbers stand behind it
//! Sample Interval,2e-05,2e-05
//! TIME,CH1,CH2
//! -1.0e-02,-0.008,0.0            from here on the first cell is a number
//!
//! heater;12.03.2024 08:00:00;30  one value a row: words that repeat, one column of stamps, one of numbers that change
//! temp;12.03.2024 08:00:00;80
//!
//! Name  fOut  Name  fTemp        a word that repeats in the header: from there to the next, columns of one time
//! 0     30    0     80
//!
//! fOut         fTemp             the same with titles above
//! Time  Value  Time  Value
//! 0     30     0     80
//! ```

use std::collections::HashSet;
use std::ops::Range;

use super::date::{self, Calendar};
use super::error::ReadError;
use super::names::Name;
use super::number::{self, Cell, Mark};
use super::records::Records;
use super::separator::Separator;

/// Most lines of an instrument before its numbers, and rows after them that are looked at.
const MOST_LINES: usize = 300;
/// Rows of numbers for each row of words among them, as an `EOF` at the end.
const MOST_WORDS_AFTER: usize = 10;
/// Most different words of a column of tags.
const MOST_WORDS: usize = 256;

/// First line of the numbers, if text begins every line before: the header of an instrument. 0 if there is no such header.
pub(super) fn first_line(head: &[u8], separator: Separator) -> Result<u64, ReadError> {
    let mut records = Records::new(head, separator);
    let (mut first, mut numbers, mut words) = (0, 0, 0);
    for _ in 0..MOST_LINES {
        let Some(row) = records.next()? else { break };
        let mut filled = row
            .cells
            .iter()
            .filter(|cell| !number::bare(cell).is_empty());
        let Some(cell) = filled.next() else { continue };
        let is_word = number::parse(cell) == Cell::Text && !is_stamp(cell);
        match (is_word, numbers > 0) {
            (true, false) => first = row.line + 1,
            (true, true) => words += 1,
            (false, _) => numbers += 1,
        }
    }
    // Words after numbers: a last line, or no header of this shape.
    Ok(if numbers > MOST_WORDS_AFTER * words {
        first
    } else {
        0
    })
}

/// Whether a cell is a date, a time of day, or both.
pub(super) fn is_stamp(cell: &[u8]) -> bool {
    date::parse(cell).is_some() || number::is_clock_time(cell)
}

/// A column of times and the columns of values that belong to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Group {
    pub(super) time: usize,
    pub(super) values: Range<usize>,
}

/// The groups of columns that a header shows by a first word that repeats; `width` is that of the numbers.
pub(super) fn groups(header: &[String], width: usize) -> Vec<Group> {
    let Some(word) = header.first().filter(|word| !word.trim().is_empty()) else {
        return vec![];
    };
    let starts: Vec<usize> = (0..header.len().min(width))
        .filter(|&at| header[at].trim() == word.trim())
        .collect();
    let ends = starts.iter().skip(1).copied().chain([width]);
    let groups: Vec<Group> = (starts.iter().zip(ends))
        .map(|(&time, end)| Group {
            time,
            values: time + 1..end,
        })
        .collect();
    let is_whole = groups.iter().all(|group| !group.values.is_empty());
    if groups.len() > 1 && is_whole {
        groups
    } else {
        vec![]
    }
}

/// The names of columns; where those of groups are alike (`Time;Value;Time;Value`), from the row of titles above them.
pub(super) fn names_above(mut names: Vec<Name>, groups: &[Group], above: &[String]) -> Vec<Name> {
    let title = |group: &Group| {
        let cells = above.get(group.time..group.values.end.min(above.len()))?;
        cells
            .iter()
            .map(|cell| cell.trim())
            .find(|cell| !cell.is_empty())
    };
    let one = |group: &Group| (group.values.len() == 1).then_some(group.values.start);
    let values: Option<Vec<usize>> = groups.iter().map(one).collect();
    let titles: Option<Vec<&str>> = groups.iter().map(title).collect();
    let (Some(values), Some(titles)) = (values, titles) else {
        return names;
    };
    let are_alike = values
        .windows(2)
        .all(|pair| names[pair[0]].full == names[pair[1]].full);
    for (column, title) in values.into_iter().zip(titles).filter(|_| are_alike) {
        names[column] =
            Name::parse(title).with_unit(names[column].unit.as_deref().unwrap_or_default());
    }
    names
}

/// What the cells of each column are, in the first rows.
#[derive(Debug, Default)]
pub(super) struct Shape {
    columns: Vec<Cells>,
    rows: usize,
}

#[derive(Debug, Default, Clone)]
struct Cells {
    numbers: usize,
    dates: usize,
    texts: usize,
    words: HashSet<Vec<u8>>,
    first: Option<Vec<u8>>,
    last: Vec<u8>,
    /// Whether all cells are alike.
    changes: bool,
    /// The last number, and whether a number was smaller than the one before.
    before: Option<f64>,
    falls: bool,
}

impl Shape {
    pub(super) fn add<'a>(&mut self, cells: impl Iterator<Item = &'a [u8]>) {
        self.rows += 1;
        for (column, cell) in cells.enumerate() {
            if self.columns.len() == column {
                self.columns.push(Cells::default());
            }
            self.columns[column].add(number::bare(cell));
        }
    }

    /// Number of rows that were added.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// The columns of dates; those first that change.
    fn dates(&self) -> Vec<usize> {
        let is_date = |column: &usize| self.columns[*column].dates > 0;
        let mut dates: Vec<usize> = (0..self.columns.len()).filter(is_date).collect();
        dates.sort_by_key(|&column| !self.columns[column].changes);
        dates
    }

    /// Whether the first cell of a column is a word of a two-valued signal.
    pub(super) fn begins_with_switch(&self, column: usize) -> bool {
        let first = self
            .columns
            .get(column)
            .and_then(|cells| cells.first.as_ref());
        first.is_some_and(|first| matches!(number::parse(first), Cell::Number(_, Mark::Word)))
    }

    /// The first column of dates that change, or else of dates.
    pub(super) fn date(&self) -> Option<usize> {
        self.dates().first().copied()
    }

    /// Time from the first to the last date of a column, in seconds.
    pub(super) fn length_s(&self, column: usize) -> Option<f64> {
        let cells = self.columns.get(column)?;
        let mut calendar = Calendar::new(date::parse(cells.first.as_ref()?)?);
        let since_ns = calendar.since_first_ns(&date::parse(&cells.last)?);
        since_ns.ok().map(|ns| ns as f64 / 1e9)
    }

    /// The columns of the tags and the column of the values, if the table has the shape of one value a row.
    pub(super) fn long(&self, is_time: impl Fn(usize) -> bool) -> Option<(Vec<usize>, usize)> {
        let half = self.rows.div_ceil(2);
        let is_tag = |column: &usize| {
            let cells = &self.columns[*column];
            let words = cells.words.len();
            cells.numbers == 0
                && cells.dates == 0
                && cells.texts > half
                && words <= half.min(MOST_WORDS)
        };
        let is_value = |column: &usize| {
            let cells = &self.columns[*column];
            cells.numbers >= half && cells.changes && cells.falls && !is_time(*column)
        };
        let all = 0..self.columns.len();
        let tags: Vec<usize> = (all.clone().filter(is_tag))
            .filter(|&column| self.columns[column].words.len() > 1)
            .collect();
        let values: Vec<usize> = all.clone().filter(is_value).collect();
        let has_time = !self.dates().is_empty() || all.clone().any(is_time);
        match values.as_slice() {
            [value] if has_time && !tags.is_empty() => Some((tags, *value)),
            _ => None,
        }
    }
}

impl Cells {
    fn add(&mut self, cell: &[u8]) {
        if cell.is_empty() {
            return;
        }
        match number::parse(cell) {
            Cell::Number(value, _) => {
                self.numbers += 1;
                self.falls |= self.before.is_some_and(|before| value < before);
                self.before = Some(value);
            }
            Cell::Text if is_stamp(cell) => self.dates += 1,
            Cell::Text => {
                self.texts += 1;
                if self.words.len() <= MOST_WORDS {
                    self.words.insert(cell.to_vec());
                }
            }
            Cell::Missing | Cell::Bad => {}
        }
        match &self.first {
            Some(first) => self.changes |= first != cell,
            None => self.first = Some(cell.to_vec()),
        }
        self.last.clear();
        self.last.extend_from_slice(cell);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first_line_of(text: &str) -> u64 {
        first_line(text.as_bytes(), Separator::Comma).unwrap()
    }

    #[test]
    fn the_header_of_an_instrument_ends_where_the_first_cell_is_a_number() {
        assert_eq!(
            first_line_of("Model,X1\n\nInterval,2e-5,2e-5\nt,a,b\n0,1,2\n1,2,3\n"),
            5
        );
        assert_eq!(first_line_of("t,u\n0,1\n"), 2);
        assert_eq!(first_line_of("0,1\n1,2\n"), 0);
        // Tags, a title behind the numbers, words only.
        assert_eq!(first_line_of("tag,1,2\ntag,2,2\n"), 0);
        assert_eq!(first_line_of("t,u\n0,1\nend,of,it\n"), 0);
        assert_eq!(first_line_of("a,b\nc,d\n"), 0);
    }

    #[test]
    fn groups_of_columns() {
        let header = |text: &str| text.split(',').map(str::to_owned).collect::<Vec<_>>();
        let group = |time, end| Group {
            time,
            values: time + 1..end,
        };
        assert_eq!(
            groups(&header("Name,a,b,Name,c"), 5),
            [group(0, 3), group(3, 5)]
        );
        assert_eq!(groups(&header("Name,a,b"), 3), []);
        assert_eq!(groups(&header("Volt,Volt"), 2), []);
        assert_eq!(groups(&header(",a,,b"), 4), []);
    }
}
