//! Line of words and integers, without the formatting of Rust's core library, whose code would count as the
//! tuner's.

/// Size of a line; the longest line in use is half of it.
const MOST_BYTES: usize = 128;

/// A line. Text beyond its size is dropped.
#[derive(Clone, Debug)]
pub struct Line {
    bytes: [u8; MOST_BYTES],
    length: usize,
}

impl Default for Line {
    fn default() -> Self {
        Self {
            bytes: [0; MOST_BYTES],
            length: 0,
        }
    }
}

impl Line {
    /// Appends a word, after a space unless it is the first.
    pub fn word(&mut self, word: &str) -> &mut Self {
        if self.length > 0 {
            self.push(b' ');
        }
        word.bytes().for_each(|byte| self.push(byte));
        self
    }

    /// Appends a number like [`Line::word`] a word.
    pub fn number(&mut self, mut number: u64) -> &mut Self {
        // The largest number has 20 digits; they are written from the right.
        let mut digits = [b'0'; 20];
        let mut first = digits.len();
        while first == digits.len() || number > 0 {
            first -= 1;
            digits[first] = b'0' + (number % 10) as u8;
            number /= 10;
        }
        self.word(core::str::from_utf8(&digits[first..]).unwrap_or_default())
    }

    /// The line with a line feed and a zero byte at its end, as a C string.
    pub fn ended(&mut self) -> &[u8] {
        self.length = self.length.min(MOST_BYTES - 2);
        self.push(b'\n');
        self.push(0);
        &self.bytes[..self.length]
    }

    fn push(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(self.length) {
            *place = byte;
            self.length += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_numbers_are_parted_by_spaces() {
        // The largest u64 is 18446744073709551615.
        let mut line = Line::default();
        line.word("a").number(0).number(u64::MAX).word("b");
        assert_eq!(line.ended(), b"a 0 18446744073709551615 b\n\0");
    }

    #[test]
    fn what_does_not_fit_is_left_out() {
        // 126 bytes of text, the line feed and the zero byte.
        let mut line = Line::default();
        (0..50).for_each(|_| {
            line.word("abcd");
        });
        let ended = line.ended();
        assert_eq!((ended.len(), &ended[124..]), (128, &b" a\n\0"[..]));
    }
}
