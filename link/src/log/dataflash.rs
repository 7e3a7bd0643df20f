//! ArduPilot DataFlash: rows whose formats the log itself describes (`FMT`), binary or as text.
//!
//! ```text
//! a3 95, type (u8), values       lengths and types of the values as FMT says; FMT itself has type 128
//! ```
//! A damaged row is skipped: reading goes on at the next `a3 95` with a known type that is followed by another.
//! Reference: ArduPilot developer documentation, "Code Overview: Adding a new log message".

mod text;

use std::io::Read;

use super::error::LogError;
use super::scalar::Scalar;
use super::source::Source;
use super::tables::{FlightTables, LogFormat, LogTables, Loss, Topic, Wanted, text_of};

pub(super) use text::read_text;

const HEAD: [u8; 2] = [0xa3, 0x95];
const FMT: u8 = 128;
const FMT_BYTES: usize = 89;

/// Reads a binary log.
pub(super) fn read(mut source: Source<impl Read>, wanted: &Wanted) -> Result<LogTables, LogError> {
    let mut log = Log::new();
    loop {
        let head = source.peek(3)?;
        let kind = match *head {
            [a, b, kind] if [a, b] == HEAD => kind,
            [_, _, _] => {
                skip_damage(&mut source, &mut log)?;
                continue;
            }
            _ => {
                log.loss.is_truncated = !head.is_empty();
                log.loss.bytes_skipped += head.len() as u64;
                break;
            }
        };
        let Some(size) = log.size(kind) else {
            log.loss.rows_dropped += 1;
            skip_damage(&mut source, &mut log)?;
            continue;
        };
        let bytes = source.peek(size + 2)?;
        if bytes.len() < size {
            log.loss.is_truncated = true;
            log.loss.bytes_skipped += bytes.len() as u64;
            break;
        }
        // Erased or zero bytes at the end of a page follow the last row.
        let is_followed = match bytes[size..] {
            [a, b] => [a, b] == HEAD || [a, b] == [0, 0] || [a, b] == [0xff, 0xff],
            _ => true,
        };
        if !is_followed && !follows_damage(&mut source, size, &log)? {
            log.loss.rows_dropped += 1;
            skip_damage(&mut source, &mut log)?;
            continue;
        }
        let bytes = source.peek(size)?;
        if kind == FMT {
            log.define(&bytes[3..], wanted);
        } else {
            log.take(kind, &bytes[3..]);
        }
        source.skip(size)?;
    }
    Ok(LogTables {
        format: LogFormat::DataFlash,
        flights: vec![log.flight],
        loss: log.loss,
    })
}

/// Whether a row whose neighbour is damaged is whole itself: another row begins within its next 256 bytes, none inside.
fn follows_damage(
    source: &mut Source<impl Read>,
    size: usize,
    log: &Log,
) -> Result<bool, LogError> {
    let bytes = source.peek(size + 256)?;
    let inside = &bytes[2..size.min(bytes.len())];
    let begins = |pair: &[u8]| pair[..2] == HEAD && log.size(pair[2]).is_some();
    Ok(!inside.windows(3).any(begins) && bytes[size.min(bytes.len())..].windows(3).any(begins))
}

/// Skips bytes up to the next row that is followed by another, or ends the log.
fn skip_damage(source: &mut Source<impl Read>, log: &mut Log) -> Result<(), LogError> {
    loop {
        source.skip(1)?;
        log.loss.bytes_skipped += 1;
        let head = source.peek(3)?;
        let kind = match *head {
            [a, b, kind] if [a, b] == HEAD => kind,
            [_, _, _] => continue,
            _ => return Ok(()),
        };
        let Some(size) = log.size(kind) else {
            continue;
        };
        let bytes = source.peek(size + 2)?;
        if bytes.len() == size || bytes.get(size..).is_some_and(|next| next == HEAD) {
            return Ok(());
        }
    }
}

/// A type of rows.
struct Row {
    /// Bytes with the head.
    size: usize,
    /// Index of the topic.
    topic: usize,
    meaning: Meaning,
    /// Offset, type and factor of every column of numbers; the last is a divisor of 1, 100 or 1e7.
    columns: Vec<Number>,
    kept: Vec<Number>,
    /// Offset and size of every column of text.
    texts: Vec<(usize, usize)>,
    /// The time in microseconds.
    time: Option<Number>,
}

#[derive(Clone, Copy)]
struct Number {
    offset: usize,
    scalar: Scalar,
    divisor: f64,
}

impl Number {
    #[inline]
    fn read(self, bytes: &[u8]) -> f64 {
        self.scalar
            .read(bytes.get(self.offset..).unwrap_or_default())
            / self.divisor
    }
}

/// What the reader itself does with a row.
#[derive(Clone, Copy, PartialEq)]
enum Meaning {
    Data,
    Parameter,
    Message,
}

/// What a log has told so far.
struct Log {
    rows: [Option<Box<Row>>; 256],
    flight: FlightTables,
    loss: Loss,
    last_us: f64,
}

