//! Evaluation: every method on the same experiments, scored by the cost of its controller.
//!
//! ```text
//! J      = (ISE of the controller on the true process - J*) / J*           exact, see deterioration
//! J*     = least ISE of the true process at a phase margin of 20 degrees at least
//! score  = mean over ALL experiments of min(|J|, 1), an unstable loop and a missing answer being 1,
//!          a J below zero at a margin of 20 degrees or more being 0
//! ```
//!
//! An answer is a process, for which the PD of least ISE at the same margin is designed, or gains: of a
//! PD, or of a cascade with a PID of the rate ([`Cascade`]), which may cost less than the best PD.
//! Unstable loops and missing answers have no `J` and are counted separately; mean, median,
//! percentiles, worst and least phase margin are over the stable loops. A method could improve those by
//! refusing hard experiments, but not its score: a refusal counts as the highest cost. The score uses
//! `|J|`, because a cost below `J*` can be bought with less margin than required, which is no merit. At
//! the full margin no PD costs less than `J*`; a cascade may.
//!
//! | module         | what it holds                                                            |
//! |----------------|--------------------------------------------------------------------------|
//! | [`contender`]  | the methods: ours and the [baselines](crate::judge::baselines)          |
//! | [`summary`]    | many verdicts in a row of numbers                                        |
//! | [`files`]      | truth, answers and results as CSV                                        |
//!
//! Times are read from a clock that the caller passes in (the program passes the processor time of the
//! thread). Nothing else depends on it.
//!
//! ```
//! use onecycle_lab::judge::evaluate::{Answer, Judge};
//! use onecycle_onboard::Soiptd;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let truth = Soiptd::new(1.0, 0.05, 0.8, 0.02)?;
//! let judge = Judge::new(&truth)?;
//! let perfect = Answer::of_process(truth)?;
//! assert!(judge.deterioration(perfect.feedback).relative().is_some_and(|j| j.abs() < 1e-12));
//! # Ok(())
//! # }
//! ```

pub mod contender;
pub mod files;
pub mod parquet;
pub mod summary;

use onecycle_onboard::{Pd, Soiptd, SoiptdError};

pub use self::contender::{Contender, Seen};
pub use self::summary::{Costs, Summary, quantile};
use onecycle_design::cascade::Cascade;
pub use onecycle_design::soiptd_pd::deterioration::PHASE_MARGIN_DEG;
use onecycle_design::soiptd_pd::deterioration::{Deterioration, Reference};
use onecycle_design::soiptd_pd::optimum::{OptimumError, pd};
use onecycle_design::{Model, Parameter};
use onecycle_identify::{Estimate, Signals};

use crate::experiments::{ExperimentError, Truth};

/// Answer of a method to an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The identified process; `None` for a method that leads directly to gains.
    pub process: Option<Soiptd>,
    /// The resulting controller.
    pub feedback: Feedback,
    /// 90 % intervals of the parameters, from a method that has them.
    pub intervals: Option<Estimate>,
}

/// A controller as the method would fly it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feedback {
    /// A PD.
    Pd(Pd),
    /// A cascade with a PID of the rate.
    Cascade(Cascade),
}

impl From<Pd> for Feedback {
    fn from(pd: Pd) -> Self {
        Self::Pd(pd)
    }
}

impl From<Cascade> for Feedback {
    fn from(cascade: Cascade) -> Self {
        Self::Cascade(cascade)
    }
}

impl Answer {
    /// A process, with its PD of least ISE at [`PHASE_MARGIN_DEG`].
    ///
    /// # Errors
    /// Those of [`pd`]: the process is too extreme.
    pub fn of_process(process: Soiptd) -> Result<Self, OptimumError> {
        let optimum = pd(&process, PHASE_MARGIN_DEG.to_radians())?;
        Ok(Self {
            process: Some(process),
            feedback: optimum.pd.into(),
            intervals: None,
        })
    }

