//! Result of an identification.

use onecycle_design::{Design, Model, StepMetrics};
use onecycle_onboard::refine::Refined;

use crate::excitation::{Excitation, Oscillation};
use crate::posterior::{Estimate, Interval, Posterior};
use crate::reading::Reading;
use crate::remark::Remark;
use crate::verdict::Verdict;

/// Result of an identification.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Identification {
    /// Excitation of the process. `None` if the recording has no usable excitation.
    pub excitation: Option<Excitation>,
    /// Process and controller, or the reason why no process was identified.
    pub outcome: Result<Identified, Verdict>,
    /// What limits the result or deserves attention.
    pub remarks: Vec<Remark>,
}

impl Identification {
    /// Relay oscillation. `None` if the recording has none.
    #[must_use]
    pub fn oscillation(&self) -> Option<&Oscillation> {
        self.excitation.as_ref().map(|excitation| {
            let Excitation::Relay { oscillation, .. } = excitation;
            oscillation
        })
    }

    /// Estimate from the last cycle by the network of the pack. `None` without an oscillation, without a pack, or if
    /// the pack returns no estimate.
    #[must_use]
    pub fn last_cycle(&self) -> Option<&Reading> {
        self.excitation.as_ref().and_then(|excitation| {
            let Excitation::Relay { last_cycle, .. } = excitation;
            last_cycle.as_ref()
        })
    }
}

/// Identified process and its controller.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Identified {
    /// Most probable model.
    pub model: Model,
    /// Parameters of the model and the input bias, each with a 90 % interval.
    pub estimate: Estimate,
    /// Probability distribution of the model.
    pub posterior: Posterior,
    /// Probability that all parameters of the model lie within their intervals at once. `None` if there are no
    /// intervals.
    pub joint_probability: Option<f64>,
    /// Controller of least expected cost over the posterior, with its cost and margins on [`Identified::model`].
    pub design: Design,
    /// Phase margin of the controller (rad), with its 90 % interval over the posterior.
    pub phase_margin_rad: Interval,
    /// Predicted response to a unit step of the reference. `None` if it is too slow to simulate.
    pub step: Option<StepMetrics>,
    /// Quality of the fit.
    pub fit: Fit,
}

/// Quality of the fit of the model to the recording.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Fit {
    /// Root mean square of the residual in excess of the noise, divided by that of the oscillation.
    pub misfit: f64,
    /// Result of the estimator: covariance, residual, noise, model error.
    pub refined: Refined,
    /// Measured and fitted output over the cycles used.
    pub points: Vec<FitPoint>,
}

/// Measured and fitted output in one bin: the mean over a few consecutive samples.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FitPoint {
    /// Mean time of the samples (s).
    pub time_s: f64,
    /// Mean of the samples (output unit).
    pub measured: f64,
    /// Mean of the output of the model at the times of the samples (output unit).
    pub fitted: f64,
}
