//! Decodes bytes to text: byte order marks, UTF-16, and files that are not text.

use std::io::{self, Read};

use super::error::ReadError;

/// Bytes of a file that are examined before it is read.
pub(super) const HEAD_BYTES: usize = 1 << 20;

/// First bytes of file formats that are sometimes mistaken for tables. MATLAB, PDF and ROS bag files
/// begin like text, so these bytes are checked first.
const MAGIC: [(&[u8], &str); 22] = [
    (b"\x89PNG", "a PNG image"),
    (b"\xff\xd8\xff", "a JPEG image"),
    (b"GIF8", "a GIF image"),
    (b"%PDF", "a PDF document"),
    (b"PK\x03\x04", "a zip archive (an .xlsx workbook is one)"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"\xfd7zXZ", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive"),
    (b"BZh", "a bzip2 archive"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook"),
    (b"ULog\x01\x12\x35", "a PX4 ULog"),
    (b"\xa3\x95", "an ArduPilot DataFlash log"),
    (b"H Product:Blackbox", "a Betaflight blackbox log"),
    (b"MATLAB 5.0 MAT-file", "a MATLAB MAT-file"),
    (
        b"MATLAB 7.3 MAT-file",
        "a MATLAB 7.3 MAT-file (save -v7 writes one that can be read)",
    ),
    (b"\x89HDF", "an HDF5 file (a MATLAB 7.3 MAT-file is one)"),
    (b"PAR1", "a Parquet file"),
    (b"\x89MCAP0", "an MCAP log"),
    (b"#ROSBAG", "a ROS bag"),
    (b"SQLite format 3", "an SQLite database"),
    (b"\x7fELF", "a program"),
];

/// The text of a file as UTF-8 without a byte order mark.
pub(super) struct Text<'a> {
    /// The first bytes, or the entire text if it is shorter than the head.
    pub(super) head: Vec<u8>,
    /// The text after the head.
    pub(super) rest: Box<dyn Read + 'a>,
    /// Whether `head` is the entire text.
    pub(super) whole: bool,
    /// Whether the file is UTF-16.
    pub(super) utf16: bool,
    /// Names of the columns, where they do not stand in the text.
    pub(super) names: Option<Vec<String>>,
    /// Whether the columns are time, tag and value.
    pub(super) is_long: bool,
    /// Whether most cells are empty: each column has stamps of its own.
    pub(super) is_sparse: bool,
    /// Whether the text was made from lines of labels and values.
    pub(super) is_labelled: bool,
}

impl<'a> Text<'a> {
    /// Reads the head of a file.
    pub(super) fn open(mut file: impl Read + 'a) -> Result<Self, ReadError> {
        let start = take(&mut file, 8)?;
        let (skip, big_endian) = match *start {
            [0xef, 0xbb, 0xbf, ..] => (3, None),
            [0xff, 0xfe, ..] => (2, Some(false)),
            [0xfe, 0xff, ..] => (2, Some(true)),
            // Without a mark: four letters of ASCII.
            [a, 0, b, 0, c, 0, d, 0] if is_letters([a, b, c, d]) => (0, Some(false)),
            [0, a, 0, b, 0, c, 0, d] if is_letters([a, b, c, d]) => (0, Some(true)),
            _ => (0, None),
        };
        let file = io::Cursor::new(start).chain(file);
        let mut file: Box<dyn Read + 'a> = Box::new(file);
        take(&mut file, skip)?;
        if let Some(big_endian) = big_endian {
            file = Box::new(Utf16 {
                file,
                big_endian,
                bytes: Vec::new(),
                text: Vec::new(),
            });
        }
        let head = take(&mut file, HEAD_BYTES)?;
        if head.is_empty() {
            return Err(ReadError::Empty);
        }
        if let Some(looks_like) = binary(&head) {
            return Err(ReadError::NotText { looks_like });
        }
        let whole = head.len() < HEAD_BYTES;
        Ok(Self {
            head,
            rest: file,
            whole,
            utf16: big_endian.is_some(),
            names: None,
            is_long: false,
            is_sparse: false,
            is_labelled: false,
        })
    }
}

fn is_letters(bytes: [u8; 4]) -> bool {
    bytes
        .iter()
        .all(|byte| byte.is_ascii_graphic() || b" \t".contains(byte))
}

/// Up to `count` bytes; fewer only at the end of the file.
fn take(file: &mut impl Read, count: usize) -> Result<Vec<u8>, ReadError> {
    let mut bytes = Vec::new();
    match file.take(count as u64).read_to_end(&mut bytes) {
        Ok(_) => Ok(bytes),
        Err(reason) => Err(ReadError::Interrupted { line: 0, reason }),
    }
}

/// What the file looks like, if it is not text.
fn binary(head: &[u8]) -> Option<&'static str> {
    if let Some((_, looks_like)) = MAGIC.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Some(looks_like);
    }
    if head.contains(&0) {
        return Some("binary data (it holds NUL bytes)");
    }
    let control = |byte: &&u8| matches!(**byte, 0..=8 | 14..=25 | 28..=31 | 127);
    if 10 * head.iter().filter(control).count() > head.len() {
        return Some("binary data (it holds control bytes)");
    }
    match head.trim_ascii_start().first() {
        Some(b'<') => Some("HTML or XML"),
        _ => None,
    }
}

