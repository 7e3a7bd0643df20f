//! Outcomes of a campaign of wrong data: refused, named, or accepted; and whether what was promised holds on the real plant.
//!
//! The real plant is closed with the controller that the identification proposes, as the firmware runs it, and steps the
//! reference. A promise is broken if
//!
//! - the loop is unstable: it diverges, or ends in a limit cycle;
//! - the phase margin on the real plant is below the low end of its interval by more than 3 degrees;
//! - the step of the paper's PD, which reaches the reference on a process with an integrator, ends more than 5 % away from
//!   it;
//! - a parameter lies outside its 90 % interval by more than half of the width of the interval, and by more than 1 % of its
//!   value.

use std::collections::BTreeMap;

use onecycle_design::soiptd_pd::margins::margins;
use onecycle_design::{Model, Parameter, Specification, Structure};
use onecycle_identify::{
    About, Identification, Identified, Interval, Options, Remark, Signals, identify,
};
use onecycle_onboard::Pd;

mod trial;

use self::trial::{LoopEnd, Trial};
use super::evaluate::Judge;
use crate::experiments::honesty::{FaultyRecording, TruePlant};

/// Result of one recording.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum HonestyOutcome {
    /// There is no recording: the output ran away during the test.
    NotRecorded,
    /// Refused, with the kind of the verdict.
    Refused(String),
    /// Accepted.
    Accepted(Accepted),
}

/// What was promised about a recording, and what broke.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Accepted {
    /// Kinds of the remarks.
    pub remarks: Vec<String>,
    /// Whether no remark is about the recording: those about the test or the controller are no reason to suspect it.
    pub is_silent: bool,
    /// Name of the structure.
    pub structure: String,
    /// Strength of the fault, where it has one.
    pub strength: Option<f64>,
    /// Low end of the interval of the phase margin (degrees).
    pub promised_margin_deg: Option<f64>,
    /// Phase margin on the real plant (degrees). `None` without a controller or a gain crossover.
    pub true_margin_deg: Option<f64>,
    /// Phase margin of the paper's PD, which promises 20 degrees, on the real plant (degrees). `None` where there is no such
    /// PD, and on a plant that is no integrator with two lags.
    pub paper_margin_deg: Option<f64>,
    /// Absolute deterioration of cost of the paper's PD. `None` where it is not judged, or unstable.
    #[serde(default)]
    pub deterioration: Option<f64>,
    /// Whether the 90 % intervals hold the true values, by the keys of the parameters. Empty where the plant has no
    /// parameters of the same meaning.
    #[serde(default)]
    pub held: BTreeMap<String, bool>,
    /// Promises that do not hold.
    pub broken: Vec<Broken>,
}

/// A promise that does not hold.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Broken {
    /// The loop with the real plant is unstable.
    Unstable {
        /// Amplitude of its limit cycle, over that of the relay oscillation. `None` if it diverges.
        limit_cycle: Option<f64>,
    },
    /// The phase margin is less than promised (degrees).
    Margin {
        /// Low end of the interval.
        promised_deg: f64,
        /// On the real plant.
        true_deg: f64,
    },
    /// The step of the paper's PD does not end at the reference.
    FinalValue {
        /// Where it ends, over the reference.
        truth: f64,
    },
    /// A parameter is not within its interval.
    Parameter {
        /// Key of the parameter.
        key: String,
        /// Low end of the interval, if it has one.
        low: Option<f64>,
        /// High end of the interval, if it has one.
        high: Option<f64>,
        /// True value.
        truth: f64,
    },
}

impl HonestyOutcome {
    /// What was accepted.
    #[must_use]
    pub fn accepted(&self) -> Option<&Accepted> {
        match self {
            Self::Accepted(accepted) => Some(accepted),
            _ => None,
        }
    }
}

impl Accepted {
    /// Whether the loop with the real plant is unstable.
    #[must_use]
    pub fn is_unstable(&self) -> bool {
        let is_unstable = |broken: &Broken| matches!(broken, Broken::Unstable { .. });
        self.broken.iter().any(is_unstable)
    }

    /// Whether one of the remarks is of these kinds.
    #[must_use]
    pub fn is_named(&self, kinds: &[String]) -> bool {
        self.remarks.iter().any(|remark| kinds.contains(remark))
    }
}

/// Degrees by which a margin may be below its interval.
const TOLERATED_DEG: f64 = 3.0;
/// Part of the reference by which a step may miss it.
const TOLERATED_END: f64 = 0.05;
/// Part of a parameter by which its interval may miss it.
const TOLERATED_PART: f64 = 0.01;

