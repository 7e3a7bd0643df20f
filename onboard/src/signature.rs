//! Signature of a cycle: its shape as a vector of fixed length, from which the network reads a process.
//!
//! A cycle runs from one rise of the relay's output to the next, `0 <= t < T`. With `y_i` the mean output in the
//! `i`-th of 32 equal parts of `T`:
//!
//! ```text
//! c = mean y_i,   a = (max y_i - min y_i) / 2,   g = sign of the process's gain
//!
//! x_i  = g (y_i - c) / a      i = 0..31     shape of the output
//! x_32 = T_high / T                         duty
//! x_33 = ln(T / dt)                         samples in a period
//! ```
//!
//! | symbol     | name                  | unit        |
//! |------------|-----------------------|-------------|
//! | `x`        | `values`              | 1           |
//! | `a`, `c`   | `amplitude`, `centre` | output unit |
//! | `g`        | `sign`                | 1           |
//! | `T`        | `Cycle::period_s`     | s           |
//! | `T_high/T` | `Cycle::duty`         | 1           |
//! | `dt`       | `Window::sample_s`    | s           |
//!
//! `x` does not depend on gain, offset and unit of the output, nor on a common time scale of process and
//! samples. It depends on the ratios of lags and delay, on the relay's `beta` and on the input bias.
//!
//! Sign: with `beta` between -1 and 1 the relay holds the phase of a process of positive gain between -270 and
//! -90 degrees, so the output is lower while the input is high. If it is higher, the gain is negative: `(K, u,
//! y)` and `(-K, u, -y)` have the same `x`.
//!
//! Accuracy: a bin of the window covers the time around its samples, from half a sample period before the first
//! to half a sample period after the last. If it straddles two parts it is divided in proportion. The output is
//! taken as constant within the bin, which costs at most `w^2 |dy/dt| / (8 W)` for bins of duration `w` and
//! parts of duration `W`, that is `25 / n^2` of the amplitude of a sine with `n` bins in a period.

use core::fmt;

use crate::cycle::Cycle;
use crate::window::{Bin, MOST_PER_BIN, Window};

/// Number of parts of equal phase over which the output is averaged.
pub(crate) const PARTS: usize = 32;

/// Length of a signature: shape, duty, samples in a period.
pub const LENGTH: usize = PARTS + 2;

/// Bins of a slice of a [`Signing`].
const SLICE_BINS: usize = 32;

/// Part of a part that samples must cover; less is the edge of a neighbour.
const LEAST_COVER: f64 = 0.5;

/// Relative amplitude below which the output may be rounding only: half an epsilon per addition, twice for a
/// difference, with the largest number of samples in a bin.
const FLAT: f64 = f64::EPSILON * MOST_PER_BIN as f64;

/// Signature of a cycle. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signature {
    /// Shape in parts of equal phase, duty, logarithm of the samples in a period.
    pub values: [f32; LENGTH],
    /// Half the peak-to-peak of the parts' mean outputs (output unit).
    pub amplitude: f64,
    /// Mean of the output (output unit).
    pub centre: f64,
    /// Sign of the gain of the process, 1 or -1.
    pub sign: f64,
}

/// Why a cycle has no signature.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SignatureError {
    /// The period is not a positive, finite time.
    Period(f64),
    /// The duty is not between 0 and 1.
    Duty(f64),
    /// The cycle begins before the window or ends after it.
    Outside {
        /// Start of the cycle (s).
        start_s: f64,
        /// End of the cycle (s).
        end_s: f64,
    },
    /// A part of the cycle has no samples: its number.
    NoSample(usize),
    /// The mean output of a part of the cycle is not finite: its number.
    NotFinite(usize),
    /// The output is constant up to rounding: its amplitude.
    Flat(f64),
}

