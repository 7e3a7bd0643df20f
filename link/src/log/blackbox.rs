//! Betaflight and INAV blackbox: headers of text, then frames of differences, several flights one after another.
//!
//! ```text
//! H name:value          headers; `Field I name`, `signed`, `predictor`, `encoding` describe the frames     header.rs
//! I, P                  main frames: whole (I) or as differences from the last two (P)                      frame.rs
//! S, G, H, E            slow frame, GPS, GPS home, event
//! ```
//! A frame counts if the byte behind it begins another frame. A damaged P frame makes those up to the next I frame
//! useless. Iteration and time must go on by less than 5000 iterations and 10 s, unless the firmware says that it paused
//! or two I frames agree. Reference: Betaflight documentation, "Blackbox flight data recorder", "Blackbox internals".

mod bits;
mod frame;
mod header;

use std::io::Read;

use self::bits::Cursor;
use self::frame::{History, Layout, MOST_FIELDS, Values};
use self::header::Headers;
use super::error::LogError;
use super::source::Source;
use super::tables::{FlightTables, LogFormat, LogTables, Loss, Topic, Wanted, text_of};

/// First bytes of a flight.
const PRODUCT: &[u8] = b"H Product:Blackbox";

/// Maximum size of a frame in bytes.
const LONGEST_FRAME: usize = 256;

/// Maximum length of a header in bytes.
const LONGEST_HEADER: usize = 4096;

/// Maximum number of flights of a log.
const MOST_FLIGHTS: usize = 4096;

/// Largest step of the iteration and of the time (us) from one main frame to the next.
const LARGEST_STEP: (u32, u32) = (5000, 10_000_000);

/// Reads a log whose first bytes are those of a blackbox.
pub(super) fn read(mut source: Source<impl Read>, wanted: &Wanted) -> Result<LogTables, LogError> {
    let mut flights = Vec::new();
    let mut loss = Loss::default();
    let mut decoder: Option<Decoder<'_>> = None;
    loop {
        let bytes = source.peek(LONGEST_HEADER)?;
        let Some(&first) = bytes.first() else {
            break;
        };
        if first == b'H' && bytes.starts_with(PRODUCT) {
            flights.extend(decoder.take().map(|decoder| decoder.finish(&mut loss)));
            if flights.len() == MOST_FLIGHTS {
                loss.is_truncated = true;
                break;
            }
            decoder = Some(Decoder::new(wanted));
        }
        let taken = match &mut decoder {
            Some(decoder) => decoder.take(bytes),
            None => 0,
        };
        loss.bytes_skipped += u64::from(taken == 0);
        source.skip(taken.max(1))?;
    }
    flights.extend(decoder.map(|decoder| decoder.finish(&mut loss)));
    Ok(LogTables {
        format: LogFormat::Blackbox,
        flights,
        loss,
    })
}

/// What follows the header `H` of a frame.
enum Taken {
    /// Bytes of a whole frame.
    Whole(usize),
    /// The log ends within the frame.
    Cut,
    Damaged,
}

/// Decodes one flight.
struct Decoder<'a> {
    wanted: &'a Wanted,
    headers: Headers,
    layout: Option<Layout>,
    history: History,
    /// Whether the frames since the last I frame are known.
    is_valid: bool,
    /// Iteration and time of the last main frame.
    last: Option<(u32, u32)>,
    /// Iteration and time of an I frame that was refused because it did not follow the last one.
    refused: Option<(u32, u32)>,
    /// Microseconds, counted on over the end of 32 bits.
    time_us: f64,
    main: Topic,
    slow: Topic,
    gps: Topic,
    home: [i32; 2],
    has_ended: bool,
    loss: Loss,
}

impl<'a> Decoder<'a> {
    fn new(wanted: &'a Wanted) -> Self {
        Self {
            wanted,
            headers: Headers::default(),
            layout: None,
            history: History::default(),
            is_valid: false,
            last: None,
            refused: None,
            time_us: 0.0,
            main: Topic::default(),
            slow: Topic::default(),
            gps: Topic::default(),
            home: [0; 2],
            has_ended: false,
            loss: Loss::default(),
        }
    }

    fn finish(self, loss: &mut Loss) -> FlightTables {
        loss.rows_dropped += self.loss.rows_dropped;
        loss.is_truncated |= self.loss.is_truncated;
        let mut flight = self.headers.tables();
        let topics = [self.main, self.slow, self.gps].into_iter();
        flight.topics = topics.filter(|topic| !topic.fields.is_empty()).collect();
        flight
    }

    /// Takes what begins with these bytes, and returns how many it has. 0: the first byte begins nothing.
    fn take(&mut self, bytes: &[u8]) -> usize {
        if self.has_ended {
            // The flash between two flights is padded.
            return usize::from(matches!(bytes[0], 0 | 0xff));
        }
        if self.layout.is_none() && bytes.starts_with(b"H ") {
            let end = bytes
                .iter()
                .position(|&byte| byte == b'\n')
                .unwrap_or(bytes.len());
            let line = &bytes[2..end.max(2)];
            if end < LONGEST_HEADER && self.headers.add(&text_of(line, LONGEST_HEADER)) {
                return (end + 1).min(bytes.len());
            }
        }
        if !is_frame(bytes[0]) {
            return 0;
        }
        if self.layout.is_none() {
            let Some(layout) = self.headers.layout() else {
                return 0;
            };
            self.main = Topic::new("main", 0, layout.main_names(), self.wanted);
            self.slow = Topic::new("slow", 0, layout.slow_names(), self.wanted);
            self.gps = Topic::new("gps", 0, layout.gps_names(), self.wanted);
            self.layout = Some(layout);
        }
        match self.frame(bytes) {
            Taken::Whole(count) => count,
            Taken::Cut => {
                self.loss.is_truncated = true;
                0
            }
            Taken::Damaged => {
                self.loss.rows_dropped += 1;
                self.is_valid &= bytes[0] != b'I' && bytes[0] != b'P';
                0
            }
        }
    }

