//! Frames of a blackbox: encodings, then predictions, field by field.

use super::Event;
use super::bits::Cursor;

/// Maximum number of fields of a frame.
pub(super) const MOST_FIELDS: usize = 128;

/// Values of a frame, as 32 bits each.
pub(super) type Values = [i32; MOST_FIELDS];

/// The layout of all frames of a flight.
#[derive(Debug)]
pub(super) struct Layout {
    /// Main frames that stand alone (I).
    pub(super) whole: Fields,
    /// Main frames of differences (P).
    pub(super) difference: Fields,
    pub(super) slow: Fields,
    pub(super) gps: Fields,
    pub(super) home: Fields,
    pub(super) constants: Constants,
    /// Iterations from one I frame to the next.
    pub(super) whole_interval: u32,
    /// Of `of` iterations, `shown` are logged.
    pub(super) shown: u32,
    pub(super) of: u32,
    pub(super) iteration: Option<usize>,
    pub(super) time: usize,
}

/// Constants of the predictions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Constants {
    pub(super) min_throttle: i32,
    pub(super) min_motor: i32,
    pub(super) battery: i32,
}

impl Layout {
    pub(super) fn main_names(&self) -> Vec<String> {
        self.whole.names.clone()
    }

    pub(super) fn slow_names(&self) -> Vec<String> {
        self.slow.names.clone()
    }

    pub(super) fn gps_names(&self) -> Vec<String> {
        self.gps.names.clone()
    }

    pub(super) fn iteration_and_time(&self, values: &Values) -> (u32, u32) {
        let iteration = self.iteration.map_or(0, |at| values[at] as u32);
        (iteration, values[self.time] as u32)
    }

    /// Iterations after this one that are not logged by intention.
    pub(super) fn skipped_after(&self, iteration: u32) -> u32 {
        let is_logged = |ahead: &u32| {
            let at = iteration.wrapping_add(1 + ahead) % self.whole_interval;
            (at + self.shown - 1) % self.of < self.shown
        };
        // An I frame is always logged.
        let most = self
            .whole_interval
            .min(self.of.saturating_mul(2))
            .min(1 << 16);
        (0..most).find(is_logged).unwrap_or(0)
    }
}

/// The last two main frames.
#[derive(Debug)]
pub(super) struct History {
    last: Values,
    before: Values,
}

impl Default for History {
    fn default() -> Self {
        Self {
            last: [0; MOST_FIELDS],
            before: [0; MOST_FIELDS],
        }
    }
}

impl History {
    pub(super) fn add(&mut self, is_whole: bool, values: &Values) {
        self.before = if is_whole { *values } else { self.last };
        self.last = *values;
    }
}

/// How consecutive fields are encoded.
#[derive(Debug, Clone, Copy)]
enum Encoding {
    Signed,
    Unsigned,
    Negative14,
    Nothing,
    Tag8x8,
    Tag2x3,
    Tag2x3Variable,
    Tag8x4,
    Tag8x4Version1,
}

/// Fields of a kind of frames.
#[derive(Debug, Default)]
pub(super) struct Fields {
    pub(super) names: Vec<String>,
    signed: Vec<bool>,
    predictors: Vec<i32>,
    encodings: Vec<i32>,
    /// First field, number of fields, encoding.
    plan: Vec<(usize, usize, Encoding)>,
    /// Fields with a prediction other than 0.
    predicted: Vec<(usize, i32)>,
    motor: usize,
}

impl Fields {
    /// `None`: the lists do not belong together.
    pub(super) fn new(
        names: &str,
        signed: &[i32],
        predictors: Vec<i32>,
        encodings: Vec<i32>,
    ) -> Option<Self> {
        let names: Vec<String> = names
            .split(',')
            .map(|name| name.trim().to_owned())
            .collect();
        let count = names.len();
        let fits = predictors.len() == count && encodings.len() == count && count <= MOST_FIELDS;
        fits.then(|| Self {
            signed: (0..count)
                .map(|at| signed.get(at).is_some_and(|&flag| flag != 0))
                .collect(),
            motor: names
                .iter()
                .position(|name| name == "motor[0]")
                .unwrap_or(0),
            names,
            predictors,
            encodings,
            ..Self::default()
        })
    }

