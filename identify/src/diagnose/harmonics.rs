//! Frequency response of the process at the harmonics of a relay oscillation, measured without a model.
//!
//! In a periodic steady state each Fourier coefficient of the output is the coefficient of the input times the
//! frequency response of the process. This holds for every relay and every constant input bias:
//!
//! ```text
//! G(j n w) = Y_n / U_n,   w = 2 pi C/T,   X_n = (1/T) integral of x(t) e^(-j n w t) over T
//! ```
//!
//! | symbol | meaning                                     | unit        |
//! |--------|---------------------------------------------|-------------|
//! | `C`    | number of cycles used                       |             |
//! | `T`    | duration of these cycles                    | s           |
//! | `n`    | order of the harmonic                       |             |
//! | `w`    | frequency of the oscillation                | rad/s       |
//! | `U_n`, `Y_n` | coefficients of input and output      | input unit, output unit |
//! | `G`    | frequency response of the process           | output unit / input unit |
//!
//! **Input.** It is held from each point to the next, so its coefficient is integrated exactly. No correction for the
//! hold is needed.
//!
//! **Output.** One sample a point: the trapezoidal rule, closed over the cycles. With `N` points a cycle it aliases the
//! coefficients of the orders `N - n, N + n, ..` onto the order `n`. Their relative size is about `(n/N)^4`, since the
//! input falls as `1/n` and the process finally as `1/n^3`. If a point is the mean of several samples, the attenuation
//! and the phase of this mean are corrected.
//!
//! **Drift.** With noise the state at the end of the cycles differs from that at the beginning. If the value is higher
//! by `dy` and the slope by `dv`, the coefficient has an error of `-dy/(j n w T) - dv/((j n w)^2 T)`. So a parabola
//! with this rise of value and slope is subtracted. `dy` and `dv` come from straight lines fitted to a quarter of a
//! period about each end; these are the same part of the wave, so its shape cancels. Jumps of higher derivatives leave
//! an error smaller by `1/(n w)` each. If the recording does not extend beyond the cycles, nothing is subtracted.
//!
//! Median error of the fundamental on 200 multirotors with 1 % noise, relay in the loop:
//!
//! | drift | 8 cycles | 2 cycles |
//! |-------|----------|----------|
//! | parabola subtracted | 0.020 % | 0.056 % |
//! | straight line through the means of the first and last cycle subtracted | 0.044 % | 0.28 % |
//! | nothing subtracted | 0.047 % | 0.17 % |

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::Complex64;

use crate::excitation::Oscillation;
use crate::signals::Signals;

/// Measured frequency response of the process at one harmonic. For the method see the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Harmonic {
    /// Order of the harmonic: multiple of the frequency of the oscillation, from 1.
    pub order: usize,
    /// Frequency of the harmonic (rad/s).
    pub omega_rad_per_s: f64,
    /// Frequency response (output unit / input unit).
    pub response: Complex64,
    /// Standard deviation of the real and of the imaginary part of the response from the white noise of the samples
    /// (output unit / input unit). It is the root mean square of both deviations, which differ if there are few cycles,
    /// since the subtracted drift is noisy too.
    pub deviation: f64,
}

/// Least coefficient of the input at a harmonic, as a fraction of that of the fundamental. Less, such as the even
/// harmonics of a slightly asymmetric relay, does not excite the process.
const LEAST_CONTENT: f64 = 0.05;
/// Least magnitude of the response at a harmonic, in standard deviations.
const LEAST_DEVIATIONS: f64 = 3.0;
/// Coefficient of the fundamental of the input, as a fraction of the largest input, below which it is rounding error.
const ROUNDING: f64 = 1e-9;
/// Half length of the windows about both ends in which straight lines are fitted, in periods. In 200 experiments with 1
/// % noise the median squared error of the fundamental is 1.1 (8 cycles) to 1.8 (1 cycle) times that predicted by the
/// deviation. With windows half as long the factor is 1.0, but the errors are larger by a quarter (8 cycles) to a half
/// (1 cycle).
const END_PART: f64 = 0.125;
/// Least number of points in the window about an end. A line through fewer points is dominated by noise.
const LEAST_END_POINTS: usize = 3;
/// Largest distance of a time stamp from an end of the oscillation, as a fraction of the duration of a point: rounding.
const STAMP_TOLERANCE: f64 = 1e-3;