/// Converts UTF-16 to UTF-8 while reading.
struct Utf16<R> {
    file: R,
    big_endian: bool,
    /// Bytes not yet decoded: an odd byte, or the first half of a surrogate pair.
    bytes: Vec<u8>,
    /// Decoded text not yet handed out, in reverse order.
    text: Vec<u8>,
}

impl<R: Read> Read for Utf16<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.text.is_empty() && self.decode()? {}
        let count = out.len().min(self.text.len());
        for to in &mut out[..count] {
            *to = self.text.pop().unwrap_or_default();
        }
        Ok(count)
    }
}

impl<R: Read> Utf16<R> {
    /// Decodes the next bytes; false at the end of the file.
    fn decode(&mut self) -> io::Result<bool> {
        let before = self.bytes.len();
        let mut piece = [0; 4096];
        let count = self.file.read(&mut piece)?;
        self.bytes.extend_from_slice(&piece[..count]);
        if count == 0 && before == 0 {
            return Ok(false);
        }
        let unit = |pair: &[u8; 2]| match self.big_endian {
            true => u16::from_be_bytes(*pair),
            false => u16::from_le_bytes(*pair),
        };
        let mut units: Vec<u16> = self.bytes.as_chunks().0.iter().map(unit).collect();
        if count > 0
            && units
                .last()
                .is_some_and(|unit| (0xd800..0xdc00).contains(unit))
        {
            units.pop();
        }
        let used = if count == 0 {
            self.bytes.len()
        } else {
            2 * units.len()
        };
        self.bytes.drain(..used);
        self.text = String::from_utf16_lossy(&units).into_bytes();
        self.text.reverse();
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text_of(bytes: &[u8]) -> String {
        let mut text = Text::open(bytes).unwrap();
        let mut all = text.head;
        text.rest.read_to_end(&mut all).unwrap();
        String::from_utf8(all).unwrap()
    }

    #[test]
    fn utf16_and_marks() {
        let text = "t,\u{b5}s,\u{1f680}\n".repeat(5000);
        let little: Vec<u8> = "\u{feff}"
            .encode_utf16()
            .chain(text.encode_utf16())
            .flat_map(u16::to_le_bytes)
            .collect();
        let big: Vec<u8> = "\u{feff}"
            .encode_utf16()
            .chain(text.encode_utf16())
            .flat_map(u16::to_be_bytes)
            .collect();
        assert_eq!(text_of(&little), text);
        assert_eq!(text_of(&big), text);
        assert_eq!(text_of(format!("\u{feff}{text}").as_bytes()), text);
        // An odd byte at the end is dropped.
        assert_eq!(text_of(&little[..little.len() - 1]), text[..text.len() - 1]);
    }

    #[test]
    fn files_that_are_not_text() {
        let refusal = |bytes: &[u8]| match Text::open(bytes) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("taken for text"),
        };
        assert!(refusal(b"").contains("empty"));
        assert!(refusal(b"\xef\xbb\xbf").contains("empty"));
        assert!(refusal(b"\x89PNG\r\n\x1a\n\0\0").contains("a PNG image"));
        assert!(refusal(b"PK\x03\x04....").contains("a zip archive"));
        assert!(refusal(b"\x1f\x8b\x08").contains("a gzip archive"));
        assert!(refusal(b"ULog\x01\x12\x35\x01").contains("a PX4 ULog"));
        assert!(refusal(b"\xa3\x95\x80").contains("DataFlash"));
        assert!(refusal(b"1,2\0,3").contains("NUL"));
        assert!(refusal(b"\x01\x02\x03\x04abc").contains("control"));
    }
}
