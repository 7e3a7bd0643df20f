//! MCAP with messages of ROS 2 (`ros2 bag`, Foxglove): topics of PX4 as the package `px4_msgs` defines them, and any with numbers.
//!
//! ```text
//! 89 "MCAP0" 0D 0A
//! kind (u8), size (u64), payload      01 header, 03 schema, 04 channel, 05 message, 06 chunk, 02 footer; others are skipped
//! chunk                               records again: as they are, zstd or lz4
//! ```
//! Schemas are `ros2msg`, messages CDR, little-endian. The name of a table is that of the topic behind the last `/`, without
//! the version that PX4 appends (`_v1`), so that it is the name in a ULog. Times are the column `timestamp` (us), the stamp of
//! the header if it has the clock of the recorder, or when the message was recorded. Reference: MCAP format specification, version 0; OMG DDS-XTYPES 1.3, section 7.4.1 (CDR).

mod cdr;

use std::collections::HashMap;
use std::io::Read;

use self::cdr::Layout;
use super::error::LogError;
use super::source::Source;
use super::tables::{FlightTables, LogFormat, LogTables, Loss, MOST_NAMES, Topic, Wanted, text_of};

/// Bytes before the first record.
const MAGIC_BYTES: usize = 8;

/// Largest schema, channel or message that is read, in bytes: pictures and point clouds are skipped.
const MOST_BYTES: u64 = 1 << 17;
/// Largest compressed chunk, and largest one after decompression, in bytes.
const MOST_PACKED: u64 = 1 << 26;
const MOST_UNPACKED: u64 = 1 << 28;
/// Maximum number of bytes of all schemas, and of columns over all channels.
const MOST_TEXT: usize = 1 << 24;
const MOST_COLUMNS: usize = 1 << 20;

/// A header whose time is nearer than this to that of the recorder has its clock, not that of a simulation: signals of other topics, which
/// may have no header, are on it too.
const SAME_CLOCK_US: f64 = 1e6;

/// Kinds of records.
const FOOTER: u8 = 2;
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
/// Kinds from here on are private; between this and the last known one none is defined.
const PRIVATE: u8 = 0x80;
const LAST: u8 = 0x0f;

/// Reads a log whose first bytes are those of an MCAP.
pub(super) fn read(mut source: Source<impl Read>, wanted: &Wanted) -> Result<LogTables, LogError> {
    let mut reader = Reader {
        wanted,
        schemas: HashMap::new(),
        text: 0,
        channels: HashMap::new(),
        columns: 0,
        row: Vec::new(),
        labels: Vec::new(),
        flight: FlightTables::default(),
        loss: Loss::default(),
    };
    source.skip(MAGIC_BYTES)?;
    reader.records(&mut source, false)?;
    Ok(LogTables {
        format: LogFormat::Mcap,
        flights: vec![reader.flight],
        loss: reader.loss,
    })
}

/// A channel whose messages can be read.
struct Channel {
    /// Index of the topic.
    topic: usize,
    layout: Layout,
    /// Of the first message; where they are others, its columns would be other signals.
    labels: Option<Vec<String>>,
    /// Whether the header has the clock of the recorder.
    has_stamp: bool,
}

struct Reader<'a> {
    wanted: &'a Wanted,
    /// Name and text of each schema.
    schemas: HashMap<u16, (String, String)>,
    text: usize,
    /// `None`: its messages are not of ROS 2, or their schema is not known.
    channels: HashMap<u16, Option<Channel>>,
    columns: usize,
    /// Values of a message, and labels of its sequences.
    row: Vec<f64>,
    labels: Vec<String>,
    flight: FlightTables,
    loss: Loss,
}

