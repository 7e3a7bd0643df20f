//! Result of an identification: values only. Sentences and advice are made by the program that shows them.

use onecycle_design::{Design, Model, StepMetrics};
use onecycle_onboard::refine::Refined;

use crate::excitation::{Excitation, Oscillation};
use crate::posterior::{Estimate, Interval, Posterior};
use crate::relay::reading::Reading;
use crate::remark::Remark;
use crate::verdict::Verdict;

/// Everything that a recording says.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Identification {
    /// What excited the process; `None` where nothing usable was found.
    pub excitation: Option<Excitation>,
    /// The process, or why there is none.
    pub outcome: Result<Identified, Verdict>,
    /// What limits the result, or deserves attention.
    pub remarks: Vec<Remark>,
}

impl Identification {
    /// The relay oscillation, where there is one.
    #[must_use]
    pub fn oscillation(&self) -> Option<&Oscillation> {
        self.excitation.as_ref().map(|excitation| {
            let Excitation::Relay { oscillation, .. } = excitation;
            oscillation
        })
    }

    /// The network's estimate from the last cycle; `None` without an oscillation, a pack or an answer.
    #[must_use]
    pub fn last_cycle(&self) -> Option<&Reading> {
        self.excitation.as_ref().and_then(|excitation| {
            let Excitation::Relay { last_cycle, .. } = excitation;
            last_cycle.as_ref()
        })
    }
}

/// An identified process and the controller designed for it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Identified {
    /// The most probable model.
    pub model: Model,
    /// Its parameters and the input bias, each with a 90 % interval.
    pub estimate: Estimate,
    /// Draws from the distribution of the model.
    pub posterior: Posterior,
    /// Probability that all parameters of the model are within their intervals at once; `None` where there are no
    /// intervals.
    pub joint_probability: Option<f64>,
    /// The controller of least expected cost, with its cost and margins on [`Identified::model`].
    pub design: Design,
    /// Its phase margin (rad), with the 90 % interval over the posterior.
    pub phase_margin_rad: Interval,
    /// Predicted response to a unit step of the reference; `None` where it is too slow to simulate.
    pub step: Option<StepMetrics>,
    /// How well the model fits.
    pub fit: Fit,
}

/// How well the model fits the recording.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Fit {
    /// Root mean square of the residual beyond the noise, over that of the oscillation.
    pub misfit: f64,
    /// The estimator's result: covariance, residual, noise, error of the model.
    pub refined: Refined,
    /// Measured and fitted output over the cycles used.
    pub points: Vec<FitPoint>,
}

/// One point of the fit: a bin of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitPoint {
    /// Mean time of its samples (s).
    pub time_s: f64,
    /// Mean of its samples (output unit).
    pub measured: f64,
    /// Mean of the model's output over the same instants (output unit).
    pub fitted: f64,
}