    /// An answer of gains alone.
    #[must_use]
    pub fn of_gains(gains: impl Into<Feedback>) -> Self {
        Self {
            process: None,
            feedback: gains.into(),
            intervals: None,
        }
    }
}

/// The process with its lags in order, the shorter one first. Swapping the lags does not change the
/// response.
///
/// # Errors
/// [`SoiptdError`] if rounding takes the parameters out of range; never for a process that a relay can
/// excite.
pub fn in_order(process: &Soiptd) -> Result<Soiptd, SoiptdError> {
    let (sum, ratio) = process.pole_sum();
    let unit = Soiptd::from_pole_sum(1.0, sum, ratio, process.tau_s())?;
    unit.with_gain_scaled(process.jerk_gain() * unit.t_prop_s())
}

/// Reference for answers: a true process and its optimum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judge(Reference);

impl Judge {
    /// The reference for answers to this process.
    ///
    /// # Errors
    /// [`OptimumError`] for a process too extreme to have an optimum.
    pub fn new(truth: &Soiptd) -> Result<Self, OptimumError> {
        Reference::new(truth).map(Self)
    }

    /// Cost of a controller on the true process.
    #[must_use]
    pub fn deterioration(&self, controller: impl Into<Feedback>) -> Deterioration {
        let cascade = match controller.into() {
            Feedback::Pd(pd) => return self.0.deterioration(pd),
            Feedback::Cascade(cascade) => cascade,
        };
        let best = self.0.optimum.ise;
        (cascade.cost(&self.0.process)).map_or(Deterioration::Unstable, |cost| {
            Deterioration::Stable {
                relative: (cost.ise - best) / best,
                phase_margin_rad: cost.phase_margin_rad,
            }
        })
    }

    /// Record of an answer to an experiment, or of the reason why there is none.
    #[must_use]
    pub fn record(&self, experiment: u64, method: &str, answer: Result<Answer, String>) -> Record {
        let mut record = Record {
            experiment,
            method: method.to_owned(),
            outcome: LoopOutcome::NoAnswer,
            deterioration: None,
            phase_margin_deg: None,
            k_over_t_body_error: None,
            t_prop_error: None,
            tau_error_s: None,
            intervals_held: None,
            reason: None,
            seconds: None,
        };
        let answer = match answer {
            Ok(answer) => answer,
            Err(reason) => {
                record.reason = Some(reason);
                return record;
            }
        };
        record.outcome = match self.deterioration(answer.feedback) {
            Deterioration::Stable {
                relative,
                phase_margin_rad,
            } => {
                record.deterioration = Some(relative);
                record.phase_margin_deg = Some(phase_margin_rad.to_degrees());
                LoopOutcome::Stable
            }
            Deterioration::Unstable => LoopOutcome::Unstable,
        };
        if let Some(errors) = answer
            .process
            .and_then(|found| errors(&found, &self.0.process))
        {
            [
                record.k_over_t_body_error,
                record.t_prop_error,
                record.tau_error_s,
            ] = errors.map(Some);
        }
        record.intervals_held = answer.intervals.and_then(|found| self.held(&found));
        record
    }

    /// As [`Self::record`], with the time that the answer takes. `clock` returns seconds.
    #[must_use]
    pub fn timed(
        &self,
        experiment: u64,
        method: &str,
        answer: impl FnOnce() -> Result<Answer, String>,
        clock: &dyn Fn() -> f64,
    ) -> Record {
        let begin_s = clock();
        let answer = answer();
        let seconds = clock() - begin_s;
        Record {
            seconds: Some(seconds),
            ..self.record(experiment, method, answer)
        }
    }

    /// Number of the 90 % intervals of [`JUDGED`] that hold the true value.
    fn held(&self, intervals: &Estimate) -> Option<u8> {
        let truth = Model::from(in_order(&self.0.process).ok()?);
        let held = |parameter| Some(intervals.get(parameter)?.holds(truth.parameter(parameter)?));
        JUDGED
            .into_iter()
            .map(|parameter| held(parameter).map(u8::from))
            .sum()
    }
}

