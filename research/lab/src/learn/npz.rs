//! Arrays in a file that NumPy reads: npz, a zip archive of npy arrays.
//!
//! ```text
//! archive   for each column: local header, npy;  for each column: central header;  end
//!           nothing compressed, dated 1 January 1980: the same numbers give the same bytes
//! npy       "\x93NUMPY", version 1.0, u16 length, a dictionary of Python's, spaces up to a multiple
//!           of 64 bytes, a line feed; then the numbers, little endian, row by row
//! ```
//!
//! References: PKWARE, "APPNOTE.TXT: .ZIP file format specification", version 6.3; NumPy,
//! "numpy.lib.format", version 1.0. Written here because crates for it take as many lines to call, and
//! bring compressors along.

/// Numbers of one type.
#[derive(Clone, Debug, PartialEq)]
pub enum Numbers {
    /// Whole numbers.
    U64(Vec<u64>),
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
}

impl Numbers {
    fn dtype(&self) -> &'static str {
        match self {
            Self::U64(_) => "<u8",
            Self::F32(_) => "<f4",
            Self::F64(_) => "<f8",
        }
    }

    fn size(&self) -> usize {
        match self {
            Self::U64(_) | Self::F64(_) => 8,
            Self::F32(_) => 4,
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::U64(numbers) => numbers.len(),
            Self::F32(numbers) => numbers.len(),
            Self::F64(numbers) => numbers.len(),
        }
    }

    fn write(&self, to: &mut Vec<u8>) {
        match self {
            Self::U64(numbers) => to.extend(numbers.iter().flat_map(|x| x.to_le_bytes())),
            Self::F32(numbers) => to.extend(numbers.iter().flat_map(|x| x.to_le_bytes())),
            Self::F64(numbers) => to.extend(numbers.iter().flat_map(|x| x.to_le_bytes())),
        }
    }

    /// Other numbers of the same type.
    fn read(&self, bytes: &[u8]) -> Self {
        fn each<const N: usize, T>(bytes: &[u8], read: fn([u8; N]) -> T) -> Vec<T> {
            let (chunks, _) = bytes.as_chunks();
            chunks.iter().map(|chunk| read(*chunk)).collect()
        }
        match self {
            Self::U64(_) => Self::U64(each(bytes, u64::from_le_bytes)),
            Self::F32(_) => Self::F32(each(bytes, f32::from_le_bytes)),
            Self::F64(_) => Self::F64(each(bytes, f64::from_le_bytes)),
        }
    }
}

/// A named array of one dimension, or of two if its rows have a width.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name of the array.
    pub name: &'static str,
    /// Numbers in a row of a two-dimensional array; `None` for one dimension.
    pub width: Option<usize>,
    /// All numbers, row by row.
    pub numbers: Numbers,
}

impl Column {
    fn member_name(&self) -> String {
        format!("{}.npy", self.name)
    }

    /// The npy array before its numbers, for this number of rows.
    fn npy_header(&self, rows: usize) -> Vec<u8> {
        /// Magic string, version and length.
        const PREFIX: usize = 10;
        let dtype = self.numbers.dtype();
        let shape = match self.width {
            None => format!("({rows},)"),
            Some(width) => format!("({rows}, {width})"),
        };
        let mut text =
            format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}");
        let padded = (PREFIX + text.len() + 1).next_multiple_of(64) - PREFIX;
        text.extend(std::iter::repeat_n(' ', padded - 1 - text.len()));
        text.push('\n');
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((padded as u16).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes
    }

    fn rows(&self) -> usize {
        self.numbers.len() / self.width.unwrap_or(1)
    }

    fn npy(&self) -> Vec<u8> {
        let mut bytes = self.npy_header(self.rows());
        self.numbers.write(&mut bytes);
        bytes
    }
}

/// Checksums of single bytes: the polynomial of zip, 0xEDB88320 with its bits reversed.
const CRC_OF_BYTE: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = (crc >> 1) ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (crc >> 8) ^ CRC_OF_BYTE[usize::from(crc as u8 ^ byte)]
    })
}

/// Bytes of the header before every member, without its name.
const LOCAL_HEADER: usize = 30;

/// The common part of both headers of a member: version 2.0, no flags, stored, the earliest date,
/// checksum, size twice, length of the name, no extra field.
fn common_header(name: &str, member: &[u8]) -> Vec<u8> {
    let mut header = Vec::new();
    for number in [20, 0, 0, 0, 1 << 5 | 1_u16] {
        header.extend(number.to_le_bytes());
    }
    let size = member.len() as u32;
    for number in [crc(member), size, size] {
        header.extend(number.to_le_bytes());
    }
    for number in [name.len() as u16, 0] {
        header.extend(number.to_le_bytes());
    }
    header
}