    pub(super) fn place(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|own| own == name)
    }

    /// Groups the fields. `None`: an encoding or a prediction is unknown.
    pub(super) fn plan(&mut self, version: i32) -> Option<()> {
        let mut at = 0;
        while at < self.encodings.len() {
            let code = self.encodings[at];
            let (encoding, most) = match code {
                0 => (Encoding::Signed, 1),
                1 => (Encoding::Unsigned, 1),
                3 => (Encoding::Negative14, 1),
                6 => (Encoding::Tag8x8, 8),
                7 => (Encoding::Tag2x3, 3),
                8 if version < 2 => (Encoding::Tag8x4Version1, 4),
                8 => (Encoding::Tag8x4, 4),
                9 => (Encoding::Nothing, 1),
                10 => (Encoding::Tag2x3Variable, 3),
                _ => return None,
            };
            let alike = self.encodings[at..]
                .iter()
                .take_while(|&&next| next == code)
                .count();
            let count = match code {
                // Only this encoding has groups of any size.
                6 => alike.min(most),
                _ => most.min(self.encodings.len() - at),
            };
            self.plan.push((at, count, encoding));
            at += count;
        }
        let predicted = self.predictors.iter().copied().enumerate();
        self.predicted = predicted.filter(|(_, code)| *code != 0).collect();
        self.predicted
            .iter()
            .all(|(_, code)| matches!(code, 1..=11 | 256))
            .then_some(())
    }

    /// Decodes the bytes of a frame.
    pub(super) fn decode(&self, cursor: &mut Cursor<'_>, values: &mut Values) -> Option<Event> {
        if self.names.is_empty() {
            return None;
        }
        for &(first, count, encoding) in &self.plan {
            let part = &mut values[first..first + count];
            match encoding {
                Encoding::Signed => part[0] = cursor.signed(),
                Encoding::Unsigned => part[0] = cursor.unsigned() as i32,
                Encoding::Negative14 => part[0] = cursor.negative_14_bit(),
                Encoding::Nothing => part[0] = 0,
                Encoding::Tag8x8 => cursor.tag8_8svb(part),
                Encoding::Tag2x3 => cursor.tag2_3s32(part),
                Encoding::Tag2x3Variable => cursor.tag2_3s_variable(part),
                Encoding::Tag8x4 => cursor.tag8_4s16(part),
                Encoding::Tag8x4Version1 => cursor.tag8_4s16_v1(part),
            }
        }
        Some(Event::Other)
    }

    /// Adds the predictions of a main frame.
    pub(super) fn complete(
        &self,
        values: &mut Values,
        history: &History,
        constants: &Constants,
        skipped: u32,
    ) {
        for &(at, code) in &self.predicted {
            let (last, before) = (history.last[at], history.before[at]);
            let prediction = match code {
                1 => last,
                2 => last.wrapping_mul(2).wrapping_sub(before),
                3 if self.signed[at] => last.wrapping_add(before) / 2,
                3 => ((last as u32).wrapping_add(before as u32) / 2) as i32,
                4 => constants.min_throttle,
                5 => values[self.motor],
                6 => last.wrapping_add(1).wrapping_add(skipped as i32),
                8 => 1500,
                9 => constants.battery,
                11 => constants.min_motor,
                _ => 0,
            };
            values[at] = values[at].wrapping_add(prediction);
        }
    }

    /// Adds the predictions of a GPS frame: time of the last main frame, coordinates of the home.
    pub(super) fn complete_gps(&self, values: &mut Values, time: u32, home: [i32; 2]) {
        let mut coordinate = 0;
        for &(at, code) in &self.predicted {
            let prediction = match code {
                10 => time as i32,
                7 | 256 => {
                    let index = if code == 256 { 1 } else { coordinate };
                    coordinate = (coordinate + 1).min(1);
                    home[index]
                }
                _ => 0,
            };
            values[at] = values[at].wrapping_add(prediction);
        }
    }

    /// The value of a field.
    #[inline]
    pub(super) fn value(&self, values: &Values, field: usize) -> f64 {
        if self.signed[field] {
            f64::from(values[field])
        } else {
            f64::from(values[field] as u32)
        }
    }
}
