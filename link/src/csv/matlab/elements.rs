//! Elements of a MAT-file: a tag of type and size, then the data, padded to 8 bytes.
//!
//! Up to 4 bytes of data may stand in the tag itself: then its first word holds the size above the type.

/// Types of data.
pub(super) const COMPRESSED: u32 = 15;
pub(super) const MATRIX: u32 = 14;

/// Largest variable, in bytes when it is not compressed.
const MOST_INFLATED: usize = 1 << 28;

/// Elements that follow each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Elements<'a> {
    bytes: &'a [u8],
    is_big_endian: bool,
}

/// An element.
#[derive(Debug, Clone, Copy)]
pub(super) struct Element<'a> {
    pub(super) kind: u32,
    pub(super) data: &'a [u8],
    is_big_endian: bool,
}

impl<'a> Elements<'a> {
    pub(super) fn new(bytes: &'a [u8], is_big_endian: bool) -> Self {
        Self {
            bytes,
            is_big_endian,
        }
    }
}

impl<'a> Iterator for Elements<'a> {
    type Item = Element<'a>;

    /// The next element; none at the end, or if the rest is shorter than it says.
    fn next(&mut self) -> Option<Element<'a>> {
        let word = |at: usize| unsigned(self.bytes.get(at..at + 4)?, self.is_big_endian);
        let first = word(0)?;
        let short = (first >> 16) as usize;
        let (kind, from, size) = match short {
            0 => (first, 8, word(4)? as usize),
            _ => (first & 0xffff, 4, short),
        };
        let end = size.checked_add(from)?;
        let data = self.bytes.get(from..end)?;
        let whole = match (short, kind) {
            (0, COMPRESSED) => end,
            (0, _) => end.next_multiple_of(8),
            _ => 8,
        };
        self.bytes = self.bytes.get(whole..).unwrap_or_default();
        Some(Element {
            kind,
            data,
            is_big_endian: self.is_big_endian,
        })
    }
}

impl<'a> Element<'a> {
    /// The elements inside of this one.
    pub(super) fn inside(&self) -> Elements<'a> {
        Elements::new(self.data, self.is_big_endian)
    }

    /// The elements that are compressed in this one. `None`: it is damaged, or too large.
    pub(super) fn inflated(&self) -> Option<Vec<u8>> {
        miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(self.data, MOST_INFLATED).ok()
    }

    pub(super) fn with_inflated<'b>(&self, bytes: &'b [u8]) -> Elements<'b> {
        Elements::new(bytes, self.is_big_endian)
    }

    /// Whole numbers of 32 bits.
    pub(super) fn words(&self) -> Vec<u32> {
        let words = self.data.chunks_exact(4);
        words
            .filter_map(|word| unsigned(word, self.is_big_endian))
            .collect()
    }

    /// Text of one byte a letter, up to the first NUL.
    pub(super) fn text(&self) -> String {
        text_of(self.data)
    }

    /// Numbers of any type, and how many. `None`: this type has none.
    pub(super) fn numbers(&self) -> Option<(impl Iterator<Item = f64> + 'a, usize)> {
        let (kind, size) = match self.kind {
            1 | 2 => (self.kind, 1),
            3 | 4 => (self.kind, 2),
            5..=7 => (self.kind, 4),
            9 | 12 | 13 => (self.kind, 8),
            _ => return None,
        };
        let is_big_endian = self.is_big_endian;
        let number = move |bytes: &[u8]| number(kind, bytes, is_big_endian);
        let chunks = self.data.chunks_exact(size);
        let count = chunks.len();
        Some((chunks.map(number), count))
    }
}

/// Text of one byte a letter, up to the first NUL; other letters than those of names become `_`.
pub(super) fn text_of(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0);
    let letters = bytes[..end.unwrap_or(bytes.len())].iter().take(64);
    letters
        .map(|&byte| match byte.is_ascii_alphanumeric() {
            true => char::from(byte),
            false => '_',
        })
        .collect()
}

fn unsigned(bytes: &[u8], is_big_endian: bool) -> Option<u32> {
    let bytes: [u8; 4] = bytes.try_into().ok()?;
    Some(match is_big_endian {
        true => u32::from_be_bytes(bytes),
        false => u32::from_le_bytes(bytes),
    })
}

/// A number of type `kind`.
fn number(kind: u32, bytes: &[u8], is_big_endian: bool) -> f64 {
    let mut raw = 0_u64;
    let count = bytes.len();
    for at in 0..count {
        let from = if is_big_endian { at } else { count - 1 - at };
        raw = raw << 8 | u64::from(bytes[from]);
    }
    match kind {
        1 => f64::from(raw as u8 as i8),
        3 => f64::from(raw as u16 as i16),
        5 => f64::from(raw as u32 as i32),
        7 => f64::from(f32::from_bits(raw as u32)),
        9 => f64::from_bits(raw),
        12 => raw as i64 as f64,
        _ => raw as f64,
    }
}
