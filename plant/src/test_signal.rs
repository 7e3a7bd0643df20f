//! Test signals that do not depend on the output: steps, pulses, PRBS, chirp, multisine.
//!
//! | signal | over the time `t` from its start, with amplitude `A` |
//! | --- | --- |
//! | step | `A` |
//! | doublet | `A`, then `-A`, each for one pulse |
//! | 3-2-1-1 | `A`, `-A`, `A`, `-A` for 3, 2, 1 and 1 pulses |
//! | PRBS | `A` or `-A` for each bit of a maximum-length sequence |
//! | chirp | `A sin(phase)` with a frequency that rises exponentially from `f1` to `f2` in its length `L`: `phase = 2 pi f1 L (r^(t/L) - 1) / ln r`, `r = f2/f1` |
//! | multisine | `A / sqrt(n) sum_k cos(2 pi f_k t + phi_k)`, `n` frequencies spaced geometrically from `f1` to `f2`, `phi_k = -pi k (k - 1) / n` |
//!
//! The multisine has the power of one sine of amplitude `A`; its peak is higher, at most `A sqrt(n)`.
//!
//! References: M. R. Schroeder, "Synthesis of low-peak-factor signals and binary sequences with low autocorrelation",
//! IEEE Trans. Inf. Theory 16 (1970), for the phases; P. Alfke, Xilinx XAPP 052 (1996), for the taps of the shift
//! registers; J. A. Mulder et al., Prog. Aerosp. Sci. 35 (1999), for the 3-2-1-1.

use std::f64::consts::{PI, TAU};

use crate::controller::{Controller, Sensed};

/// A switching time counts as reached when less than this fraction of it is left: sample times are rounded.
const ROUNDING: f64 = 1e-12;

/// Orders of a PRBS: periods of 7 to 1,048,575 bits.
pub const PRBS_ORDERS: std::ops::RangeInclusive<u32> = 3..=20;

/// Smallest order of a PRBS that does not repeat within `bits` bits; the largest order if there is none.
#[must_use]
pub fn prbs_order(bits: f64) -> u32 {
    let mut orders = PRBS_ORDERS;
    orders
        .find(|order| f64::from((1_u32 << order) - 1) >= bits)
        .unwrap_or(*PRBS_ORDERS.end())
}

/// Feedback taps of a register of `PRBS_ORDERS.start() + index` bits with the longest period; 0 is no tap.
const TAPS: [[u32; 4]; 18] = [
    [3, 2, 0, 0],
    [4, 3, 0, 0],
    [5, 3, 0, 0],
    [6, 5, 0, 0],
    [7, 6, 0, 0],
    [8, 6, 5, 4],
    [9, 5, 0, 0],
    [10, 7, 0, 0],
    [11, 9, 0, 0],
    [12, 6, 4, 1],
    [13, 4, 3, 1],
    [14, 5, 3, 1],
    [15, 14, 0, 0],
    [16, 15, 13, 4],
    [17, 14, 0, 0],
    [18, 11, 0, 0],
    [19, 6, 2, 1],
    [20, 17, 0, 0],
];

/// Number of pulses and sign, one after the other.
const DOUBLET: &[(f64, f64)] = &[(1.0, 1.0), (1.0, -1.0)];
const THREE_TWO_ONE_ONE: &[(f64, f64)] = &[(3.0, 1.0), (2.0, -1.0), (1.0, 1.0), (1.0, -1.0)];

/// A test signal. See the [module](self).
#[derive(Clone, Debug, PartialEq)]
pub struct TestSignal {
    amplitude: f64,
    shape: Shape,
}

#[derive(Clone, Debug, PartialEq)]
enum Shape {
    Step,
    Pulses {
        pattern: &'static [(f64, f64)],
        pulse_s: f64,
    },
    Prbs {
        bits: Vec<bool>,
        bit_s: f64,
    },
    Chirp {
        low_hz: f64,
        /// `ln(f2/f1)`.
        log_ratio: f64,
        length_s: f64,
    },
    /// Angular frequency (rad/s) and phase (rad).
    Multisine(Vec<(f64, f64)>),
}

