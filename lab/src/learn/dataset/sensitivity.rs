//! What a small error of the values costs: the derivative of the deterioration.
//!
//! ```text
//! J(d) = cost of the controller made for the process at values + d, on the true process,
//!        above the true optimum and as a fraction of it
//! g_k  = dJ/dd_k  at d = 0
//! ```
//!
//! An optimum has no slope, but this one is least at a phase margin that is an equality: a controller
//! of a little less margin is a little cheaper, and of a little more a little dearer. So `J` is nearly
//! linear near zero, and `|g . d|` is what an estimate that is off by `d` costs, to first order: within
//! 5 % of costs up to 1 %. Of far errors it says too much, above all of a ratio of poles off by 0.05.

use onecycle_onboard::classify::process_of;

use super::{Example, VALUES};
use onecycle_design::soiptd_pd::cost::ise;
use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;

/// Steps of the central differences: a thousandth of each value's extent or less, so that of the third
/// derivative 1e-5 of the slope is left at most, and of rounding less.
const STEPS: [f64; VALUES] = [1e-3, 1e-4, 1e-4, 1e-3];

/// What a ratio of poles and a delay by the period can be.
const RANGES: [(f64, f64); VALUES] = [
    (f64::NEG_INFINITY, f64::INFINITY),
    (0.0, 0.25),
    (0.0, f64::INFINITY),
    (f64::NEG_INFINITY, f64::INFINITY),
];

impl Example {
    /// Derivatives of what a controller made at this phase margin costs, by the errors of the values
    /// that it was made for. At an end of what a value can be errors have one side only, and so does
    /// the difference.
    ///
    /// `None` where a controller's gains or cost overflow, or it is unstable a step beside its optimum:
    /// no process of ordinary times is so.
    #[must_use]
    pub fn cost_gradient(&self, phase_margin_rad: f64) -> Option<[f64; VALUES]> {
        let best = pd_at_phase_margin(&self.process, phase_margin_rad).ok()?;
        let truth = self.values();
        let cost = |k: usize, value: f64| {
            let mut values = truth;
            values[k] = value;
            let found = process_of(&values, &self.signature, self.period_s).ok()?;
            let made = pd_at_phase_margin(&found, phase_margin_rad).ok()?;
            Some(ise(&self.process, made.pd)? / best.ise)
        };
        let mut gradient = [0.0; VALUES];
        for (k, slope) in gradient.iter_mut().enumerate() {
            let (least, most) = RANGES[k];
            let (low, high) = (
                (truth[k] - STEPS[k]).max(least),
                (truth[k] + STEPS[k]).min(most),
            );
            *slope = (cost(k, high)? - cost(k, low)?) / (high - low);
        }
        gradient
            .iter()
            .all(|slope| slope.is_finite())
            .then_some(gradient)
    }
}
