//! Outcomes of a campaign of recordings: verdict or structure, errors and intervals of the parameters.

use std::collections::{BTreeMap, BTreeSet};

use onecycle_design::{Parameter, Structure};
use onecycle_identify::{
    Estimate, Hold, Identification, Identified, Interval, Options, Remark, Verdict, expected,
    identify,
};

use crate::experiments::recording::SimulatedRecording;
use crate::experiments::signals_of;
use crate::judge::promises::{PROMISES, Promise, promises};

/// Result of the likelihood on a recording, beside the truth.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordingOutcome {
    /// Refused, with the name of the reason.
    Refused(String),
    /// Identified.
    Identified {
        /// Kinds of the remarks.
        remarks: Vec<String>,
        /// Name of the structure.
        structure: String,
        /// Parameters that both the truth and the result have, by their keys.
        parameters: BTreeMap<String, ParameterOutcome>,
        /// The loop with the controller found, by the names of [`PROMISES`]. Empty without a controller.
        #[serde(default)]
        promises: BTreeMap<String, ParameterOutcome>,
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
    /// The same error over the standard deviation of the Cramer-Rao bound of the recording, at the true process and the
    /// true intensity of the noise. `None` if samples are missing.
    pub error_over_bound: Option<f64>,
}

/// Quantile of the normal distribution at 95 %: half width of a 90 % interval in standard deviations.
const HALF_WIDTH: f64 = 1.644_854;

/// Identifies a recording.
#[must_use]
pub fn recording_outcome(recording: &SimulatedRecording, options: &Options) -> RecordingOutcome {
    let signals = signals_of(&recording.trace, recording.sample_s);
    let Identification {
        outcome, remarks, ..
    } = identify(&signals, options);
    match outcome {
        Err(verdict) => RecordingOutcome::Refused(reason(&verdict).to_owned()),
        Ok(identified) => RecordingOutcome::Identified {
            remarks: remarks
                .iter()
                .map(Remark::kind)
                .map(str::to_owned)
                .collect(),
            structure: identified.model.structure().name().to_owned(),
            parameters: parameters(&identified.estimate, recording),
            promises: promised(&identified, recording),
        },
    }
}

/// Name of a verdict, one for each threshold of the likelihood.
fn reason(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::NoFit => "no_fit",
        Verdict::NoPrediction { .. } => "no_prediction",
        Verdict::InputLeft { .. } => "input_left",
        _ => verdict.kind(),
    }
}

fn parameters(
    estimate: &Estimate,
    recording: &SimulatedRecording,
) -> BTreeMap<String, ParameterOutcome> {
    let bound = bound(recording);
    let of = |(parameter, interval): (Parameter, Interval)| {
        let truth = match parameter {
            Parameter::InputBias => recording.input_bias,
            _ => recording.model.parameter(parameter)?,
        };
        let distance = distance(parameter, &interval, truth);
        let bound = bound.as_ref().and_then(|bound| bound.get(parameter));
        let over = |interval| Some(distance / deviation(parameter, &interval)?);
        let outcome = ParameterOutcome {
            held: interval.holds(truth),
            error: over(interval),
            error_over_bound: bound.and_then(over),
        };
        Some((parameter.key().to_owned(), outcome))
    };
    estimate.iter().filter_map(of).collect()
}

fn promised(
    identified: &Identified,
    recording: &SimulatedRecording,
) -> BTreeMap<String, ParameterOutcome> {
    let of = |(name, promise): (&str, Promise)| {
        let Promise { interval, truth } = promise;
        let error = interval.estimate.zip(half_width(&interval));
        let outcome = ParameterOutcome {
            held: interval.holds(truth),
            error: error
                .map(|(estimate, half)| (estimate - truth) / (half / HALF_WIDTH))
                .filter(|error| error.is_finite()),
            error_over_bound: None,
        };
        (name.to_owned(), outcome)
    };
    let found = promises(identified, &recording.model);
    let named = found.map(|found| PROMISES.into_iter().zip(found));
    named.into_iter().flatten().map(of).collect()
}

/// Intervals of an efficient estimator. `None` if samples are missing or a disturbance has no relative intensity.
fn bound(recording: &SimulatedRecording) -> Option<Estimate> {
    // What acts on the process: the bias too, since it does not cancel the mean of the commanded input otherwise.
    let commanded = recording.trace.input.iter();
    let input: Vec<f64> = commanded.map(|u| u + recording.input_bias).collect();
    let times = &recording.trace.time_s;
    let steps = (times.last()? - times.first()?) / recording.sample_s;
    let is_whole = steps.round() as usize + 1 == input.len();
    let noise = recording.noise.as_ref().filter(|_| is_whole)?;
    expected(
        &recording.model,
        noise,
        &input,
        recording.sample_s,
        Hold::Held,
    )
}

