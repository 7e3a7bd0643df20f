//! Preview of a table: its header and its first rows.

use super::date;
use super::error::{ReadError, decoded, quoted};
use super::long::Activity;
use super::names::{Name, is_unit, key};
use super::number::{self, Cell};
use super::records::Records;
use super::separator::Separator;
use super::shape::{self, Group, Shape, is_stamp};
use super::tags::Signal;
use super::text::Text;
use crate::recording::{ColumnLabel, Role};
use crate::time_unit::TimeUnit;

/// Maximum number of lines before the first row of numbers: the header and text before it.
const MOST_LEADING: usize = 100;

/// Usual names of the column of tags in a table of one value a row, as [`key`] writes them.
const TAGS: [&str; 24] = [
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
    "varname",
    "entity_id",
    "entity",
    "series",
    "metric",
    "sensor",
    "channel",
    "topic",
    "field",
    "measurement_field",
];

/// Maximum number of rows kept: enough to see the relay switch.
const MOST_ROWS: usize = 50_000;

/// Maximum number of rows that show the shape of a table.
const MOST_SHAPE: usize = 5_000;

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
    /// Column of dates with a time of day, or of times of day, if any.
    pub(super) date: Option<usize>,
    /// Columns of the date and of the time of day, if they are two.
    pub(super) split: Option<(usize, usize)>,
    /// Columns of the tags, in a table of one value a row; empty in others.
    pub(super) tags: Vec<usize>,
    /// Column of the values, in a table of one value a row, if its shape tells.
    pub(super) value: Option<usize>,
    /// Groups of columns with stamps of their own; empty in other tables.
    pub(super) groups: Vec<Group>,
    /// Start and step of the time, if the column of times counts samples: the header of an oscilloscope.
    pub(super) ramp: Option<(f64, f64)>,
    /// Whether the rows are lines of labels and values, as an Arduino writes them.
    pub(super) is_labelled: bool,
    /// The separator of thousands that a cell of the first rows proves.
    pub(super) thousands: Option<char>,
    /// Column and text of the first cell on that line that is another date, if any.
    pub(super) clock_time: Option<(usize, String)>,
    /// First rows, row by row; NaN where a cell is not a number.
    cells: Vec<f64>,
    /// For each column, whether all its numbers are integers.
    whole: Vec<bool>,
    /// For each column, number of empty cells.
    empty: Vec<usize>,
    /// For each column, the unit behind its first number that has one.
    units: Vec<Option<String>>,
    shape: Shape,
}

