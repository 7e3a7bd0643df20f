//! Cleans the lines of a text, so that the record reader can take them unchanged.
//!
//! Each line of the file becomes one line that ends in LF, so line numbers stay correct. Comments
//! and blank lines become empty lines. Where blanks separate columns, each run of blanks becomes
//! one blank. Quotes are kept and must be closed on their line: otherwise one missing quote would
//! make the rest of the file a single cell.

use std::io::{self, Read};

use super::error::ReadError;
use super::separator::Separator;

/// Number of bytes read at a time.
const PIECE_BYTES: u64 = 1 << 15;

/// Longest line accepted, in bytes: a row of ten thousand short cells.
const LONGEST_LINE: usize = 1 << 16;

/// A reader of clean lines.
pub(super) struct Lines<R> {
    text: R,
    separator: Separator,
    /// Bytes read and not yet cleaned: part of one line.
    raw: Vec<u8>,
    /// Clean lines; the first `sent` bytes have been handed out.
    clean: Vec<u8>,
    sent: usize,
    state: State,
}

/// Facts about the lines read so far.
#[derive(Default)]
pub(super) struct State {
    /// Number of lines read.
    pub(super) lines: u64,
    /// The last comment before the table, without its mark, and its line.
    pub(super) comment: Option<(u64, Vec<u8>)>,
    /// `beta` of the relay, if a comment before the table states it.
    pub(super) relay_beta: Option<f64>,
    /// Whether the text ended without a line ending.
    pub(super) ends_open: bool,
    /// Number of the last line, if it was dropped because it ends within quotes.
    pub(super) cut_line: Option<u64>,
    /// Why reading stopped, unless the operating system stopped it.
    pub(super) fault: Option<ReadError>,
    preface_over: bool,
    after_cr: bool,
    ended: bool,
}

impl<R: Read> Lines<R> {
    pub(super) fn new(text: R, separator: Separator) -> Self {
        let (raw, clean) = (Vec::new(), Vec::new());
        Self {
            text,
            separator,
            raw,
            clean,
            sent: 0,
            state: State::default(),
        }
    }

    pub(super) fn state(&mut self) -> &mut State {
        &mut self.state
    }

    /// Reads the next bytes and cleans the lines that they complete.
    fn refill(&mut self) -> io::Result<()> {
        self.clean.clear();
        self.sent = 0;
        let mut raw = std::mem::take(&mut self.raw);
        let searched = raw.len();
        let count = self.text.by_ref().take(PIECE_BYTES).read_to_end(&mut raw)?;
        self.state.ended = count == 0;

        let mut start = 0;
        let mut from = searched;
        while let Some(length) = raw[from..]
            .iter()
            .position(|&byte| byte == b'\n' || byte == b'\r')
        {
            let end = from + length;
            let second_half = self.state.after_cr && start == end && raw[end] == b'\n';
            self.state.after_cr = raw[end] == b'\r';
            if !second_half {
                self.finish_line(&raw[start..end])?;
            }
            start = end + 1;
            from = start;
        }
        self.state.after_cr &= start == raw.len();
        if self.state.ended && start < raw.len() {
            self.state.ends_open = true;
            self.finish_line(&raw[start..])?;
            start = raw.len();
        }
        raw.drain(..start);
        if raw.len() > LONGEST_LINE {
            let line = self.state.lines + 1;
            return self.fail(ReadError::LineTooLong {
                line,
                limit: LONGEST_LINE,
            });
        }
        self.raw = raw;
        Ok(())
    }

    /// Cleans one line.
    fn finish_line(&mut self, line: &[u8]) -> io::Result<()> {
        self.state.lines += 1;
        let number = self.state.lines;
        if line.contains(&0) {
            return self.fail(ReadError::NulByte { line: number });
        }
        let text = line.trim_ascii_start();
        if let Some(comment) = self.comment(text) {
            if !self.state.preface_over {
                self.state.relay_beta = relay_beta(comment).or(self.state.relay_beta);
                self.state.comment = Some((number, comment.to_vec()));
            }
        } else if !matches!(text, [] | [0x1a, ..]) {
            self.state.preface_over = true;
            if line.contains(&b'"') && line.iter().filter(|&&byte| byte == b'"').count() % 2 == 1 {
                if !self.state.ends_open {
                    return self.fail(ReadError::UnclosedQuote { line: number });
                }
                self.state.cut_line = Some(number);
            } else if self.separator == Separator::Blanks {
                for word in text
                    .split(u8::is_ascii_whitespace)
                    .filter(|word| !word.is_empty())
                {
                    self.clean.extend_from_slice(word);
                    self.clean.push(b' ');
                }
                self.clean.pop();
            } else {
                self.clean.extend_from_slice(line);
            }
        }
        self.clean.push(b'\n');
        Ok(())
    }