impl fmt::Display for SignatureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Period(v) => write!(f, "the period must be a positive time, but is {v} s"),
            Self::Duty(v) => write!(f, "the duty must lie between 0 and 1, but is {v}"),
            Self::Outside { start_s, end_s } => write!(
                f,
                "the cycle from {start_s} s to {end_s} s is not wholly in the window"
            ),
            Self::NoSample(part) => write!(f, "part {part} of {PARTS} of the cycle has no sample"),
            Self::NotFinite(part) => {
                write!(f, "the output in part {part} of {PARTS} is not finite")
            }
            Self::Flat(v) => write!(f, "the output does not move: its amplitude is {v}"),
        }
    }
}

impl core::error::Error for SignatureError {}

impl Signature {
    /// Memory of a signature, all zeros.
    pub(crate) const NONE: Self = Self {
        values: [0.0; LENGTH],
        amplitude: 0.0,
        centre: 0.0,
        sign: 0.0,
    };

    /// Signature of a cycle that lies in the window. The window may be longer. Start, period and duty of the
    /// cycle are used; its amplitude and centre, which are those of single samples, are not.
    ///
    /// # Errors
    /// Why there is no signature: see [`SignatureError`].
    pub fn new<const BINS: usize, const EDGES: usize>(
        window: &Window<BINS, EDGES>,
        cycle: &Cycle,
    ) -> Result<Self, SignatureError> {
        let mut signing = Signing::NONE;
        loop {
            if let Some(signature) = signing.advance(window, cycle) {
                return signature;
            }
        }
    }

    /// From the parts of a cycle in the window.
    fn of_parts<const BINS: usize, const EDGES: usize>(
        parts: &[Part; PARTS],
        window: &Window<BINS, EDGES>,
        cycle: &Cycle,
    ) -> Result<Self, SignatureError> {
        let means = means(parts)?;

        let centre = means.iter().sum::<f64>() / PARTS as f64;
        let lowest = means.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let amplitude = 0.5 * (highest - lowest);
        if amplitude <= FLAT * highest.abs().max(lowest.abs()) {
            return Err(SignatureError::Flat(amplitude));
        }
        let sign = sign_of_gain(&means, centre, cycle.duty);
        let mut values = [0.0; LENGTH];
        for (value, mean) in values.iter_mut().zip(means) {
            *value = (sign * (mean - centre) / amplitude) as f32;
        }
        values[PARTS] = cycle.duty as f32;
        values[PARTS + 1] = libm::log(cycle.period_s / window.sample_s()) as f32;
        Ok(Self {
            values,
            amplitude,
            centre: window.first_output() + centre,
            sign,
        })
    }
}

/// A signature in slices of `SLICE_BINS` bins, each short enough for a control tick. [`Signature::new`] loops over them.
#[derive(Clone, Debug)]
pub struct Signing {
    parts: [Part; PARTS],
    next_bin: usize,
}

impl Signing {
    /// A signature that has not begun, all zeros.
    pub const NONE: Self = Self {
        parts: [Part::NONE; PARTS],
        next_bin: 0,
    };

    /// Does one slice; give it the same window and cycle each time. Returns the signature after the last slice, `None` before.
    ///
    /// # Errors
    /// In the result: why there is no signature.
    pub fn advance<const BINS: usize, const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
        cycle: &Cycle,
    ) -> Option<Result<Signature, SignatureError>> {
        if self.next_bin == 0
            && let Err(error) = validate(window, cycle)
        {
            return Some(Err(error));
        }
        let part_s = cycle.period_s / PARTS as f64;
        let since_s = window.start_s() - cycle.start_s;
        let bins = window.bins();
        let end = bins.len().min(self.next_bin + SLICE_BINS);
        for bin in (bins[self.next_bin..end].iter()).filter(|bin| bin.count > 0) {
            let count = f64::from(bin.count);
            let middle = (since_s + bin.time_sum_s / count) / part_s;
            let half = 0.5 * count * window.sample_s() / part_s;
            share_out(&mut self.parts, middle - half, middle + half, mean(bin));
        }
        self.next_bin = end;
        (end == bins.len()).then(|| Signature::of_parts(&self.parts, window, cycle))
    }
}

