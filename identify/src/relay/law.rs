//! The law of the relay that made a recording, as the recording shows it.
//!
//! A relay of the test switches when the output has come back from its last extreme by a fixed ratio:
//!
//! ```text
//! beta = -(y(to high) - y(to low)) / (extreme while low - extreme while high)
//! ```
//!
//! Differences of the two switches of a cycle, so that the reference of the relay need not be known. `beta` is that of
//! [`onecycle_onboard::relay`]: 0 for a plain relay, positive with hysteresis. An input that was logged late appears to
//! switch late, at another ratio: this is the only trace that a constant offset of its clock leaves, because in the model
//! the offset looks like dead time.

use super::input::{RelayInput, find_relay};
use crate::excitation::Switching;
use crate::signals::Signals;

/// Half width of the window (share of the period; samples) in which the output is smoothed by a parabola.
const WINDOW: f64 = 0.04;
const WINDOW_SAMPLES: f64 = 2.6;
/// Most points of a phase that are compared, and of a window that are smoothed: a recording may have millions in a period.
const MOST_POINTS: usize = 400;
/// Largest offset of the clock that is looked for, as a share of the period.
const FARTHEST: f64 = 0.25;
/// Steps from no offset to the farthest.
const STEPS: i32 = 50;
/// Largest standard deviation of `beta` from cycle to cycle of an input that follows such a law. Switches at other times
/// scatter far more.
const MOST_SCATTER: f64 = 0.1;
/// Largest distance of the share of time high from one half at which the ratio is that of `beta`.
/// A relay of the board that turned back on one side is high for 38 % of the time; one that trims its bias for 45 % and more.
const MOST_ASYMMETRY: f64 = 0.08;
/// Fewest cycles that show a scatter.
const FEWEST_CYCLES: usize = 3;

/// The switches of the relay, with the extremes between them.
pub(crate) struct Law<'a> {
    signals: &'a Signals<'a>,
    half_width_s: f64,
    farthest_s: f64,
    cycles: Vec<Cycle>,
}

/// The switches at the ends of a low phase and of a high phase, one after the other.
struct Cycle {
    to_high: Switch,
    to_low: Switch,
}

#[derive(Clone, Copy)]
struct Switch {
    time_s: f64,
    /// Extreme of the output since the switch before.
    extreme: f64,
}

impl<'a> Law<'a> {
    /// As [`Law::new`], with the relay that the input holds. `None` also if it holds none.
    pub(crate) fn find(signals: &'a Signals<'a>, span_s: (f64, f64), rises: bool) -> Option<Self> {
        let relay = find_relay(signals).ok()?;
        Self::new(signals, &relay, span_s, rises)
    }

    /// Switches between two times (s). `rises`: whether the output rises after a switch to high. `None` if there is no
    /// complete cycle, or if the samples were averaged.
    fn new(
        signals: &'a Signals<'a>,
        relay: &RelayInput,
        (from_s, to_s): (f64, f64),
        rises: bool,
    ) -> Option<Self> {
        if signals.samples_per_point > 1 {
            return None;
        }
        let levels: Vec<bool> = relay.levels(&signals.input[relay.span.clone()]).collect();
        let mut starts = vec![relay.span.start];
        for phase in levels.chunk_by(|a, b| a == b) {
            starts.push(starts[starts.len() - 1] + phase.len());
        }
        let is_high = |phase: usize| levels[starts[phase] - relay.span.start];
        let rounding_s = 0.5 * signals.sample_period_s;
        let inside = |phase: usize| {
            let (start, end) = (starts[phase], starts[phase + 1]);
            // A gap inside a phase may hide its extreme or a switch.
            phase > 0
                && end < signals.time_s.len()
                && signals.time_s[start] > from_s - rounding_s
                && signals.time_s[end] < to_s + rounding_s
                && !signals.breaks.iter().any(|at| (start..=end).contains(at))
        };
        // The first phase has no beginning, the last one no end.
        let phases: Vec<usize> = (1..starts.len().saturating_sub(2))
            .filter(|p| inside(*p))
            .collect();
        let (first, last) = (*phases.first()?, *phases.last()?);
        let length_s = signals.time_s[starts[last + 1]] - signals.time_s[starts[first]];
        let period_s = 2.0 * length_s / phases.len() as f64;
        let half_width_s = (WINDOW * period_s).max(WINDOW_SAMPLES * signals.sample_period_s);
        let mut law = Self {
            signals,
            half_width_s,
            farthest_s: FARTHEST * period_s,
            cycles: vec![],
        };
        let switch = |phase: usize| Switch {
            time_s: signals.time_s[starts[phase + 1]],
            extreme: law.extreme(starts[phase]..starts[phase + 1], is_high(phase) != rises),
        };
        let pairs = (phases.chunks_exact(2)).filter(|pair| pair[1] == pair[0] + 1);
        law.cycles = pairs
            .map(|pair| {
                let [first, second] = [switch(pair[0]), switch(pair[1])];
                let (to_low, to_high) = if is_high(pair[0]) {
                    (first, second)
                } else {
                    (second, first)
                };
                Cycle { to_high, to_low }
            })
            .collect();
        (!law.cycles.is_empty()).then_some(law)
    }

