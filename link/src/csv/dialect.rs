//! Detects the separator of the columns.
//!
//! The first lines are split by each separator in turn. The separator with the largest fraction of
//! numbers and dates among its cells wins; of equals, the first of tab, semicolon, bar, comma, blanks.

use std::io::Read;

use super::date;
use super::error::ReadError;
use super::number::{self, Cell};
use super::records::Records;
use super::separator::Separator;

/// Maximum number of bytes and of rows that are split.
const LOOK_BYTES: usize = 1 << 16;
const LOOK_ROWS: usize = 200;

/// Detects the separator from the head of a text; `whole` if `head` is the entire text.
pub(super) fn detect(head: &[u8], whole: bool) -> Result<Separator, ReadError> {
    let look = &head[..head.len().min(LOOK_BYTES)];
    let complete = look
        .iter()
        .rposition(|&byte| byte == b'\n' || byte == b'\r');
    let look = match complete {
        Some(end) if !whole || look.len() < head.len() => &look[..=end],
        _ => look,
    };
    let mut best = (Separator::Comma, Score::default());
    for separator in Separator::ALL {
        let score = Score::of(look, separator)?;
        if score.beats(&best.1) {
            best = (separator, score);
        }
    }
    Ok(best.0)
}

/// How well a separator splits the first lines.
#[derive(Debug, Clone, Copy, Default)]
struct Score {
    /// Number of cells that are numbers or dates, in rows of at least two cells.
    numbers: usize,
    /// Number of cells that are not empty.
    cells: usize,
    /// Number of rows of at least two cells.
    rows: usize,
}

impl Score {
    fn of(text: impl Read, separator: Separator) -> Result<Self, ReadError> {
        let mut score = Self::default();
        let mut records = Records::new(text, separator);
        for _ in 0..LOOK_ROWS {
            let Some(row) = records.next()? else { break };
            // A signal with a sample time of its own leaves cells empty.
            score.cells += row
                .cells
                .iter()
                .filter(|cell| !number::bare(cell).is_empty())
                .count();
            if row.cells.len() > 1 {
                let is_number = |cell: &&[u8]| match number::parse(cell) {
                    Cell::Number(..) => true,
                    Cell::Text => {
                        date::parse(cell).is_some()
                            || date::of_day(cell).is_some()
                            || number::with_unit(cell).is_some()
                    }
                    Cell::Missing | Cell::Bad => false,
                };
                score.numbers += row.cells.iter().filter(is_number).count();
                score.rows += 1;
            }
        }
        Ok(score)
    }

    /// Whether the fraction of numbers is larger; without any numbers, whether more rows are split.
    fn beats(&self, other: &Self) -> bool {
        let ours = self.numbers as u128 * other.cells.max(1) as u128;
        let theirs = other.numbers as u128 * self.cells.max(1) as u128;
        ours > theirs || (self.numbers == 0 && other.numbers == 0 && self.rows > other.rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn separator_of(text: &str) -> Separator {
        detect(text.as_bytes(), true).unwrap()
    }

    #[test]
    fn the_plain_separators() {
        assert_eq!(separator_of("t,y,u\n0,1,2\n1,2,3\n"), Separator::Comma);
        assert_eq!(separator_of("t;y;u\n0;1;2\n"), Separator::Semicolon);
        assert_eq!(separator_of("t\ty\tu\n0\t1\t2\n"), Separator::Tab);
        assert_eq!(separator_of("t|y|u\n0|1|2\n"), Separator::Bar);
        assert_eq!(separator_of("t y u\n0  1   2\n"), Separator::Blanks);
    }

    #[test]
    fn decimal_commas_do_not_separate() {
        assert_eq!(
            separator_of("0,001;1,5;2,5\n0,002;1,5;2,5\n"),
            Separator::Semicolon
        );
        assert_eq!(separator_of("0,001\t1,5\t2,5\n"), Separator::Tab);
        assert_eq!(separator_of("0,001  1,5  2,5\n"), Separator::Blanks);
        assert_eq!(
            separator_of("\"0,001\",\"1,5\",\"2,5\"\n"),
            Separator::Comma
        );
    }

    #[test]
    fn blanks_beside_a_separator_do_not_count() {
        assert_eq!(
            separator_of("time (s), pv, u\n0.1, 1, 2\n"),
            Separator::Comma
        );
        assert_eq!(separator_of("1 ,2 ,3\n4 ,5 ,6\n"), Separator::Comma);
        assert_eq!(separator_of("0.1,\t2.5,\t3\n"), Separator::Comma);
    }

    #[test]
    fn a_row_cut_by_the_head_does_not_count() {
        let head = "0;1\n0,5";
        assert_eq!(
            detect(head.as_bytes(), false).unwrap(),
            Separator::Semicolon
        );
    }
}
