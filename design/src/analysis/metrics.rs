//! Overshoot, rise time, settling time and peak input from the steps of a response.
//!
//! Between nodes the output is the polynomial of degree 7 through the nodes of its step.

use crate::roots::{minimum, root};
use crate::soiptd_pd::step_metrics::StepMetrics;

use super::propagator::{MONOMIALS, NODES};

/// Half width of the settling band, as a fraction of the step: the common 2 %.
const SETTLING_BAND: f64 = 0.02;

/// Outputs at which the rise time starts and ends: the common 10 % and 90 %.
const RISE: [f64; 2] = [0.1, 0.9];

/// Tolerance of times, as a fraction of a step.
const TOLERANCE: f64 = 1e-9;

/// Response in steps: `u` at the 8 nodes, then `y`.
#[derive(Default)]
pub(crate) struct Record {
    pub h: f64,
    /// Time of the first node.
    pub start: f64,
    pub steps: Vec<[f64; 2 * NODES]>,
}

impl Record {
    /// `[u, y]` at all nodes. The first node of a step is the last one of the step before, and is not repeated.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let first = self.steps.first().map(|step| [step[0], step[NODES]]);
        let rest = self
            .steps
            .iter()
            .flat_map(|step| (1..NODES).map(|i| [step[i], step[NODES + i]]));
        first.into_iter().chain(rest)
    }
}

/// Polynomial through the nodes of a step at `s` in 0..1.
fn at(values: &[f64], s: f64) -> f64 {
    let coefficient = |p: usize| (0..NODES).map(|i| MONOMIALS[p][i] * values[i]).sum::<f64>();
    (0..NODES)
        .rev()
        .fold(0.0, |sum, p| sum * s + coefficient(p))
}

/// Metrics in the unit of time of the loop, of a response that settles at `goal`.
pub(crate) fn reference_metrics(record: &Record, goal: f64) -> StepMetrics {
    let y = |step: usize| &record.steps[step][NODES..];
    let time = |step: usize, s: f64| record.start + record.h * (step as f64 + s);
    let node = |i: usize| i as f64 / (NODES - 1) as f64;
    // First time at which `excess` becomes positive between two nodes, searched from the start or from the end.
    let crossing = |step: usize, i: usize, excess: &dyn Fn(f64) -> f64| {
        let function = |s: f64| excess(at(y(step), s));
        time(step, root(function, node(i), node(i + 1), TOLERANCE))
    };
    let cells = || (0..record.steps.len()).flat_map(|step| (0..NODES - 1).map(move |i| (step, i)));
    let rise = |level: f64| {
        let reached = |&(step, i): &(usize, usize)| y(step)[i + 1] / goal >= level;
        let cell = cells().find(reached);
        cell.map_or(record.start, |(step, i)| {
            crossing(step, i, &|value| value / goal - level)
        })
    };
    let beyond = |value: f64| (1.0 - value / goal).abs() - SETTLING_BAND;
    let unsettled = cells().rfind(|&(step, i)| beyond(y(step)[i]) > 0.0);
    let inputs = cells().flat_map(|(step, i)| [record.steps[step][i], record.steps[step][i + 1]]);
    let peak_input = inputs.fold(0.0, |most: f64, u| most.max(u.abs()));
    // The highest node, then the highest point of the cells on both sides of it.
    let highest = cells().fold(None, |best: Option<(usize, usize)>, cell| {
        let end = |(step, i): (usize, usize)| y(step)[i + 1] / goal;
        if best.is_none_or(|best| end(cell) > end(best)) {
            Some(cell)
        } else {
            best
        }
    });
    let around = highest.into_iter().flat_map(|highest| {
        let next = cells().skip_while(move |cell| *cell != highest);
        next.take(2)
    });
    let peaks = around.map(|(step, i)| {
        let below = |s: f64| -at(y(step), s) / goal;
        let (s, least) = minimum(below, node(i), node(i + 1), TOLERANCE);
        (-least, time(step, s))
    });
    let (peak, peak_time) = peaks.fold((0.0, record.start), |best, found| {
        if found.0 > best.0 { found } else { best }
    });
    StepMetrics {
        overshoot: (peak - 1.0).max(0.0),
        peak_time_s: (peak > 1.0).then_some(peak_time),
        rise_time_s: rise(RISE[1]) - rise(RISE[0]),
        settling_time_s: unsettled.map_or(record.start, |(step, i)| crossing(step, i, &beyond)),
        peak_input,
    }
}
