//! The contents of a log before anyone knows what they mean: flights, topics with rows, parameters.
//!
//! Every reader fills these tables. Only the columns asked for ([`Wanted`]) are kept, so that memory is bounded by the
//! chosen signals; of the other topics only names, counts and times are known.

use std::collections::BTreeMap;

/// Maximum number of rows that are kept of a topic: 2^22, two hours at 500 Hz.
pub(super) const MOST_ROWS: usize = 1 << 22;

/// Maximum number of names (topics, parameters, messages of text) that are kept of a log.
pub(super) const MOST_NAMES: usize = 1 << 16;

/// Maximum number of messages of text that are kept of a flight.
const MOST_MESSAGES: usize = 1000;

/// A longer increment of time, in microseconds, is a pause of the log; it does not count for rates.
const PAUSE_US: f64 = 5e6;

/// A time farther from those before, in seconds, is a damaged stamp.
const DAY_S: f64 = 86_400.0;

/// Format of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LogFormat {
    /// PX4 ULog (`.ulg`).
    ULog,
    /// ArduPilot DataFlash, binary (`.bin`).
    DataFlash,
    /// ArduPilot DataFlash as text (`.log`).
    DataFlashText,
    /// Betaflight or INAV blackbox (`.bbl`, `.bfl`, `.txt`).
    Blackbox,
    /// MCAP with messages of PX4 through ROS 2 (`.mcap`). Read with the feature `mcap`.
    Mcap,
}

impl LogFormat {
    /// Bytes that [`Self::detect`] needs at most.
    pub const HEAD_BYTES: usize = 24;

    /// The format of a log that starts with these bytes. `None`: no flight log that is known.
    pub fn detect(head: &[u8]) -> Option<Self> {
        let starts = |magic: &[u8]| head.starts_with(magic);
        if starts(b"ULog\x01\x12\x35") {
            Some(Self::ULog)
        } else if starts(b"\xa3\x95\x80") {
            Some(Self::DataFlash)
        } else if starts(b"H Product:Blackbox") {
            Some(Self::Blackbox)
        } else if starts(b"FMT, 128,") || starts(b"FMT,128,") {
            Some(Self::DataFlashText)
        } else if starts(b"\x89MCAP0\r\n") {
            Some(Self::Mcap)
        } else {
            None
        }
    }
}

/// What was lost of a damaged or incomplete log.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Loss {
    /// Bytes that belong to no message.
    pub bytes_skipped: u64,
    /// Messages that are damaged or whose format is unknown.
    pub rows_dropped: u64,
    /// Times that the firmware says it could not write fast enough.
    pub dropouts: u64,
    /// Time lost by them, in seconds, as far as the firmware says.
    pub dropout_s: f64,
    /// Whether the log ends inside a message.
    pub is_truncated: bool,
}

/// Contents of a log.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LogTables {
    /// Its format.
    pub format: LogFormat,
    /// The flights, in order.
    pub flights: Vec<FlightTables>,
    /// What was lost.
    pub loss: Loss,
}

/// Contents of one flight.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct FlightTables {
    /// Facts about the log and the board, as the firmware names them.
    pub info: BTreeMap<String, String>,
    /// Parameters by name. Of a blackbox: the numbers of its headers; those of a list are `name[0]`, `name[1]`, ...
    pub parameters: BTreeMap<String, LogParameter>,
    /// Topics, in order of their appearance.
    pub topics: Vec<Topic>,
    /// Messages of text and their times in seconds.
    pub messages: Vec<(f64, String)>,
}

/// A parameter and its changes during the flight.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LogParameter {
    /// Value at the start.
    pub value: f64,
    /// Whether the firmware stores it as an integer.
    pub is_integer: bool,
    /// Later values and their times in seconds.
    pub changes: Vec<(f64, f64)>,
}

impl LogParameter {
    /// Value at the end.
    pub fn last(&self) -> f64 {
        self.changes.last().map_or(self.value, |&(_, value)| value)
    }
}

/// Messages of one kind: a table.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Topic {
    /// Name in the firmware.
    pub name: String,
    /// Instance, from 0, of a topic that exists several times.
    pub instance: u32,
    /// Names of the columns that hold numbers.
    pub fields: Vec<String>,
    /// Number of rows.
    pub rows: u64,
    /// Earliest time of a row, in seconds: that of the first one, unless the clock goes back.
    pub start_s: f64,
    /// Latest time of a row, in seconds.
    pub end_s: f64,
    /// Times of the rows that were kept, in seconds.
    pub time_s: Vec<f64>,
    /// Columns that were kept: index in `fields`, and values.
    pub columns: Vec<(usize, Vec<f64>)>,
    only_changes: bool,
    /// Rows and time of the increments that are no pauses.
    increments: u64,
    covered_us: f64,
    last_us: f64,
}

impl Topic {
    pub(super) fn new(name: &str, instance: u32, fields: Vec<String>, wanted: &Wanted) -> Self {
        let (chosen, only_changes) = wanted.of(name, instance, &fields);
        Self {
            name: name.to_owned(),
            instance,
            fields,
            columns: chosen
                .into_iter()
                .map(|field| (field, Vec::new()))
                .collect(),
            only_changes,
            ..Self::default()
        }
    }

    /// Rows per second, without pauses of more than 5 s; 0 with fewer than two rows.
    pub fn rate_hz(&self) -> f64 {
        if self.covered_us > 0.0 {
            self.increments as f64 * 1e6 / self.covered_us
        } else {
            0.0
        }
    }

