//! Nonlinear forces: drag and dry friction of the rate of the output, thrust quadratic in the lagged input.
//!
//! A relay, and any test at one amplitude, lets a linear damping explain most of a quadratic one; the lag and the dead
//! time then make up for the rest, and the controller loses its margin. Friction passes for a disturbance in the same way.
//! So each force is tried after the linear fit, and taken if the likelihood asks for it.
//!
//! The rate is the derivative of a cubic through the output around each sample: A. Savitzky, M. J. E. Golay, Anal. Chem. 36
//! (1964). With noise of 5 % of the output at one amplitude a linear damping explains the record as well: only a second
//! amplitude tells.

use super::descent::Found;
use super::record::{Blocks, Forces, Record};
use super::search::{self, Candidate};
use super::spectrum;
use super::theta::Theta;
use crate::nonlinear::Nonlinear;
use crate::signals::range;

/// Half width of the cubic over the period of the excitation.
const HALF_WIDTH: f64 = 1.0 / 14.0;
/// Most points of the cubic to each side: more are thinned.
const POINTS: usize = 50;
/// Difference of the BIC from which a force is taken: a likelihood ratio of `e^10`.
const ASKED: f64 = 20.0;
/// Most forces: there is room for two columns beside the linear ones.
const MOST: usize = 2;
/// Rate below which the friction is smoothed, over the root mean square of the rate.
const CREEP: f64 = 0.05;

/// A nonlinear force.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Force {
    Drag,
    Friction,
    Thrust,
}

/// Which forces a record asks for.
#[derive(Clone, Debug)]
pub(super) struct Asked {
    forces: Vec<Force>,
    /// Period of the excitation (s).
    period_s: f64,
}

impl Asked {
    /// These forces along `record`.
    pub(super) fn of(&self, record: &Record) -> Forces {
        let mut forces = Forces {
            thrust: (self.forces.contains(&Force::Thrust))
                .then(|| record.input.iter().sum::<f64>() / record.len() as f64),
            ..Forces::default()
        };
        if self.forces.iter().all(|force| *force == Force::Thrust) {
            return forces;
        }
        let rate = rate(record, self.period_s);
        if self.forces.contains(&Force::Drag) {
            forces.drag = rate.iter().map(|v| v * v.abs()).collect();
        }
        if self.forces.contains(&Force::Friction) {
            let mean = rate.iter().map(|v| v * v).sum::<f64>() / rate.len() as f64;
            let creep = CREEP * CREEP * mean;
            forces.friction = rate.iter().map(|v| v / (v * v + creep).sqrt()).collect();
        }
        forces
    }
}

/// The nonlinear forces that explain `record` better than the linear fit `best`, and the fit with them from `start`, an
/// integrator with two lags. `None` if the record asks for none, and with uneven samples.
pub(super) fn forces(
    record: &Record,
    best: &Candidate,
    start: &Theta,
    (samples, skip_s, longest_tau_s): (usize, f64, f64),
) -> Option<(Asked, Candidate)> {
    if !record.uneven_s.is_empty() {
        return None;
    }
    let period_s = spectrum::period_s(&Blocks::new(record, samples, skip_s))?;
    let mut trial = record.clone();
    let mut chosen: Option<(Asked, Candidate)> = None;
    // The best force alone; then another one beside it.
    for _ in 0..MOST {
        let (known, lead) = match &chosen {
            Some((asked, found)) => (asked.forces.clone(), found),
            None => (vec![], best),
        };
        let others = [Force::Drag, Force::Friction, Force::Thrust].into_iter();
        let mut next: Option<(Asked, Candidate)> = None;
        for force in others.filter(|force| !known.contains(force)) {
            let mut forces = known.clone();
            forces.push(force);
            let asked = Asked { forces, period_s };
            trial.forces = asked.of(record);
            let blocks = Blocks::new(&trial, samples, skip_s);
            let mut raced = search::race(&blocks, &[*start], Some(lead), longest_tau_s);
            let Some(found) = raced.pop() else {
                continue;
            };
            let least = next.as_ref().map_or(lead.bic - ASKED, |(_, next)| next.bic);
            if found.bic < least && is_physical(&trial, &found) {
                next = Some((asked, found));
            }
        }
        let Some(found) = next else { break };
        chosen = Some(found);
    }
    chosen
}

