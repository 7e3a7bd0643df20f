//! What a recording says of the process at the harmonics of its oscillation, with no model.
//!
//! In a periodic steady state every Fourier coefficient of the output is that of the input times the
//! response of the process there, whatever the relay is and whatever constant adds to the input:
//!
//! ```text
//! G(j n w) = Y_n / U_n,   w = 2 pi C/T,   X_n = (1/T) integral of x(t) e^(-j n w t) over T
//! ```
//!
//! | symbol | meaning                                     | unit        |
//! |--------|---------------------------------------------|-------------|
//! | `C`    | cycles used, a whole number                 |             |
//! | `T`    | their duration                              | s           |
//! | `n`    | order of the harmonic                       |             |
//! | `G`    | response of the process                     | output unit / input unit |
//!
//! - The input is held from each point to the next, and so it is integrated, exactly: there is no half
//!   sample of a hold to be corrected for.
//! - The output is a sample a point: the trapezoidal rule, closed over the cycles. It adds the
//!   coefficients at `N - n, N + n, ..` of `N` points a cycle, some `(n/N)^4` of the one sought, for the
//!   input falls as `1/n` and such a process at last as `1/n^3`. A point that is the mean of several
//!   samples is put at their middle, and what the mean takes from a sine is given back.
//! - **Drift.** Under noise no cycle ends where it began, and where the value is higher by `dy` and the
//!   slope by `dv` at the end the coefficient has `-dy/(j n w T) - dv/((j n w)^2 T)` that is not the
//!   oscillation's. So the parabola with this rise of value and slope is taken out; they are those of
//!   straight lines over a quarter of a period about the two ends, the same part of the wave, whose shape
//!   cancels. Jumps of higher derivatives leave less, a `1/(n w)` each. Where the recording does not reach
//!   beyond the cycles nothing is taken out.
//!
//! Of 200 multirotors with 1 % noise, the relay in the loop, the median error of the fundamental is
//! 0.020 % of eight cycles and 0.056 % of two; with the straight line through the means of the first and
//! the last cycle instead 0.044 % and 0.28 %, with nothing taken out 0.047 % and 0.17 %.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::Complex64;

use crate::excitation::Oscillation;
use crate::signals::Signals;

/// The process at one frequency, as measured. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Multiple of the oscillation's frequency, from one.
    pub order: usize,
    /// Its frequency (rad/s).
    pub omega_rad_per_s: f64,
    /// Output over input at that frequency (output unit / input unit).
    pub response: Complex64,
    /// Standard deviation of the real part of the response, and of the imaginary one, from the white noise
    /// of the samples (output unit / input unit): the root mean square of the two, which differ where cycles
    /// are few, for the drift taken out is noisy too.
    pub deviation: f64,
}

/// Part of the fundamental's content that the input has at a harmonic at the least: what a small
/// asymmetry of the relay leaves at the even ones is no excitation.
const LEAST_CONTENT: f64 = 0.05;
/// Deviations that the response at a harmonic is above zero at the least.
const LEAST_DEVIATIONS: f64 = 3.0;
/// Content of the fundamental, in the largest input, below which it is what rounding leaves.
const ROUNDING: f64 = 1e-9;
/// Part of a period on either side of both ends, over which lines tell the drift. In 200 experiments with
/// 1 % noise the median squared error of the fundamental is 1.1 of what the deviation says (8 cycles) to
/// 1.8 (one); with windows half as long it is 1.0, but the errors are a quarter (8 cycles) to a half (one)
/// larger.
const END_PART: f64 = 0.125;
/// A line through fewer points than this is all noise.
const LEAST_END_POINTS: usize = 3;
/// Part of a point's duration by which stamps may differ from the oscillation's ends: rounding.
const STAMP_TOLERANCE: f64 = 1e-3;