/// Without damping these are infinite, and their upper end often is: the other end and inverse values are not.
fn is_inverse(parameter: Parameter) -> bool {
    matches!(parameter, Parameter::K | Parameter::TBody)
}

/// Distance of an estimate from the truth.
fn distance(parameter: Parameter, interval: &Interval, truth: f64) -> f64 {
    let estimate = interval.estimate.unwrap_or(f64::INFINITY);
    if is_inverse(parameter) {
        1.0 / truth - 1.0 / estimate
    } else {
        estimate - truth
    }
}

/// Standard deviation of a posterior in the unit of [`distance`]. `None` if the interval has no width.
fn deviation(parameter: Parameter, interval: &Interval) -> Option<f64> {
    if !is_inverse(parameter) {
        return Some(half_width(interval)? / HALF_WIDTH);
    }
    let estimate = interval.estimate.unwrap_or(f64::INFINITY);
    let near = [interval.low, interval.high].into_iter().flatten();
    let near = near.min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    let half = (1.0 / near - 1.0 / estimate).abs();
    (half > 0.0).then_some(half / HALF_WIDTH)
}

/// Half the width of an interval. `None` if it has none, or no end.
fn half_width(interval: &Interval) -> Option<f64> {
    let half = 0.5 * (interval.high? - interval.low?);
    (half > 0.0).then_some(half)
}

/// Sums over recordings of one kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingTally {
    /// Number of recordings.
    pub cases: usize,
    /// Refused recordings, by the name of the reason.
    pub refused: BTreeMap<String, usize>,
    /// Recordings for which another structure than the true one was identified: true and identified structure.
    pub confused: BTreeMap<(&'static str, String), usize>,
    /// Identified recordings with a remark, by its kind.
    pub remarks: BTreeMap<String, usize>,
    /// Parameters by their keys, and the [`PROMISES`].
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
    bounded: usize,
    squares_over_bound: f64,
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

    /// Root mean square error over the Cramer-Rao bound.
    #[must_use]
    pub fn rms_over_bound(&self) -> Option<f64> {
        (self.bounded > 0).then(|| (self.squares_over_bound / self.bounded as f64).sqrt())
    }

    fn add(&mut self, outcome: &ParameterOutcome) {
        let clamped = |error: f64| error.clamp(-MOST_DEVIATIONS, MOST_DEVIATIONS);
        self.count += 1;
        self.held += usize::from(outcome.held);
        if let Some(error) = outcome.error.map(clamped) {
            self.scaled += 1;
            self.sum += error;
            self.squares += error * error;
        }
        if let Some(error) = outcome.error_over_bound.map(clamped) {
            self.bounded += 1;
            self.squares_over_bound += error * error;
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
                remarks,
                parameters,
                promises,
            } => {
                // One of each kind: a remark that names a parameter may stand there for several.
                for remark in remarks.iter().collect::<BTreeSet<_>>() {
                    *self.remarks.entry(remark.clone()).or_default() += 1;
                }
                if structure != truth.name() {
                    let pair = (truth.name(), structure.clone());
                    *self.confused.entry(pair).or_default() += 1;
                }
                for (key, outcome) in parameters.iter().chain(promises) {
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
        let error = |parameter, interval: &Interval, truth| {
            Some(distance(parameter, interval, truth) / deviation(parameter, interval)?)
        };
        let found = error(Parameter::Tau, &tau, 1.0).unwrap();
        assert!((found - 2.0).abs() < 1e-12, "{found}");
        let body = interval(Some(2.0), Some(1.0), None);
        let found = error(Parameter::TBody, &body, f64::INFINITY).unwrap();
        assert!((found + HALF_WIDTH).abs() < 1e-12, "{found}");
        let exact = interval(Some(1.0), Some(1.0), Some(1.0));
        assert_eq!(error(Parameter::Tau, &exact, 1.0), None);
    }

    // Errors of 1 and -2 deviations, one held: coverage 1/2, bias -1/2, rms sqrt(5/2). The bound is half as large, so the
    // rms over it is twice as large. A remark twice on a recording counts once.
    #[test]
    fn a_tally_by_hand() {
        let outcome = |held, error: f64| RecordingOutcome::Identified {
            structure: "soptd".to_owned(),
            remarks: vec!["weak_parameter".to_owned(); 2],
            parameters: BTreeMap::from([(
                "tau_s".to_owned(),
                ParameterOutcome {
                    held,
                    error: Some(error),
                    error_over_bound: Some(2.0 * error),
                },
            )]),
            promises: BTreeMap::new(),
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
        assert!((tau.rms_over_bound().unwrap() - 10.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!(tally.remarks["weak_parameter"], 2);
    }
}
