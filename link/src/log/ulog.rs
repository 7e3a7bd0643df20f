//! PX4 ULog: definitions, then messages of data, each with a header of size and type.
//!
//! ```text
//! "ULog" 01 12 35, version, start       16 bytes
//! size (u16), type (u8), payload        F format, A subscription, D row, P parameter, I information, L text,
//!                                       O drop-out, S synchronisation, B flags with offsets of appended data
//! ```
//! A damaged message is skipped: reading goes on at the next place where three messages follow each other.
//! Reference: PX4 user guide, "ULog File Format".

mod layout;

use std::collections::HashMap;
use std::io::Read;

use self::layout::{Layout, Member, layout_of, members_of};
use super::error::LogError;
use super::scalar::Scalar;
use super::source::Source;
use super::tables::{FlightTables, LogFormat, LogTables, Loss, MOST_NAMES, Topic, Wanted, text_of};

/// Bytes before the first message.
const HEAD_BYTES: usize = 16;

/// Messages that must follow each other before reading goes on after damage.
const CHAIN: usize = 3;

/// Maximum number of columns over all subscriptions.
const MOST_COLUMNS: usize = 1 << 20;

/// Reads a log whose first bytes are those of a ULog.
pub(super) fn read(source: Source<impl Read>, wanted: &Wanted) -> Result<LogTables, LogError> {
    let mut reader = Reader {
        source,
        wanted,
        formats: HashMap::new(),
        subscriptions: HashMap::new(),
        columns: 0,
        appended: Vec::new(),
        has_data: false,
        last_us: 0.0,
        flight: FlightTables::default(),
        loss: Loss::default(),
    };
    reader.source.skip(HEAD_BYTES)?;
    while reader.next()? {}
    Ok(LogTables {
        format: LogFormat::ULog,
        flights: vec![reader.flight],
        loss: reader.loss,
    })
}

/// A topic under the number by which its rows name it.
struct Subscription {
    /// Index of the topic.
    topic: usize,
    layout: Layout,
    /// Offset and type of the columns that are kept.
    kept: Vec<(usize, Scalar)>,
}

struct Reader<'a, R> {
    source: Source<R>,
    wanted: &'a Wanted,
    formats: HashMap<String, Vec<Member>>,
    subscriptions: HashMap<u16, Subscription>,
    columns: usize,
    /// Offsets at which the log goes on, the last one first.
    appended: Vec<u64>,
    has_data: bool,
    last_us: f64,
    flight: FlightTables,
    loss: Loss,
}

