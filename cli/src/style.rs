//! Styles of the text reports.
//!
//! Reports contain the escape codes of these styles. The output removes them in files and pipes and if `NO_COLOR` is set.

use std::fmt::Write;

use anstream::adapter::strip_str;
use anstyle::{AnsiColor, Style};

/// Headings.
pub const HEADING: Style = Style::new().bold();
/// Positive results.
pub const HOLDS: Style = AnsiColor::Green.on_default();
/// Remarks.
pub const REMARK: Style = AnsiColor::Yellow.on_default();
/// Negative results and errors.
pub const REFUSAL: Style = AnsiColor::Red.on_default().bold();
/// Measured points and frames of plots: the default text style of the terminal.
pub const PLAIN: Style = Style::new();

/// The text in a style, applied line by line.
pub fn painted(style: Style, text: &str) -> String {
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

/// The text without styles.
pub fn plain(text: &str) -> String {
    strip_str(text).to_string()
}

/// The text in the style of a positive or a negative result.
pub fn verdict(holds: bool, text: &str) -> String {
    painted(if holds { HOLDS } else { REFUSAL }, text)
}

/// The text with the first word of each line that is not indented as a heading.
pub fn headed(text: &str) -> String {
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

    // Code 1 is bold, 32 green, 0 ends both. Each line has its own codes, an empty line has none.
    #[test]
    fn lines_are_painted_one_by_one() {
        let green = "\x1b[32m";
        assert_eq!(
            painted(HOLDS, "one\n\ntwo"),
            format!("{green}one\x1b[0m\n\n{green}two\x1b[0m")
        );
        assert_eq!(painted(PLAIN, "as it is\n"), "as it is\n");
        let painted = painted(HOLDS, "one\n\ntwo");
        assert_eq!(plain(&painted), "one\n\ntwo");
    }

    #[test]
    fn only_what_is_not_indented_is_a_heading() {
        assert_eq!(
            headed("Grid  5 %\n      more\n\nTime"),
            "\x1b[1mGrid\x1b[0m  5 %\n      more\n\n\x1b[1mTime\x1b[0m"
        );
    }
}
