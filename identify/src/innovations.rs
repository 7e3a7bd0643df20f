//! Identification from any recording, by an exact likelihood with disturbances.
//!
//! The process is one of several structures; the output carries white noise, and disturbances act on the process or on
//! the measurement. All of the recording is used, transients included; the initial state is unknown.
//!
//! ```text
//! 1. put the samples on their grid; mark lost, stale and far samples      prepare, stale, outliers
//! 2. find the simplest structure that explains the record         chosen, choose, search
//! 3. fit it to finer rows; mark samples it cannot predict, fit again      refine
//!    add drag, friction and thrust, if the record asks for them           forces
//! 4. average the posterior over the intensity of the noise                mixture, laplace
//! 5. test the innovations, predict the last third from the first two      validate
//! 6. refuse what the record does not tell                                 judge
//! 7. draw from the posterior, design the controller                       design
//!    judge its loop with the response that the past input shows           flexible
//! ```
//!
//! The likelihood itself is in `likelihood`, on the matrices of `lifted` and the response of `response`. Method: L. Ljung,
//! "System Identification" (1999), section 7.4, with unknown initial state (P. de Jong, Biometrika 75 (1988)).

mod arx;
mod before_fit;
mod choose;
mod chosen;
#[cfg(test)]
mod dense;
mod descent;
mod draws;
mod filter;
mod fitted;
mod flexible;
mod forces;
mod laplace;
mod lifted;
mod likelihood;
mod mixture;
mod near_lags;
mod normal;
mod orthogonal;
mod outliers;
mod output_error;
mod plan;
mod prediction;
mod prepare;
mod record;
mod response;
mod result;
mod search;
mod spectrum;
mod stale;
#[cfg(test)]
mod starts;
mod system;
mod theta;
mod tries;
mod unfilter;
mod unstable;
mod validate;
#[cfg(test)]
mod vectors;

use onecycle_design::{Design, Parameter, Structure};

use self::before_fit::describe;
pub(crate) use self::before_fit::{input_follows, recorded};
use self::choose::NEARLY;
use self::fitted::{Disturbances, Fitted};
use self::mixture::Component;
pub(crate) use self::orthogonal::{Orthogonal, dot};
pub use self::plan::expected;
use self::prepare::{FEWEST, FLOOR, Prepared, prepare};
pub use self::record::Hold;
use self::record::{Blocks, Record};
pub(crate) use self::result::gain_of;
use self::search::Candidate;
use self::theta::{Bounds, Theta};
pub(crate) use self::tries::identify;
pub(crate) use self::validate::is_left_to_the_input;
use crate::assumed::recorded_filter;
use crate::conclusion::conclude;
use crate::excitation::{Excitation, Recorded};
use crate::outcome::{Identification, Identified, InnovationTests, Prediction, Refused};
use crate::posterior::{Draw, Posterior};
use crate::progress::part;
use crate::remark::Remark;
use crate::remarks;
use crate::settings::Options;
use crate::signals::Signals;
use crate::thresholds::{
    ANOTHER_KIND, BEYOND_DOUBT, EXPECTED_ERROR_RATIO, LEAST_POWER, LEAST_PREDICTED, MOST_DEVIATION,
    MOST_ERROR_RATIO, MOST_TAKEN, STRONGLY_COLOURED, WELL_PREDICTED,
};
use crate::verdict::Verdict;

/// Longest dead time as a share of the record.
const LONGEST_TAU: f64 = 1.0 / 8.0;
/// Rows of the final fit, unless a row would be longer than the dead time with the shortest lag, or with the time in which
/// the disturbance outgrows the noise.
pub(crate) const ROWS: usize = 1200;

/// Shares of the time after the fit and after its tests, without the controller: of hover, flight and heater recordings.
const FITTED: f64 = 0.8;
const TESTED: f64 = 0.85;

