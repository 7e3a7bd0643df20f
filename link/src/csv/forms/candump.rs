//! Logs of candump, of which a DBC file says what the bytes are.
//!
//! ```text
//! (1710230400.000100) can0 101#0A0B                -l; `##1` before the bytes of CAN FD, `#R` without bytes
//!  (1710230400.000100)  can0  101   [2]  0A 0B     -ta, -tz, -tA: seconds or a date; -td counts from the frame before: refused
//! ```

use std::rc::Rc;

use super::dbc::Dbc;
use super::fields::{Fields, field};
use crate::csv::date;
use crate::csv::error::ReadError;

/// Frames that are looked at for the kind of their times.
const LOOK: usize = 200;

struct Frame<'a> {
    time: Option<(&'static str, &'a str)>,
    id: u32,
    data: Vec<u8>,
}

/// Whether a text is a log of candump.
///
/// # Errors
/// Its frames have no times, or those since the frame before.
pub(super) fn begins(head: &[u8]) -> Result<bool, ReadError> {
    let head = String::from_utf8_lossy(head);
    let lines = head.lines().filter(|line| !line.trim().is_empty());
    // The last line may be cut.
    let look = head.lines().count().min(LOOK + 1);
    let frames: Vec<Option<Frame<'_>>> = lines.take(look.saturating_sub(1)).map(frame).collect();
    let found = frames.iter().flatten().count();
    if found < 2 || 2 * found < frames.len() {
        return Ok(false);
    }
    let times: Vec<f64> = (frames.iter().flatten())
        .filter_map(|frame| frame.time?.1.parse().ok())
        .collect();
    let back = times.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let has_times = frames.iter().flatten().all(|frame| frame.time.is_some());
    if !has_times || 10 * back > times.len() {
        return Err(ReadError::NoCanTimes);
    }
    Ok(true)
}

/// The time and the signals of a frame.
pub(super) fn signals(line: &str, dbc: &Rc<Dbc>) -> Fields {
    let Some(frame) = frame(line) else {
        return vec![];
    };
    let mut fields: Fields = (dbc.values(frame.id, &frame.data))
        .map(|(name, value)| (name.to_owned(), value.to_string()))
        .collect();
    match frame.time {
        Some((name, time)) if !fields.is_empty() => {
            fields.insert(0, (name.to_owned(), time.to_owned()));
            fields
        }
        _ => vec![],
    }
}

fn frame(line: &str) -> Option<Frame<'_>> {
    let line = line.trim();
    let (time, rest) = match line.strip_prefix('(').and_then(|rest| rest.split_once(')')) {
        Some((time, rest)) => (Some(time), rest),
        None => (None, line),
    };
    let is_date = |time: &&str| date::parse(time.as_bytes()).is_some();
    let time = match time {
        Some(time) if field("", time).is_some() => Some(("time [s]", time)),
        Some(time) => Some(("time", Some(time).filter(is_date)?)),
        None => None,
    };
    // Directions of the option -x.
    let is_direction = |word: &&str| matches!(*word, "RX" | "TX" | "-" | "B" | "E");
    let mut words = rest.split_whitespace().skip(1).skip_while(is_direction);
    let word = words.next()?;
    let (id, data) = match word.split_once('#') {
        Some((id, data)) => (id, bytes(data)?),
        None => {
            let count = words.next()?.strip_prefix('[')?.strip_suffix(']')?;
            let of = |word| u8::from_str_radix(word, 16).ok();
            let data: Option<Vec<u8>> = words.take(count.parse().ok()?).map(of).collect();
            (word, data?)
        }
    };
    let number = u32::from_str_radix(id, 16).ok()?;
    let id = match id.len() {
        3 => number,
        8 => number | 1 << 31,
        _ => return None,
    };
    Some(Frame { time, id, data })
}

/// `0A0B`, `0A.0B`, `#10A0B` of CAN FD, `R` without bytes.
fn bytes(text: &str) -> Option<Vec<u8>> {
    let digits = match text.strip_prefix('#') {
        Some(flags) => flags.get(1..)?,
        None if text.starts_with('R') => "",
        None => text,
    };
    let digits = digits.replace('.', "");
    let at = (0..digits.len()).step_by(2);
    at.map(|at| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_candump() {
        for (line, time, id, data) in [
            ("(17.5) can0 101#0A0B", "17.5", 0x101, &[10, 11][..]),
            ("(17.5) can0 101#R8", "17.5", 0x101, &[]),
            ("(17.5) can0 101##30A0B", "17.5", 0x101, &[10, 11]),
            (
                " (017.5)  can0  18FF0115   [2]  0A 0B   '..'",
                "017.5",
                0x98ff_0115,
                &[10, 11],
            ),
            ("(2)  can0  RX - -  101   [0]", "2", 0x101, &[]),
            (
                "(2024-03-12 08:00:00.5)  can0  101   [1]  0A",
                "2024-03-12 08:00:00.5",
                0x101,
                &[10],
            ),
        ] {
            let found = frame(line).map(|frame| (frame.time.unwrap().1, frame.id, frame.data));
            assert_eq!(found, Some((time, id, data.to_vec())), "{line}");
        }
        for line in [
            "",
            "(1) can0",
            "(x) can0 101#00",
            "(1) can0 101#0",
            "(1) can0 1011#00",
            "(1) can0 101 [2] 0A xx",
        ] {
            assert!(frame(line).is_none(), "{line}");
        }
    }
}