impl Log {
    fn new() -> Self {
        Self {
            rows: [const { None }; 256],
            flight: FlightTables::default(),
            loss: Loss::default(),
            last_us: 0.0,
        }
    }

    fn size(&self, kind: u8) -> Option<usize> {
        match &self.rows[usize::from(kind)] {
            Some(row) => Some(row.size),
            None => (kind == FMT).then_some(FMT_BYTES),
        }
    }

    /// Takes a format: type, length, name, types of the values, names of the columns.
    fn define(&mut self, bytes: &[u8], wanted: &Wanted) {
        let [kind, size, rest @ ..] = bytes else {
            return;
        };
        let [name, types, labels] = [0..4, 4..20, 20..84].map(|part| {
            rest.get(part)
                .map(|bytes| text_of(bytes, 64))
                .unwrap_or_default()
        });
        let known = self.rows[usize::from(*kind)].as_ref();
        if *kind == FMT || known.is_some() {
            return;
        }
        let mut row = Row {
            size: usize::from(*size),
            topic: self.flight.topics.len(),
            meaning: meaning(&name),
            columns: Vec::new(),
            kept: Vec::new(),
            texts: Vec::new(),
            time: None,
        };
        let mut fields = Vec::new();
        let mut offset = 0;
        for (letter, label) in types.chars().zip(labels.split(',')) {
            let Some((size, number)) = value(letter, offset) else {
                return;
            };
            match number {
                Some(number) => {
                    match label {
                        "TimeUS" => row.time = Some(number),
                        "TimeMS" => {
                            row.time = Some(Number {
                                divisor: 1e-3,
                                ..number
                            });
                        }
                        _ => {}
                    }
                    fields.push(label.to_owned());
                    row.columns.push(number);
                }
                None => row.texts.push((offset, size)),
            }
            offset += size;
        }
        if row.size != offset + 3 {
            self.loss.rows_dropped += 1;
            return;
        }
        let topic = Topic::new(&name, 0, fields, wanted);
        row.kept = topic
            .columns
            .iter()
            .map(|&(at, _)| row.columns[at])
            .collect();
        self.flight.topics.push(topic);
        self.rows[usize::from(*kind)] = Some(Box::new(row));
    }

    /// Takes a row.
    #[inline]
    fn take(&mut self, kind: u8, bytes: &[u8]) {
        let Some(row) = &self.rows[usize::from(kind)] else {
            return;
        };
        let time_us = row.time.map_or(self.last_us, |time| time.read(bytes));
        self.flight.topics[row.topic].push(time_us, |at, _| row.kept[at].read(bytes));
        if row.meaning == Meaning::Data {
            self.last_us = time_us;
            return;
        }
        let text = |at: usize| {
            let &(offset, size) = row.texts.get(at)?;
            Some(text_of(bytes.get(offset..offset + size)?, 64))
        };
        let first = text(0).unwrap_or_default();
        match row.meaning {
            Meaning::Message => self.flight.tell(time_us * 1e-6, first),
            _ => {
                let at = usize::from(row.time.is_some());
                let value = row
                    .columns
                    .get(at)
                    .map_or(f64::NAN, |number| number.read(bytes));
                if value.is_finite() && !first.is_empty() {
                    self.flight.set(&first, value, false, Some(time_us * 1e-6));
                }
            }
        }
    }
}

fn meaning(topic: &str) -> Meaning {
    match topic {
        "PARM" => Meaning::Parameter,
        "MSG" => Meaning::Message,
        _ => Meaning::Data,
    }
}

/// Size of a value of this type, and how to read it if it is a number. `None`: no such type.
fn value(letter: char, offset: usize) -> Option<(usize, Option<Number>)> {
    let number = |scalar: Scalar, divisor| {
        let number = Number {
            offset,
            scalar,
            divisor,
        };
        Some((scalar.size(), Some(number)))
    };
    match letter {
        'b' => number(Scalar::I8, 1.0),
        'B' | 'M' => number(Scalar::U8, 1.0),
        'h' => number(Scalar::I16, 1.0),
        'H' => number(Scalar::U16, 1.0),
        'i' => number(Scalar::I32, 1.0),
        'I' => number(Scalar::U32, 1.0),
        'f' => number(Scalar::F32, 1.0),
        'd' => number(Scalar::F64, 1.0),
        'q' => number(Scalar::I64, 1.0),
        'Q' => number(Scalar::U64, 1.0),
        'g' => number(Scalar::F16, 1.0),
        'c' => number(Scalar::I16, 100.0),
        'C' => number(Scalar::U16, 100.0),
        'e' => number(Scalar::I32, 100.0),
        'E' => number(Scalar::U32, 100.0),
        'L' => number(Scalar::I32, 1e7),
        'n' => Some((4, None)),
        'N' => Some((16, None)),
        'Z' | 'a' => Some((64, None)),
        _ => None,
    }
}