/// Identifies the process, where samples are believed to this share of the movement of the output, with a dead time up to this (s).
fn identify_to(
    believed: f64,
    longest_tau_s: f64,
    signals: &Signals<'_>,
    options: &Options,
) -> Identification {
    let mut search = Search {
        options,
        believed,
        longest_tau_s,
        excitation: None,
        refused: None,
        remarks: vec![],
    };
    let outcome = search.run(signals);
    if let Ok(identified) = &outcome {
        let period_s = (search
            .excitation
            .and_then(|found| found.informative_rad_per_s))
        .map_or(f64::INFINITY, |(_, high)| std::f64::consts::TAU / high);
        remarks::of_model(identified, period_s, &mut search.remarks);
        remarks::of_controller(identified, &mut search.remarks);
    }
    Identification {
        excitation: search.excitation.map(Excitation::Recorded),
        refused: search.refused.filter(|_| outcome.is_err()),
        outcome,
        steady: None,
        switching: None,
        amplitudes: None,
        remarks: search.remarks,
    }
}

struct Search<'a> {
    options: &'a Options,
    /// Share of the movement of the output to which a sample is believed.
    believed: f64,
    /// Longest dead time to look for (s).
    longest_tau_s: f64,
    excitation: Option<Recorded>,
    refused: Option<Refused>,
    remarks: Vec<Remark>,
}