impl Preview {
    /// Reads the head of a text.
    pub(super) fn of(text: &Text<'_>, separator: Separator) -> Result<Self, ReadError> {
        let first = shape::first_line(&text.head, separator)?;
        let mut records = Records::new(text.head.as_slice(), separator);
        let mut leading: Vec<Leading> = Vec::new();
        leading.extend(text.names.as_ref().map(|names| Leading {
            cells: names.clone(),
        }));
        // A first row that has another width than the header is refused, unless it stands in a title above it.
        let mut preview: Option<Result<Self, ReadError>> = None;
        let mut rows = 0;
        while let Some(row) = records.next()? {
            let is_data = row.line >= first && (rows > MOST_LEADING || is_data(row.cells.iter()));
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
        preview.date = preview.shape.date().filter(|_| preview.date.is_some());
        preview.is_labelled = text.is_labelled;
        preview.find_tags(text);
        Ok(preview)
    }

    /// Starts the preview with its first row of numbers, after lines of text.
    fn start(line: u64, cells: &[&[u8]], leading: &[Leading]) -> Result<Self, ReadError> {
        let ramp = (leading.iter().zip(leading.iter().skip(1)))
            .position(|(row, below)| row.ramp(below).is_some());
        let header = ramp.or_else(|| header_of(leading, cells));
        let ramp = ramp.and_then(|at| leading[at].ramp(leading.get(at + 1)?));
        let width = match (header, leading.last()) {
            (Some(at), _) => ramp.map_or(leading[at].width(), |(width, ..)| width),
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
            let is_units = |row: &&Leading| row.is_units() || row.begins_with("unit");
            let mut names = leading[at].names(width, units.find(is_units));
            if leading[at].begins_with_name() && is_number(cells[0]) {
                // Its first column holds the keys of the header, and below these the times.
                let unit = leading.iter().find_map(Leading::unit_of_time);
                names[0] = Name::parse("time").with_unit(unit.map_or("", TimeUnit::symbol));
            }
            names
        });
        let groups = header.map_or_else(Vec::new, |at| shape::groups(&leading[at].cells, width));
        let above = header.and_then(|at| leading.get(at.checked_sub(1)?));
        let names = names.map(|names| match above {
            Some(above) => shape::names_above(names, &groups, &above.cells),
            None => names,
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
            date: cells[..width].iter().position(|cell| is_time(cell)),
            split: split(&cells[..width]),
            tags: vec![],
            value: None,
            groups,
            ramp: ramp.map(|(_, start, step)| (start, step)),
            is_labelled: false,
            thousands: None,
            clock_time: cells[..width]
                .iter()
                .position(|cell| number::is_clock_time(cell) && !is_time(cell))
                .map(|column| (column, quoted(cells[column]))),
            cells: Vec::new(),
            whole: vec![true; width],
            empty: vec![0; width],
            units: vec![None; width],
            shape: Shape::default(),
        };
        preview.clock_time.take_if(|_| preview.split.is_some());
        preview.tags = preview.tag_column(&cells[..width]).into_iter().collect();
        preview.add(cells.iter().copied());
        Ok(preview)
    }

    fn add<'a>(&mut self, cells: impl Iterator<Item = &'a [u8]> + Clone) {
        let mut column = 0;
        if self.shape.rows() < MOST_SHAPE {
            self.shape.add(cells.clone().take(self.width));
        }
        for cell in cells.take(self.width) {
            let mut value = number::parse(cell);
            if value == Cell::Text
                && let Some((number, unit)) = number::with_unit(cell)
            {
                value = number::parse(number);
                self.units[column].get_or_insert_with(|| unit.to_owned());
            }
            let value = match value {
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
        let names: Vec<Name> = cells
            .iter()
            .map(|cell| Name::parse(&decoded(cell)))
            .collect();
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

    /// Tags by the shape of the first rows; none where the names of two columns tell input and output.
    fn find_tags(&mut self, text: &Text<'_>) {
        let names = self.names.as_deref().unwrap_or_default();
        let has = |role, signal| {
            let is_one = |name: &Name| name.role() == Some(role) || name.told() == Some(signal);
            names.iter().any(is_one)
        };
        let has_both = has(Role::Input, Signal::Input) && has(Role::Output, Signal::Output);
        if text.is_long {
            (self.tags, self.value) = (vec![1], Some(2));
            return;
        }
        if text.is_sparse {
            self.groups = vec![Group {
                time: 0,
                values: 1..self.width,
            }];
        }
        if !self.groups.is_empty() || has_both {
            self.tags.clear();
            return;
        }
        let is_time = |column: usize| {
            names
                .get(column)
                .is_some_and(|name| name.role() == Some(Role::Time))
        };
        if let Some((tags, value)) = self.shape.long(is_time) {
            (self.tags, self.value) = (tags, Some(value));
        }
    }

    /// Whether the table has one value a row, or groups of columns with stamps of their own.
    pub(super) fn has_own_stamps(&self) -> bool {
        !self.tags.is_empty() || !self.groups.is_empty()
    }

    /// Whether a column may hold the words of a two-valued signal: its first number is one, or it has the values of many tags.
    pub(super) fn has_switches(&self, column: usize) -> bool {
        self.has_own_stamps() || self.shape.begins_with_switch(column)
    }

    /// The unit that stands behind the numbers of a column.
    pub(super) fn unit(&self, column: usize) -> Option<&str> {
        self.units[column].as_deref()
    }

    /// What a signal does in the first rows.
    pub(super) fn activity(&self, column: usize) -> Activity {
        Activity::of(self.column(column).filter(|value| !value.is_nan()))
    }

    /// Numbers of a column in the rows of [`Self::length_s`].
    pub(super) fn shape_column(&self, column: usize) -> impl Iterator<Item = f64> + Clone {
        self.column(column).take(self.shape.rows())
    }

    /// Time between the first and the last date of a column in the first rows (s).
    pub(super) fn length_s(&self, column: usize) -> Option<f64> {
        self.shape.length_s(column)
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

/// The row of names among lines of text above the first numbers.
fn header_of(leading: &[Leading], cells: &[&[u8]]) -> Option<usize> {
    let fitting = |row: &Leading| row.width() > 1 && fits(cells, row.width());
    let is_named = |row: &Leading| fitting(row) && !row.is_units();
    let last =
        |is: &dyn Fn(&Leading) -> bool| leading.iter().rposition(|row| is_named(row) && is(row));
    let has_key = |word| last(&move |row: &Leading| row.begins_with(word));
    (has_key("name").or_else(|| has_key("symbolname")))
        .or_else(|| last(&Leading::is_header))
        .or_else(|| last(&|_| true))
        .or_else(|| leading.iter().rposition(fitting))
}

/// Columns of a date without a time of day and of a time of day without a date.
fn split(cells: &[&[u8]]) -> Option<(usize, usize)> {
    let joined = |date: &[u8], of_day: &[u8]| date::parse(&date::joined(date, of_day)).is_some();
    let date = cells.iter().position(|cell| joined(cell, b"00:00"))?;
    let of_day = cells.iter().position(|cell| joined(b"2000-01-01", cell))?;
    Some((date, of_day))
}

/// Whether a cell is a date with a time of day, or a time of day.
fn is_time(cell: &[u8]) -> bool {
    date::parse(cell).is_some() || date::of_day(cell).is_some()
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
            cells: cells.map(decoded).collect(),
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

    /// Whether two of the cells are different usual names of signals or tags.
    fn is_header(&self) -> bool {
        let is_known = |cell: &&String| {
            let name = Name::parse(cell);
            name.role().is_some()
                || name.signal().is_some()
                || TAGS.contains(&key(&name.bare).as_str())
        };
        let mut known = self.cells.iter().filter(is_known);
        let first = known.next();
        known.any(|cell| Some(cell) != first)
    }

    fn begins_with(&self, word: &str) -> bool {
        (self.cells.first()).is_some_and(|cell| cell.trim().eq_ignore_ascii_case(word))
    }

    /// Whether the row holds the names of a header with a key in its first column.
    fn begins_with_name(&self) -> bool {
        self.begins_with("name") || self.begins_with("symbolname")
    }

    /// The unit of time in brackets in the first cell: `SampleTime[ms]`.
    fn unit_of_time(&self) -> Option<TimeUnit> {
        TimeUnit::from_name(&Name::parse(self.cells.first()?).unit?)
    }

    /// `X,CH1,Start,Increment` over `Sequence,Volt,-1e-3,2e-6`: the number of columns before the start, start and step of
    /// the time.
    fn ramp(&self, below: &Self) -> Option<(usize, f64, f64)> {
        let is = |wanted: &str| {
            let mut cells = self.cells.iter();
            cells.position(|cell| cell.trim().eq_ignore_ascii_case(wanted))
        };
        let (start, step) = (is("start")?, is("increment")?);
        let value = |at: usize| match number::parse(below.cells.get(at)?.as_bytes()) {
            Cell::Number(value, _) => Some(value),
            _ => None,
        };
        (start > 1 && step > start).then_some((start, value(start)?, value(step)?))
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

fn is_number(cell: &[u8]) -> bool {
    matches!(number::parse(cell), Cell::Number(..))
}

/// Whether a row is data: it holds a number, also one with its unit behind a time, or only words for a missing number such as NaN.
fn is_data<'a>(cells: impl Iterator<Item = &'a [u8]> + Clone) -> bool {
    let filled = cells.filter(|cell| !number::bare(cell).is_empty());
    // A line of dashes, which underlines a header, is no row of missing numbers.
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || !byte.is_ascii();
    let is_missing = |cell: &[u8]| {
        cell.iter().any(is_word) && matches!(number::parse(cell), Cell::Missing | Cell::Bad)
    };
    let is_duration =
        |cell| number::with_unit(cell).is_some_and(|(_, unit)| TimeUnit::from_name(unit).is_some());
    let begins_with_time =
        (filled.clone().next()).is_some_and(|cell| is_time(cell) || is_duration(cell));
    filled.clone().any(is_number)
        || (begins_with_time && filled.clone().any(|cell| number::with_unit(cell).is_some()))
        || (filled.clone().next().is_some() && filled.clone().all(is_missing))
}

/// Refuses a line that starts with a date or a time of day. Such a file may have no row that counts
/// as data, so this is found before the columns are chosen.
fn check_leading(line: u64, first: Option<&[u8]>) -> Result<(), ReadError> {
    match first {
        Some(cell) if number::is_clock_time(cell) && !is_time(cell) => {
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
