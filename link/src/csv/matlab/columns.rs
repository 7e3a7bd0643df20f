//! The columns of a MAT-file that make a table: those of one length, best with a time among them.

use std::collections::HashMap;
use std::io::{self, Read, Write};

use super::arrays::ArrayColumn;

/// Names of a time, in small letters.
const TIMES: [&str; 8] = [
    "t",
    "time",
    "times",
    "tout",
    "time_s",
    "t_s",
    "timestamp",
    "timestamps",
];

/// Columns of the same length as lines of text.
#[derive(Debug)]
pub(super) struct Columns {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    /// Next row; `None` before the names.
    next: Option<usize>,
    line: Vec<u8>,
    taken: usize,
}

impl Columns {
    /// Chooses the structure, or the variables outside of any, and the length with a time and the most columns; then takes all
    /// columns of this length. Those of other structures are named `structure.field`. `None`: there are no two columns of
    /// the same length.
    pub(super) fn choose(all: Vec<ArrayColumn>) -> Option<Self> {
        let is_time = |column: &ArrayColumn| {
            let name = column.name.to_ascii_lowercase();
            TIMES.contains(&name.as_str())
        };
        let mut groups: HashMap<(&str, usize), (bool, usize)> = HashMap::new();
        for column in &all {
            let group = groups.entry((&column.path, column.values.len()));
            let (has_time, count) = group.or_default();
            *has_time |= is_time(column);
            *count += 1;
        }
        // Of equals the longest, then the first by name, so that the choice does not depend on the order of the map.
        let best = groups.into_iter().max_by(|a, b| {
            let ((a_path, a_rows), a_rank) = a;
            let ((b_path, b_rows), b_rank) = b;
            (a_rank, a_rows)
                .cmp(&(b_rank, b_rows))
                .then(b_path.cmp(a_path))
        });
        let ((path, rows), _) = best?;
        let path = path.to_owned();
        let mut found = Self {
            names: Vec::new(),
            columns: Vec::new(),
            next: None,
            line: Vec::new(),
            taken: 0,
        };
        for column in all {
            if column.values.len() != rows {
                continue;
            }
            found.names.push(match column.path == path {
                true => column.name,
                false if column.path.is_empty() => column.name,
                false => format!("{}.{}", column.path, column.name),
            });
            found.columns.push(column.values);
        }
        (found.columns.len() > 1).then_some(found)
    }

    pub(super) fn count(&self) -> usize {
        self.columns.len()
    }

    pub(super) fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Writes the next line; false at the end.
    fn advance(&mut self) -> io::Result<bool> {
        self.line.clear();
        self.taken = 0;
        let Some(row) = self.next else {
            self.next = Some(0);
            writeln!(self.line, "{}", self.names.join(","))?;
            return Ok(true);
        };
        if row >= self.rows() {
            return Ok(false);
        }
        self.next = Some(row + 1);
        for (at, column) in self.columns.iter().enumerate() {
            let separator = if at == 0 { "" } else { "," };
            match column[row] {
                value if value.is_finite() => write!(self.line, "{separator}{value:?}")?,
                _ => write!(self.line, "{separator}NaN")?,
            }
        }
        self.line.push(b'\n');
        Ok(true)
    }
}

impl Read for Columns {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.line.len() && !self.advance()? {
            return Ok(0);
        }
        let left = &self.line[self.taken..];
        let count = left.len().min(out.len());
        out[..count].copy_from_slice(&left[..count]);
        self.taken += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(path: &str, name: &str, rows: usize) -> ArrayColumn {
        ArrayColumn {
            path: path.to_owned(),
            name: name.to_owned(),
            values: (0..rows).map(|row| row as f64).collect(),
        }
    }

    fn text(all: Vec<ArrayColumn>) -> String {
        let mut text = String::new();
        let mut columns = Columns::choose(all).unwrap();
        columns.read_to_string(&mut text).unwrap();
        text
    }

    // The structure with the time counts, although another one has more columns; what has its length comes along.
    #[test]
    fn the_time_decides() {
        let all = vec![
            column("est", "a", 9),
            column("est", "b", 9),
            column("est", "c", 9),
            column("est", "d", 5),
            column("data", "time", 5),
            column("data", "u", 5),
            column("", "w", 5),
        ];
        let first = text(all).lines().next().unwrap().to_owned();
        assert_eq!(first, "est.d,time,u,w");
    }

    #[test]
    fn rows_as_text() {
        let mut y = column("", "y", 4);
        y.values[1] = f64::INFINITY;
        y.values[2] = 0.1 + 0.2;
        let text = text(vec![column("", "t", 4), y]);
        assert_eq!(
            text,
            "t,y\n0.0,0.0\n1.0,NaN\n2.0,0.30000000000000004\n3.0,3.0\n"
        );
        assert!(Columns::choose(vec![column("", "t", 4), column("", "y", 5)]).is_none());
        assert!(Columns::choose(Vec::new()).is_none());
    }
}