impl Search<'_> {
    /// The main loop: steps 1 to 7 of the [module](self).
    fn run(&mut self, signals: &Signals<'_>) -> Result<Identified, Verdict> {
        self.options
            .specification
            .check()
            .map_err(Verdict::NoController)?;
        let mut prepared = prepare(signals, self.options, self.believed)?;
        prepared.longest_tau_s = prepared.longest_tau_s.min(self.longest_tau_s);
        let outliers = outliers::mark_far(&mut prepared.record);
        self.excitation = Some(describe(&prepared, outliers));
        if let Some(filter) = prepared.filter {
            let delay_s = filter.time_s();
            self.remarks.push(Remark::OutputFilter { delay_s });
        }
        if self.options.assumes_rest(&prepared.record.input) {
            self.remarks.push(Remark::AssumedRest);
        }
        if prepared.part_used < 0.999 {
            self.remarks.push(Remark::PartUsed(prepared.part_used));
        }
        let fitted = part(0.0..FITTED, || match self.options.is_unstable {
            true => Fitted::unstable(&prepared, outliers, self.options, &mut self.remarks),
            false => Fitted::new(&prepared, outliers, self.options, &mut self.remarks),
        })?;
        let blocks = fitted.blocks();
        let components = part(FITTED..TESTED, || fitted.posterior(&blocks));
        let tests = validate::tests(&blocks, &fitted.best.found.at);
        let informative = spectrum::informative(&blocks, &fitted.best.found);
        let prediction = fitted.prediction;
        if let Some(excitation) = &mut self.excitation {
            excitation.outliers = fitted.outliers;
            excitation.samples_per_row = fitted.samples;
            excitation.hold = fitted.record.hold;
            excitation.informative_rad_per_s = informative.map(|found| found.band_rad_per_s);
            excitation.excited_rad_per_s = informative.map(|found| found.highest_rad_per_s);
        }
        let judged = self.judge(&fitted, &blocks, &components, &tests, prediction.as_ref());
        let outcome = judged.and_then(|()| {
            self.remark(&fitted, &blocks, &tests, prediction.as_ref());
            let checked = (tests, prediction);
            self.design(&prepared, &fitted, &blocks, &components, checked)
        });
        if outcome.is_err() {
            let fit = result::fit(&fitted, &blocks, prepared.start_s, (tests, prediction, 1.0));
            let model = result::model(&fitted.best.found, prepared.early_s);
            self.refused = fit.map(|fit| Refused { model, fit });
        }
        outcome
    }

    /// Step 6: reasons to refuse.
    fn judge(
        &self,
        fitted: &Fitted,
        blocks: &Blocks<'_>,
        components: &[Component],
        tests: &InnovationTests,
        prediction: Option<&Prediction>,
    ) -> Result<(), Verdict> {
        let informative = (self.excitation).and_then(|found| found.informative_rad_per_s);
        if informative.is_some_and(|band| spectrum::input_share(blocks, band) <= LEAST_POWER) {
            return Err(self.no_information(&fitted.best.found.theta, None));
        }
        // A few sines fit a few others. Steps are many, however few show over a lag.
        let unknowns = fitted.best.found.theta.free().len() + 1;
        let is_smooth =
            fitted.disturbances != Disturbances::Kept || !blocks.record.keeps_its_input();
        if is_smooth && spectrum::order_of_excitation(blocks, LEAST_POWER) < unknowns {
            return Err(self.no_information(&fitted.best.found.theta, None));
        }
        let rows = fitted.best.found.at.rows();
        if rows < FEWEST / 2 {
            return Err(Verdict::TooFewRows {
                rows,
                needed: FEWEST / 2,
            });
        }
        if let Some(verdict) = self.too_little(fitted, blocks, components) {
            return Err(verdict);
        }
        if validate::is_of_controller(blocks, &fitted.best.found.theta) {
            return Err(Verdict::OfController);
        }
        if self.options.input_late_s.is_none()
            && let Some(share) = validate::leads(blocks, &fitted.best.found.at)
        {
            return Err(Verdict::OutputLeads { share });
        }
        let (explained, ratio) = prediction.map_or((1.0, 0.0), |prediction| {
            (prediction.explained, prediction.error_ratio)
        });
        self.judge_stability(fitted, blocks, tests, explained)?;
        let is_another = tests.input_share > ANOTHER_KIND.0 && tests.input_f > ANOTHER_KIND.1;
        let is_left = is_left_to_the_input(tests) && explained < 0.0;
        if is_left || is_another && explained < WELL_PREDICTED {
            return Err(Verdict::InputLeft {
                share: tests.input_share,
            });
        }
        // Without disturbances all errors are coloured.
        let is_coloured = tests.autocorrelation > STRONGLY_COLOURED;
        let is_wrong = explained
            < match (is_coloured, fitted.disturbances) {
                (true, Disturbances::Kept) => BEYOND_DOUBT,
                (true, _) => WELL_PREDICTED,
                (false, _) => LEAST_PREDICTED,
            };
        match prediction {
            Some(prediction) if is_wrong && ratio > MOST_ERROR_RATIO => {
                Err(Verdict::NoPrediction {
                    explained,
                    horizon_s: prediction.horizon_s,
                })
            }
            _ => Ok(()),
        }
    }

    /// Refuses a process that is unstable without its controller: a reason why it is hardly predicted, or not explained by its input,
    /// or why the pole of the fit is on its boundary. A random walk may take what grows, and leaves clean innovations. What is
    /// predicted is refused for what it shows by itself only, and so is a structure that the user states: an unstable pole may
    /// explain what they lack.
    fn judge_stability(
        &self,
        fitted: &Fitted,
        blocks: &Blocks<'_>,
        tests: &InnovationTests,
        explained: f64,
    ) -> Result<(), Verdict> {
        let theta = &fitted.best.found.theta;
        let is_doubted = explained < WELL_PREDICTED
            || is_left_to_the_input(tests)
            || unstable::is_at_edge(theta, blocks);
        if theta.grows || !is_doubted || !validate::is_fed_back(blocks) {
            return Ok(());
        }
        let longest_tau_s = fitted.limits.longest_tau_s;
        let is_open = explained < LEAST_PREDICTED && self.options.structure.is_none();
        let better = || unstable::explains_better(&fitted.record, theta, longest_tau_s);
        let growth_per_s = unstable::growth_per_s(blocks, theta.tau_s());
        match growth_per_s.or_else(|| is_open.then(better).flatten()) {
            Some(growth_per_s) => Err(Verdict::UnstableProcess { growth_per_s }),
            None => Ok(()),
        }
    }

    /// Verdict if the record does not tell the gain, or if a bound of the search holds the fit.
    fn too_little(
        &self,
        fitted: &Fitted,
        blocks: &Blocks<'_>,
        components: &[Component],
    ) -> Option<Verdict> {
        let theta = &fitted.best.found.theta;
        let gain = |component: &Component| component.laplace.gain_deviation(&component.found);
        let deviation = components.first().map(gain).filter(|v| v.is_finite());
        // A process that comes to rest has another gain, which the draws tell.
        let is_told = deviation.is_some_and(|deviation| {
            deviation <= MOST_DEVIATION || gain_of(theta.structure) != Parameter::K
        });
        if !is_told {
            return Some(self.no_information(theta, deviation));
        }
        let bounds = Bounds::new(theta, blocks, fitted.limits.longest_tau_s);
        match result::at_bound(theta, &bounds)? {
            // A resonance without damping explains an oscillation that the input does not drive.
            Parameter::Zeta => Some(self.no_information(theta, None)),
            parameter => Some(Verdict::AtBound(parameter)),
        }
    }

    /// Time (s) by which the input may have changed before the sample that shows it. Zero for an input that moves all the time,
    /// and where the user has said that it is held.
    fn late_s(&self, record: &Record) -> f64 {
        let is_known = self.options.hold.is_some() || record.hold == Hold::Interpolated;
        match is_known || !record.keeps_its_input() {
            true => 0.0,
            false => record.dt_s,
        }
    }

    /// The gain is not known; `deviation` is its relative uncertainty.
    fn no_information(&self, theta: &Theta, deviation: Option<f64>) -> Verdict {
        let found = self.excitation;
        let length_s = found.map_or(f64::INFINITY, |found| found.end_s - found.start_s);
        let lag_s = theta.shortest_lag_s().min(LONGEST_TAU * length_s);
        Verdict::NoInformation {
            parameter: gain_of(theta.structure),
            deviation,
            informative_rad_per_s: found.and_then(|found| found.informative_rad_per_s),
            needed_rad_per_s: 1.0 / (lag_s + theta.tau_s().max(0.0)),
        }
    }

    fn remark(
        &mut self,
        fitted: &Fitted,
        blocks: &Blocks<'_>,
        tests: &InnovationTests,
        prediction: Option<&Prediction>,
    ) {
        let present = fitted.record.present_outputs().count();
        let absent = 1.0 - present as f64 / fitted.record.len() as f64;
        if absent > 0.0 {
            self.remarks.push(Remark::Absent(absent));
        }
        // One reason for one fault: without disturbances all of them are left, and what the input explains is not white.
        let fault = if is_left_to_the_input(tests) {
            Some(Remark::InputLeft(tests.input_share))
        } else if validate::is_coloured(tests) {
            Some(Remark::Coloured(tests.autocorrelation))
        } else {
            None
        };
        (self.remarks).extend(fault.filter(|_| fitted.disturbances != Disturbances::Doubted));
        // Worse than the mean is no prediction, whatever the disturbances: under feedback alone the input answers to those that are
        // still to come, and less of them is left in the output than in the prediction.
        let is_weak = |found: &&Prediction| match found.is_as_good_as_disturbances_allow() {
            true => found.explained < 0.0 && !validate::is_fed_back(blocks),
            false => !found.is_good(),
        };
        if let Some(prediction) = prediction.filter(is_weak) {
            self.remarks.push(Remark::WeakPrediction {
                explained: prediction.explained,
                horizon_s: prediction.horizon_s,
            });
        }
        let chosen = fitted.best.structure();
        let others: Vec<Structure> = (fitted.choice.within(NEARLY))
            .filter(|other| other.structure() != chosen)
            .map(Candidate::structure)
            .collect();
        // The fits of the others lack the nonlinear forces.
        let is_linear = fitted.record.forces.len() == 0;
        if !others.is_empty() && self.options.structure.is_none() && is_linear {
            self.remarks.push(Remark::OtherStructures(others));
        }
    }

    /// Step 7: posterior, controller, and the result.
    fn design(
        &mut self,
        prepared: &Prepared,
        fitted: &Fitted,
        blocks: &Blocks<'_>,
        components: &[Component],
        (tests, prediction): (InnovationTests, Option<Prediction>),
    ) -> Result<Identified, Verdict> {
        // An error of the prediction that the noise does not explain is one of the model.
        let ratio = prediction.map_or(1.0, |found| found.error_ratio.max(1.0));
        let is_wider = validate::is_coloured(&tests)
            || is_left_to_the_input(&tests)
            || ratio > EXPECTED_ERROR_RATIO;
        let (posterior, widened) = draws::posterior_of(
            &fitted.best.found,
            components,
            draws::Stamps {
                sample_s: fitted.record.dt_s,
                early_s: prepared.early_s,
                late_s: self.late_s(&fitted.record),
                rest: fitted.record.rest.map_or(0.0, |rest| rest.input),
            },
            is_wider.then_some(ratio.sqrt()),
        );
        let model = result::model(&fitted.best.found, prepared.early_s);
        let is_assumed = self.options.assumes_rest(&fitted.record.input);
        if is_assumed && !begins_at_rest(model.structure(), &posterior, fitted.record.dt_s) {
            return Err(Verdict::ConstantInput);
        }
        let excited = self.excitation.and_then(|found| found.excited_rad_per_s);
        let filter = recorded_filter(prepared.filter, &model);
        let recorded = fitted.recorded_loop(excited, prepared.rounding, filter);
        let specification = recorded.complete(&self.options.specification);
        let checked = (tests, prediction, widened);
        let mut remarks = std::mem::take(&mut self.remarks);
        let found = conclude(
            (model, posterior),
            specification,
            &mut remarks,
            |width| self.no_information(&fitted.best.found.theta, width),
            || result::fit(fitted, blocks, prepared.start_s, checked),
        );
        self.remarks = remarks;
        // What the model lacks counts by what it does to the loop, whatever the fit took for noise.
        let is_doubted = is_left_to_the_input(&tests) || self.believed > FLOOR;
        let is_risky = |design: Design| {
            let record = Record {
                floor: fitted.record.floor * FLOOR / self.believed,
                ..fitted.record.clone()
            };
            let span_s = fitted.best.found.theta.span_s();
            flexible::distance_taken(&record, span_s, &model, &design.controller) > MOST_TAKEN
        };
        match found {
            Ok(found) if is_doubted && found.design.is_some_and(is_risky) => {
                Err(Verdict::InputLeft {
                    share: tests.input_share,
                })
            }
            other => other,
        }
    }
}

/// Whether a prediction is good, and as good as the disturbances allow.
pub(crate) fn is_as_expected(prediction: &Prediction) -> bool {
    prediction.is_good() && prediction.is_as_good_as_disturbances_allow()
}

/// Whether the response to a step before the first row begins as one from rest: in 95 % of the likely processes behind a dead time and
/// shorter lags of more than a sample. A single exponential can begin anywhere, as after a step long ago.
fn begins_at_rest(structure: Structure, posterior: &Posterior, sample_s: f64) -> bool {
    let late_s = |draw: &Draw| {
        let of = |parameter| draw.value(parameter).unwrap_or(0.0);
        let of_pair = |rad_per_s| 2.0 * of(Parameter::Zeta) / rad_per_s;
        let shorter = [Parameter::Tau, Parameter::TProp, Parameter::TProp2].map(of);
        let pair_s = draw.value(Parameter::NaturalFrequency).map_or(0.0, of_pair);
        shorter.iter().sum::<f64>() + pair_s
    };
    let draws = posterior.draws();
    let late = draws.iter().filter(|draw| late_s(draw) > sample_s).count();
    structure.stages().integrators == 0 && late as f64 > 0.95 * draws.len() as f64
}