fn validate<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    cycle: &Cycle,
) -> Result<(), SignatureError> {
    if !(cycle.period_s.is_finite() && cycle.period_s > 0.0) {
        return Err(SignatureError::Period(cycle.period_s));
    }
    if !(cycle.duty > 0.0 && cycle.duty < 1.0) {
        return Err(SignatureError::Duty(cycle.duty));
    }
    // From the first sample to where the sample after the last would be; half a sample is rounding.
    let slack_s = 0.5 * window.sample_s();
    let last = window.bins().last().copied().unwrap_or_default();
    let count = f64::from(last.count.max(1));
    let after_s = window.start_s() + last.time_sum_s / count + slack_s * (count + 1.0);
    let end_s = cycle.start_s + cycle.period_s;
    if cycle.start_s >= window.start_s() - slack_s && end_s <= after_s + slack_s {
        return Ok(());
    }
    Err(SignatureError::Outside {
        start_s: cycle.start_s,
        end_s,
    })
}

/// Mean output of a bin, minus the window's first output (output unit).
fn mean(bin: &Bin) -> f64 {
    bin.output_sum / f64::from(bin.count)
}

/// Contribution of the window's bins to a part of the cycle.
#[derive(Clone, Copy, Debug)]
struct Part {
    /// Covered fraction of the part, 0 to 1.
    cover: f64,
    /// Sum of outputs times the fraction that each covers (output unit).
    sum: f64,
}

impl Part {
    const NONE: Self = Self {
        cover: 0.0,
        sum: 0.0,
    };
}

/// Adds an output over the interval `low` to `high`, in units of a part, to the parts that it overlaps.
fn share_out(parts: &mut [Part; PARTS], low: f64, high: f64, output: f64) {
    let low = low.max(0.0);
    // Beyond the cycle the conversion saturates, and no part is left.
    for (index, part) in parts.iter_mut().enumerate().skip(low as usize) {
        let overlap = high.min((index + 1) as f64) - low.max(index as f64);
        if overlap <= 0.0 {
            return;
        }
        part.cover += overlap;
        part.sum += overlap * output;
    }
}

fn means(parts: &[Part; PARTS]) -> Result<[f64; PARTS], SignatureError> {
    let mut means = [0.0; PARTS];
    for (index, (mean, part)) in means.iter_mut().zip(parts).enumerate() {
        if part.cover < LEAST_COVER {
            return Err(SignatureError::NoSample(index));
        }
        *mean = part.sum / part.cover;
        if !mean.is_finite() {
            return Err(SignatureError::NotFinite(index));
        }
    }
    Ok(means)
}