/// Frequency response at the harmonics of the oscillation `found` up to the order `most`, in ascending order.
///
/// A harmonic above the first is left out if the input has less than 5 % of the fundamental there, if the magnitude of
/// the response is below three standard deviations, or if a period of the harmonic has two points or fewer. The result
/// is empty if the input has no fundamental, or if the cycles do not begin and end at points of `signals`. All numbers
/// are finite.
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
    // Highest order with more than two points in a period of the harmonic.
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

/// Whole cycles of a recording, prepared for coefficients of any order.
struct Cycles<'a> {
    signals: &'a Signals<'a>,
    found: &'a Oscillation,
    points: Range<usize>,
    /// Duration of the cycles (s).
    length_s: f64,
    /// Frequency of the oscillation (rad/s).
    omega_rad_per_s: f64,
    /// Weight of each point of the output in the trapezoidal rule; they add up to 1.
    weights: Vec<f64>,
    /// Mean output (output unit).
    mean: f64,
    /// `None` if the recording has no points outside the cycles.
    ends: Option<Ends>,
}

/// Straight lines about the beginning and the end of the cycles, as linear functions of the output.
struct Ends {
    /// First point of each window.
    first: [usize; 2],
    /// Weights of the points of each window in the value (1) and the slope (1/s) of the line.
    lines: [Vec<(f64, f64)>; 2],
}

impl<'a> Cycles<'a> {
    /// `None` if the oscillation does not begin and end at points, or has fewer than three points a cycle.
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
                // The centre of the relay contributes nothing; subtracting it reduces rounding errors.
                let input = input[index] - self.found.relay_centre;
                middle * (input * 2.0 * half_turn.sin() / (omega * self.length_s))
            })
            .sum()
    }

    /// Response at a harmonic at which the input has the coefficient `input`.
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

    /// Weights of the points in the coefficient of the output at `omega`, and the index of the first of these points.
    fn output_parts(&self, omega: f64) -> (usize, Vec<Complex64>) {
        let first = (self.ends.as_ref()).map_or(self.points.start, |ends| ends.first[0]);
        let end = (self.ends.as_ref()).map_or(self.points.end, |ends| {
            self.points.end.max(ends.first[1] + ends.lines[1].len())
        });
        let mut parts = vec![Complex64::ZERO; end - first];
        // Coefficients of t and t^2 by the same trapezoidal rule.
        let (mut line, mut parabola) = (Complex64::ZERO, Complex64::ZERO);
        for (index, weight) in self.points.clone().zip(&self.weights) {
            let time_s = self.signals.time_s[index] - self.found.start_s;
            let part = Complex64::cis(-omega * time_s) * *weight;
            line += part * time_s;
            parabola += part * time_s * time_s;
            parts[index - first] = part;
        }
        if let Some(ends) = &self.ends {
            // Subtract (dy/T - dv/2) t + dv/(2T) t^2, whose value rises by dy and whose slope rises by dv over T.
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
    /// Windows of equal width about both ends, within the part of the recording without a gap. `None` if they have no
    /// points after the end or too few in all.
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

/// Weights of values at these times in the value (1) and the slope (1/s) at `at_s` of the straight line fitted to them
/// by least squares.
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

/// Weights of the trapezoidal rule for a function of the period `length_s`, as fractions of the period.
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

/// Mean of `exp(j turn_rad k)` over `samples` consecutive samples `k`, from 0.
fn mean_of_samples(samples: f64, turn_rad: f64) -> Complex64 {
    let half = 0.5 * turn_rad;
    let size = (samples * half).sin() / (samples * half.sin());
    Complex64::from_polar(size, (samples - 1.0) * half)
}
