//! Settings of an identification.

use onecycle_design::Specification;

/// Largest number of cycles that a fit can use.
pub const MOST_CYCLES: usize = 50;

/// Settings of an identification. `Default`: the last eight cycles, [`Method::Map`], a PD with 20 degrees of phase margin.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// Number of steady cycles to fit, the last ones; at most [`MOST_CYCLES`].
    pub cycles: usize,
    /// What the controller has to keep.
    pub specification: Specification,
    /// How the process is found.
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
    /// Fits the last `cycles` steady cycles, 1 to [`MOST_CYCLES`]; values beyond are brought to the nearest of these.
    #[must_use]
    pub fn cycles(self, cycles: usize) -> Self {
        Self {
            cycles: cycles.clamp(1, MOST_CYCLES),
            ..self
        }
    }

    /// Asks for a controller with at least this phase margin (rad), between 0 and `pi/2`.
    #[must_use]
    pub fn phase_margin_rad(self, phase_margin_rad: f64) -> Self {
        Self {
            specification: self.specification.with_phase_margin_rad(phase_margin_rad),
            ..self
        }
    }

    /// Finds the process by `method`.
    #[must_use]
    pub fn method(self, method: Method) -> Self {
        Self { method, ..self }
    }
}

/// How the process is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Method {
    /// By the network of the pack alone, from the last cycle.
    Classify,
    /// By least squares alone, without a pack.
    Refine,
    /// The most probable process: least squares that starts where the network points to, with the prior of the pack's
    /// family of processes.
    #[default]
    Map,
}