/// Sign of the gain: 1 if the output is below its mean while the input is high, otherwise -1.
fn sign_of_gain(means: &[f64; PARTS], centre: f64, duty: f64) -> f64 {
    let high_parts = duty * PARTS as f64;
    let while_high: f64 = (means.iter().enumerate())
        .map(|(index, mean)| (high_parts - index as f64).clamp(0.0, 1.0) * (mean - centre))
        .sum();
    if while_high > 0.0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;

    const PERIOD: usize = 128;
    const SAMPLE_S: f64 = 1.0 / 64.0;

    /// Distance in parts from the lowest point of the triangle, 12 parts after the rise: 0 to 16.
    fn distance(parts: f64) -> f64 {
        let apart = (parts - 12.0).rem_euclid(32.0);
        apart.min(32.0 - apart)
    }

    /// Triangle with four samples in a part, from -1 to 1, lower in the first half.
    fn triangle(sample: usize) -> f64 {
        distance(sample as f64 / 4.0) / 8.0 - 1.0
    }

    /// Cycle of two seconds; the window begins `before` samples earlier.
    fn cycle(before: usize) -> Cycle {
        Cycle {
            start_s: 8.0 + before as f64 * SAMPLE_S,
            period_s: 2.0,
            duty: 0.5,
            amplitude: 1.0,
            centre: 0.0,
        }
    }

    fn window<const BINS: usize>(
        outputs: impl IntoIterator<Item = (usize, f64)>,
    ) -> Window<BINS, 4> {
        let mut window = Window::new(8.0, SAMPLE_S);
        for (sample, output) in outputs {
            window.push_output(8.0 + sample as f64 * SAMPLE_S, output);
        }
        window
    }

    fn outputs(
        output: impl Fn(usize) -> f64,
        samples: usize,
    ) -> impl Iterator<Item = (usize, f64)> {
        (0..samples).map(move |sample| (sample, output(sample)))
    }

    // The bends lie between parts, so the mean of every part is the output at its middle, at the distances 0.5,
    // 1.5, ... 15.5 of 16: mean 8, half peak-to-peak 7.5, x_i = (distance - 8) / 7.5. All sums are exact in
    // binary. A gain of 2 and an offset of 3 give the amplitude 2 * 7.5 / 8 = 1.875.
    #[test]
    fn a_triangle_is_exact() {
        for gain in [2.0, -2.0] {
            let window = window::<160>(outputs(|k| 3.0 + gain * triangle(k), PERIOD + 1));
            assert_eq!(window.per_bin(), 1);
            let signature = Signature::new(&window, &cycle(0)).unwrap();
            for (index, value) in signature.values[..PARTS].iter().enumerate() {
                let expected = (distance(index as f64 + 0.5) - 8.0) / 7.5;
                assert_eq!(*value, expected as f32, "part {index}");
            }
            assert_eq!(signature.values[PARTS], 0.5);
            assert_eq!(signature.values[PARTS + 1], libm::log(128.0) as f32);
            assert_eq!((signature.amplitude, signature.centre), (1.875, 3.0));
            assert_eq!(signature.sign, gain.signum());
        }
    }

    // Samples of the window before and after the cycle do not count. A sample covers [k - 1/2, k + 1/2], so at
    // either end only half a sample comes from the neighbours.
    #[test]
    fn only_the_cycle_counts() {
        let alone = Signature::new(&window::<512>(outputs(triangle, PERIOD + 1)), &cycle(0));
        let before = 100;
        let among = window::<512>(outputs(
            |k| match k.checked_sub(before) {
                Some(inside) if inside <= PERIOD => triangle(inside),
                _ => 1000.0,
            },
            400,
        ));
        let among = Signature::new(&among, &cycle(before)).unwrap();
        assert_eq!(among.values, alone.unwrap().values);
        assert_eq!(among.centre, 0.0);
    }

    // 25 / n^2 for a sine with n bins in a period; bins of 1, 2, 4, 8 and 16 of 1003 samples, the largest half
    // as long as a part, none aligned with the parts.
    #[test]
    fn resolutions_agree() {
        fn sine<const BINS: usize>() -> ([f32; LENGTH], f64) {
            let mut window = Window::<BINS, 4>::new(0.0, 1.0);
            for k in 0..1100 {
                let angle = core::f64::consts::TAU * (f64::from(k) - 37.0) / 1003.0;
                window.push_output(f64::from(k), -libm::sin(angle - 0.6));
            }
            let cycle = Cycle {
                start_s: 37.0,
                period_s: 1003.0,
                ..cycle(0)
            };
            let signature = Signature::new(&window, &cycle).unwrap();
            (signature.values, 1003.0 / window.bin_s())
        }
        let (fine, _) = sine::<1200>();
        for (coarse, bins) in [sine::<600>(), sine::<300>(), sine::<150>(), sine::<75>()] {
            let apart = fine.iter().zip(coarse).map(|(a, b)| (a - b).abs());
            let apart = f64::from(apart.fold(0.0, f32::max));
            let bound = 25.2 / (bins * bins);
            // Centre and scale move too, each by less than the bound.
            assert!(
                apart < 2.0 * bound && apart > 0.1 * bound,
                "{apart} at {bins} bins"
            );
        }
    }

    // The cycle covers samples 0 to 127, and the sample at its end with half its width.
    #[test]
    fn a_cycle_outside_is_refused() {
        let samples = |count| window::<512>(outputs(triangle, count));
        assert!(Signature::new(&samples(PERIOD), &cycle(0)).is_ok());
        let outside = |start_s| {
            Err(SignatureError::Outside {
                start_s,
                end_s: start_s + 2.0,
            })
        };
        assert_eq!(
            Signature::new(&samples(PERIOD - 1), &cycle(0)),
            outside(8.0)
        );
        let early = Cycle {
            start_s: 8.0 - SAMPLE_S,
            ..cycle(0)
        };
        assert_eq!(
            Signature::new(&samples(200), &early),
            outside(8.0 - SAMPLE_S)
        );
        assert_eq!(
            Signature::new(&Window::<512, 4>::new(8.0, SAMPLE_S), &cycle(0)),
            outside(8.0)
        );
    }

    // Samples 41 to 45 are missing: part 10 covers samples 40 to 44 with half of the two at its ends, so an
    // eighth is left; part 11, samples 44 to 48, keeps 46, 47 and half of 48: five eighths.
    #[test]
    fn a_part_without_samples_is_refused() {
        let lost = outputs(triangle, 200).filter(|(k, _)| !(41..46).contains(k));
        assert_eq!(
            Signature::new(&window::<512>(lost), &cycle(0)),
            Err(SignatureError::NoSample(10))
        );
        let fewer = outputs(triangle, 200).filter(|(k, _)| !(42..44).contains(k));
        assert!(Signature::new(&window::<512>(fewer), &cycle(0)).is_ok());
    }

    // The means of a constant that differs from the window's first output differ by rounding only.
    #[test]
    fn a_flat_output_is_refused() {
        fn refused<const BINS: usize>(window: &Window<BINS, 4>, cycle: &Cycle) -> bool {
            matches!(
                Signature::new(window, cycle),
                Err(SignatureError::Flat(amplitude)) if amplitude < 1e-15
            )
        }
        let constant = window::<512>(outputs(|_| 0.1, 300));
        assert!(refused(&constant, &cycle(0)));
        let stepped = window::<64>(outputs(|k| if k < 50 { 0.0 } else { 0.1 }, 300));
        assert!(refused(&stepped, &cycle(64)));
    }

    #[test]
    fn what_is_no_cycle_is_refused() {
        let window = window::<512>(outputs(triangle, 200));
        for period_s in [0.0, -1.0, f64::INFINITY] {
            let refused = Signature::new(
                &window,
                &Cycle {
                    period_s,
                    ..cycle(0)
                },
            );
            assert_eq!(refused, Err(SignatureError::Period(period_s)));
        }
        for duty in [0.0, 1.0, -0.5] {
            let refused = Signature::new(&window, &Cycle { duty, ..cycle(0) });
            assert_eq!(refused, Err(SignatureError::Duty(duty)));
        }
        let not_finite = |k| if k == 21 { f64::NAN } else { triangle(k) };
        let window = self::window::<512>(outputs(not_finite, 200));
        assert_eq!(
            Signature::new(&window, &cycle(0)),
            Err(SignatureError::NotFinite(5))
        );
    }

    #[test]
    fn errors_name_their_value() {
        for (error, sentence) in [
            (
                SignatureError::Duty(1.0),
                "the duty must lie between 0 and 1, but is 1",
            ),
            (
                SignatureError::NoSample(10),
                "part 10 of 32 of the cycle has no sample",
            ),
            (
                SignatureError::Outside {
                    start_s: 1.0,
                    end_s: 2.5,
                },
                "the cycle from 1 s to 2.5 s is not wholly in the window",
            ),
        ] {
            assert_eq!(error.to_string(), sentence);
        }
    }
}