/// A setting of a test signal that is out of range, with its value.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{setting} must be {requirement}, but is {value}")]
pub struct TestSignalError {
    /// Name of the setting.
    pub setting: &'static str,
    /// The range it must lie in.
    pub requirement: &'static str,
    /// Its value.
    pub value: f64,
}

fn positive(setting: &'static str, value: f64) -> Result<f64, TestSignalError> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(TestSignalError {
        setting,
        requirement: "positive",
        value,
    })
}

impl TestSignal {
    fn new(amplitude: f64, shape: Shape) -> Result<Self, TestSignalError> {
        Ok(Self {
            amplitude: positive("the amplitude", amplitude)?,
            shape,
        })
    }

    /// Step to `amplitude`.
    ///
    /// # Errors
    /// An amplitude that is not positive; so for all signals.
    pub fn step(amplitude: f64) -> Result<Self, TestSignalError> {
        Self::new(amplitude, Shape::Step)
    }

    /// Doublet with halves of `pulse_s`.
    ///
    /// # Errors
    /// A length that is not positive.
    pub fn doublet(amplitude: f64, pulse_s: f64) -> Result<Self, TestSignalError> {
        Self::pulses(DOUBLET, amplitude, pulse_s)
    }

    /// 3-2-1-1 with a unit of `pulse_s`.
    ///
    /// # Errors
    /// A length that is not positive.
    pub fn three_two_one_one(amplitude: f64, pulse_s: f64) -> Result<Self, TestSignalError> {
        Self::pulses(THREE_TWO_ONE_ONE, amplitude, pulse_s)
    }

    fn pulses(
        pattern: &'static [(f64, f64)],
        amplitude: f64,
        pulse_s: f64,
    ) -> Result<Self, TestSignalError> {
        let pulse_s = positive("the length of a pulse", pulse_s)?;
        Self::new(amplitude, Shape::Pulses { pattern, pulse_s })
    }

    /// Pseudo-random binary sequence of bits of `bit_s`, which repeats after `2^order - 1` bits.
    ///
    /// # Errors
    /// A length that is not positive, an order outside [`PRBS_ORDERS`].
    pub fn prbs(amplitude: f64, bit_s: f64, order: u32) -> Result<Self, TestSignalError> {
        let bit_s = positive("the length of a bit", bit_s)?;
        if !PRBS_ORDERS.contains(&order) {
            return Err(TestSignalError {
                setting: "the order of the PRBS",
                requirement: "3 to 20",
                value: f64::from(order),
            });
        }
        let bits = maximum_length_sequence(order);
        Self::new(amplitude, Shape::Prbs { bits, bit_s })
    }

    /// Chirp from `low_hz` to `high_hz` in `length_s`, zero after it.
    ///
    /// # Errors
    /// A frequency or a length that is not positive, a band without width.
    pub fn chirp(
        amplitude: f64,
        low_hz: f64,
        high_hz: f64,
        length_s: f64,
    ) -> Result<Self, TestSignalError> {
        let log_ratio = log_ratio(low_hz, high_hz)?;
        let length_s = positive("the length of the chirp", length_s)?;
        let shape = Shape::Chirp {
            low_hz,
            log_ratio,
            length_s,
        };
        Self::new(amplitude, shape)
    }

    /// Sum of `lines >= 2` sines between `low_hz` and `high_hz`.
    ///
    /// # Errors
    /// A frequency that is not positive, a band without width, fewer than two lines.
    pub fn multisine(
        amplitude: f64,
        low_hz: f64,
        high_hz: f64,
        lines: u32,
    ) -> Result<Self, TestSignalError> {
        let log_ratio = log_ratio(low_hz, high_hz)?;
        if lines < 2 {
            return Err(TestSignalError {
                setting: "the number of sines",
                requirement: "at least 2",
                value: f64::from(lines),
            });
        }
        let sine = |line: u32| {
            let (k, n) = (f64::from(line), f64::from(lines));
            let frequency_hz = low_hz * (log_ratio * k / (n - 1.0)).exp();
            (TAU * frequency_hz, -PI * k * (k + 1.0) / n)
        };
        Self::new(amplitude, Shape::Multisine((0..lines).map(sine).collect()))
    }