impl<R: Read> Reader<'_, R> {
    /// Reads a message. False at the end of the log.
    fn next(&mut self) -> Result<bool, LogError> {
        let head = self.source.peek(5)?;
        let (size, kind, id) = match *head {
            [] => return Ok(false),
            [a, b, kind, c, d] => (u16::from_le_bytes([a, b]), kind, u16::from_le_bytes([c, d])),
            [a, b, kind, ..] => (u16::from_le_bytes([a, b]), kind, 0),
            _ => {
                self.loss.is_truncated = true;
                return Ok(false);
            }
        };
        let whole = 3 + usize::from(size);
        if !is_plausible(&self.subscriptions, kind, size, id) {
            return self.resynchronise();
        }
        if self.goes_on_elsewhere(whole)? {
            return Ok(true);
        }
        let bytes = self.source.peek(whole + 3)?;
        if bytes.len() < whole {
            self.loss.is_truncated = true;
            self.loss.bytes_skipped += bytes.len() as u64;
            return Ok(false);
        }
        // A row has its number and its size to vouch for it; other messages need a neighbour.
        if kind != b'D' && bytes.get(whole + 2).is_some_and(|&next| !is_kind(next)) {
            return self.resynchronise();
        }
        if kind == b'D' {
            if let Some(subscription) = self.subscriptions.get(&id) {
                let row = &bytes[5..whole];
                let time_us = Scalar::U64.read(&row[subscription.layout.time_offset..]);
                self.last_us = self.last_us.max(time_us);
                self.flight.topics[subscription.topic].push(time_us, |at, _| {
                    let (offset, scalar) = subscription.kept[at];
                    scalar.read(&row[offset..])
                });
            } else {
                self.loss.rows_dropped += 1;
            }
        } else {
            let payload = bytes[3..whole].to_vec();
            self.take(kind, &payload);
        }
        self.source.skip(whole)?;
        Ok(true)
    }

    /// Takes a message that is no row.
    fn take(&mut self, kind: u8, payload: &[u8]) {
        match kind {
            b'B' => self.take_flags(payload),
            b'F' => {
                if let Some((name, members)) = members_of(payload)
                    && self.formats.len() < MOST_NAMES
                {
                    self.formats.insert(name, members);
                }
            }
            b'A' => self.subscribe(payload),
            b'R' => {
                if let Some(id) = payload.first_chunk() {
                    self.subscriptions.remove(&u16::from_le_bytes(*id));
                }
            }
            b'P' | b'I' => self.take_value(kind, payload),
            b'L' if payload.len() > 9 => {
                self.has_data = true;
                let time_s = Scalar::U64.read(&payload[1..]) * 1e-6;
                self.flight.tell(time_s, text_of(&payload[9..], 256));
            }
            b'O' => {
                self.loss.dropouts += 1;
                self.loss.dropout_s += Scalar::U16.read(payload) * 1e-3;
            }
            _ => {}
        }
    }

    fn take_flags(&mut self, payload: &[u8]) {
        let offsets = payload.get(16..).unwrap_or_default().chunks_exact(8);
        let offsets = offsets.filter_map(|bytes| bytes.try_into().ok().map(u64::from_le_bytes));
        self.appended = offsets.filter(|&offset| offset > 0).collect();
        self.appended.sort_unstable_by(|a, b| b.cmp(a));
    }

    /// Goes to appended data if the next message would reach into them: the part before was not finished.
    fn goes_on_elsewhere(&mut self, whole: usize) -> Result<bool, LogError> {
        let position = self.source.position();
        while self
            .appended
            .last()
            .is_some_and(|&offset| offset <= position)
        {
            self.appended.pop();
        }
        match self.appended.last() {
            Some(&offset) if offset < position + whole as u64 => {
                let rest = offset - position;
                self.loss.bytes_skipped += rest;
                self.source.skip(rest as usize)?;
                self.appended.pop();
                Ok(true)
            }
            _ => Ok(false),
        }
    }

    fn subscribe(&mut self, payload: &[u8]) {
        self.has_data = true;
        let [instance, low, high, name @ ..] = payload else {
            return;
        };
        let name = text_of(name, 256);
        let Some(layout) = layout_of(&self.formats, &name) else {
            return;
        };
        self.columns += layout.columns.len();
        if self.columns > MOST_COLUMNS || self.flight.topics.len() >= MOST_NAMES {
            return;
        }
        let names = layout
            .columns
            .iter()
            .map(|column| column.name.clone())
            .collect();
        let topic = Topic::new(&name, u32::from(*instance), names, self.wanted);
        let place = |field: usize| (layout.columns[field].offset, layout.columns[field].scalar);
        let kept = topic
            .columns
            .iter()
            .map(|&(field, _)| place(field))
            .collect();
        let subscription = Subscription {
            topic: self.flight.topics.len(),
            layout,
            kept,
        };
        self.flight.topics.push(topic);
        self.subscriptions
            .insert(u16::from_le_bytes([*low, *high]), subscription);
    }

    /// Takes a parameter or a fact: length of the key, key such as `float MC_ROLL_P`, value.
    fn take_value(&mut self, kind: u8, payload: &[u8]) {
        let Some((&length, rest)) = payload.split_first() else {
            return;
        };
        let Some((key, value)) = rest.split_at_checked(usize::from(length)) else {
            return;
        };
        let key = text_of(key, 256);
        let Some((type_name, name)) = key.split_once(' ') else {
            return;
        };
        let scalar = layout::scalar_of(type_name);
        if kind == b'I' {
            let text = match scalar {
                Some(scalar) => scalar.read(value).to_string(),
                None => text_of(value, 256),
            };
            if self.flight.info.len() < MOST_NAMES {
                self.flight.info.insert(name.to_owned(), text);
            }
            return;
        }
        let changed_s = self.has_data.then_some(self.last_us * 1e-6);
        let value = scalar.map_or(f64::NAN, |scalar| scalar.read(value));
        if value.is_finite() {
            self.flight
                .set(name, value, scalar != Some(Scalar::F32), changed_s);
        }
    }

    /// Skips bytes up to the next place where messages follow each other.
    fn resynchronise(&mut self) -> Result<bool, LogError> {
        self.loss.rows_dropped += 1;
        loop {
            self.source.skip(1)?;
            self.loss.bytes_skipped += 1;
            if self.source.peek(3)?.len() < 3 {
                self.loss.bytes_skipped += self.source.peek(3)?.len() as u64;
                self.loss.is_truncated = true;
                return Ok(false);
            }
            if self.is_chain()? {
                return Ok(true);
            }
        }
    }

    fn is_chain(&mut self) -> Result<bool, LogError> {
        let mut at = 0;
        for link in 0..CHAIN {
            let head = self.source.peek(at + 5)?.get(at..).unwrap_or_default();
            let (size, kind, id) = match *head {
                [] => return Ok(link > 0),
                [a, b, kind, c, d] => {
                    (u16::from_le_bytes([a, b]), kind, u16::from_le_bytes([c, d]))
                }
                _ => return Ok(false),
            };
            if !is_plausible(&self.subscriptions, kind, size, id) {
                return Ok(false);
            }
            at += 3 + usize::from(size);
        }
        Ok(true)
    }
}

fn is_kind(byte: u8) -> bool {
    b"BFIMPQARDLCSO".contains(&byte)
}

/// Whether a message may have this header; `id` are its first two bytes.
fn is_plausible(rows: &HashMap<u16, Subscription>, kind: u8, size: u16, id: u16) -> bool {
    let size = usize::from(size);
    match kind {
        b'D' => rows
            .get(&id)
            .map_or(size > 2, |row| row.layout.fits(size.saturating_sub(2))),
        b'S' => size == 8 && id == 0x732f,
        b'O' | b'R' => size == 2,
        b'L' => size > 9,
        b'C' => size > 11,
        kind => is_kind(kind) && size > 0,
    }
}