/// Parameters whose intervals are compared with the truth: those that decide the controller.
pub const JUDGED: [Parameter; 3] = [Parameter::KOverTBody, Parameter::TProp, Parameter::Tau];

/// Errors of `K/T_body` and `T_prop` over their true values, and of `tau` (s), lags in order.
fn errors(found: &Soiptd, truth: &Soiptd) -> Option<[f64; 3]> {
    let (found, truth) = (in_order(found).ok()?, in_order(truth).ok()?);
    Some([
        found.k_over_t_body() / truth.k_over_t_body() - 1.0,
        found.t_prop_s() / truth.t_prop_s() - 1.0,
        found.tau_s() - truth.tau_s(),
    ])
}

/// Outcome of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LoopOutcome {
    /// The loop is stable.
    Stable,
    /// The loop is unstable.
    Unstable,
    /// There is no answer.
    NoAnswer,
}

/// Record of a method in an experiment: a row of the results.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Record {
    /// Number of the experiment.
    pub experiment: u64,
    /// Name of the method.
    pub method: String,
    /// Outcome of the answer.
    pub outcome: LoopOutcome,
    /// `J`, if the loop is stable.
    pub deterioration: Option<f64>,
    /// Phase margin on the true process (degrees), if the loop is stable.
    pub phase_margin_deg: Option<f64>,
    /// Error of `K/T_body` over its true value, if there is a process.
    pub k_over_t_body_error: Option<f64>,
    /// Error of `T_prop` over its true value.
    pub t_prop_error: Option<f64>,
    /// Error of `tau` (s).
    pub tau_error_s: Option<f64>,
    /// Number of the 90 % intervals of [`JUDGED`] that hold the true value, if the method has intervals.
    #[serde(default)]
    pub intervals_held: Option<u8>,
    /// Why there is no answer.
    pub reason: Option<String>,
    /// Time that the method took (s), if it was measured; the only number that depends on more than the
    /// seed.
    pub seconds: Option<f64>,
}

impl Record {
    /// Cost of the controller; `None` without an answer.
    #[must_use]
    pub fn judged(&self) -> Option<Deterioration> {
        match (self.outcome, self.deterioration, self.phase_margin_deg) {
            (LoopOutcome::Stable, Some(relative), Some(margin_deg)) => {
                Some(Deterioration::Stable {
                    relative,
                    phase_margin_rad: margin_deg.to_radians(),
                })
            }
            (LoopOutcome::NoAnswer, ..) => None,
            _ => Some(Deterioration::Unstable),
        }
    }
}

/// Why an experiment cannot be evaluated; this never happens for experiments of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum EvaluationError {
    /// The experiment cannot be run.
    #[error("{0}")]
    Experiment(#[from] ExperimentError),
    /// The true process has no optimum to compare with.
    #[error("{0}")]
    Optimum(#[from] OptimumError),
}

/// Every contender's record of an experiment. `recorded` is the benchmark's recording; a contender with
/// another relay test gets a recording of that test on the same process with the same bias, noise and
/// seed. `clock` returns seconds.
///
/// # Errors
/// [`EvaluationError`]: the true process has no optimum or cannot be run.
pub fn records(
    truth: &Truth,
    recorded: &Signals<'_>,
    contenders: &[Contender],
    clock: &dyn Fn() -> f64,
) -> Result<Vec<Record>, EvaluationError> {
    let judge = Judge::new(&truth.process)?;
    let mut records = Vec::with_capacity(contenders.len());
    for contender in contenders {
        let own = truth.recorded_by(contender.relay_test())?;
        let seen = own.as_ref().map_or(Seen::of(*recorded), Seen::of_recorded);
        let answer = || contender.answer(&seen);
        records.push(judge.timed(truth.number, &contender.name(), answer, clock));
    }
    Ok(records)
}
