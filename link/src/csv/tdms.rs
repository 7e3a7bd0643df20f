//! TDMS files of LabVIEW and other programs of National Instruments, version 2.
//!
//! ```text
//! segment: "TDSm", contents (u32), version (u32), length behind this lead-in (u64), length of the metadata (u64)
//! metadata: number of objects; for each its path, the place of its values, its properties
//! values: of each channel in turn, or interleaved; repeated while the segment lasts
//! ```
//! Times are those of the waveform properties `wf_start_offset` and `wf_increment`, or a channel that is named as time.
//! Reference: National Instruments, "TDMS File Format Internal Structure".

use std::collections::HashMap;

use super::error::ReadError;
use super::sheet::Sheet;

pub(super) const MAGIC: &[u8] = b"TDSm";

/// Bytes before the metadata of a segment.
const LEAD_IN_BYTES: usize = 28;
/// Bits of the contents.
const HAS_METADATA: u32 = 1 << 1;
const HAS_NEW_OBJECTS: u32 = 1 << 2;
const HAS_VALUES: u32 = 1 << 3;
const IS_INTERLEAVED: u32 = 1 << 5;
const IS_BIG_ENDIAN: u32 = 1 << 6;
const IS_DAQMX: u32 = 1 << 7;
/// Places of values: none, and as in the segment before.
const NO_VALUES: u32 = u32::MAX;
const AS_BEFORE: u32 = 0;
/// Most channels, and most values of all of them.
const MOST_CHANNELS: usize = 1 << 12;
const MOST_VALUES: usize = 1 << 24;

/// Type of a value by its number.
const STRING: u32 = 0x20;
const DOUBLE: u32 = 10;

#[derive(Debug, Default)]
struct Channel {
    path: String,
    kind: u32,
    count: usize,
    unit: Option<String>,
    start_s: f64,
    step_s: f64,
    values: Vec<f64>,
}

/// The channels of numbers of a file.
///
/// # Errors
/// The file has raw data of a DAQmx device, too many values, or no numbers.
pub(super) fn read(file: &[u8]) -> Result<Sheet, ReadError> {
    let mut reader = Reader::default();
    let mut rest = file;
    while let Some(segment) = Segment::take(&mut rest) {
        reader.add(&segment)?;
    }
    let channels: Vec<Channel> = reader
        .channels
        .into_iter()
        .filter(|of| !of.values.is_empty())
        .collect();
    sheet(&channels).ok_or(ReadError::NoNumbers {
        format: "TDMS file",
    })
}

struct Segment<'a> {
    contents: u32,
    metadata: Bytes<'a>,
    values: &'a [u8],
}

impl<'a> Segment<'a> {
    /// The next segment; the last one of a file that was not closed reaches to its end.
    fn take(rest: &mut &'a [u8]) -> Option<Self> {
        let (lead_in, after) = rest.split_at_checked(LEAD_IN_BYTES)?;
        if !lead_in.starts_with(MAGIC) {
            return None;
        }
        let contents = u32::from_le_bytes(lead_in.get(4..8)?.try_into().ok()?);
        let is_big = contents & IS_BIG_ENDIAN != 0;
        let mut numbers = Bytes {
            bytes: lead_in.get(12..)?,
            is_big,
        };
        let (length, metadata) = (numbers.u64()?, numbers.u64()?);
        let length = usize::try_from(length)
            .unwrap_or(usize::MAX)
            .min(after.len());
        let (body, next) = after.split_at(length);
        let metadata = usize::try_from(metadata).ok()?.min(body.len());
        let (metadata, values) = body.split_at(metadata);
        *rest = next;
        Some(Self {
            contents,
            metadata: Bytes {
                bytes: metadata,
                is_big,
            },
            values,
        })
    }

    fn has(&self, bit: u32) -> bool {
        self.contents & bit != 0
    }
}

#[derive(Default)]
struct Reader {
    channels: Vec<Channel>,
    index_of: HashMap<String, usize>,
    /// The channels with values in the segment, in order.
    active: Vec<usize>,
    count: usize,
}