    /// The text of a comment line without its mark.
    fn comment<'a>(&self, text: &'a [u8]) -> Option<&'a [u8]> {
        match text {
            [b'/', b'/', comment @ ..] | [b'#' | b'%', comment @ ..] => Some(comment),
            [b';', comment @ ..] if self.separator != Separator::Semicolon => Some(comment),
            _ => None,
        }
    }

    fn fail(&mut self, fault: ReadError) -> io::Result<()> {
        let message = fault.to_string();
        self.state.fault = Some(fault);
        Err(io::Error::other(message))
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.sent == self.clean.len() && !self.state.ended {
            self.refill()?;
        }
        let count = out.len().min(self.clean.len() - self.sent);
        out[..count].copy_from_slice(&self.clean[self.sent..self.sent + count]);
        self.sent += count;
        Ok(count)
    }
}

/// Number after the word `beta` in a comment, if it can be that of a relay.
fn relay_beta(comment: &[u8]) -> Option<f64> {
    let text = String::from_utf8_lossy(comment).to_ascii_lowercase();
    let mut words = text
        .split([' ', '\t', ',', ';', '=', ':'])
        .filter(|word| !word.is_empty());
    words.find(|word| *word == "beta")?;
    let beta: f64 = words.next()?.trim_end_matches('.').parse().ok()?;
    (-1.0..=1.0).contains(&beta).then_some(beta)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hands out one byte at a time, so that a line is cut at every byte.
    struct Drip<'a>(&'a [u8]);

    impl Read for Drip<'_> {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            let count = self.0.len().min(1);
            out[..count].copy_from_slice(&self.0[..count]);
            self.0 = &self.0[count..];
            Ok(count)
        }
    }

    fn clean(text: &str, separator: Separator) -> String {
        let mut whole = String::new();
        Lines::new(text.as_bytes(), separator)
            .read_to_string(&mut whole)
            .unwrap();
        let mut dripped = String::new();
        Lines::new(Drip(text.as_bytes()), separator)
            .read_to_string(&mut dripped)
            .unwrap();
        assert_eq!(whole, dripped);
        whole
    }

    #[test]
    fn all_line_endings() {
        let expected = "1,2\n\n3,4\n";
        assert_eq!(clean("1,2\n\n3,4\n", Separator::Comma), expected);
        assert_eq!(clean("1,2\r\n\r\n3,4\r\n", Separator::Comma), expected);
        assert_eq!(clean("1,2\r\r3,4", Separator::Comma), expected);
    }

    #[test]
    fn comments_leave_their_line() {
        let text = "# a\n% \"b\n // c\n;d\n1;2\n#e\n";
        assert_eq!(clean(text, Separator::Comma), "\n\n\n\n1;2\n\n");
        assert_eq!(clean(text, Separator::Semicolon), "\n\n\n;d\n1;2\n\n");
    }

    #[test]
    fn runs_of_blanks_become_one() {
        assert_eq!(
            clean("  1   2\t 3  \n4 5", Separator::Blanks),
            "1 2 3\n4 5\n"
        );
    }

    #[test]
    fn the_comment_before_the_table_is_kept() {
        let mut lines = Lines::new("# a\n# t, u\n\n1,2\n# b\n".as_bytes(), Separator::Comma);
        io::copy(&mut lines, &mut io::sink()).unwrap();
        assert_eq!(lines.state().comment, Some((2, b" t, u".to_vec())));
        assert_eq!(lines.state().lines, 5);
    }

    #[test]
    fn faults_are_found() {
        let fault = |text: &[u8]| {
            let mut lines = Lines::new(text, Separator::Comma);
            io::copy(&mut lines, &mut io::sink()).unwrap_err();
            lines.state().fault.take().unwrap().to_string()
        };
        assert!(fault(b"1,2\n3,\0\n").contains("line 2"));
        assert!(fault(b"1,2\n\n\"3,4\n5\n").contains("line 3"));
        assert!(fault(&[b'1'; 3 << 20]).contains("line 1"));
        let mut lines = Lines::new("1,2\n3,\"4".as_bytes(), Separator::Comma);
        io::copy(&mut lines, &mut io::sink()).unwrap();
        assert_eq!(lines.state().cut_line, Some(2));
    }

    #[test]
    fn the_relay_is_read_from_a_comment() {
        for (comment, beta) in [
            ("relay: amplitude 1, beta -0.73, trim on", Some(-0.73)),
            ("Beta = 0.5", Some(0.5)),
            ("beta:-0.6; h 2", Some(-0.6)),
            ("alphabeta 0.5", None),
            ("beta 7", None),
            ("beta of the relay", None),
        ] {
            assert_eq!(relay_beta(comment.as_bytes()), beta, "{comment}");
        }
    }
}