    /// Mean ratio.
    pub(crate) fn mean_beta(&self) -> f64 {
        let betas = self.cycles.iter().map(|cycle| self.beta(cycle, 0.0));
        betas.sum::<f64>() / self.cycles.len() as f64
    }

    /// The ratio, if the input follows such a law over three cycles or more.
    pub(crate) fn switching(&self) -> Option<Switching> {
        let beta = self.mean_beta();
        let squares = (self.cycles.iter()).map(|cycle| (self.beta(cycle, 0.0) - beta).powi(2));
        let count = self.cycles.len() as f64;
        let scatter = (squares.sum::<f64>() / (count - 1.0)).sqrt();
        let is_law = self.cycles.len() >= FEWEST_CYCLES && scatter < MOST_SCATTER;
        is_law.then_some(Switching {
            beta,
            deviation: scatter / count.sqrt(),
            cycles: self.cycles.len(),
        })
    }

    /// Time (s) by which the input lies behind the switches of a relay with this `beta`. A sampled relay switches up to one
    /// sample after the output has reached its ratio; half a sample is taken off. `None` if no offset explains the
    /// switches.
    pub(crate) fn late_s(&self, beta: f64) -> Option<f64> {
        let at = |late_s: f64| {
            let sum: f64 = self
                .cycles
                .iter()
                .map(|cycle| self.beta(cycle, late_s))
                .sum();
            sum / self.cycles.len() as f64 - beta
        };
        let step_s = self.farthest_s / f64::from(STEPS);
        // The nearest crossing, on either side.
        let crossing = |sign: f64| {
            let mut before = (0.0, at(0.0));
            for step in 1..=STEPS {
                let late_s = sign * f64::from(step) * step_s;
                let here = at(late_s);
                if (here > 0.0) != (before.1 > 0.0) {
                    return Some(before.0 + (late_s - before.0) * before.1 / (before.1 - here));
                }
                before = (late_s, here);
            }
            None
        };
        let nearest = [crossing(1.0), crossing(-1.0)].into_iter().flatten();
        let late_s = nearest.min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        Some(late_s - 0.5 * self.signals.sample_period_s)
    }

    /// Whether the relay is high for about half of the time. Against a bias that is not trimmed a relay with protection
    /// against turning back early switches later on one side than its `beta` says.
    pub(crate) fn is_symmetric(&self) -> bool {
        self.asymmetry() < MOST_ASYMMETRY
    }

    /// Distance of the share of time high from one half.
    pub(crate) fn asymmetry(&self) -> f64 {
        let high_s: f64 = (self.cycles.iter())
            .map(|cycle| (cycle.to_low.time_s - cycle.to_high.time_s).rem_euclid(self.period_s()))
            .sum();
        let share = high_s / self.cycles.len() as f64 / self.period_s();
        (share - 0.5).abs()
    }

    /// Mean period of the cycles (s).
    pub(crate) fn period_s(&self) -> f64 {
        self.farthest_s / FARTHEST
    }

    /// Sample period (s).
    pub(crate) fn sample_s(&self) -> f64 {
        self.signals.sample_period_s
    }

    /// Ratio of a cycle whose switches came `late_s` before their time stamps.
    fn beta(&self, cycle: &Cycle, late_s: f64) -> f64 {
        let [high, low] = [cycle.to_high, cycle.to_low];
        let output = |switch: Switch| self.smooth(switch.time_s - late_s);
        -(output(high) - output(low)) / (high.extreme - low.extreme)
    }

