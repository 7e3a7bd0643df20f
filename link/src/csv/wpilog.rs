//! Data logs of WPILib (`.wpilog`): a table of one value a row.
//!
//! ```text
//! "WPILOG", version (u16), length of the extra header (u32), extra header
//! records: lengths (u8: bits 0, 1 of the entry, 2, 3 of the size, 4 to 6 of the time, each less one), entry, size, time (us), payload
//! entry 0: control; 0 begins an entry: number (u32), name, type and metadata, each with its length (u32) before it
//! ```
//! All numbers have the least significant byte first. Reference: WPILib, "WPILib Data Log File Format Specification, Version 1.0".

use std::collections::HashMap;

use super::error::ReadError;
use super::sheet::Sheet;

pub(super) const MAGIC: &[u8] = b"WPILOG";

/// Bytes before the extra header.
const HEAD_BYTES: usize = 12;

/// Most elements of an array that become signals: more are no signals.
const MOST_ELEMENTS: usize = 16;

/// Type of the values of an entry.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Double,
    Float,
    Whole,
    Truth,
    Doubles,
    Floats,
}

struct Entry {
    name: String,
    kind: Kind,
}

/// The numbers of a log; of the entries `wanted` alone, if there are any.
///
/// # Errors
/// The log has no numbers.
pub(super) fn read(file: &[u8], wanted: &[&str]) -> Result<Sheet, ReadError> {
    let mut sheet = Sheet::long();
    let mut entries: HashMap<u32, Entry> = HashMap::new();
    let extra = file
        .get(8..HEAD_BYTES)
        .map_or(0, |bytes| number(bytes) as usize);
    let mut rest = HEAD_BYTES
        .checked_add(extra)
        .and_then(|start| file.get(start..))
        .unwrap_or_default();
    while let Some(record) = Record::take(&mut rest) {
        if record.entry == 0 {
            if let Some((number, entry)) = begun(record.payload) {
                entries.insert(number, entry);
            }
            continue;
        }
        let Some(entry) = entries.get(&record.entry) else {
            continue;
        };
        let time_s = record.time_us as f64 / 1e6;
        let is_wanted = |name: &str| wanted.is_empty() || wanted.contains(&name);
        let values = entry.kind.values(record.payload);
        for (index, value) in values.iter().enumerate() {
            let name = match entry.kind {
                Kind::Doubles | Kind::Floats => format!("{}/{index}", entry.name),
                _ => entry.name.clone(),
            };
            if is_wanted(&name) {
                sheet.value(time_s, &name, *value);
            }
        }
    }
    match sheet.is_empty() {
        true => Err(ReadError::NoNumbers {
            format: "WPILib log",
        }),
        false => Ok(sheet),
    }
}

struct Record<'a> {
    entry: u32,
    time_us: u64,
    payload: &'a [u8],
}

impl<'a> Record<'a> {
    /// The next record; `None` at the end, or where the log is cut off.
    fn take(rest: &mut &'a [u8]) -> Option<Self> {
        let (&lengths, after) = rest.split_first()?;
        let length = |shift: u8, most: u8| usize::from(lengths >> shift & most) + 1;
        let (entry, after) = after.split_at_checked(length(0, 3))?;
        let (size, after) = after.split_at_checked(length(2, 3))?;
        let (time, after) = after.split_at_checked(length(4, 7))?;
        let (payload, after) = after.split_at_checked(usize::try_from(number(size)).ok()?)?;
        *rest = after;
        Some(Self {
            entry: u32::try_from(number(entry)).ok()?,
            time_us: number(time),
            payload,
        })
    }
}

/// The entry that a control record begins, if its values are numbers.
fn begun(payload: &[u8]) -> Option<(u32, Entry)> {
    let (0, rest) = payload.split_first().map(|(kind, rest)| (*kind, rest))? else {
        return None;
    };
    let (entry, mut rest) = rest.split_at_checked(4)?;
    let mut text = || {
        let (length, after) = rest.split_at_checked(4)?;
        let (text, after) = after.split_at_checked(usize::try_from(number(length)).ok()?)?;
        rest = after;
        Some(String::from_utf8_lossy(text).into_owned())
    };
    let name = text()?;
    let kind = match text()?.as_str() {
        "double" => Kind::Double,
        "float" => Kind::Float,
        "int64" => Kind::Whole,
        "boolean" => Kind::Truth,
        "double[]" => Kind::Doubles,
        "float[]" => Kind::Floats,
        _ => return None,
    };
    Some((u32::try_from(number(entry)).ok()?, Entry { name, kind }))
}

impl Kind {
    /// The values of a payload; none if it has another length than the type.
    fn values(self, payload: &[u8]) -> Vec<f64> {
        let doubles = || {
            payload
                .as_chunks()
                .0
                .iter()
                .map(|bytes| f64::from_le_bytes(*bytes))
        };
        let floats = || {
            payload
                .as_chunks()
                .0
                .iter()
                .map(|bytes| f64::from(f32::from_le_bytes(*bytes)))
        };
        match (self, payload.len()) {
            (Self::Double, 8) => doubles().collect(),
            (Self::Float, 4) => floats().collect(),
            (Self::Whole, 8) => payload
                .as_chunks()
                .0
                .iter()
                .map(|bytes| i64::from_le_bytes(*bytes) as f64)
                .collect(),
            (Self::Truth, 1) => vec![f64::from(u8::from(payload[0] != 0))],
            (Self::Doubles, length) if length % 8 == 0 => doubles().take(MOST_ELEMENTS).collect(),
            (Self::Floats, length) if length % 4 == 0 => floats().take(MOST_ELEMENTS).collect(),
            _ => vec![],
        }
    }
}

/// A number of up to eight bytes, the least significant first.
fn number(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .rev()
        .take(8)
        .fold(0, |sum, &byte| sum << 8 | u64::from(byte))
}