/// Coefficients of the nonlinear forces that the model has.
pub(super) fn nonlinear(found: &Found, forces: &Forces) -> Nonlinear {
    let gain = found.at.gain;
    let mut values = found.at.forces.iter().map(|(value, _)| *value);
    let mut next = |is_there: bool| is_there.then(|| values.next()).flatten();
    Nonlinear {
        drag: next(!forces.drag.is_empty()).map(|value| -value),
        friction: next(!forces.friction.is_empty()).map(|value| -value / gain.abs()),
        thrust: next(forces.thrust.is_some()).map(|value| value / gain),
        middle: forces.thrust.unwrap_or(0.0),
    }
}

/// Whether the forces of the rate oppose the motion, and the thrust grows with the input over all of its range: that of an on-off input
/// may have any square.
fn is_physical(record: &Record, found: &Candidate) -> bool {
    let forces = &record.forces;
    let coefficients = found.found.at.forces.iter();
    let mut of_rate = coefficients.take(forces.of_rate().count());
    let nonlinear = nonlinear(&found.found, forces);
    let (low, high) = range(&record.input);
    let slope =
        |input: f64| 1.0 + 2.0 * nonlinear.thrust.unwrap_or(0.0) * (input - nonlinear.middle);
    of_rate.all(|(value, _)| *value < 0.0) && slope(low) > 0.0 && slope(high) > 0.0
}

/// Rate of the output at each sample (output unit/s).
fn rate(record: &Record, period_s: f64) -> Vec<f64> {
    let output = without_holes(record);
    let half =
        ((HALF_WIDTH * period_s / record.dt_s).round() as usize).clamp(2, (record.len() - 1) / 4);
    let stride = half.div_ceil(POINTS);
    let half = half / stride;
    // Slope of the cubic at its middle from the sums of i y and i^3 y.
    let (mut s2, mut s4, mut s6) = (0.0, 0.0, 0.0);
    for i in 1..=half {
        let square = (i * i) as f64;
        s2 += 2.0 * square;
        s4 += 2.0 * square * square;
        s6 += 2.0 * square * square * square;
    }
    let weight = |i: usize| {
        let i = i as f64;
        (s6 * i - s4 * i * i * i) / (s2 * s6 - s4 * s4)
    };
    let weights: Vec<f64> = (1..=half).map(weight).collect();
    let reach = half * stride;
    let step_s = stride as f64 * record.dt_s;
    let at = |middle: usize| {
        let middle = middle.clamp(reach, output.len() - 1 - reach);
        let pairs = weights.iter().zip(1..);
        let sum: f64 = pairs
            .map(|(weight, i)| weight * (output[middle + i * stride] - output[middle - i * stride]))
            .sum();
        sum / step_s
    };
    (0..output.len()).map(at).collect()
}

/// Outputs with straight lines in the place of absent ones.
fn without_holes(record: &Record) -> Vec<f64> {
    let present: Vec<usize> = (0..record.len()).filter(|i| record.present[*i]).collect();
    let mut output = record.output.clone();
    let (Some(&first), Some(&last)) = (present.first(), present.last()) else {
        return output;
    };
    for pair in present.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        for index in from + 1..to {
            let part = (index - from) as f64 / (to - from) as f64;
            output[index] = record.output[from] + part * (record.output[to] - record.output[from]);
        }
    }
    output[..first].fill(record.output[first]);
    output[last..].fill(record.output[last]);
    output
}

#[cfg(test)]
mod tests {
    use super::*;

    // A cubic is differentiated exactly, across a hole too where the path is straight.
    #[test]
    fn the_rate_of_a_cubic_is_exact() {
        let output = |t: f64| 1.0 + 2.0 * t - 3.0 * t * t + 0.5 * t * t * t;
        let rate_of = |t: f64| 2.0 - 6.0 * t + 1.5 * t * t;
        let times: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
        let record = Record::even(
            0.01,
            vec![0.0; 400],
            times.iter().map(|t| output(*t)).collect(),
        );
        let found = rate(&record, 1.0);
        for k in [10, 57, 200, 389] {
            assert!((found[k] - rate_of(times[k])).abs() < 1e-9, "{k}");
        }
    }
}
