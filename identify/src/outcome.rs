//! Result of an identification.

use num_complex::Complex64;
use onecycle_design::bands::quantiles;
use onecycle_design::{Design, Model, Parameter, Proposal, Specification, StepMetrics, proposals};
use onecycle_onboard::refine::Refined;

use crate::excitation::{Excitation, Oscillation, Switching};
use crate::nonlinear::Nonlinear;
use crate::posterior::{Estimate, Interval, Posterior, StepIntervals};
use crate::reading::Reading;
use crate::remark::Remark;
use crate::thresholds::{EXPECTED_ERROR_RATIO, WELL_PREDICTED};
use crate::two_amplitudes::TwoAmplitudes;
use crate::verdict::Verdict;

/// Result of an identification.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Identification {
    /// Excitation of the process. `None` if the recording has no usable excitation.
    pub excitation: Option<Excitation>,
    /// Process and controller, or the reason why no process was identified.
    pub outcome: Result<Identified, Verdict>,
    /// Fit that was refused: the reason of the verdict shows in its residual. `None` if a process was identified, or if there
    /// was nothing to fit.
    pub refused: Option<Refused>,
    /// Steady relay oscillation in a recording that was fitted whole.
    pub(crate) steady: Option<Oscillation>,
    /// Ratio at which the relay switched. `None` if nothing was identified, if the input is no relay, or if it switches at
    /// other times.
    pub switching: Option<Switching>,
    /// Comparison of the two amplitudes of a relay test. `None` if it has one, or if one of them has no process.
    pub amplitudes: Option<TwoAmplitudes>,
    /// What limits the result or deserves attention.
    pub remarks: Vec<Remark>,
}

impl Identification {
    /// Without anything to fit.
    pub(crate) fn refused(verdict: Verdict) -> Self {
        Self {
            excitation: None,
            outcome: Err(verdict),
            refused: None,
            steady: None,
            switching: None,
            amplitudes: None,
            remarks: vec![],
        }
    }

    /// Steady relay oscillation. `None` if the recording has none.
    #[must_use]
    pub fn oscillation(&self) -> Option<&Oscillation> {
        match &self.excitation {
            Some(Excitation::Relay { oscillation, .. }) => Some(oscillation),
            _ => self.steady.as_ref(),
        }
    }

    /// Estimate from the last cycle by the network of the pack. `None` without an oscillation, without a pack, or if
    /// the pack returns no estimate.
    #[must_use]
    pub fn last_cycle(&self) -> Option<&Reading> {
        match &self.excitation {
            Some(Excitation::Relay { last_cycle, .. }) => last_cycle.as_ref(),
            _ => None,
        }
    }

    /// Refuses what was identified.
    pub fn refuse(&mut self, verdict: Verdict) {
        if let Ok(identified) = std::mem::replace(&mut self.outcome, Err(verdict)) {
            self.refused = Some(Refused {
                model: identified.model,
                fit: identified.fit,
            });
        }
    }
}

/// A fit that was made and refused.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Refused {
    /// Model of least residual.
    pub model: Model,
    /// Its quality.
    pub fit: Fit,
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
    /// Requirements on the controller, with the noise and the sample period of the recording where the settings leave
    /// them open.
    pub specification: Specification,
    /// Controller of least expected cost over the posterior, with its cost and margins on [`Identified::model`]. `None`
    /// if none can be designed; a remark says why.
    pub design: Option<Design>,
    /// Phase margin of the controller (rad), with its 90 % interval over the posterior. `None` without a controller.
    pub phase_margin_rad: Option<Interval>,
    /// Predicted response to a unit step of the reference. `None` without a controller, or if it is too slow to
    /// simulate.
    pub step: Option<StepMetrics>,
    /// Largest factor by which a resonance above 1.5 times the highest frequency that the recording excites may raise the response of the
    /// process before the loop becomes unstable. `None` without a controller.
    pub resonance: Option<f64>,
    /// Quality of the fit.
    pub fit: Fit,
}

impl Identified {
    /// Rate of change of the output per unit of input (output unit/(s input unit)), with its 90 % interval: low, estimate, high.
    /// Of the loop of an angular rate it is the angular acceleration. An integrator has it in steady state, a damped body before it
    /// moves, and a resonance at its natural frequency, where `|s G|` has its peak `K w0 / (2 zeta)`. The high end may be infinite.
    /// `None`: there is no such rate, or no interval.
    #[must_use]
    pub fn effectiveness(&self) -> Option<[f64; 3]> {
        let stages = self.model.structure().stages();
        let gain = match (stages.integrators, stages.poles, stages.pairs) {
            (1, _, _) => self.estimate.get(Parameter::K)?,
            (0, 1, _) => self.estimate.get(Parameter::KOverTBody)?,
            (0, _, 1) => return self.peak_rate(),
            _ => return None,
        };
        let high = gain.high.unwrap_or(f64::INFINITY);
        Some([gain.low?, gain.estimate?, high])
    }