impl Reader<'_> {
    /// Reads records up to the footer or the end.
    fn records(
        &mut self,
        source: &mut Source<impl Read>,
        is_unpacked: bool,
    ) -> Result<(), LogError> {
        loop {
            let (kind, size) = match *source.peek(9)? {
                [] => return Ok(()),
                [kind, ref size @ ..] if size.len() == 8 => (kind, number(size)),
                _ => {
                    self.loss.is_truncated = true;
                    return Ok(());
                }
            };
            if kind == 0 || (kind > LAST && kind < PRIVATE) {
                // Sizes cannot be trusted any more.
                self.loss.rows_dropped += 1;
                self.loss.is_truncated = true;
                return Ok(());
            }
            source.skip(9)?;
            let is_read = matches!(kind, SCHEMA | CHANNEL | MESSAGE) && size <= MOST_BYTES;
            match kind {
                FOOTER => return Ok(()),
                CHUNK => self.chunk(source, size, is_unpacked)?,
                _ if is_read => {
                    let payload = source.peek(size as usize)?;
                    if (payload.len() as u64) < size {
                        self.loss.is_truncated = true;
                        return Ok(());
                    }
                    match kind {
                        SCHEMA => self.schema(payload),
                        CHANNEL => self.channel(payload),
                        _ => self.message(payload),
                    }
                    source.skip(size as usize)?;
                }
                _ => self.pass(source, size)?,
            }
        }
    }

    /// Skips `size` bytes.
    fn pass(&mut self, source: &mut Source<impl Read>, size: u64) -> Result<(), LogError> {
        let end = source.position().saturating_add(size);
        source.skip(usize::try_from(size).unwrap_or(usize::MAX))?;
        self.loss.is_truncated |= source.position() < end;
        Ok(())
    }

    /// Times (2 u64), size, checksum (u32), name of the compression, size of the records (u64), records.
    fn chunk(
        &mut self,
        source: &mut Source<impl Read>,
        size: u64,
        is_unpacked: bool,
    ) -> Result<(), LogError> {
        /// Longest name of a compression.
        const NAME: usize = 16;
        let mut head = Fields(source.peek((32 + NAME + 8).min(size as usize))?);
        let _times = head.take(16);
        let unpacked = head.take(8).map_or(0, number);
        let _checksum = head.take(4);
        let compression = head.text().unwrap_or_default();
        let Some(packed) = head.take(8).map(number) else {
            self.loss.rows_dropped += 1;
            return self.pass(source, size);
        };
        let head_size = 32 + compression.len() as u64 + 8;
        if compression.is_empty() {
            // The records follow as they are.
            return source.skip(head_size as usize);
        }
        if is_unpacked || packed > MOST_PACKED || head_size + packed > size {
            self.loss.rows_dropped += 1;
            return self.pass(source, size);
        }
        source.skip(head_size as usize)?;
        let mut bytes = Vec::new();
        while (bytes.len() as u64) < packed {
            let left = (packed - bytes.len() as u64).min(MOST_BYTES);
            let part = source.peek(left as usize)?;
            if part.is_empty() {
                self.loss.is_truncated = true;
                break;
            }
            bytes.extend_from_slice(part);
            let count = part.len();
            source.skip(count)?;
        }
        self.unpack(&compression, &bytes, unpacked.min(MOST_UNPACKED));
        self.pass(source, size - head_size - packed)
    }

    /// Reads the records of a compressed chunk, as far as it can be unpacked.
    fn unpack(&mut self, compression: &str, bytes: &[u8], most: u64) {
        let reader: Option<Box<dyn Read + '_>> = match compression {
            "lz4" => Some(Box::new(lz4_flex::frame::FrameDecoder::new(bytes))),
            "zstd" => match ruzstd::decoding::StreamingDecoder::new(bytes) {
                Ok(reader) => Some(Box::new(reader)),
                Err(_) => None,
            },
            _ => None,
        };
        let read = reader.map(|reader| self.records(&mut Source::new(reader.take(most)), true));
        if !matches!(read, Some(Ok(()))) {
            self.loss.rows_dropped += 1;
        }
    }

    /// Number (u16), name, encoding, text.
    fn schema(&mut self, payload: &[u8]) {
        let mut fields = Fields(payload);
        let id = fields.take(2).map(number);
        let (name, encoding) = (fields.text(), fields.text());
        let (Some(id), Some(name), Some("ros2msg"), Some(text)) =
            (id, name, encoding.as_deref(), fields.text())
        else {
            return;
        };
        self.text += text.len();
        if self.text <= MOST_TEXT {
            self.schemas.entry(id as u16).or_insert((name, text));
        }
    }

    /// Number and number of the schema (u16), topic, encoding of the messages.
    fn channel(&mut self, payload: &[u8]) {
        let mut fields = Fields(payload);
        let [id, schema] = [(); 2].map(|()| fields.take(2).map(number));
        let (Some(id), Some(schema)) = (id, schema) else {
            return;
        };
        // Every chunk may repeat its channels.
        if self.channels.contains_key(&(id as u16)) || self.channels.len() >= MOST_NAMES {
            return;
        }
        let (topic, encoding) = (fields.text(), fields.text());
        let is_cdr = encoding.as_deref() == Some("cdr");
        let layout = (self.schemas.get(&(schema as u16)))
            .filter(|_| is_cdr)
            .and_then(|(name, text)| cdr::layout_of(name, text));
        let channel = layout.zip(topic).and_then(|(layout, topic)| {
            self.columns += layout.names.len();
            (self.columns <= MOST_COLUMNS).then(|| {
                let name = text_of(table_name(&topic).as_bytes(), 256);
                let topics = &self.flight.topics;
                let instance = topics.iter().filter(|own| own.name == name).count();
                let topic = Topic::new(&name, instance as u32, layout.names.clone(), self.wanted);
                self.flight.topics.push(topic);
                Channel {
                    topic: self.flight.topics.len() - 1,
                    layout,
                    labels: None,
                    has_stamp: false,
                }
            })
        });
        self.channels.insert(id as u16, channel);
    }

    /// Number of the channel (u16), count (u32), time of the recording and of the sender (u64, ns), message.
    fn message(&mut self, payload: &[u8]) {
        let mut fields = Fields(payload);
        let id = fields.take(2).map(number);
        let _count = fields.take(4);
        let recorded_ns = fields.take(8).map(number);
        let sent = fields.take(8);
        let (Some(id), Some(recorded_ns), Some(_)) = (id, recorded_ns, sent) else {
            self.loss.rows_dropped += 1;
            return;
        };
        let channel = match self.channels.get_mut(&(id as u16)) {
            Some(Some(channel)) => channel,
            Some(None) => return,
            None => {
                self.loss.rows_dropped += 1;
                return;
            }
        };
        let (row, labels) = (&mut self.row, &mut self.labels);
        if channel.layout.read(fields.0, row, labels).is_none() {
            self.loss.rows_dropped += 1;
            return;
        }
        let stamp_us =
            (channel.layout.stamp).map(|[seconds, rest]| row[seconds] * 1e6 + row[rest] * 1e-3);
        let recorded_us = recorded_ns as f64 * 1e-3;
        if channel.labels.is_none() {
            self.flight.topics[channel.topic].fields = channel.layout.labelled(labels);
            channel.labels = Some(labels.clone());
            channel.has_stamp =
                stamp_us.is_some_and(|stamp_us| (stamp_us - recorded_us).abs() < SAME_CLOCK_US);
        }
        if channel.labels.as_ref() != Some(labels) {
            self.loss.rows_dropped += 1;
            return;
        }
        let own_us = channel
            .layout
            .timestamp
            .map(|at| row[at])
            .or(stamp_us.filter(|_| channel.has_stamp));
        let time_us = own_us.filter(|time_us| *time_us > 0.0);
        let time_us = time_us.unwrap_or(recorded_us);
        self.flight.topics[channel.topic].push(time_us, |_, field| row[field]);
    }
}

