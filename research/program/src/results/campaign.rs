//! Result of `onecycle-lab campaign`: the outcome of every case, as far as the tables need it.

use onecycle::Model;
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_lab::judge::bound::{BOUND_DRAWS, SHAPE_AND_GAIN};
use onecycle_lab::judge::out_of_family::{CYCLES, Evaluated};
use onecycle_lab::judge::outcome::{IdentificationOutcome, RelayOutcome};
use onecycle_lab::judge::promises::PROMISES;
use onecycle_onboard::classify::Familiarity;
use serde::{Deserialize, Serialize};

/// The relay of one case.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RelayCase {
    /// Cycle at which three cycles had been alike; `None` if never.
    pub(crate) steady_at: Option<u32>,
    /// Largest excursion over the amplitude by the describing function.
    pub(crate) excursion: f64,
    /// Period at the end over that of the describing function.
    pub(crate) period_ratio: f64,
    /// Whether the relay was still switching at the end.
    pub(crate) alive: bool,
    /// Switches taken back.
    pub(crate) undone: u32,
}

impl From<RelayOutcome> for RelayCase {
    fn from(outcome: RelayOutcome) -> Self {
        Self {
            steady_at: outcome.steady_at,
            excursion: outcome.excursion,
            period_ratio: outcome.period_ratio,
            alive: outcome.alive,
            undone: outcome.undone,
        }
    }
}

/// The identification of one case.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct IdentificationCase {
    /// Cost of the controller on the true process, where there is one.
    pub(crate) cost: Option<ControllerCost>,
    /// Whether the 90 % intervals hold the truth: K, K/T_body, T_prop, T_body, tau, bias; `None` if no process was
    /// identified.
    pub(crate) held: Option<[bool; 6]>,
    /// Whether the 90 % intervals of the [`PROMISES`] hold what the controller does on the true process; `None` without a
    /// controller.
    pub(crate) promises_held: Option<[bool; PROMISES.len()]>,
    /// Squared errors of the coordinates in standard deviations, at most [`MOST_SQUARED_ERROR`] each; `None` where the
    /// estimator gives no standard deviations.
    pub(crate) squared_errors: Option<[f64; SHAPE_AND_GAIN]>,
    /// Costs of the controllers of an ideal estimator; `None` where the estimator gives no standard deviations.
    #[serde(default)]
    pub(crate) bound: Option<[Option<ControllerCost>; BOUND_DRAWS]>,
}

/// Five standard deviations: a larger error shows in the cost, and would alone determine the mean.
const MOST_SQUARED_ERROR: f64 = 25.0;

/// Cost of a controller on a process.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ControllerCost {
    Stable {
        relative: f64,
        phase_margin_rad: f64,
    },
    Unstable,
}

impl From<Deterioration> for ControllerCost {
    fn from(cost: Deterioration) -> Self {
        match cost {
            Deterioration::Stable {
                relative,
                phase_margin_rad,
            } => Self::Stable {
                relative,
                phase_margin_rad,
            },
            Deterioration::Unstable => Self::Unstable,
        }
    }
}

impl From<ControllerCost> for Deterioration {
    fn from(cost: ControllerCost) -> Self {
        match cost {
            ControllerCost::Stable {
                relative,
                phase_margin_rad,
            } => Self::Stable {
                relative,
                phase_margin_rad,
            },
            ControllerCost::Unstable => Self::Unstable,
        }
    }
}

impl IdentificationCase {
    pub(crate) fn of(outcome: &IdentificationOutcome) -> Self {
        let squared = |error: f64| error.powi(2).min(MOST_SQUARED_ERROR);
        Self {
            cost: outcome.deterioration.map(ControllerCost::from),
            bound: (outcome.bound).map(|costs| costs.map(|cost| cost.map(ControllerCost::from))),
            held: held(outcome),
            promises_held: outcome.promises_held,
            squared_errors: outcome.errors.map(|errors| errors.map(squared)),
        }
    }

    /// The cost as the summary takes it.
    pub(crate) fn deterioration(&self) -> Option<Deterioration> {
        self.cost.map(Deterioration::from)
    }
}

/// Whether each interval holds the truth: the five parameters of the model, then the input bias.
fn held(outcome: &IdentificationOutcome) -> Option<[bool; 6]> {
    let truth = Model::from(outcome.truth);
    let estimate = &outcome.found.outcome.as_ref().ok()?.estimate;
    let mut held = [false; 6];
    for (held, (parameter, interval)) in held.iter_mut().zip(estimate.iter()) {
        let truth = truth.parameter(parameter).unwrap_or(outcome.bias);
        *held = interval.holds(truth);
    }
    Some(held)
}

/// One case of a process that may be out of the family.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct OutsiderCase {
    pub(crate) is_steady: bool,
    /// Score of the last cycle, if it has one.
    pub(crate) scored: Option<ScoredCycle>,
    /// For each of [`CYCLES`]; `None` if no process was identified.
    pub(crate) accepted: [Option<AcceptedCase>; CYCLES.len()],
}

/// An accepted identification.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct AcceptedCase {
    pub(crate) is_harmful: bool,
    /// Whether no remark is about the recording.
    pub(crate) is_silent: bool,
}

/// The judgement of one cycle by its score.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ScoredCycle {
    pub(crate) is_harmful: bool,
    pub(crate) is_known: bool,
}

impl From<Evaluated> for OutsiderCase {
    fn from(judgement: Evaluated) -> Self {
        Self {
            is_steady: judgement.is_steady,
            scored: judgement.scored.map(|scored| ScoredCycle {
                is_harmful: scored.harm.is_harmful(),
                is_known: scored.verdict == Familiarity::Known,
            }),
            accepted: judgement.identified.map(|accepted| {
                accepted.map(|accepted| AcceptedCase {
                    is_harmful: accepted.harm.is_harmful(),
                    is_silent: accepted.is_silent,
                })
            }),
        }
    }
}