    fn peak_rate(&self) -> Option<[f64; 3]> {
        let peak = |value: &dyn Fn(Parameter) -> Option<f64>| {
            let frequency = value(Parameter::NaturalFrequency)?;
            Some(value(Parameter::K)? * frequency / (2.0 * value(Parameter::Zeta)?))
        };
        let estimate = peak(&|parameter| self.model.parameter(parameter))?;
        let draws = self.posterior.draws().iter();
        let of_draws = draws.filter_map(|draw| peak(&|parameter| draw.value(parameter)));
        let (low, high) = quantiles(of_draws.collect())?;
        Some([low.min(estimate), estimate, high.max(estimate)])
    }

    /// Model to design a controller for, and the first `most` draws that it has to serve. There are no draws if the model
    /// leaves a part of the oscillation unexplained: the distribution of such an error is not known.
    #[must_use]
    pub fn for_design(&self, most: usize) -> (Model, Vec<Model>) {
        let has_model_error = (self.fit.refined()).is_some_and(|fit| fit.response_error > 0.0);
        let most = if has_model_error { 0 } else { most };
        let undamped = self.model.soiptd().map_or(self.model, Model::Soiptd);
        (undamped, self.posterior.models(most))
    }

    /// [`Identified::step`] with 90 % intervals over the posterior. `None` without a predicted step, or if the posterior tells
    /// none: see [`Posterior::step`].
    #[must_use]
    pub fn step_intervals(&self) -> Option<StepIntervals> {
        let (step, design) = self.step.as_ref().zip(self.design.as_ref())?;
        self.posterior.step(step, &design.controller)
    }

    /// Controllers to choose from, robust over the posterior: one for each of [`Proposal::choices`] for
    /// [`Identified::specification`], [`Identified::design`] among them. Three styles cost about one and a half times the
    /// first.
    #[must_use]
    pub fn proposals(&self) -> Vec<Proposal> {
        let (model, draws) = self.for_design(Specification::default().draws());
        proposals(&model, &draws, &self.specification, self.design.as_ref())
    }

    /// Controller for other requirements than [`Identified::specification`], robust over the posterior. Those of
    /// [`Proposal::choices`] for `specification` are the ones to compare.
    #[must_use]
    pub fn propose(&self, specification: &Specification) -> Proposal {
        let (model, draws) = self.for_design(specification.draws());
        Proposal::new(&model, &draws, specification)
    }
}

/// Quality of the fit of the model to the recording.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Fit {
    /// Part of the output that the model leaves unexplained. Of a steady oscillation: root mean square of the residual
    /// in excess of the noise, divided by that of the oscillation. Of any other record: root of the unexplained share of
    /// the variance, in a prediction of the last third from the model of the first two thirds; of a response to a set-point:
    /// root of [`SetPointResponse::unexplained`].
    pub misfit: f64,
    /// Measured and fitted output over the cycles, or over the record, used. Empty if the fit is one of spectra.
    pub points: Vec<FitPoint>,
    /// How the model was estimated.
    pub evidence: Evidence,
}

/// Estimator of a model, with its results.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Evidence {
    /// Least squares over whole cycles of a steady oscillation, as on board.
    Relay(Refined),
    /// Likelihood of the whole record with disturbances.
    Innovations(Innovations),
    /// Cross-spectra with the set-point of a closed loop.
    SetPoint(SetPointResponse),
}

impl Fit {
    /// Result of the relay's estimator: covariance, residual, noise, model error. `None` for the whole recording.
    #[must_use]
    pub fn refined(&self) -> Option<&Refined> {
        match &self.evidence {
            Evidence::Relay(refined) => Some(refined),
            _ => None,
        }
    }

    /// Result for the whole recording. `None` for a fit to cycles.
    #[must_use]
    pub fn innovations(&self) -> Option<&Innovations> {
        match &self.evidence {
            Evidence::Innovations(innovations) => Some(innovations),
            _ => None,
        }
    }

    /// Response to the set-point of a closed loop, where that told the process. `None` elsewhere.
    #[must_use]
    pub fn set_point_response(&self) -> Option<&SetPointResponse> {
        match &self.evidence {
            Evidence::SetPoint(response) => Some(response),
            _ => None,
        }
    }
}

/// Frequency response of a process in a closed loop, from what the set-point caused.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SetPointResponse {
    /// Measured response and model, in ascending order of frequency.
    pub points: Vec<ResponsePoint>,
    /// Segments of the record, each overlapping the next by half.
    pub segments: usize,
    /// Sum of the squared errors of the model over their deviations: chi-squared if the model is right.
    pub chi_squared: f64,
    /// Degrees of freedom of that sum.
    pub freedom: f64,
    /// Share of the power of the output's cross-spectrum with the set-point that the model does not explain.
    pub unexplained: f64,
    /// Factor by which the deviations were widened because the sum is larger than its degrees of freedom; 1 if it is not.
    pub widened: f64,
    /// Standard deviation of white noise of a sample that has the power of the output's highest frequencies (output unit).
    pub noise_sigma: f64,
}

