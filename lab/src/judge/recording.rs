//! Outcomes of a campaign of recordings: verdict or structure, errors and intervals of the parameters.

use std::collections::BTreeMap;

use onecycle_design::{Parameter, Specification, Structure};
use onecycle_identify::{Estimate, Interval, Options, Road, identify};

use crate::experiments::recording::SimulatedRecording;
use crate::experiments::signals_of;

/// Result of the general estimator on a recording, beside the truth.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordingOutcome {
    /// Refused, with the kind of the verdict.
    Refused(String),
    /// Identified.
    Identified {
        /// Name of the structure.
        structure: String,
        /// Parameters that both the truth and the result have, by their keys.
        parameters: BTreeMap<String, ParameterOutcome>,
    },
}

/// An estimated parameter beside its true value.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ParameterOutcome {
    /// Whether the 90 % interval holds the true value.
    pub held: bool,
    /// Error over the standard deviation of the posterior: of a lag, a frequency or a gain that of the inverse value,
    /// which stays finite without damping. `None` if the interval has no width.
    pub error: Option<f64>,
}

/// Quantile of the normal distribution at 95 %: half width of a 90 % interval in standard deviations.
const HALF_WIDTH: f64 = 1.644_854;

/// Identifies a recording by the general estimator, with this structure or the one that it chooses.
#[must_use]
pub fn recording_outcome(
    recording: &SimulatedRecording,
    structure: Option<Structure>,
) -> RecordingOutcome {
    let signals = signals_of(&recording.trace, recording.sample_s);
    let options = Options::default()
        .road(Road::General)
        .structure(structure)
        .specification(Specification::paper());
    match identify(&signals, &options).outcome {
        Err(verdict) => RecordingOutcome::Refused(verdict.kind().to_owned()),
        Ok(identified) => RecordingOutcome::Identified {
            structure: identified.model.structure().name().to_owned(),
            parameters: parameters(&identified.estimate, recording),
        },
    }
}

fn parameters(
    estimate: &Estimate,
    recording: &SimulatedRecording,
) -> BTreeMap<String, ParameterOutcome> {
    let of = |(parameter, interval): (Parameter, Interval)| {
        let truth = match parameter {
            Parameter::InputBias => recording.input_bias,
            _ => recording.model.parameter(parameter)?,
        };
        let outcome = ParameterOutcome {
            held: interval.holds(truth),
            error: error(parameter, &interval, truth),
        };
        Some((parameter.key().to_owned(), outcome))
    };
    estimate.iter().filter_map(of).collect()
}

/// Error in standard deviations.
fn error(parameter: Parameter, interval: &Interval, truth: f64) -> Option<f64> {
    let estimate = interval.estimate.unwrap_or(f64::INFINITY);
    let (error, deviation) = match parameter {
        // Without damping these are infinite, and their upper end often is: the other end and inverse values are not.
        Parameter::K | Parameter::TBody => {
            let near = [interval.low, interval.high].into_iter().flatten();
            let near = near.min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
            let deviation = (1.0 / near - 1.0 / estimate).abs() / HALF_WIDTH;
            (1.0 / truth - 1.0 / estimate, deviation)
        }
        _ => {
            let width = interval.high? - interval.low?;
            (estimate - truth, 0.5 * width / HALF_WIDTH)
        }
    };
    (deviation > 0.0).then(|| error / deviation)
}

/// Sums over recordings of one kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingTally {
    /// Number of recordings.
    pub cases: usize,
    /// Refused recordings, by the kind of the verdict.
    pub refused: BTreeMap<String, usize>,
    /// Recordings for which another structure than the true one was identified: true and identified structure.
    pub confused: BTreeMap<(&'static str, String), usize>,
    /// Parameters by their keys.
    pub parameters: BTreeMap<String, ParameterTally>,
}

/// Sums over the estimates of one parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ParameterTally {
    count: usize,
    held: usize,
    scaled: usize,
    sum: f64,
    squares: f64,
}

/// Errors beyond this many standard deviations count as this many, so that one case does not determine a mean.
const MOST_DEVIATIONS: f64 = 10.0;

impl ParameterTally {
    /// Share of the intervals that hold the true value. `None` without a case.
    #[must_use]
    pub fn coverage(&self) -> Option<f64> {
        (self.count > 0).then(|| self.held as f64 / self.count as f64)
    }

