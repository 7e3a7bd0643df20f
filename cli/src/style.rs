//! What looks how in the terminal: the one place that knows of colours.
//!
//! Reports carry the codes of these styles; the output takes them out where nobody sees them, in files and
//! pipes and where `NO_COLOR` is set, and then leaves the same bytes as if there had been none.

use std::fmt::Write;

use anstyle::{AnsiColor, Style};

/// What a part of a report is about.
pub(crate) const HEADING: Style = Style::new().bold();
/// What holds.
pub(crate) const HOLDS: Style = AnsiColor::Green.on_default();
/// What one should know besides.
pub(crate) const REMARK: Style = AnsiColor::Yellow.on_default();
/// What does not hold, and why nothing came of it.
pub(crate) const REFUSAL: Style = AnsiColor::Red.on_default().bold();
/// A curve of the model.
pub(crate) const FIT: Style = AnsiColor::Cyan.on_default();
/// What was measured, and the frame of a plot: as the terminal's own text.
pub(crate) const PLAIN: Style = Style::new();

/// The text in a style, each line for itself.
pub(crate) fn painted(style: Style, text: &str) -> String {
    let mut all = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        let words = line.trim_end_matches('\n');
        if words.is_empty() {
            all.push_str(line);
        } else {
            // Writing to a string cannot fail.
            let _ = write!(all, "{style}{words}{style:#}{}", &line[words.len()..]);
        }
    }
    all
}

/// That of a verdict: what holds, or not.
pub(crate) fn verdict(holds: bool, text: &str) -> String {
    painted(if holds { HOLDS } else { REFUSAL }, text)
}

/// The first word of every line that is not indented as a heading.
pub(crate) fn headed(text: &str) -> String {
    let mut all = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        let end = line.find(char::is_whitespace).unwrap_or(line.len());
        all += &painted(HEADING, &line[..end]);
        all += &line[end..];
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    // Bold is code 1, green 32, and 0 ends either: each line begins and ends its own, an empty one has none.
    #[test]
    fn lines_are_painted_one_by_one() {
        let green = "\x1b[32m";
        assert_eq!(
            painted(HOLDS, "one\n\ntwo"),
            format!("{green}one\x1b[0m\n\n{green}two\x1b[0m")
        );
        assert_eq!(painted(PLAIN, "as it is\n"), "as it is\n");
        let painted = painted(HOLDS, "one\n\ntwo");
        let bare = anstream::adapter::strip_str(&painted).to_string();
        assert_eq!(bare, "one\n\ntwo");
    }

    #[test]
    fn only_what_is_not_indented_is_a_heading() {
        assert_eq!(
            headed("Grid  5 %\n      more\n\nTime"),
            "\x1b[1mGrid\x1b[0m  5 %\n      more\n\n\x1b[1mTime\x1b[0m"
        );
    }
}
