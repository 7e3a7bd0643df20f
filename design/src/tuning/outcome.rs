//! Result of a design: the controller with its cost and margins, or the reason why no controller exists.

use crate::controller::{Controller, Form};
use crate::model::Structure;
use crate::soiptd_pd::margins::Margins;
use crate::soiptd_pd::optimum::OptimumError;

/// Controller with its cost and margins on one model.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Design {
    /// The controller.
    pub controller: Controller,
    /// Integral of the squared error of a unit step of the reference (output unit^2 s): exact in the paper's style, to a
    /// relative 1e-4 in the others.
    pub ise: f64,
    /// Stability margins of the loop.
    pub margins: Margins,
    /// How the controller does on the draws. `None` without draws, and in the paper's style.
    pub robustness: Option<Robustness>,
}

/// A design over draws, beside the one for the most probable model alone: the price of not knowing the process.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Robustness {
    /// Share of the draws on which the limits hold.
    pub coverage: f64,
    /// Mean IAE over the first 12 draws: of a unit step of the load, or of the reference without an integral term.
    pub mean_iae: f64,
    /// Share of the draws on which the controller of the most probable model alone keeps the limits.
    pub nominal_coverage: f64,
    /// Mean IAE of that controller over the same draws. Infinite if one of the loops is unstable.
    pub nominal_mean_iae: f64,
}

/// Why no controller was designed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DesignError {
    /// The specified phase margin (rad) is not between 0 and `pi/2`.
    #[error("the phase margin must lie between 0 and pi/2 rad, but is {0} rad")]
    PhaseMargin(f64),
    /// The gain or the time constants of the model are so large or small that the controller gains or the cost
    /// overflow.
    #[error("the process is too extreme: its optimal gains or their cost cannot be represented")]
    Overflow,
    /// The method of `Style::Paper` designs no controller for this structure, or none of the specified form.
    #[error("the paper's method designs no such controller for the structure {}", .0.name())]
    Structure(Structure),
    /// A value of the specification is out of range.
    #[error("{name} must be {requirement}, but is {value}")]
    Setting {
        /// Field of the `Specification`.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range it must lie in.
        requirement: &'static str,
    },
    /// The process has more than one unstable pole, or one and an integrator.
    #[error(
        "the process has poles in the right half-plane; controllers are designed for one such pole without an integrator"
    )]
    UnstableProcess,
    /// The form has no integral term, so that a stable process would not reach the reference.
    #[error("a process without integrator needs a controller with an integral term, but {} has none", .0.name())]
    NoIntegral(Form),
    /// A cascade needs a process whose output is the integral of a rate.
    #[error("the form {} needs a process whose last stage is an integrator", .0.name())]
    NoRate(Form),
    /// Nothing limits the gain: the process has no dead time, or too few lags.
    #[error(
        "the best gain is infinite, because nothing delays the loop: give the sample period of the controller"
    )]
    Unbounded,
    /// No controller of this form keeps the limits.
    #[error("no controller of the form {} keeps the limits{}", .form.name(), at_least(.least_peak))]
    Infeasible {
        /// Form.
        form: Form,
        /// Least limit of `Ms` and `Mt` that a controller can keep with the other limits. `None` if none below 10.
        least_peak: Option<f64>,
    },
}

fn at_least(peak: &Option<f64>) -> String {
    peak.map_or(String::new(), |peak| {
        format!("; the least Ms and Mt is {peak:.2}")
    })
}

impl From<OptimumError> for DesignError {
    fn from(error: OptimumError) -> Self {
        match error {
            OptimumError::PhaseMargin(rad) => Self::PhaseMargin(rad),
            OptimumError::Overflow => Self::Overflow,
        }
    }
}