    /// Mean error in standard deviations.
    #[must_use]
    pub fn bias(&self) -> Option<f64> {
        (self.scaled > 0).then(|| self.sum / self.scaled as f64)
    }

    /// Root mean square error in standard deviations.
    #[must_use]
    pub fn rms(&self) -> Option<f64> {
        (self.scaled > 0).then(|| (self.squares / self.scaled as f64).sqrt())
    }

    fn add(&mut self, outcome: &ParameterOutcome) {
        self.count += 1;
        self.held += usize::from(outcome.held);
        if let Some(error) = outcome.error {
            let error = error.clamp(-MOST_DEVIATIONS, MOST_DEVIATIONS);
            self.scaled += 1;
            self.sum += error;
            self.squares += error * error;
        }
    }
}

impl RecordingTally {
    /// Adds the outcome of a recording of a process of structure `truth`.
    pub fn add(&mut self, truth: Structure, outcome: &RecordingOutcome) {
        self.cases += 1;
        match outcome {
            RecordingOutcome::Refused(kind) => {
                *self.refused.entry(kind.clone()).or_default() += 1;
            }
            RecordingOutcome::Identified {
                structure,
                parameters,
            } => {
                if structure != truth.name() {
                    let pair = (truth.name(), structure.clone());
                    *self.confused.entry(pair).or_default() += 1;
                }
                for (key, outcome) in parameters {
                    self.parameters.entry(key.clone()).or_default().add(outcome);
                }
            }
        }
    }

    /// Number of recordings that were refused.
    #[must_use]
    pub fn refusals(&self) -> usize {
        self.refused.values().sum()
    }

    /// Number of recordings that were identified with the true structure.
    #[must_use]
    pub fn true_structures(&self) -> usize {
        self.cases - self.refusals() - self.confused.values().sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // A deviation of 0.1 makes a 90 % interval of +-0.1645. An estimate 0.2 above the truth is 2 deviations off. T_body of
    // 2 s with a low end of 1 s: 1/T_body is 0.5 with a deviation of 0.5 / 1.645 = 0.304 (1/s), and the truth without damping
    // lies 0.5 below, at -1.645 deviations of 1/T_body.
    #[test]
    fn errors_in_standard_deviations() {
        let interval = |estimate, low, high| Interval {
            estimate,
            low,
            high,
        };
        let tau = interval(Some(1.2), Some(1.2 - 0.164_485_4), Some(1.2 + 0.164_485_4));
        let found = error(Parameter::Tau, &tau, 1.0).unwrap();
        assert!((found - 2.0).abs() < 1e-12, "{found}");
        let body = interval(Some(2.0), Some(1.0), None);
        let found = error(Parameter::TBody, &body, f64::INFINITY).unwrap();
        assert!((found + HALF_WIDTH).abs() < 1e-12, "{found}");
        let exact = interval(Some(1.0), Some(1.0), Some(1.0));
        assert_eq!(error(Parameter::Tau, &exact, 1.0), None);
    }

    // Errors of 1 and -2 deviations, one held: coverage 1/2, bias -1/2, rms sqrt(5/2).
    #[test]
    fn a_tally_by_hand() {
        let outcome = |held, error| RecordingOutcome::Identified {
            structure: "soptd".to_owned(),
            parameters: BTreeMap::from([(
                "tau_s".to_owned(),
                ParameterOutcome {
                    held,
                    error: Some(error),
                },
            )]),
        };
        let mut tally = RecordingTally::default();
        tally.add(Structure::Soptd, &outcome(true, 1.0));
        tally.add(Structure::Foptd, &outcome(false, -2.0));
        let refused = RecordingOutcome::Refused("no_information".to_owned());
        tally.add(Structure::Foptd, &refused);
        let counts = (tally.cases, tally.refusals(), tally.true_structures());
        assert_eq!(counts, (3, 1, 1));
        assert_eq!(tally.confused[&("foptd", "soptd".to_owned())], 1);
        let tau = tally.parameters["tau_s"];
        assert_eq!((tau.coverage(), tau.bias()), (Some(0.5), Some(-0.5)));
        assert!((tau.rms().unwrap() - 2.5_f64.sqrt()).abs() < 1e-15);
    }
}
