//! The fields of a line: names and values as text, the date or time of day in front of it.

use crate::csv::{date, number};

/// Name and value of each field of a line, as in the log. The time is called `time`.
pub(super) type Fields = Vec<(String, String)>;

/// A reader of lines.
pub(super) trait Lines {
    /// The fields of a line; empty if it holds no values.
    fn fields(&mut self, line: &str) -> Fields;
}

impl<F: FnMut(&str) -> Fields> Lines for F {
    fn fields(&mut self, line: &str) -> Fields {
        self(line)
    }
}

/// A field with the number in a text, if it is one.
pub(super) fn field(name: impl Into<String>, value: &str) -> Option<(String, String)> {
    let is_number = matches!(number::parse(value.as_bytes()), number::Cell::Number(..));
    is_number.then(|| (name.into(), value.to_owned()))
}

/// The date or time of day at the start of a line, as a field, and what follows: `2024-03-12 08:00:00,123 - Recv: ...`,
/// `[08:00:01.123][D]...`, `08:00:01.123 -> ...`.
pub(super) fn stamp(line: &str) -> (Option<(String, String)>, &str) {
    let start = line.trim_start_matches(['[', '<', '>', '(', ' ']);
    let is_of_stamp = |c: char| c.is_ascii_digit() || "-/.:,TZ+ ".contains(c);
    let end = start.find(|c| !is_of_stamp(c)).unwrap_or(start.len());
    let words: Vec<(usize, &str)> = (start[..end].split(' '))
        .map(|word| (word.as_ptr() as usize - start.as_ptr() as usize, word))
        .collect();
    // The longest of one or two words that is a stamp.
    for count in [2, 1] {
        let Some((at, word)) = words.get(count - 1) else {
            continue;
        };
        let length = start[..at + word.len()]
            .trim_end_matches([':', '-', ',', ' '])
            .len();
        let text = &start[..length];
        if date::parse(text.as_bytes()).is_some() || date::of_day(text.as_bytes()).is_some() {
            return (Some(("time".to_owned(), text.to_owned())), &start[length..]);
        }
    }
    (None, line)
}

/// The fields of a line as `name=value`, for tests.
#[cfg(test)]
pub(super) fn joined(fields: Fields) -> String {
    let all: Vec<String> = (fields.into_iter())
        .map(|(name, value)| format!("{name}={value}"))
        .collect();
    all.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_at_the_start_of_a_line() {
        for (line, expected, rest) in [
            (
                "2024-03-12 08:00:00,123 - Recv: T:1",
                "2024-03-12 08:00:00,123",
                " - Recv: T:1",
            ),
            ("[08:00:01.123][D]", "08:00:01.123", "][D]"),
            ("[08:00:01]: x", "08:00:01", "]: x"),
            ("08:00:01.123 -> a:1", "08:00:01.123", " -> a:1"),
            ("2024-03-12T08:00:00Z a:1", "2024-03-12T08:00:00Z", " a:1"),
        ] {
            let (stamp, after) = stamp(line);
            assert_eq!(stamp.unwrap().1, expected);
            assert_eq!(after, rest);
        }
        assert_eq!(stamp("T:1.0 /2.0").0, None);
        assert_eq!(stamp("12 08").0, None);
    }
}
