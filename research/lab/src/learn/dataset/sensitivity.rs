//! Cost of a small error of the values: the derivative of the deterioration.
//!
//! ```text
//! J(d) = cost of the controller made for the process at values + d, on the true process,
//!        above the true optimum and as a fraction of it
//! g_k  = dJ/dd_k  at d = 0
//! ```
//!
//! An unconstrained optimum has no slope, but this one is at an exact phase margin: a controller with a
//! little less margin is a little cheaper, one with a little more a little dearer. So `J` is nearly
//! linear near zero, and `|g . d|` is the cost of an estimate with the error `d` to first order: within
//! 5 % for costs up to 1 %. For large errors it is too high, above all for a ratio of poles off by
//! 0.05.

use onecycle_onboard::classify::process_of;

use super::{Example, VALUES};
use onecycle_design::soiptd_pd::cost::ise;
use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;

/// Steps of the central differences: at most a thousandth of the range of each value, so that the third
/// derivative contributes at most 1e-5 of the slope and rounding less.
const STEPS: [f64; VALUES] = [1e-3, 1e-4, 1e-4, 1e-3];

/// Possible range of each value.
const RANGES: [(f64, f64); VALUES] = [
    (f64::NEG_INFINITY, f64::INFINITY),
    (0.0, 0.25),
    (0.0, f64::INFINITY),
    (f64::NEG_INFINITY, f64::INFINITY),
];

impl Example {
    /// Derivatives of the cost of a controller with this phase margin (rad), by errors of the values
    /// that the controller is designed for. At a limit of a value's range the difference is one-sided.
    ///
    /// `None` if the controller's gains or cost overflow, or a controller one step from the optimum is
    /// unstable; this does not happen for processes with ordinary times.
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
