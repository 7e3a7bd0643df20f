//! Set-point weight of a controller with integral term.
//!
//! The response to the reference is `y0 + b y1`, linear in the weight `b`. So the overshoot is a convex function of `b`,
//! and two simulations give it for every `b`.

use crate::analysis::Law;
use crate::analysis::process::Process;
use crate::analysis::propagator::NODES;
use crate::analysis::realisation::Excitation;
use crate::analysis::response::{STEP_RAD, run};

/// Bisections of the weight: exact to 1e-6.
const BISECTIONS: usize = 20;

/// Duration of the simulations, in steps, and at most.
const LONGEST: usize = 20_000;

/// The responses have settled within this.
const SETTLED: f64 = 1e-3;

/// Largest weight of at most 1 with at most this overshoot (a share of the step), and outputs of the controller of at most
/// `input_peak`. Zero if no weight has.
pub(crate) fn weight(
    process: &Process,
    law: &Law,
    omega: f64,
    (overshoot, input_peak): (f64, Option<f64>),
) -> f64 {
    let response = |b: f64| {
        let mut nodes = Vec::new();
        let mut quiet = 0;
        let take = |h: f64, _: f64, out: &[f64; 2 * NODES]| {
            let off = out[NODES..]
                .iter()
                .fold(0.0, |off: f64, y| off.max((y - 1.0).abs()));
            quiet = if off < SETTLED { quiet + 1 } else { 0 };
            nodes.push(*out);
            f64::from(quiet) * h * omega < 6.0 && nodes.len() < LONGEST
        };
        let law = Law { b, ..*law };
        run(process, &law, Excitation::Reference, STEP_RAD / omega, take).map(|()| nodes)
    };
    let (Some(without), Some(with)) = (response(0.0), response(1.0)) else {
        return 0.0;
    };
    let is_kept = |b: f64| {
        without.iter().zip(&with).all(|(y0, y1)| {
            (0..NODES).all(|i| {
                let u = y0[i] + b * (y1[i] - y0[i]);
                let y = y0[NODES + i] + b * (y1[NODES + i] - y0[NODES + i]);
                y <= 1.0 + overshoot && input_peak.is_none_or(|limit| u.abs() <= limit)
            })
        })
    };
    if is_kept(1.0) {
        return 1.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    // Convex: below an infeasible weight there may be feasible ones only if it is above them.
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if is_kept(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
