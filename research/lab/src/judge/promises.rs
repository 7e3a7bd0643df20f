//! What an identification predicts of its loop, beside what the loop does on the true process.

use onecycle_design::{Model, margins, step_metrics};
use onecycle_identify::{Identified, Interval};

/// Names of the promises, in their order.
pub const PROMISES: [&str; 4] = ["margin", "overshoot", "rise", "settling"];

/// A prediction with its 90 % interval, and what comes out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Promise {
    /// What was predicted.
    pub interval: Interval,
    /// What the controller does on the true process. Of an unstable loop the margin is negative infinity, the rest
    /// infinite.
    pub truth: f64,
}

/// Phase margin (rad), overshoot (1), rise time (s) and settling time (s) of the controller found, in the order of
/// [`PROMISES`]. `None` if there is no controller or no predicted step.
#[must_use]
pub fn promises(identified: &Identified, truth: &Model) -> Option<[Promise; PROMISES.len()]> {
    let controller = identified.design.as_ref()?.controller;
    let predicted = identified.step_intervals()?;
    let margin = margins(truth, &controller).map(|margins| margins.phase_margin_rad);
    let step = step_metrics(truth, &controller).ok();
    let promise = |interval: Interval, truth: Option<f64>| Promise {
        interval,
        truth: truth.unwrap_or(f64::INFINITY),
    };
    Some([
        Promise {
            interval: identified.phase_margin_rad?,
            truth: margin.unwrap_or(f64::NEG_INFINITY),
        },
        promise(predicted.overshoot, step.map(|step| step.overshoot)),
        promise(predicted.rise_time_s, step.map(|step| step.rise_time_s)),
        promise(
            predicted.settling_time_s,
            step.map(|step| step.settling_time_s),
        ),
    ])
}