/// Identifies a recording as the defaults do, and tries the result on the real plant.
#[must_use]
pub fn honesty_outcome(recording: Option<&FaultyRecording>) -> HonestyOutcome {
    let Some(recording) = recording else {
        return HonestyOutcome::NotRecorded;
    };
    let columns = &recording.columns;
    let signals = Signals {
        time_s: &columns.time_s,
        input: &columns.input,
        output: &columns.output,
        samples_per_point: 1,
        sample_period_s: columns.sample_s,
        breaks: &[],
    };
    let Identification {
        outcome, remarks, ..
    } = identify(&signals, &Options::default());
    match outcome {
        Err(verdict) => HonestyOutcome::Refused(verdict.kind().to_owned()),
        Ok(identified) => HonestyOutcome::Accepted(judge(recording, &identified, &remarks)),
    }
}

fn judge(recording: &FaultyRecording, identified: &Identified, remarks: &[Remark]) -> Accepted {
    let truth = recording.truth.in_flight();
    let mut broken = vec![];
    if truth.has_parameters() {
        broken.extend(parameters(&truth, identified));
    }
    let paper = paper_pd(identified);
    broken.extend(paper.and_then(|pd| final_value(&truth, identified, pd.kp)));
    let judged =
        (paper.zip(Model::from(truth.process).soiptd())).filter(|_| truth.has_parameters());
    let paper_margin_deg = (judged.and_then(|(pd, process)| margins(&process, pd)))
        .map(|margins| margins.phase_margin_rad.to_degrees());
    let deterioration = judged
        .and_then(|(pd, process)| Some(Judge::new(&process).ok()?.deterioration(pd)))
        .and_then(|cost| cost.relative())
        .map(f64::abs);
    let margin = identified.phase_margin_rad;
    let promised_margin_deg = margin.and_then(|margin| Some(margin.low?.to_degrees()));
    let mut true_margin_deg = None;
    if let Some(design) = &identified.design {
        let trial = Trial {
            truth,
            controller: design.controller,
            crossover_rad_per_s: design.margins.gain_crossover_rad_per_s,
        };
        let end = trial.run(recording.columns.sample_s, recording.noise_sigma);
        let margin = trial.least_margin_rad().map(f64::to_degrees);
        true_margin_deg = margin.map(|margin| match end {
            LoopEnd::Settled => margin,
            _ => margin.min(-margin),
        });
        broken.extend(end.broken());
    }
    if let (Some(promised_deg), Some(true_deg)) = (promised_margin_deg, true_margin_deg)
        && true_deg < promised_deg - TOLERATED_DEG
    {
        broken.push(Broken::Margin {
            promised_deg,
            true_deg,
        });
    }
    let kinds = remarks.iter().map(Remark::kind);
    Accepted {
        remarks: kinds.map(str::to_owned).collect(),
        is_silent: !(remarks.iter()).any(|remark| remark.about() == About::Recording),
        structure: identified.model.structure().name().to_owned(),
        strength: recording.strength,
        promised_margin_deg,
        true_margin_deg,
        paper_margin_deg,
        deterioration,
        held: held(recording, identified),
        broken,
    }
}

/// Whether the intervals hold the true values.
fn held(recording: &FaultyRecording, identified: &Identified) -> BTreeMap<String, bool> {
    let truth = recording.truth.in_flight();
    let model = Model::from(truth.process);
    let is_comparable = is_comparable(model.structure(), identified.model.structure());
    let of = |(parameter, interval): (Parameter, Interval)| {
        let value = match parameter {
            Parameter::InputBias => recording.input_bias,
            _ => model.parameter(parameter)?,
        };
        Some((parameter.key().to_owned(), interval.holds(value)))
    };
    let judged = (identified.estimate.iter()).filter(|_| truth.has_parameters() && is_comparable);
    judged.filter_map(of).collect()
}

/// The paper's PD for an identified integrator with two lags.
fn paper_pd(identified: &Identified) -> Option<Pd> {
    (identified.model.structure() == Structure::Soiptd).then_some(())?;
    let proposal = identified.propose(&Specification::paper());
    proposal.outcome.ok()?.controller.pd()
}

/// The end of a step that was promised to reach the reference, on a process without an integrator.
fn final_value(truth: &TruePlant, identified: &Identified, kp: f64) -> Option<Broken> {
    let integrators = |structure: Structure| structure.stages().integrators;
    let is_promised = integrators(identified.model.structure()) > 0;
    if !is_promised || integrators(truth.process.structure()) > 0 {
        return None;
    }
    let gain = kp * truth.process.parameter(Parameter::K)?;
    let end = gain / (1.0 + gain);
    ((end - 1.0).abs() > TOLERATED_END).then_some(Broken::FinalValue { truth: end })
}