    /// The column of this name, if it was kept.
    pub fn column(&self, field: &str) -> Option<&[f64]> {
        let is_it = |(at, _): &&(usize, Vec<f64>)| self.fields.get(*at).is_some_and(|f| f == field);
        self.columns
            .iter()
            .find(is_it)
            .map(|(_, values)| values.as_slice())
    }

    /// Whether the topic has a column of this name.
    pub fn has(&self, field: &str) -> bool {
        self.fields.iter().any(|own| own == field)
    }

    /// Counts a row of this time (us), and keeps the columns that were chosen: `value(index in the choice, field)`.
    #[inline]
    pub(super) fn push(&mut self, time_us: f64, mut value: impl FnMut(usize, usize) -> f64) {
        let time_s = time_us * 1e-6;
        if self.rows == 0 {
            (self.start_s, self.end_s) = (time_s, time_s);
        } else {
            let increment_us = time_us - self.last_us;
            if increment_us > 0.0 && increment_us < PAUSE_US {
                self.increments += 1;
                self.covered_us += increment_us;
            }
            if (time_s - self.end_s).abs() < DAY_S {
                self.start_s = self.start_s.min(time_s);
                self.end_s = self.end_s.max(time_s);
            }
        }
        self.rows += 1;
        self.last_us = time_us;
        if self.columns.is_empty() || self.time_s.len() >= MOST_ROWS {
            return;
        }
        if self.only_changes && !self.time_s.is_empty() {
            let is_same = self
                .columns
                .iter()
                .enumerate()
                .all(|(at, (field, values))| {
                    let new = value(at, *field);
                    values.last().is_some_and(|old| *old == new || new.is_nan())
                });
            if is_same {
                return;
            }
        }
        self.time_s.push(time_s);
        for (at, (field, values)) in self.columns.iter_mut().enumerate() {
            values.push(value(at, *field));
        }
    }
}

impl FlightTables {
    /// The topic of this name and instance 0.
    pub fn topic(&self, name: &str) -> Option<&Topic> {
        self.topics
            .iter()
            .find(|topic| topic.name == name && topic.instance == 0)
    }

    /// Value of a parameter at the start of the flight.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.get(name).map(|parameter| parameter.value)
    }

    /// Names, counts and times without the rows that were kept.
    pub(super) fn without_rows(mut self) -> Self {
        for topic in &mut self.topics {
            topic.time_s = Vec::new();
            topic.columns = Vec::new();
        }
        self
    }

    /// Stores a parameter, or its change.
    pub(super) fn set(&mut self, name: &str, value: f64, is_integer: bool, changed_s: Option<f64>) {
        if let Some(parameter) = self.parameters.get_mut(name) {
            let last = parameter
                .changes
                .last()
                .map_or(parameter.value, |&(_, value)| value);
            if last != value && parameter.changes.len() < MOST_NAMES {
                parameter.changes.push((changed_s.unwrap_or(0.0), value));
            }
        } else if self.parameters.len() < MOST_NAMES {
            let parameter = LogParameter {
                value,
                is_integer,
                changes: Vec::new(),
            };
            self.parameters.insert(name.to_owned(), parameter);
        }
    }

    pub(super) fn tell(&mut self, time_s: f64, text: String) {
        if self.messages.len() < MOST_MESSAGES && !text.is_empty() {
            self.messages.push((time_s, text));
        }
    }
}

/// Which columns a reader keeps.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wanted {
    everything: bool,
    columns: Vec<(String, String)>,
    changes: Vec<String>,
}

impl Wanted {
    /// Nothing but names, counts and times.
    pub fn nothing() -> Self {
        Self::default()
    }

    /// Every column of every topic, of every instance.
    pub fn everything() -> Self {
        Self {
            everything: true,
            ..Self::default()
        }
    }

    /// This column of the first instance of a topic, too.
    #[must_use]
    pub fn and(mut self, topic: &str, field: &str) -> Self {
        self.columns.push((topic.to_owned(), field.to_owned()));
        self
    }

    /// Keeps of this topic only the rows in which a chosen column changes.
    #[must_use]
    pub fn changes_of(mut self, topic: &str) -> Self {
        self.changes.push(topic.to_owned());
        self
    }

    /// What either wants.
    #[must_use]
    pub(super) fn with(mut self, other: Self) -> Self {
        self.everything |= other.everything;
        self.columns.extend(other.columns);
        self.changes.extend(other.changes);
        self
    }

    /// Indices of the fields to keep, and whether only changes are kept.
    fn of(&self, topic: &str, instance: u32, fields: &[String]) -> (Vec<usize>, bool) {
        let is_wanted = |field: &String| {
            self.everything
                || instance == 0
                    && self
                        .columns
                        .iter()
                        .any(|(of, name)| of == topic && name == field)
        };
        let chosen = (0..fields.len())
            .filter(|&at| is_wanted(&fields[at]))
            .collect();
        (chosen, self.changes.iter().any(|of| of == topic))
    }
}

/// Text for people out of bytes of a log: printable, at most `most` characters.
pub(super) fn text_of(bytes: &[u8], most: usize) -> String {
    let end = bytes
        .iter()
        .position(|&byte| byte == 0)
        .unwrap_or(bytes.len());
    let text = String::from_utf8_lossy(&bytes[..end]);
    let printable = text.chars().map(|c| if c.is_control() { ' ' } else { c });
    printable.take(most).collect::<String>().trim().to_owned()
}