    /// Value at `time_s` seconds after the start; zero before it.
    #[must_use]
    pub fn at(&self, time_s: f64) -> f64 {
        if time_s < 0.0 {
            return 0.0;
        }
        let time_s = time_s * (1.0 + ROUNDING);
        let value = match &self.shape {
            Shape::Step => 1.0,
            Shape::Pulses { pattern, pulse_s } => pulse_at(pattern, time_s / pulse_s),
            Shape::Prbs { bits, bit_s } => {
                // The sequence has at least seven bits.
                let bit = (time_s / bit_s).floor() % bits.len() as f64;
                if bits[bit as usize] { 1.0 } else { -1.0 }
            }
            Shape::Chirp {
                low_hz,
                log_ratio,
                length_s,
            } => {
                if time_s < *length_s {
                    let growth = (log_ratio * time_s / length_s).exp_m1();
                    (TAU * low_hz * length_s * growth / log_ratio).sin()
                } else {
                    0.0
                }
            }
            Shape::Multisine(sines) => {
                let sine = |(omega, phase): &(f64, f64)| (omega * time_s + phase).cos();
                sines.iter().map(sine).sum::<f64>() / (sines.len() as f64).sqrt()
            }
        };
        self.amplitude * value
    }
}

/// `ln(high_hz / low_hz)`.
fn log_ratio(low_hz: f64, high_hz: f64) -> Result<f64, TestSignalError> {
    positive("the lowest frequency", low_hz)?;
    positive("the highest frequency", high_hz)?;
    if high_hz <= low_hz {
        return Err(TestSignalError {
            setting: "the highest frequency",
            requirement: "above the lowest",
            value: high_hz,
        });
    }
    Ok((high_hz / low_hz).ln())
}

/// Sign at a time counted in pulses; zero behind the pattern.
fn pulse_at(pattern: &[(f64, f64)], mut pulses: f64) -> f64 {
    for (length, sign) in pattern {
        if pulses < *length {
            return *sign;
        }
        pulses -= length;
    }
    0.0
}

/// One period of the output of a shift register with linear feedback that starts with ones.
fn maximum_length_sequence(order: u32) -> Vec<bool> {
    let taps = TAPS[(order - PRBS_ORDERS.start()) as usize];
    let mut register = (1_u32 << order) - 1;
    let step = |_| {
        let out = register >> (order - 1) & 1;
        let tapped = taps.iter().filter(|tap| **tap > 0);
        let feedback = tapped.fold(0, |sum, tap| sum ^ (register >> (tap - 1)));
        register = (register << 1 | feedback & 1) & ((1 << order) - 1);
        out == 1
    };
    (0..(1_u32 << order) - 1).map(step).collect()
}

/// A test signal from a start time on. As a [`Controller`] it is an open loop: the output has no effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Stimulus {
    signal: TestSignal,
    start_s: f64,
    /// Time of the next sample, as a sum and the rounding error of that sum (Kahan's summation), so that a long test
    /// keeps its switching times.
    time_s: f64,
    error_s: f64,
}

impl Stimulus {
    /// `signal` from `start_s` (s) on, zero before.
    #[must_use]
    pub fn new(signal: TestSignal, start_s: f64) -> Self {
        Self {
            signal,
            start_s,
            time_s: 0.0,
            error_s: 0.0,
        }
    }
}

impl Controller for Stimulus {
    fn step(&mut self, dt_s: f64, _reference: f64, _sensed: Sensed) -> f64 {
        let since_start_s = self.time_s * (1.0 + ROUNDING) - self.start_s;
        let addend_s = dt_s - self.error_s;
        let sum_s = self.time_s + addend_s;
        self.error_s = (sum_s - self.time_s) - addend_s;
        self.time_s = sum_s;
        self.signal.at(since_start_s)
    }
}