/// The response at the harmonics of `found` up to the order `most`, ascending.
///
/// The first is there wherever the input has it; a higher one where the input has at least 5 % of the
/// fundamental's content, the response is at least three deviations above zero and a period has more
/// than two points. Empty without a fundamental, or where the cycles do not begin and end at points of
/// `signals`; every number is finite.
#[must_use]
pub fn harmonics(signals: &Signals<'_>, found: &Oscillation, most: usize) -> Vec<Harmonic> {
    let Some(cycles) = Cycles::of(signals, found) else {
        return Vec::new();
    };
    let largest = (signals.input[cycles.points.clone()].iter())
        .fold(0.0_f64, |largest, input| largest.max(input.abs()));
    let fundamental = cycles.input(1).norm();
    if fundamental <= ROUNDING * largest {
        return Vec::new();
    }
    let least = LEAST_CONTENT * fundamental;
    // More than two points in a period of the harmonic.
    let resolved = (cycles.points.len() - 1) / (2 * found.cycles_used);
    (1..=most.min(resolved))
        .filter_map(|order| {
            let input = cycles.input(order);
            let is_excited = order == 1 || input.norm() >= least;
            is_excited.then(|| cycles.harmonic(order, input))
        })
        .filter(|harmonic| {
            let size = harmonic.response.norm();
            let stands_out = harmonic.order == 1 || size >= LEAST_DEVIATIONS * harmonic.deviation;
            stands_out && size.is_finite() && harmonic.deviation.is_finite()
        })
        .collect()
}

/// The cycles of a recording, ready for a coefficient of any order.
struct Cycles<'a> {
    signals: &'a Signals<'a>,
    found: &'a Oscillation,
    points: Range<usize>,
    /// Duration (s) and frequency (rad/s).
    length_s: f64,
    omega_rad_per_s: f64,
    /// Part of the duration that each point of the output stands for.
    weights: Vec<f64>,
    /// Mean output (output unit).
    mean: f64,
    ends: Option<Ends>,
}

/// Lines through the points about the beginning and about the end of the cycles.
struct Ends {
    /// First point of each window.
    first: [usize; 2],
    /// What each point adds to the value at the end (1) and to the slope there (1/s).
    lines: [Vec<(f64, f64)>; 2],
}

impl<'a> Cycles<'a> {
    /// `None` where these are no cycles of at least three points.
    fn of(signals: &'a Signals<'a>, found: &'a Oscillation) -> Option<Self> {
        let length_s = found.end_s - found.start_s;
        let tolerance_s =
            STAMP_TOLERANCE * signals.sample_period_s * f64::from(signals.samples_per_point);
        let index = |time_s: f64| {
            (signals.time_s).partition_point(|&before_s| before_s < time_s - tolerance_s)
        };
        let points = index(found.start_s)..index(found.end_s);
        let is_point = |index: usize, time_s: f64| {
            let stamp_s = signals.time_s.get(index);
            stamp_s.is_some_and(|stamp_s| (stamp_s - time_s).abs() <= tolerance_s)
        };
        let is_whole = is_point(points.start, found.start_s) && is_point(points.end, found.end_s);
        if !is_whole || found.cycles_used == 0 || points.len() < 3 * found.cycles_used {
            return None;
        }
        let output = &signals.output[points.clone()];
        Some(Self {
            signals,
            found,
            length_s,
            omega_rad_per_s: TAU * found.cycles_used as f64 / length_s,
            weights: closed_trapezoid(&signals.time_s[points.clone()], length_s),
            mean: output.iter().sum::<f64>() / output.len() as f64,
            ends: Ends::about(signals, &points, found.cycles_used),
            points,
        })
    }

    /// Fourier coefficient of the held input (input unit).
    fn input(&self, order: usize) -> Complex64 {
        let omega = self.omega_rad_per_s * order as f64;
        let Signals { time_s, input, .. } = self.signals;
        (self.points.clone())
            .map(|index| {
                let begin_s = time_s[index] - self.found.start_s;
                let end_s = if index + 1 < self.points.end {
                    time_s[index + 1] - self.found.start_s
                } else {
                    self.length_s
                };
                let half_turn = 0.5 * omega * (end_s - begin_s);
                let middle = Complex64::cis(-0.5 * omega * (begin_s + end_s));
                // A constant has no coefficient; without it less is rounded off.
                let input = input[index] - self.found.relay_centre;
                middle * (input * 2.0 * half_turn.sin() / (omega * self.length_s))
            })
            .sum()
    }

    /// The response at a harmonic where the input has this coefficient.
    fn harmonic(&self, order: usize, input: Complex64) -> Harmonic {
        let omega = self.omega_rad_per_s * order as f64;
        let (first, parts) = self.output_parts(omega);
        let output: Complex64 = (parts.iter().zip(&self.signals.output[first..]))
            .map(|(part, output)| part * (output - self.mean))
            .sum();
        let samples = f64::from(self.signals.samples_per_point);
        let size_of_parts = parts.iter().map(Complex64::norm_sqr).sum::<f64>().sqrt();
        let noise = self.found.noise_sigma / samples.sqrt() * size_of_parts / 2_f64.sqrt();
        let whole = input * mean_of_samples(samples, omega * self.signals.sample_period_s);
        Harmonic {
            order,
            omega_rad_per_s: omega,
            response: output / whole,
            deviation: noise / whole.norm(),
        }
    }

