//! Flight logs of a vehicle: their list, and their bytes in order.
//!
//! A log comes in blocks of 90 bytes. A window of blocks is asked for at once; those that do not come are asked for again,
//! in any order, until the window is complete.

use std::io;
use std::time::Duration;

use mavlink::dialects::common::{
    LOG_DATA_DATA, LOG_ENTRY_DATA, LOG_REQUEST_DATA_DATA, LOG_REQUEST_END_DATA,
    LOG_REQUEST_LIST_DATA, MavMessage,
};

use crate::error::LiveError;
use crate::vehicle::{TRIES, Vehicle};

/// Bytes of a block.
const BLOCK: u32 = 90;
/// Blocks of a window.
const WINDOW: u32 = 512;
/// After this time without a block the missing ones are asked for again.
const PAUSE: Duration = Duration::from_millis(400);
/// Logs are listed from the card, which may be slow.
const LIST: Duration = Duration::from_secs(3);

/// A log on the card of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct LogEntry {
    /// Number in the vehicle.
    pub id: u16,
    /// Size in bytes.
    pub size: u32,
    /// When it was written, in seconds since 1970; `None`: not known.
    pub utc_s: Option<u32>,
}

impl LogEntry {
    /// The log up to a place, as if it ended there.
    #[must_use]
    pub fn up_to(self, size: u32) -> Self {
        Self {
            size: size.min(self.size),
            ..self
        }
    }
}

/// Why a log did not come whole. What came before is in order.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The vehicle cannot be asked.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// The bytes cannot be written.
    #[error(transparent)]
    Write(#[from] io::Error),
    /// The log ends before its size.
    #[error("the log ends after {got} of {size} bytes")]
    Short {
        /// Bytes that came.
        got: u32,
        /// Bytes of the list.
        size: u32,
    },
}

impl Vehicle {
    /// The logs on the card, by number.
    ///
    /// # Errors
    /// The vehicle does not answer, as ArduPilot while it is armed.
    pub fn logs(&mut self) -> Result<Vec<LogEntry>, LiveError> {
        let mut found: Vec<LogEntry> = Vec::new();
        let mut is_answered = false;
        for _ in 0..TRIES {
            let (target_system, target_component) = self.target();
            self.send(&MavMessage::LOG_REQUEST_LIST(LOG_REQUEST_LIST_DATA {
                start: 0,
                end: u16::MAX,
                target_system,
                target_component,
            }));
            let mut until = self.now() + LIST;
            while let Some(message) = self.receive(until) {
                let MavMessage::LOG_ENTRY(entry) = message else {
                    continue;
                };
                is_answered = true;
                // Only a new entry is worth waiting for the next: a vehicle may repeat a part of its list for ever.
                if entry.num_logs > 0 && found.iter().all(|own| own.id != entry.id) {
                    found.push(log_entry(&entry));
                    found.sort_by_key(|entry| entry.id);
                    until = self.now() + LIST;
                }
                if found.len() >= usize::from(entry.num_logs) {
                    return Ok(found);
                }
            }
        }
        match is_answered {
            // Some entries never come; the others are of use.
            true => Ok(found),
            false if self.is_lost() => Err(LiveError::Lost),
            false => Err(LiveError::NoLogs),
        }
    }

    /// The bytes of a log from a place on, in order. `patience`: longest time without any block.
    ///
    /// # Errors
    /// The link is lost for longer, the log ends early, or `sink` fails.
    pub fn download(
        &mut self,
        entry: &LogEntry,
        from: u32,
        patience: Duration,
        sink: &mut dyn FnMut(&[u8]) -> io::Result<()>,
    ) -> Result<(), LogError> {
        let mut at = from;
        while at < entry.size {
            let end = entry.size.min(at.saturating_add(BLOCK * WINDOW));
            let window = self.window(entry.id, at..end, patience)?;
            sink(&window)?;
            at += window.len() as u32;
            if at < end {
                let size = entry.size;
                return Err(LogError::Short { got: at, size });
            }
        }
        let (target_system, target_component) = self.target();
        self.send(&MavMessage::LOG_REQUEST_END(LOG_REQUEST_END_DATA {
            target_system,
            target_component,
        }));
        Ok(())
    }

    /// The bytes of a window; fewer if the log ends within it.
    fn window(
        &mut self,
        id: u16,
        range: std::ops::Range<u32>,
        patience: Duration,
    ) -> Result<Vec<u8>, LiveError> {
        let mut window = Window::new(range);
        let mut heard = self.now();
        while let Some((ofs, count)) = window.gap() {
            if self.now() - heard > patience {
                return Err(LiveError::Lost);
            }
            let (target_system, target_component) = self.target();
            self.send(&MavMessage::LOG_REQUEST_DATA(LOG_REQUEST_DATA_DATA {
                ofs,
                count,
                id,
                target_system,
                target_component,
            }));
            let mut until = self.now() + PAUSE;
            while let Some(message) = self.receive(until) {
                let MavMessage::LOG_DATA(data) = message else {
                    continue;
                };
                if data.id == id && window.take(&data) {
                    heard = self.now();
                    until = heard + PAUSE;
                }
                // Behind the asked part nothing more comes.
                if window.has(ofs, count) {
                    break;
                }
            }
        }
        Ok(window.bytes())
    }
}

fn log_entry(message: &LOG_ENTRY_DATA) -> LogEntry {
    LogEntry {
        id: message.id,
        size: message.size,
        utc_s: (message.time_utc > 0).then_some(message.time_utc),
    }
}

/// Blocks of a part of a log.
struct Window {
    start: u32,
    bytes: Vec<u8>,
    has: Vec<bool>,
}

impl Window {
    fn new(range: std::ops::Range<u32>) -> Self {
        let length = range.end - range.start;
        Self {
            start: range.start,
            bytes: vec![0; length as usize],
            has: vec![false; length.div_ceil(BLOCK) as usize],
        }
    }

    /// Takes a block in. False: it is not of this window, or is there already.
    fn take(&mut self, data: &LOG_DATA_DATA) -> bool {
        let Some(at) = data.ofs.checked_sub(self.start) else {
            return false;
        };
        let (at, count) = (at as usize, usize::from(data.count).min(data.data.len()));
        if at % BLOCK as usize != 0 || at >= self.bytes.len() {
            return false;
        }
        let wanted = (self.bytes.len() - at).min(BLOCK as usize);
        if count < wanted {
            // The log ends here.
            self.bytes.truncate(at + count);
            self.has.truncate(self.bytes.len().div_ceil(BLOCK as usize));
        }
        let count = count.min(wanted);
        self.bytes[at..at + count].copy_from_slice(&data.data[..count]);
        // Only a new block is worth waiting for the next: a vehicle may repeat one for ever.
        let has = self.has.get_mut(at / BLOCK as usize);
        has.is_none_or(|has| !std::mem::replace(has, true))
    }

    /// Place and length of the first blocks in a row that are missing.
    fn gap(&self) -> Option<(u32, u32)> {
        let first = self.has.iter().position(|has| !has)?;
        let blocks = self.has[first..].iter().take_while(|has| !**has).count();
        let at = first * BLOCK as usize;
        let length = (blocks * BLOCK as usize).min(self.bytes.len() - at);
        Some((self.start + at as u32, length as u32))
    }

    /// Whether every block of this part is there.
    fn has(&self, from: u32, length: u32) -> bool {
        let first = ((from - self.start) / BLOCK) as usize;
        let blocks = length.div_ceil(BLOCK) as usize;
        self.has.iter().skip(first).take(blocks).all(|has| *has)
    }

    fn bytes(self) -> Vec<u8> {
        self.bytes
    }
}
