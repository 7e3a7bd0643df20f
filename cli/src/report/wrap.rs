//! Lines as wide as a terminal.

use std::fmt::Write;

use crate::output::columns;
use crate::words::as_shown;

/// Width of a report without a terminal, and the narrowest and widest one in a terminal.
const WIDTH: usize = 80;
const WIDTHS: (usize, usize) = (60, 100);

/// A blank at which no line ends.
pub(super) const TOGETHER: &str = "\u{a0}";

/// Width of reports in this terminal.
pub(super) fn width() -> usize {
    columns().map_or(WIDTH, |columns| columns.clamp(WIDTHS.0, WIDTHS.1))
}

/// Writes `words` behind `lead`, in lines as wide as the terminal, indented like the first.
pub fn wrapped(text: &mut String, lead: &str, words: &str) {
    let width = width();
    let mut line = lead.to_owned();
    let mut is_first = true;
    for word in as_shown(words).split_ascii_whitespace() {
        if !is_first && line.chars().count() + 1 + word.chars().count() > width {
            let _ = writeln!(text, "{}", line.replace(TOGETHER, " "));
            line = " ".repeat(lead.len());
            is_first = true;
        }
        if !is_first {
            line.push(' ');
        }
        line.push_str(word);
        is_first = false;
    }
    let _ = writeln!(text, "{}", line.replace(TOGETHER, " "));
}