/// Name of the table of a topic: behind the last `/`, without a version.
fn table_name(topic: &str) -> &str {
    let name = topic.rsplit('/').next().unwrap_or(topic);
    let is_version = |end: &str| !end.is_empty() && end.bytes().all(|byte| byte.is_ascii_digit());
    match name.rsplit_once("_v") {
        Some((own, version)) if is_version(version) => own,
        _ => name,
    }
}

/// A little-endian number of at most 8 bytes.
fn number(bytes: &[u8]) -> u64 {
    let next = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
    bytes.iter().rev().take(8).fold(0, next)
}

/// The fields of a record.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    /// Size (u32) and text.
    fn text(&mut self) -> Option<String> {
        let size = self.take(4).map(number)?;
        let bytes = self.take(usize::try_from(size).ok()?)?;
        Some(String::from_utf8_lossy(bytes).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_have_the_names_of_a_ulog() {
        for (topic, name) in [
            (
                "/fmu/out/vehicle_torque_setpoint",
                "vehicle_torque_setpoint",
            ),
            ("/px4_1/fmu/out/vehicle_status_v1", "vehicle_status"),
            ("estimator_v", "estimator_v"),
            ("/", ""),
        ] {
            assert_eq!(table_name(topic), name);
        }
        assert_eq!(number(&[1, 2, 0, 0]), 513);
    }
}
