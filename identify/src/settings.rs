//! Settings of an identification.

use onecycle_design::Specification;

/// Maximum number of cycles that a fit can use: the window of the estimator has room for the switches of 50 cycles.
pub const MOST_CYCLES: usize = 50;

/// Settings of an identification. `Default`: the last 8 cycles, [`Method::Map`], a PD with 20 degrees of phase margin.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// Number of cycles to fit, counted from the end of the steady oscillation: 1 to [`MOST_CYCLES`]. More cycles
    /// narrow the intervals; fewer follow a process that drifts.
    pub cycles: usize,
    /// Requirements on the controller.
    pub specification: Specification,
    /// Method of estimation.
    pub method: Method,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            cycles: 8,
            specification: Specification::default(),
            method: Method::default(),
        }
    }
}

impl Options {
    /// Fits the last `cycles` steady cycles. Values outside 1 to [`MOST_CYCLES`] are set to the nearest limit.
    #[must_use]
    pub fn cycles(self, cycles: usize) -> Self {
        Self {
            cycles: cycles.clamp(1, MOST_CYCLES),
            ..self
        }
    }

    /// Requires this phase margin (rad) at least, between 0 and `pi/2`. A value outside this range leads to the verdict
    /// [`NoController`](crate::Verdict::NoController).
    #[must_use]
    pub fn phase_margin_rad(self, phase_margin_rad: f64) -> Self {
        Self {
            specification: self.specification.with_phase_margin_rad(phase_margin_rad),
            ..self
        }
    }

    /// Estimates the process by `method`.
    #[must_use]
    pub fn method(self, method: Method) -> Self {
        Self { method, ..self }
    }
}

/// Method of estimation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Method {
    /// The estimate of the network of the pack, from the last cycle alone.
    Classify,
    /// Least squares without a pack.
    Refine,
    /// Maximum a posteriori: least squares that starts at the estimate of the network, with the prior of the pack.
    /// Without a pack, or if no process of the pack's family explains the last cycle, it is the same as
    /// [`Method::Refine`].
    #[default]
    Map,
}