/// Response at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ResponsePoint {
    /// Frequency (rad/s).
    pub omega_rad_per_s: f64,
    /// Ratio of the cross-spectra of output and input with the set-point (output unit over input unit).
    pub measured: Complex64,
    /// Its deviation over its size. Above 0.3 or so the ratio is biased towards the inverse of the controller.
    pub deviation: f64,
    /// Response of the model.
    pub fitted: Complex64,
}

/// Result of the likelihood: the innovations, which are what a Kalman filter of the model could not predict.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Innovations {
    /// Noise and disturbances beside the response to the input.
    pub noise: Noise,
    /// Nonlinear forces beside the linear process.
    pub nonlinear: Nonlinear,
    /// Logarithm of the likelihood of the rows of the fit.
    pub log_likelihood: f64,
    /// Bayesian information criterion; lower is better.
    pub bic: f64,
    /// Best fit of every structure tried, in ascending order of BIC, the chosen one included.
    pub alternatives: Vec<Alternative>,
    /// Whether the innovations are white and free of the input.
    pub whiteness: InnovationTests,
    /// Prediction of the last third of the record from the model of the first two thirds. `None` if that is too short
    /// to fit.
    pub prediction: Option<Prediction>,
    /// Factor by which the deviations were widened because the innovations are not white; 1 if they are.
    pub widened: f64,
    /// Rows of the fit that have a sample, in order of time.
    pub rows: Vec<InnovationRow>,
}

/// Noise and disturbances of a record. A frequency is the one below which the disturbance outweighs the white noise of
/// the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Noise {
    /// Standard deviation of the white noise of one sample (output unit).
    pub sigma: f64,
    /// Random walk of a disturbance that acts behind the actuator lags, as wind (rad/s).
    pub w1_rad_per_s: Option<f64>,
    /// White disturbance at the same place, as gusts (rad/s).
    pub w0_rad_per_s: Option<f64>,
    /// Random walk of the measured output, as an angle integrated from a gyro (rad/s).
    pub wy_rad_per_s: Option<f64>,
}

impl Noise {
    /// White noise of this standard deviation (output unit), with the disturbances whose frequency (rad/s) is given.
    #[must_use]
    pub fn new(
        sigma: f64,
        w1_rad_per_s: Option<f64>,
        w0_rad_per_s: Option<f64>,
        wy_rad_per_s: Option<f64>,
    ) -> Self {
        Self {
            sigma,
            w1_rad_per_s,
            w0_rad_per_s,
            wy_rad_per_s,
        }
    }

    /// Kinds of noise beside the white one, as in JSON: `white`, or the names joined by `+`.
    #[must_use]
    pub fn kind(&self) -> String {
        let names = [
            ("w1", self.w1_rad_per_s),
            ("w0", self.w0_rad_per_s),
            ("wy", self.wy_rad_per_s),
        ];
        let present = names.iter().filter(|(_, value)| value.is_some());
        let joined = present.map(|(name, _)| *name).collect::<Vec<_>>().join("+");
        if joined.is_empty() {
            "white".to_owned()
        } else {
            joined
        }
    }
}

/// Best fit of a structure.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Alternative {
    /// The model.
    pub model: Model,
    /// Its noise.
    pub noise: Noise,
    /// Its Bayesian information criterion.
    pub bic: f64,
}

/// Tests of the innovations at lags of 1 to 20 rows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct InnovationTests {
    /// Largest magnitude of the autocorrelation.
    pub autocorrelation: f64,
    /// Statistic of Ljung and Box over its degrees of freedom: 1 for white innovations.
    pub ljung_box: f64,
    /// Share of the innovations' variance that the past input explains.
    pub input_share: f64,
    /// F statistic of that share: 1 if the input explains nothing.
    pub input_f: f64,
    /// Number of innovations.
    pub rows: usize,
}

/// Prediction of data that the model was not fitted to.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Prediction {
    /// Time ahead of the last measurement used (s).
    pub horizon_s: f64,
    /// Share of the variance of the output that the prediction explains; below zero if the mean is a better guess.
    pub explained: f64,
    /// Mean square of the error over the variance that the disturbances and the noise of the model cause: 1 if the
    /// model is right.
    pub error_ratio: f64,
}

impl Prediction {
    /// Whether it explains nine tenths of the variance.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.explained >= WELL_PREDICTED
    }

    /// Whether its error is what the disturbances and the noise of the model cause.
    #[must_use]
    pub fn is_as_good_as_disturbances_allow(&self) -> bool {
        self.error_ratio <= EXPECTED_ERROR_RATIO
    }
}

/// Row of the fit: the mean over the samples of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct InnovationRow {
    /// Mean time of the samples (s).
    pub time_s: f64,
    /// Mean of the measured outputs (output unit).
    pub measured: f64,
    /// Output of the model without disturbances (output unit).
    pub simulated: f64,
    /// Innovation over its standard deviation.
    pub innovation: f64,
    /// Output predicted from the rows before (output unit).
    pub predicted: f64,
    /// Disturbance at the process input, estimated from the rows before (input unit).
    pub disturbance: f64,
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
