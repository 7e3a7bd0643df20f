//! DBC files: where the signals lie in the frames of a CAN bus.
//!
//! ```text
//! BO_ 257 Motor: 8 ECU                                   frame 257 (with bit 31 for 29-bit numbers) of 8 bytes
//!  SG_ Speed : 0|16@1+ (0.1,0) [0|6553.5] "rpm" Vector   first bit | bits @ 1 least or 0 most significant byte first, sign (scale, offset)
//!  SG_ Kind M : 16|8@1+ (1,0) [0|0] "" Vector            tells which of the signals `m0`, `m1` ... is in the frame
//! SIG_VALTYPE_ 257 Speed : 1;                            1: the bits are those of a float, 2: of a double
//! ```
//! Reference: Vector, "DBC File Format Documentation", version 1.0.5. Lines of other kinds are skipped. The crate `can-dbc` 10 reads
//! all of it, but its parser needs a C compiler (`psm`), which the page of WebAssembly is built without.

use std::collections::HashMap;

use crate::csv::error::ReadError;

/// Most signals of a file.
const MOST_SIGNALS: usize = 1 << 16;

/// The frames of a bus by their numbers.
#[derive(Debug, Default)]
pub(super) struct Dbc {
    frames: HashMap<u32, Vec<Signal>>,
}

#[derive(Debug, Clone, PartialEq)]
struct Signal {
    /// `Motor.Speed [rpm]`.
    name: String,
    place: Place,
    scale: f64,
    offset: f64,
    number: Number,
    part: Part,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    start: usize,
    bits: usize,
    is_little_endian: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Number {
    Unsigned,
    Signed,
    Float,
    Double,
}

/// Whether a signal is in every frame.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    Always,
    /// It tells which others are.
    Selector,
    /// Only where the selector has this value.
    Selected(u64),
}

impl Dbc {
    /// Reads a file.
    ///
    /// # Errors
    /// [`ReadError::BadDbc`]: a signal that cannot be read, or no signal.
    pub(super) fn parse(text: &str) -> Result<Self, ReadError> {
        let mut dbc = Self::default();
        let (mut frame, mut count) = (None, 0);
        for (line, number) in text.lines().map(str::trim).zip(1..) {
            let bad = ReadError::BadDbc { line: number };
            if let Some(rest) = line.strip_prefix("BO_ ") {
                let mut words = rest.split_whitespace();
                let id = words.next().and_then(|id| id.parse().ok());
                let name = words.next().map(|name| name.trim_end_matches(':'));
                frame = Some(id.zip(name).ok_or(bad)?);
            } else if let (Some(rest), Some((id, name))) = (line.strip_prefix("SG_ "), frame) {
                let signal = Signal::parse(rest, name).ok_or(bad)?;
                dbc.frames.entry(id).or_default().push(signal);
                count += 1;
                if count > MOST_SIGNALS {
                    return Err(ReadError::BadDbc { line: number });
                }
            } else if let Some(rest) = line.strip_prefix("SIG_VALTYPE_ ") {
                dbc.set_float(rest).ok_or(bad)?;
            }
        }
        match count {
            0 => Err(ReadError::BadDbc { line: 1 }),
            _ => Ok(dbc),
        }
    }

    /// `257 Speed : 1;`
    fn set_float(&mut self, text: &str) -> Option<()> {
        let (signal, kind) = text.trim_end_matches(';').split_once(':')?;
        let (id, name) = signal.trim().split_once(' ')?;
        let signals = self.frames.get_mut(&id.parse().ok()?)?;
        let is_it = |signal: &&mut Signal| {
            let own = signal.name.split(" [").next().unwrap_or_default();
            own.rsplit('.').next() == Some(name.trim())
        };
        let signal = signals.iter_mut().find(is_it)?;
        signal.number = match (kind.trim(), signal.place.bits) {
            ("1", 32) => Number::Float,
            ("2", 64) => Number::Double,
            ("0" | "3", _) => signal.number,
            _ => return None,
        };
        Some(())
    }

    /// Name and value of each signal of a frame.
    pub(super) fn values(&self, id: u32, data: &[u8]) -> impl Iterator<Item = (&str, f64)> {
        let signals = self.frames.get(&id).map_or(&[][..], Vec::as_slice);
        let selector = signals.iter().find(|signal| signal.part == Part::Selector);
        let selected = selector.and_then(|signal| signal.place.raw(data));
        let is_there = move |signal: &&Signal| match signal.part {
            Part::Selected(wanted) => selected == Some(wanted),
            _ => true,
        };
        let value = |signal: &Signal| {
            Some(
                signal
                    .number
                    .value(signal.place.raw(data)?, signal.place.bits),
            )
        };
        signals.iter().filter(is_there).filter_map(move |signal| {
            let value = signal.scale * value(signal)? + signal.offset;
            value.is_finite().then_some((signal.name.as_str(), value))
        })
    }
}