/// Parameters whose intervals miss the truth by too much.
fn parameters(truth: &TruePlant, identified: &Identified) -> Vec<Broken> {
    let model = Model::from(truth.process);
    if !is_comparable(model.structure(), identified.model.structure()) {
        return vec![];
    }
    let of = |(parameter, interval): (Parameter, Interval)| {
        // The inverse values of these go through zero.
        if matches!(parameter, Parameter::TBody | Parameter::InputBias)
            || parameter == Parameter::K && model.structure() == Structure::Soiptd
        {
            return None;
        }
        let value = model.parameter(parameter)?;
        let is_gain = matches!(parameter, Parameter::K | Parameter::KOverTBody);
        let last = if is_gain {
            value * truth.last_gain
        } else {
            value
        };
        let scale = match parameter {
            // A dead time of nearly nothing matters beside the lags only.
            Parameter::Tau => value + truth.process.lags_s().iter().sum::<f64>(),
            _ => value.abs(),
        };
        let misses = |value| misses(&interval, value, scale);
        (misses(value) && misses(last)).then(|| Broken::Parameter {
            key: parameter.key().to_owned(),
            low: interval.low,
            high: interval.high,
            truth: value,
        })
    };
    identified.estimate.iter().filter_map(of).collect()
}

/// Whether the parameters of a structure mean the same in another one: a lag of one structure is dead time in a simpler
/// one.
fn is_comparable(truth: Structure, found: Structure) -> bool {
    use Structure::{DoubleIntegratorLag, Soiptd};
    truth == found || matches!((truth, found), (Soiptd, DoubleIntegratorLag))
}

/// Whether a value lies outside an interval by more than half its width, and by more than a hundredth of `scale`.
fn misses(interval: &Interval, value: f64, scale: f64) -> bool {
    let below = interval.low.map_or(0.0, |low| low - value);
    let above = interval.high.map_or(0.0, |high| value - high);
    let half = match (interval.low, interval.high) {
        (Some(low), Some(high)) => 0.5 * (high - low),
        _ => 0.0,
    };
    below.max(above) > half.max(TOLERATED_PART * scale)
}

/// Counts over the recordings of one kind, or of several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct HonestyTally {
    /// Recordings.
    pub cases: usize,
    /// Refused.
    pub refused: usize,
    /// Accepted, with a remark that names the trouble.
    pub named: usize,
    /// Accepted with other remarks, and every promise holds.
    pub remarked_right: usize,
    /// Accepted with other remarks, and a promise is broken.
    pub remarked_wrong: usize,
    /// Accepted without a remark about the recording, and every promise holds.
    pub silent_right: usize,
    /// Accepted without a remark about the recording, and a promise is broken.
    pub silent_wrong: usize,
    /// Accepted, and the loop with the real plant is unstable.
    pub unstable: usize,
    /// Of these, those without a remark that names the trouble.
    pub unstable_unnamed: usize,
}

impl HonestyTally {
    /// Adds an outcome of a kind whose trouble the remarks `named_by` name. Tests that ran away leave no recording, so they do not count.
    pub fn add(&mut self, outcome: &HonestyOutcome, named_by: &[String]) {
        let accepted = match outcome {
            HonestyOutcome::NotRecorded => return,
            HonestyOutcome::Refused(_) => {
                self.cases += 1;
                self.refused += 1;
                return;
            }
            HonestyOutcome::Accepted(accepted) => accepted,
        };
        let is_named = accepted.is_named(named_by);
        let is_right = accepted.broken.is_empty();
        let count = match (is_named, accepted.is_silent, is_right) {
            (true, ..) => &mut self.named,
            (_, false, true) => &mut self.remarked_right,
            (_, false, false) => &mut self.remarked_wrong,
            (_, true, true) => &mut self.silent_right,
            (_, true, false) => &mut self.silent_wrong,
        };
        *count += 1;
        self.cases += 1;
        self.unstable += usize::from(accepted.is_unstable());
        self.unstable_unnamed += usize::from(accepted.is_unstable() && !is_named);
    }

    /// The sum of two.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            cases: self.cases + other.cases,
            refused: self.refused + other.refused,
            named: self.named + other.named,
            remarked_right: self.remarked_right + other.remarked_right,
            remarked_wrong: self.remarked_wrong + other.remarked_wrong,
            silent_right: self.silent_right + other.silent_right,
            silent_wrong: self.silent_wrong + other.silent_wrong,
            unstable: self.unstable + other.unstable,
            unstable_unnamed: self.unstable_unnamed + other.unstable_unnamed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // An interval of 0.9 to 1.1 has a half width of 0.1: it misses 1.21 and does not miss 1.19. One of 0.999 to 1.001 misses
    // 1.005 by more than its width, but not by a hundredth; it misses 1.02.
    #[test]
    fn an_interval_misses_by_more_than_half_its_width_and_a_hundredth() {
        let interval = |low, high| Interval {
            estimate: Some(1.0),
            low,
            high,
        };
        let wide = interval(Some(0.9), Some(1.1));
        let found = [1.0, 1.19, 1.21, 0.81, 0.79].map(|value| misses(&wide, value, value));
        assert_eq!(found, [false, false, true, false, true]);
        let narrow = interval(Some(0.999), Some(1.001));
        let found = [1.005, 1.02].map(|value| misses(&narrow, value, value));
        assert_eq!(found, [false, true]);
        let open = interval(Some(0.9), None);
        assert!(!misses(&open, 1e9, 1.0) && misses(&open, 0.5, 0.5));
    }
}