    /// Largest or smallest smoothed output of a phase.
    fn extreme(&self, phase: std::ops::Range<usize>, is_largest: bool) -> f64 {
        let sign = if is_largest { 1.0 } else { -1.0 };
        let every = (phase.len() / MOST_POINTS).max(1);
        let smoothed =
            (phase.step_by(every)).map(|index| sign * self.smooth(self.signals.time_s[index]));
        sign * smoothed.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Output at a time (s): the parabola of least squares through the samples about it.
    fn smooth(&self, time_s: f64) -> f64 {
        let times_s = self.signals.time_s;
        let first = times_s.partition_point(|t| *t < time_s - self.half_width_s);
        let end = times_s.partition_point(|t| *t <= time_s + self.half_width_s);
        let mut moments = [0.0; 5];
        let mut products = [0.0; 3];
        let every = ((end - first) / MOST_POINTS).max(1);
        for index in (first..end).step_by(every) {
            let x = (times_s[index] - time_s) / self.half_width_s;
            let y = self.signals.output[index];
            let mut power = 1.0;
            for k in 0..5 {
                moments[k] += power;
                if k < 3 {
                    products[k] += power * y;
                }
                power *= x;
            }
        }
        value_at_zero(&moments, &products)
    }
}

/// Constant of the parabola with these moments of `x` and products of `x` and `y`, by Cramer's rule.
fn value_at_zero(m: &[f64; 5], p: &[f64; 3]) -> f64 {
    let minor = |a: f64, b: f64, c: f64, d: f64| a * d - b * c;
    let minors = [
        minor(m[2], m[3], m[3], m[4]),
        minor(m[1], m[3], m[2], m[4]),
        minor(m[1], m[2], m[2], m[3]),
    ];
    let determinant = m[0] * minors[0] - m[1] * minors[1] + m[2] * minors[2];
    (p[0] * minors[0] - p[1] * minors[1] + p[2] * minors[2]) / determinant
}

/// Sign of the gain of a process that a relay makes oscillate: with a positive one the output rises until the input goes low, whatever the
/// law of the relay is. Zero if it does not move there for certain.
pub(crate) fn sign_of_gain(signals: &Signals<'_>) -> f64 {
    /// Part of a phase over which the output moves, and the deviations of the sum of all movements that are certain.
    const PART: f64 = 0.05;
    const CERTAIN: f64 = 3.0;
    let Ok(relay) = find_relay(signals) else {
        return 0.0;
    };
    let levels: Vec<bool> = relay.levels(&signals.input[relay.span.clone()]).collect();
    let output = &signals.output[relay.span.clone()];
    let phases: Vec<&[bool]> = levels.chunk_by(|a, b| a == b).collect();
    let mut end = phases.first().map_or(0, |phase| phase.len());
    let (mut sum, mut squares) = (0.0, 0.0);
    // The first phase has no beginning, the last one no end.
    for phase in phases.iter().take(phases.len().saturating_sub(1)).skip(1) {
        end += phase.len();
        let rows = (PART * phase.len() as f64).ceil() as usize;
        let rise = output[end] - output[end - rows];
        sum += if phase[0] { rise } else { -rise };
        squares += rise * rise;
    }
    // Deviation of a sum of movements whose mean may be zero: the root of their squares.
    match sum.abs() > CERTAIN * squares.sqrt() {
        true => sum.signum(),
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels of 100 rows, the first one high.
    fn square(row: i32) -> f64 {
        if row.rem_euclid(200) < 100 { 1.0 } else { -1.0 }
    }

    // Relays of both directions that oscillate with an integrator (a triangle that turns with the input), and with a dead time of half a
    // period. An output at rest tells nothing.
    #[test]
    fn the_law_of_a_relay_has_the_sign_of_the_gain() {
        let triangle = |row: i32| (0..row).map(square).sum::<f64>();
        let delayed = |row: i32| square(row - 99);
        let resting = |row: i32| square(row - 30);
        let waves: [(&dyn Fn(i32) -> f64, f64); 3] =
            [(&triangle, 1.0), (&delayed, 1.0), (&resting, 0.0)];
        for ((wave, sign), side) in waves.into_iter().flat_map(|of| [(of, 1.0), (of, -1.0)]) {
            let input: Vec<f64> = (0..2000).map(square).collect();
            let output: Vec<f64> = (0..2000).map(|row| 5.0 + side * wave(row)).collect();
            let time_s: Vec<f64> = (0..2000).map(f64::from).collect();
            let signals = Signals {
                time_s: &time_s,
                input: &input,
                output: &output,
                samples_per_point: 1,
                sample_period_s: 1.0,
                breaks: &[],
            };
            assert_eq!(sign_of_gain(&signals), side * sign);
        }
    }
}