/// The bytes of an archive of these arrays, below 4 GiB.
#[must_use]
pub fn write(columns: &[Column]) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for column in columns {
        let (name, member) = (column.member_name(), column.npy());
        let header = common_header(&name, &member);
        let offset = bytes.len() as u32;
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&header);
        bytes.extend(name.as_bytes());
        bytes.extend(&member);

        directory.extend(b"PK\x01\x02");
        directory.extend(20_u16.to_le_bytes());
        directory.extend(&header);
        // No comment, disk 0, no attributes.
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (start, size, count) = (bytes.len(), directory.len(), columns.len());
    bytes.extend(directory);
    bytes.extend(b"PK\x05\x06");
    bytes.extend([0; 4]);
    bytes.extend([count as u16; 2].map(u16::to_le_bytes).as_flattened());
    bytes.extend(
        [size as u32, start as u32]
            .map(u32::to_le_bytes)
            .as_flattened(),
    );
    bytes.extend([0; 2]);
    bytes
}

/// Reads an archive of arrays with the names, widths and types of `like` and this number of rows. `None`
/// for any bytes that [`write()`] would not have written: nothing in them is trusted.
#[must_use]
pub fn read(bytes: &[u8], like: &[Column], rows: usize) -> Option<Vec<Column>> {
    let mut at = 0_usize;
    let mut columns = Vec::new();
    for column in like {
        let header = LOCAL_HEADER + column.member_name().len() + column.npy_header(rows).len();
        let from = at.checked_add(header)?;
        let numbers = rows.checked_mul(column.width.unwrap_or(1))?;
        at = from.checked_add(numbers.checked_mul(column.numbers.size())?)?;
        columns.push(Column {
            numbers: column.numbers.read(bytes.get(from..at)?),
            ..column.clone()
        });
    }
    (write(&columns) == bytes).then_some(columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns() -> Vec<Column> {
        let column = |name, width, numbers| Column {
            name,
            width,
            numbers,
        };
        vec![
            column("number", None, Numbers::U64(vec![7, u64::MAX])),
            column("inputs", Some(3), Numbers::F32(vec![1.0; 6])),
            column("empty", Some(0), Numbers::F64(vec![])),
            column("values", Some(1), Numbers::F64(vec![-0.5, f64::NAN])),
        ]
    }

    // The check value of this polynomial's catalogue.
    #[test]
    fn checksum_of_nine_digits() {
        assert_eq!(crc(b"123456789"), 0xCBF4_3926);
    }

    // The first array, byte by byte: 10 bytes, 117 of dictionary and blanks and a line feed are two
    // times 64; then two numbers.
    #[test]
    fn an_array_is_numpys() {
        let npy = columns()[0].npy();
        let (header, numbers) = npy.split_at(128);
        assert_eq!(header[..10], *b"\x93NUMPY\x01\x00\x76\x00");
        let text = "{'descr': '<u8', 'fortran_order': False, 'shape': (2,), }";
        assert_eq!(header[10..10 + text.len()], *text.as_bytes());
        assert!(
            header[10 + text.len()..127]
                .iter()
                .all(|&byte| byte == b' ')
        );
        assert_eq!(header[127], b'\n');
        assert_eq!(numbers[..8], [7, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(numbers[8..], [255; 8]);
    }

    #[test]
    fn what_is_written_is_read() {
        let columns = &columns()[..2];
        let bytes = write(columns);
        assert_eq!(read(&bytes, columns, 2).as_deref(), Some(columns));
        // 22 bytes end an archive of two.
        assert_eq!(bytes[bytes.len() - 22..][..4], *b"PK\x05\x06");
        assert_eq!(bytes[bytes.len() - 12], 2);
    }

    // Any byte that changes, is missing or is one too many: no file of ours.
    #[test]
    fn nothing_is_trusted() {
        let columns = &columns()[..2];
        let bytes = write(columns);
        for k in 0..bytes.len() {
            let mut other = bytes.clone();
            other[k] ^= 1;
            assert_eq!(read(&other, columns, 2), None, "{k}");
            assert_eq!(read(&bytes[..k], columns, 2), None, "{k}");
        }
        assert_eq!(read(&[&bytes[..], &[0]].concat(), columns, 2), None);
        for rows in [0, 1, 3, usize::MAX] {
            assert_eq!(read(&bytes, columns, rows), None, "{rows}");
        }
        let others = &self::columns()[1..];
        assert_eq!(read(&bytes, others, 2), None);
    }
}
