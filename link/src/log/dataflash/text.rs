//! The text form of DataFlash: one row a line, `RATE, 1234567, 0.1, ...`, formats as `FMT` lines.

use std::collections::HashMap;
use std::io::Read;

use super::{Meaning, meaning};
use crate::log::error::LogError;
use crate::log::source::Source;
use crate::log::tables::{
    FlightTables, LogFormat, LogTables, Loss, MOST_NAMES, Topic, Wanted, text_of,
};

/// Maximum length of a line in bytes.
const LONGEST_LINE: usize = 4096;

/// A type of rows: its topic, and which cells hold the time and the columns that are kept.
struct Row {
    topic: usize,
    meaning: Meaning,
    /// Cell of the time, and its unit in microseconds.
    time: Option<(usize, f64)>,
    /// Cell of each column of numbers.
    cells: Vec<usize>,
    width: usize,
}

/// Reads a log of text.
pub(in crate::log) fn read_text(
    mut source: Source<impl Read>,
    wanted: &Wanted,
) -> Result<LogTables, LogError> {
    let mut log = Log::default();
    loop {
        let bytes = source.peek(LONGEST_LINE)?;
        if bytes.is_empty() {
            break;
        }
        let end = bytes.iter().position(|&byte| byte == b'\n');
        let taken = end.map_or(bytes.len(), |end| end + 1);
        let is_whole = end.is_some();
        match std::str::from_utf8(&bytes[..end.unwrap_or(bytes.len())]) {
            Ok(line) if is_whole || bytes.len() < LONGEST_LINE => {
                if !log.take(line.trim(), wanted) {
                    log.loss.rows_dropped += u64::from(is_whole);
                    log.loss.is_truncated |= !is_whole;
                }
            }
            _ => log.loss.bytes_skipped += taken as u64,
        }
        source.skip(taken)?;
    }
    Ok(LogTables {
        format: LogFormat::DataFlashText,
        flights: vec![log.flight],
        loss: log.loss,
    })
}

#[derive(Default)]
struct Log {
    rows: HashMap<String, Row>,
    flight: FlightTables,
    loss: Loss,
    last_us: f64,
}

impl Log {
    /// Takes a line. False: it is damaged, or its format is unknown.
    fn take(&mut self, line: &str, wanted: &Wanted) -> bool {
        if line.is_empty() {
            return true;
        }
        let (name, rest) = line.split_once(',').unwrap_or((line, ""));
        if name == "FMT" {
            return self.define(rest, wanted);
        }
        let Some(row) = self.rows.get(name) else {
            return false;
        };
        // The last cell of a message may hold commas.
        let cells: Vec<&str> = rest.splitn(row.width, ',').map(str::trim).collect();
        if cells.len() != row.width {
            return false;
        }
        let number = |cell: usize| cells[cell].parse().unwrap_or(f64::NAN);
        let time_us = row
            .time
            .map_or(self.last_us, |(cell, unit_us)| number(cell) * unit_us);
        if !time_us.is_finite() {
            return false;
        }
        self.flight.topics[row.topic].push(time_us, |_, field| number(row.cells[field]));
        let at = usize::from(row.time.is_some());
        let cell = |at: usize| text_of(cells.get(at).unwrap_or(&"").as_bytes(), 64);
        match row.meaning {
            Meaning::Data => self.last_us = time_us,
            Meaning::Message => self.flight.tell(time_us * 1e-6, cell(at)),
            Meaning::Parameter => {
                let value = cells.get(at + 1).and_then(|cell| cell.parse().ok());
                if let Some(value) = value.filter(|value: &f64| value.is_finite()) {
                    self.flight
                        .set(&cell(at), value, false, Some(time_us * 1e-6));
                }
            }
        }
        true
    }

    /// Takes a format: type, length, name, types of the values, names of the columns.
    fn define(&mut self, rest: &str, wanted: &Wanted) -> bool {
        let cells: Vec<&str> = rest.split(',').map(str::trim).collect();
        let [_, _, name, types, labels @ ..] = cells.as_slice() else {
            return false;
        };
        if *name == "FMT" || self.rows.contains_key(*name) || self.rows.len() >= MOST_NAMES {
            return true;
        }
        let is_number = |letter: char| !"nNZa".contains(letter);
        let numbers = || {
            let labels = types.chars().zip(labels).enumerate();
            labels
                .filter(|(_, (letter, _))| is_number(*letter))
                .map(|(at, (_, label))| (at, *label))
        };
        let fields = numbers().map(|(_, label)| label.to_owned()).collect();
        let time = numbers().find_map(|(at, label)| match label {
            "TimeUS" => Some((at, 1.0)),
            "TimeMS" => Some((at, 1e3)),
            _ => None,
        });
        let row = Row {
            topic: self.flight.topics.len(),
            meaning: meaning(name),
            time,
            cells: numbers().map(|(at, _)| at).collect(),
            width: types.chars().count().min(labels.len()),
        };
        self.flight.topics.push(Topic::new(name, 0, fields, wanted));
        self.rows.insert((*name).to_owned(), row);
        true
    }
}
