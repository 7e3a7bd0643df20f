//! Lines as wide as a terminal.

use std::fmt::Write;

use crate::words::as_shown;

/// Widest line of remarks, as terminals are.
const WIDTH: usize = 96;

/// Writes `words` behind `lead`, in lines as wide as a terminal, indented like the first.
pub fn wrapped(text: &mut String, lead: &str, words: &str) {
    wrapped_to(text, lead, words, WIDTH);
}

/// As [`wrapped`], in lines of `width`.
pub(super) fn wrapped_to(text: &mut String, lead: &str, words: &str, width: usize) {
    let mut line = lead.to_owned();
    let mut is_first = true;
    for word in as_shown(words).split_ascii_whitespace() {
        if !is_first && line.chars().count() + 1 + word.chars().count() > width {
            let _ = writeln!(text, "{line}");
            line = " ".repeat(lead.len());
            is_first = true;
        }
        if !is_first {
            line.push(' ');
        }
        line.push_str(word);
        is_first = false;
    }
    let _ = writeln!(text, "{line}");
}