    fn frame(&mut self, bytes: &[u8]) -> Taken {
        let Some(layout) = &self.layout else {
            return Taken::Damaged;
        };
        let kind = bytes[0];
        let mut values: Values = [0; MOST_FIELDS];
        let mut cursor = Cursor::new(&bytes[1..bytes.len().min(LONGEST_FRAME)]);
        let event = match kind {
            b'I' => layout.whole.decode(&mut cursor, &mut values),
            b'P' => layout.difference.decode(&mut cursor, &mut values),
            b'S' => layout.slow.decode(&mut cursor, &mut values),
            b'G' => layout.gps.decode(&mut cursor, &mut values),
            b'H' => layout.home.decode(&mut cursor, &mut values),
            _ => Event::read(&mut cursor),
        };
        let Some(event) = event else {
            return Taken::Damaged;
        };
        if cursor.is_beyond() {
            return match bytes.len() < LONGEST_FRAME {
                true => Taken::Cut,
                false => Taken::Damaged,
            };
        }
        let end = 1 + cursor.taken();
        let is_last = matches!(event, Event::End);
        if !is_last && bytes.get(end).is_some_and(|&next| !is_frame(next)) {
            return Taken::Damaged;
        }
        match kind {
            b'I' | b'P' => self.take_main(kind, &mut values),
            b'S' => self
                .slow
                .push(self.time_us, |_, field| layout.slow.value(&values, field)),
            b'G' => {
                let base = self.last.map_or(0, |(_, time)| time);
                layout.gps.complete_gps(&mut values, base, self.home);
                self.gps
                    .push(self.time_us, |_, field| layout.gps.value(&values, field));
            }
            b'H' => self.home = [values[0], values[1]],
            _ => self.take_event(&event),
        }
        Taken::Whole(end)
    }

    /// Takes a main frame whose differences are decoded.
    fn take_main(&mut self, kind: u8, values: &mut Values) {
        let Some(layout) = &self.layout else {
            return;
        };
        let part = if kind == b'I' {
            &layout.whole
        } else {
            &layout.difference
        };
        if kind == b'P' && !self.is_valid {
            self.loss.rows_dropped += 1;
            return;
        }
        let skipped = layout.skipped_after(self.last.map_or(0, |(iteration, _)| iteration));
        part.complete(values, &self.history, &layout.constants, skipped);
        let new = layout.iteration_and_time(values);
        let follows = |old: (u32, u32)| {
            new.0.wrapping_sub(old.0) < LARGEST_STEP.0 && new.1.wrapping_sub(old.1) < LARGEST_STEP.1
        };
        let is_next = self.last.is_none_or(follows);
        let is_second = kind == b'I' && self.refused.is_some_and(follows);
        if !(is_next || is_second) {
            self.refused = (kind == b'I').then_some(new);
            self.is_valid = false;
            self.loss.rows_dropped += 1;
            return;
        }
        self.refused = None;
        self.is_valid = true;
        self.time_us = match self.last {
            Some((_, last)) if is_next => self.time_us + f64::from(new.1.wrapping_sub(last)),
            _ => f64::from(new.1),
        };
        self.last = Some(new);
        self.history.add(kind == b'I', values);
        self.main
            .push(self.time_us, |_, field| part.value(values, field));
    }

    fn take_event(&mut self, event: &Event) {
        match event {
            Event::Resume { iteration, time } if self.last.is_some() => {
                let on = time.wrapping_sub(self.last.map_or(0, |(_, last)| last));
                self.time_us += f64::from(on);
                self.last = Some((*iteration, *time));
            }
            Event::End => self.has_ended = true,
            _ => {}
        }
    }
}

fn is_frame(byte: u8) -> bool {
    b"IPSGHE".contains(&byte)
}

/// An event, or no event in particular.
enum Event {
    Other,
    Resume { iteration: u32, time: u32 },
    End,
}

impl Event {
    /// Reads an event after its `E`. `None`: there is no such event.
    fn read(cursor: &mut Cursor<'_>) -> Option<Self> {
        match cursor.byte() {
            // Beep of the synchronisation, reason of disarming, error of the inertial sensor.
            0 | 15 => _ = cursor.unsigned(),
            40 => _ = cursor.unsigned(),
            // Autotune of Cleanflight: cycle, result, targets.
            10 | 11 => (0..5).for_each(|_| _ = cursor.byte()),
            12 => (0..8).for_each(|_| _ = cursor.byte()),
            13 => {
                if cursor.byte() < 128 {
                    _ = cursor.signed();
                } else {
                    (0..4).for_each(|_| _ = cursor.byte());
                }
            }
            14 => {
                let (iteration, time) = (cursor.unsigned(), cursor.unsigned());
                return Some(Self::Resume { iteration, time });
            }
            30 => _ = (cursor.unsigned(), cursor.unsigned()),
            255 => {
                let is_end = b"End of log".iter().all(|&letter| cursor.byte() == letter);
                return (is_end && cursor.byte() == 0).then_some(Self::End);
            }
            _ => return None,
        }
        Some(Self::Other)
    }
}