impl Signal {
    /// `Speed m0 : 0|16@1+ (0.1,0) [0|6553.5] "rpm" Vector`
    fn parse(text: &str, frame: &str) -> Option<Self> {
        let (names, rest) = text.split_once(':')?;
        let mut names = names.split_whitespace();
        let (name, part) = (names.next()?, names.next());
        let part = match part {
            None => Part::Always,
            Some("M") => Part::Selector,
            // Selectors of selectors are not followed.
            Some(part) => Part::Selected(part.strip_prefix('m')?.parse().ok()?),
        };
        let (place, rest) = rest.trim_start().split_once(['(', ' '])?;
        let (start, rest_of_place) = place.split_once('|')?;
        let (bits, kind) = rest_of_place.split_once('@')?;
        let (scaling, rest) = rest.trim_start_matches('(').split_once(')')?;
        let (scale, offset) = scaling.split_once(',')?;
        let unit = rest.split('"').nth(1).unwrap_or_default().trim();
        let place = Place {
            start: start.parse().ok()?,
            bits: bits.parse().ok().filter(|bits| (1..=64).contains(bits))?,
            is_little_endian: kind.starts_with('1'),
        };
        let unit = if unit.is_empty() {
            String::new()
        } else {
            format!(" [{unit}]")
        };
        Some(Self {
            name: format!("{frame}.{name}{unit}"),
            place,
            scale: scale.trim().parse().ok()?,
            offset: offset.trim().parse().ok()?,
            number: match kind.get(1..)?.trim() {
                "+" => Number::Unsigned,
                "-" => Number::Signed,
                _ => return None,
            },
            part,
        })
    }
}

impl Place {
    /// The bits of a frame; `None` if it is too short.
    fn raw(self, data: &[u8]) -> Option<u64> {
        let mut at = self.start;
        let mut raw = 0;
        for count in 0..self.bits {
            let bit = u64::from(data.get(at / 8)? >> (at % 8) & 1);
            if self.is_little_endian {
                raw |= bit << count;
                at += 1;
            } else {
                raw = raw << 1 | bit;
                // From the least significant bit of a byte to the most significant of the next.
                at = if at.is_multiple_of(8) {
                    at + 15
                } else {
                    at - 1
                };
            }
        }
        Some(raw)
    }
}

impl Number {
    fn value(self, raw: u64, bits: usize) -> f64 {
        match self {
            Self::Unsigned => raw as f64,
            Self::Signed => {
                let unused = 64 - bits as u32;
                ((raw << unused) as i64 >> unused) as f64
            }
            Self::Float => f64::from(f32::from_bits(raw as u32)),
            Self::Double => f64::from_bits(raw),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "VERSION \"\"\nBO_ 257 Motor: 8 ECU\n SG_ Speed : 0|16@1+ (0.1,-5) [0|0] \"rpm\" V\n \
        SG_ Current : 23|12@0- (0.5,0) [0|0] \"\" V,W\nBO_ 2566834709 Multi: 8 ECU\n SG_ Kind M : 0|8@1+ (1,0) [0|0] \"\" V\n \
        SG_ A m0 : 8|32@1- (1,0) [0|0] \"\" V\n SG_ B m1 : 8|8@1- (1,0) [0|0] \"\" V\nSIG_VALTYPE_ 2566834709 A : 1;\n";

    fn values(id: u32, data: &[u8]) -> Vec<(String, f64)> {
        let dbc = Dbc::parse(TEXT).unwrap();
        dbc.values(id, data)
            .map(|(name, value)| (name.to_owned(), value))
            .collect()
    }

    // Speed 0x0102 = 258: 20.8 rpm. Current, from bit 7 of byte 2 downwards: 0xff8 is -8 of 12 bits: -4.
    #[test]
    fn frames_by_hand() {
        let named = |name: &str, value| (name.to_owned(), value);
        let speed = named("Motor.Speed [rpm]", 258.0 * 0.1 - 5.0);
        assert_eq!(
            values(257, &[2, 1, 0xff, 0x80, 0]),
            [speed.clone(), named("Motor.Current", -4.0)]
        );
        // Too short for the second signal; another frame.
        assert_eq!(values(257, &[2, 1, 0xff]), [speed]);
        assert_eq!(values(258, &[2, 1, 0xff]), []);
        let [a, b, c, d] = 1.5_f32.to_le_bytes();
        let kind = |value| named("Multi.Kind", value);
        assert_eq!(
            values(2_566_834_709, &[0, a, b, c, d]),
            [kind(0.0), named("Multi.A", 1.5)]
        );
        assert_eq!(
            values(2_566_834_709, &[1, 0xff]),
            [kind(1.0), named("Multi.B", -1.0)]
        );
        assert_eq!(values(2_566_834_709, &[2, 0xff]), [kind(2.0)]);
    }

    #[test]
    fn faults_have_their_line() {
        for (text, line) in [
            ("", 1),
            ("BO_ x Motor: 8 E", 1),
            ("BO_ 1 M: 8 E\nSG_ S : 0|65@1+ (1,0) [0|0] \"\" V", 2),
            ("BO_ 1 M: 8 E\n\nSG_ S : 0|8@1+ (x,0) [0|0] \"\" V", 3),
            ("BO_ 1 M: 8 E\nSG_ S m0M : 0|8@1+ (1,0) [0|0] \"\" V", 2),
            (
                "BO_ 1 M: 8 E\nSG_ S : 0|8@1+ (1,0) [0|0] \"\" V\nSIG_VALTYPE_ 1 S : 1;",
                3,
            ),
        ] {
            let error = Dbc::parse(text).unwrap_err().to_string();
            assert!(error.contains(&format!("line {line}")), "{error}");
        }
    }
}