    /// What each point adds to the output's coefficient at `omega`, and the point the list begins with.
    fn output_parts(&self, omega: f64) -> (usize, Vec<Complex64>) {
        let first = (self.ends.as_ref()).map_or(self.points.start, |ends| ends.first[0]);
        let end = (self.ends.as_ref()).map_or(self.points.end, |ends| {
            self.points.end.max(ends.first[1] + ends.lines[1].len())
        });
        let mut parts = vec![Complex64::ZERO; end - first];
        // Coefficients of t and t^2, as the same rule has them.
        let (mut line, mut parabola) = (Complex64::ZERO, Complex64::ZERO);
        for (index, weight) in self.points.clone().zip(&self.weights) {
            let time_s = self.signals.time_s[index] - self.found.start_s;
            let part = Complex64::cis(-omega * time_s) * *weight;
            line += part * time_s;
            parabola += part * time_s * time_s;
            parts[index - first] = part;
        }
        if let Some(ends) = &self.ends {
            // Less (dy/T - dv/2) t + dv/(2T) t^2, which rises by dy and whose slope rises by dv.
            let of_value = -line / self.length_s;
            let of_slope = 0.5 * (line - parabola / self.length_s);
            for ((begin, lines), sign) in ends.first.iter().zip(&ends.lines).zip([-1.0, 1.0]) {
                for (part, (value, slope)) in parts[begin - first..].iter_mut().zip(lines) {
                    *part += sign * (of_value * *value + of_slope * *slope);
                }
            }
        }
        (first, parts)
    }
}

impl Ends {
    /// As wide about one end as about the other, within the stretch of the recording without a break.
    fn about(signals: &Signals<'_>, points: &Range<usize>, cycles: usize) -> Option<Self> {
        let next = signals.breaks.partition_point(|&at| at <= points.start);
        let begin = next.checked_sub(1).map_or(0, |last| signals.breaks[last]);
        let end = (signals.breaks.get(next).copied()).unwrap_or(signals.time_s.len());
        let reach = (END_PART * points.len() as f64 / cycles as f64) as usize;
        let before = reach.min(points.start - begin);
        let behind = (reach + 1).min(end.saturating_sub(points.end));
        if behind == 0 || before + behind < LEAST_END_POINTS {
            return None;
        }
        let lines = [points.start, points.end].map(|at| {
            let times_s = &signals.time_s[at - before..at + behind];
            line_at(times_s, signals.time_s[at])
        });
        Some(Self {
            first: [points.start - before, points.end - before],
            lines,
        })
    }
}

/// What values at these times add to the value (1) and the slope (1/s) at `at_s` of the straight line
/// that fits them best.
fn line_at(times_s: &[f64], at_s: f64) -> Vec<(f64, f64)> {
    let count = times_s.len() as f64;
    let mean_s = times_s.iter().map(|time_s| time_s - at_s).sum::<f64>() / count;
    let about_mean = |time_s: &f64| time_s - at_s - mean_s;
    let spread: f64 = (times_s.iter())
        .map(|time_s| about_mean(time_s).powi(2))
        .sum();
    (times_s.iter())
        .map(|time_s| {
            let slope = about_mean(time_s) / spread;
            (1.0 / count - mean_s * slope, slope)
        })
        .collect()
}

/// Weights of the trapezoidal rule over points of a periodic function, in parts of its length.
fn closed_trapezoid(times_s: &[f64], length_s: f64) -> Vec<f64> {
    let count = times_s.len();
    (0..count)
        .map(|k| {
            let before_s = match k {
                0 => times_s[count - 1] - length_s,
                _ => times_s[k - 1],
            };
            let behind_s = match k + 1 {
                next if next == count => times_s[0] + length_s,
                next => times_s[next],
            };
            0.5 * (behind_s - before_s) / length_s
        })
        .collect()
}

/// Mean of a complex sine over so many samples from time zero on, each turning by `turn_rad`.
fn mean_of_samples(samples: f64, turn_rad: f64) -> Complex64 {
    let half = 0.5 * turn_rad;
    let size = (samples * half).sin() / (samples * half.sin());
    Complex64::from_polar(size, (samples - 1.0) * half)
}