impl Reader {
    fn add(&mut self, segment: &Segment<'_>) -> Result<(), ReadError> {
        if segment.has(IS_DAQMX) {
            return Err(ReadError::NotText {
                looks_like: "a TDMS file with raw data of a DAQmx device",
            });
        }
        if segment.has(HAS_METADATA) {
            if segment.has(HAS_NEW_OBJECTS) {
                self.active.clear();
            }
            // What follows damage is lost.
            if self.metadata(segment.metadata).is_none() {
                return Ok(());
            }
        }
        if segment.has(HAS_VALUES) {
            self.values(segment)?;
        }
        Ok(())
    }

    fn metadata(&mut self, mut bytes: Bytes<'_>) -> Option<()> {
        for _ in 0..bytes.u32()? {
            let path = bytes.text()?;
            let index = self.channel(path)?;
            match bytes.u32()? {
                NO_VALUES => self.active.retain(|&of| of != index),
                AS_BEFORE => self.activate(index),
                _ => {
                    let (kind, _dimension, count) = (bytes.u32()?, bytes.u32()?, bytes.u64()?);
                    if kind == STRING {
                        bytes.u64()?;
                    }
                    let channel = self.channels.get_mut(index)?;
                    (channel.kind, channel.count) = (kind, usize::try_from(count).ok()?);
                    self.activate(index);
                }
            }
            for _ in 0..bytes.u32()? {
                let (name, kind) = (bytes.text()?, bytes.u32()?);
                let channel = self.channels.get_mut(index)?;
                if kind == STRING {
                    let value = bytes.text()?;
                    if name == "unit_string" {
                        channel.unit = Some(value);
                    }
                    continue;
                }
                let value = bytes.value(kind)?;
                match name.as_str() {
                    "wf_increment" => channel.step_s = value,
                    "wf_start_offset" => channel.start_s = value,
                    _ => {}
                }
            }
        }
        Some(())
    }

    fn channel(&mut self, path: String) -> Option<usize> {
        if let Some(&index) = self.index_of.get(&path) {
            return Some(index);
        }
        let index = self.channels.len();
        self.channels.push(Channel {
            path: path.clone(),
            ..Channel::default()
        });
        self.index_of.insert(path, index);
        (index < MOST_CHANNELS).then_some(index)
    }

    fn activate(&mut self, index: usize) {
        if !self.active.contains(&index) {
            self.active.push(index);
        }
    }

    fn values(&mut self, segment: &Segment<'_>) -> Result<(), ReadError> {
        let mut bytes = Bytes {
            bytes: segment.values,
            is_big: segment.has(IS_BIG_ENDIAN),
        };
        let has_size = |&index: &usize| size_of(self.channels[index].kind).is_some();
        if !self.active.iter().all(has_size) {
            // Texts have no fixed length, so what follows in the segment cannot be found.
            return Ok(());
        }
        let active = self.active.clone();
        let most = active
            .iter()
            .map(|&index| self.channels[index].count)
            .max()
            .unwrap_or(0);
        while most > 0 && !bytes.bytes.is_empty() {
            let before = bytes.bytes.len();
            // Counts may be damaged: the bytes end first.
            let mut left = most;
            while segment.has(IS_INTERLEAVED) && left > 0 && !bytes.bytes.is_empty() {
                left -= 1;
                for &index in &active {
                    self.value(index, &mut bytes)?;
                }
            }
            for &index in active.iter().filter(|_| !segment.has(IS_INTERLEAVED)) {
                let mut left = self.channels[index].count;
                while left > 0 && self.value(index, &mut bytes)? {
                    left -= 1;
                }
            }
            if bytes.bytes.len() == before {
                break;
            }
        }
        Ok(())
    }

    /// Adds the next value of a channel; false at the end.
    fn value(&mut self, index: usize, bytes: &mut Bytes<'_>) -> Result<bool, ReadError> {
        let channel = &mut self.channels[index];
        let Some(value) = bytes.value(channel.kind) else {
            bytes.bytes = &[];
            return Ok(false);
        };
        channel.values.push(value);
        self.count += 1;
        match self.count > MOST_VALUES {
            true => Err(ReadError::TooManyValues { limit: MOST_VALUES }),
            false => Ok(true),
        }
    }
}

/// Bytes of a value of a type; `None` of a text or an unknown one.
fn size_of(kind: u32) -> Option<usize> {
    Some(match kind {
        1 | 5 | 0x21 => 1,
        2 | 6 => 2,
        3 | 7 | 9 | 0x19 => 4,
        4 | 8 | DOUBLE | 0x1a => 8,
        0x44 => 16,
        _ => return None,
    })
}

/// Bytes that are read from their start.
#[derive(Clone, Copy)]
struct Bytes<'a> {
    bytes: &'a [u8],
    is_big: bool,
}

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(count)?;
        self.bytes = rest;
        Some(taken)
    }

    fn raw(&mut self, count: usize) -> Option<u64> {
        let is_big = self.is_big;
        let bytes = self.take(count)?.iter();
        let fold = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        Some(if is_big {
            bytes.fold(0, fold)
        } else {
            bytes.rev().fold(0, fold)
        })
    }

    fn u32(&mut self) -> Option<u32> {
        self.raw(4).and_then(|value| u32::try_from(value).ok())
    }

    fn u64(&mut self) -> Option<u64> {
        self.raw(8)
    }

    fn text(&mut self) -> Option<String> {
        let length = usize::try_from(self.u32()?).ok()?;
        self.take(length)
            .map(|text| String::from_utf8_lossy(text).into_owned())
    }

    /// A number of a type. A time is in seconds since 1904.
    fn value(&mut self, kind: u32) -> Option<f64> {
        if kind == 0x44 {
            let (first, second) = (self.raw(8)?, self.raw(8)?);
            let (whole, part) = if self.is_big {
                (first, second)
            } else {
                (second, first)
            };
            return Some(whole.cast_signed() as f64 + part as f64 / 2_f64.powi(64));
        }
        let raw = self.raw(size_of(kind)?)?;
        let low = raw as u32;
        Some(match kind {
            1 => f64::from(raw as u8 as i8),
            2 => f64::from(raw as u16 as i16),
            3 => f64::from(low.cast_signed()),
            4 => raw.cast_signed() as f64,
            9 | 0x19 => f64::from(f32::from_bits(low)),
            DOUBLE | 0x1a => f64::from_bits(raw),
            _ => raw as f64,
        })
    }
}

/// The channels as a table: of one time if they share it, else of one value a row.
fn sheet(channels: &[Channel]) -> Option<Sheet> {
    let first = channels.first()?;
    let is_alike = |of: &&Channel| {
        of.values.len() == first.values.len()
            && of.step_s == first.step_s
            && of.start_s == first.start_s
    };
    let has_steps = channels.iter().all(|of| of.step_s > 0.0);
    if has_steps && !channels.iter().all(|of| is_alike(&of)) {
        let mut sheet = Sheet::long();
        for channel in channels {
            let name = channel.name();
            for (index, value) in channel.values.iter().enumerate() {
                sheet.value(
                    channel.start_s + index as f64 * channel.step_s,
                    &name,
                    *value,
                );
            }
        }
        return Some(sheet);
    }
    // Without steps, the columns of the length that most channels have.
    let count = |length: usize| {
        channels
            .iter()
            .filter(|of| of.values.len() == length)
            .count()
    };
    let length = channels
        .iter()
        .map(|of| of.values.len())
        .max_by_key(|&length| (count(length), length))?;
    let columns: Vec<&Channel> = channels
        .iter()
        .filter(|of| of.values.len() == length)
        .collect();
    let time = has_steps.then(|| "time [s]".to_owned());
    let names = time
        .into_iter()
        .chain(columns.iter().map(|of| of.name()))
        .collect();
    let mut sheet = Sheet::wide(names);
    for row in 0..length {
        let time = has_steps.then(|| format!("{:?}", first.start_s + row as f64 * first.step_s));
        let cells = columns.iter().map(|of| format!("{:?}", of.values[row]));
        sheet.row(time.into_iter().chain(cells));
    }
    (sheet.columns() > 1).then_some(sheet)
}

impl Channel {
    /// The name behind the last mark of the path `/'group'/'channel'`, with the unit.
    fn name(&self) -> String {
        let name = self
            .path
            .rsplit_once("'/'")
            .map_or(self.path.as_str(), |(_, name)| name);
        let name = name.trim_end_matches('\'').replace("''", "'");
        match self.unit.as_deref().filter(|unit| !unit.is_empty()) {
            Some(unit) => format!("{name} [{unit}]"),
            None => name,
        }
    }
}
