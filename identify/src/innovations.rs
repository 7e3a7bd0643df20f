//! Identification from any recording, by an exact likelihood with disturbances.
//!
//! The process is one of several structures; the output carries white noise, and disturbances act on the process or on
//! the measurement. All of the recording is used, transients included; the initial state is unknown.
//!
//! ```text
//! 1. put the samples on their grid; mark lost, stale and far samples      prepare, outliers
//! 2. find the simplest structure that explains the record                 choose, search
//! 3. fit it to finer rows; mark samples it cannot predict, fit again      refine
//!    add drag, friction and thrust, if the record asks for them           forces
//! 4. average the posterior over the intensity of the noise                mixture, laplace
//! 5. test the innovations, predict the last third from the first two      validate
//! 6. refuse what the record does not tell                                 judge
//! 7. draw from the posterior, design the controller                       design
//! ```
//!
//! The likelihood itself is in `likelihood`, on the matrices of `lifted` and the response of `response`. Method: L. Ljung,
//! "System Identification" (1999), section 7.4, with unknown initial state (P. de Jong, Biometrika 75 (1988)).

mod check;
mod choose;
#[cfg(test)]
mod dense;
mod descent;
mod filter;
mod forces;
mod laplace;
mod lifted;
mod likelihood;
mod mixture;
mod normal;
mod orthogonal;
mod outliers;
mod plan;
mod prediction;
mod prepare;
mod record;
mod response;
mod result;
mod search;
#[cfg(test)]
mod starts;
mod theta;
mod validate;
#[cfg(test)]
mod vectors;

use std::ops::Range;

use onecycle_design::{Model, Proposal, Structure, step_response};

pub(crate) use self::check::check;
use self::choose::{Choice, Limits, NEARLY, choose};
use self::mixture::{Component, mixture};
pub use self::plan::expected;
use self::prepare::{FEWEST, Prepared, prepare};
pub use self::record::Hold;
use self::record::{Blocks, Record};
use self::search::Candidate;
use self::theta::{Bounds, NoiseKind, Theta};
use crate::assumed::RecordedLoop;
use crate::excitation::{Excitation, Recorded};
use crate::outcome::{Evidence, Fit, Identification, Identified, InnovationTests, Prediction};
use crate::posterior::Interval;
use crate::remark::Remark;
use crate::remarks;
use crate::settings::Options;
use crate::signals::Signals;
use crate::verdict::Verdict;

/// Longest dead time as a share of the record.
const LONGEST_TAU: f64 = 1.0 / 8.0;
/// Time at the start whose outputs are left out while the dead time is not known, as a share of the record. Most records
/// begin with the input at rest, and some with all their excitation.
const SKIPPED: f64 = 1.0 / 40.0;
/// Rows of the final fit, unless a row would be longer than the dead time with the shortest lag, or with the time in which
/// the disturbance outgrows the noise.
const ROWS: usize = 1200;
/// Most rows of the final fit: they take a few seconds.
const MOST_ROWS: usize = 40_000;
/// Most samples of the part that chooses the structure.
const CHOOSING: usize = 20_000;
/// Samples between the outputs of a second difference that shows how much such a part moves: several periods of what moves
/// it, and less of its noise than between neighbours.
const CURVED: usize = CHOOSING / 100;
/// Rounds of outliers.
const ROUNDS: usize = 3;
/// Difference of the log-likelihood above which the input is taken as straight lines between the samples.
const STRAIGHT: f64 = 3.0;
/// Relative standard deviation of the gain above which the record tells nothing.
const MOST_DEVIATION: f64 = 0.3;
/// Share of the input's power in the informative band below which a fit rests on rounding errors, as that of a sine does
/// which has nothing to do with the output. A relay has 0.1 % beyond its 140th harmonic.
const LEAST_POWER: f64 = 1e-5;
/// Half width of the interval of the gain over the estimate above which the record tells nothing.
const MOST_WIDTH: f64 = 0.5;
/// Autocorrelation and share of the input above which the innovations are coloured.
const COLOURED: (f64, f64) = (0.1, 0.02);
/// Autocorrelation of the innovations above which an error of the prediction is the model's fault.
const STRONGLY_COLOURED: f64 = 0.3;
/// Share of the input and its F statistic above which the model is of another kind, if it also predicts little.
const ANOTHER_KIND: (f64, f64) = (0.2, 3.0);
/// Explained share of the last third below which a fit gets a remark, and below which it is refused.
const WELL_PREDICTED: f64 = 0.9;
const LEAST_PREDICTED: f64 = 0.7;
/// Mean square of the prediction's error over what the disturbances explain, above which a weak prediction gets a remark,
/// and above which the model is at fault.
const EXPECTED_ERROR_RATIO: f64 = 2.0;
const MOST_ERROR_RATIO: f64 = 4.0;

/// Identifies the process from a record of any input.
pub(crate) fn identify(signals: &Signals<'_>, options: &Options) -> Identification {
    let mut search = Search {
        options,
        excitation: None,
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
        outcome,
        remarks: search.remarks,
    }
}

/// A fit and all that the result needs of it.
struct Fitted {
    /// Samples that chose the structure.
    part: Range<usize>,
    choice: Choice,
    record: Record,
    limits: Limits,
    /// Samples a row.
    samples: usize,
    best: Candidate,
    /// Fit of the structure that contains the best one and has its damping as a further unknown. The posterior is that
    /// of this structure: damping that a record does not show may be there.
    wider: Candidate,
    outliers: usize,
}

struct Search<'a> {
    options: &'a Options,
    excitation: Option<Recorded>,
    remarks: Vec<Remark>,
}

impl Search<'_> {
    /// The main loop: steps 1 to 7 of the [module](self).
    fn run(&mut self, signals: &Signals<'_>) -> Result<Identified, Verdict> {
        self.options
            .specification
            .check()
            .map_err(Verdict::NoController)?;
        let mut prepared = prepare(signals, self.options)?;
        let outliers = outliers::mark_far(&mut prepared.record);
        self.excitation = Some(describe(&prepared, outliers));
        if prepared.part_used < 0.999 {
            self.remarks.push(Remark::PartUsed(prepared.part_used));
        }
        let fitted = self.fit(&prepared, outliers)?;
        let blocks = fitted.blocks();
        let components = fitted.posterior(&blocks);
        let tests = validate::tests(&blocks, &fitted.best.found.at);
        let informative = validate::informative(&blocks, &fitted.best.found.theta);
        let horizon_s = validate::period_s(&blocks).unwrap_or(blocks.length_s() / 10.0);
        let theta = &fitted.best.found.theta;
        let prediction = validate::prediction(
            &fitted.record,
            theta,
            &fitted.limits,
            fitted.samples,
            horizon_s,
        );
        if let Some(excitation) = &mut self.excitation {
            excitation.outliers = fitted.outliers;
            excitation.samples_per_row = fitted.samples;
            excitation.hold = fitted.record.hold;
            excitation.informative_rad_per_s = informative;
        }
        let is_excited =
            informative.is_none_or(|band| validate::input_share(&blocks, band) > LEAST_POWER);
        if !is_excited {
            return Err(self.no_information(&fitted.best.found.theta, None));
        }
        self.judge(&fitted, &blocks, &components, &tests, prediction.as_ref())?;
        self.remark(&fitted, &tests, prediction.as_ref());
        let checked = (tests, prediction);
        self.design(&prepared, &fitted, &blocks, &components, checked)
    }

    /// Steps 2 and 3: the structure, and its fit to finer rows.
    fn fit(&mut self, prepared: &Prepared, outliers: usize) -> Result<Fitted, Verdict> {
        let mut record = prepared.record.clone();
        let length_s = record.time_s(record.len() - 1);
        let longest = LONGEST_TAU * length_s;
        let mut limits = Limits {
            skip_s: 0.0,
            longest_tau_s: longest,
            structure: self.options.structure,
        };
        let mut choices = Vec::new();
        for part in excited_parts(&record) {
            if let Some(choice) = self.choose_on(&mut record, part.clone()) {
                choices.push((part, choice));
            }
        }
        let (part, choice) = most_likely(choices, &record, longest).ok_or(Verdict::NoFit)?;
        let theta = choice.chosen().ok_or(Verdict::NoFit)?.found.theta;
        let (samples, skip_s) = rows_for(&record, &theta);
        limits.skip_s = skip_s;
        let (best, found) = refine(&mut record, &theta, &limits, samples).ok_or(Verdict::NoFit)?;
        let blocks = Blocks::new(&record, samples, limits.skip_s);
        let damped = choice
            .damped(best.structure())
            .map(|damped| damped.found.theta);
        let wider = damped.and_then(|theta| search::fit(&blocks, &theta, longest));
        let mut fitted = Fitted {
            part,
            choice,
            limits,
            samples,
            wider: wider.unwrap_or_else(|| best.clone()),
            best,
            outliers: outliers + found,
            record,
        };
        if let Some(remark) = fitted.add_forces() {
            self.remarks.push(remark);
        }
        Ok(fitted)
    }

    /// Step 2 on a part of a record, whose input is taken as straight lines from then on if that explains the part better.
    fn choose_on(&mut self, record: &mut Record, part: Range<usize>) -> Option<Choice> {
        let mut part = record.part(part);
        let length_s = part.time_s(part.len() - 1);
        let limits = Limits {
            skip_s: SKIPPED * length_s,
            longest_tau_s: LONGEST_TAU * length_s,
            structure: self.options.structure,
        };
        let mut choice = choose(&part, &limits);
        if record.hold == Hold::Held
            && let Some(gain) = straight(&part, &choice, &limits, self.options)
        {
            record.hold = Hold::Interpolated;
            part.hold = Hold::Interpolated;
            self.remarks.push(Remark::Interpolated(gain));
            choice = choose(&part, &limits);
        }
        choice.chosen().is_some().then_some(choice)
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
        let rows = fitted.best.found.at.residual.len();
        if rows < FEWEST / 2 {
            return Err(Verdict::TooFewRows {
                rows,
                needed: FEWEST / 2,
            });
        }
        if let Some(verdict) = self.too_little(fitted, blocks, components) {
            return Err(verdict);
        }
        let (explained, ratio) = prediction.map_or((1.0, 0.0), |prediction| {
            (prediction.explained, prediction.error_ratio)
        });
        let is_another = tests.input_share > ANOTHER_KIND.0 && tests.input_f > ANOTHER_KIND.1;
        if is_another && explained < WELL_PREDICTED {
            return Err(Verdict::InputLeft {
                share: tests.input_share,
            });
        }
        let is_wrong = explained < LEAST_PREDICTED || tests.autocorrelation > STRONGLY_COLOURED;
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

    /// Verdict if the record does not tell the gain, or if a bound of the search holds the fit.
    fn too_little(
        &self,
        fitted: &Fitted,
        blocks: &Blocks<'_>,
        components: &[Component],
    ) -> Option<Verdict> {
        let theta = &fitted.best.found.theta;
        let gain = |component: &Component| {
            let deviation = component.laplace.gain_deviation(&component.found.at);
            deviation / component.found.at.gain.abs()
        };
        let deviation = components.first().map(gain).filter(|v| v.is_finite());
        if deviation.is_none_or(|deviation| deviation > MOST_DEVIATION) {
            return Some(self.no_information(theta, deviation));
        }
        let bounds = Bounds::new(theta.structure, blocks, fitted.limits.longest_tau_s);
        result::at_bound(theta, &bounds).map(Verdict::AtBound)
    }

    /// The gain is not known; `deviation` is its relative uncertainty.
    fn no_information(&self, theta: &Theta, deviation: Option<f64>) -> Verdict {
        let found = self.excitation;
        let length_s = found.map_or(f64::INFINITY, |found| found.end_s - found.start_s);
        let lag_s = theta.shortest_lag_s().min(LONGEST_TAU * length_s);
        Verdict::NoInformation {
            parameter: result::gain_of(theta.structure),
            deviation,
            informative_rad_per_s: found.and_then(|found| found.informative_rad_per_s),
            needed_rad_per_s: 1.0 / (lag_s + theta.tau_s().max(0.0)),
        }
    }

    fn remark(
        &mut self,
        fitted: &Fitted,
        tests: &InnovationTests,
        prediction: Option<&Prediction>,
    ) {
        let present = fitted.record.present_outputs().count();
        let absent = 1.0 - present as f64 / fitted.record.len() as f64;
        if absent > 0.0 {
            self.remarks.push(Remark::Absent(absent));
        }
        if is_coloured(tests) {
            self.remarks.push(Remark::Coloured(tests.autocorrelation));
        }
        if tests.input_share > COLOURED.1 && tests.input_f > ANOTHER_KIND.1 {
            self.remarks.push(Remark::InputLeft(tests.input_share));
        }
        let is_weak = |found: &&Prediction| {
            found.explained < WELL_PREDICTED && found.error_ratio > EXPECTED_ERROR_RATIO
        };
        if let Some(prediction) = prediction.filter(is_weak) {
            self.remarks.push(Remark::WeakPrediction {
                explained: prediction.explained,
                horizon_s: prediction.horizon_s,
            });
        }
        let chosen = fitted.best.structure();
        let best = fitted
            .choice
            .candidates
            .first()
            .map_or(0.0, |best| best.bic);
        let others: Vec<Structure> = (fitted.choice.candidates.iter())
            .filter(|other| other.bic < best + NEARLY && other.structure() != chosen)
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
        let is_wider = is_coloured(&tests) || tests.input_share > COLOURED.1;
        let (posterior, widened) =
            result::posterior_of(&fitted.best.found, components, prepared.early_s, is_wider);
        let model = result::model(&fitted.best.found, prepared.early_s);
        let specification = recorded_loop(fitted).complete(&self.options.specification);
        let draws = posterior.models(specification.draws());
        let undamped = model.soiptd().map_or(model, Model::Soiptd);
        let design = match Proposal::new(&undamped, &draws, &specification).outcome {
            Ok(design) => Some(design),
            Err(error) => {
                self.remarks.push(Remark::NoController(error));
                None
            }
        };
        let phase_margin_rad = design.map(|design| posterior.phase_margin_rad(&design.controller));
        let is_unsafe = |margin: Interval| margin.low.is_none_or(|low| low <= 0.0);
        if phase_margin_rad.is_some_and(is_unsafe) || !posterior.keeps_stable(&undamped, &draws) {
            return Err(Verdict::TooUncertain);
        }
        let estimate = posterior.estimate();
        let gain = result::gain_of(model.structure());
        let width = (estimate.get(gain)).and_then(|interval| interval.relative_half_width());
        if width.is_none_or(|width| width > MOST_WIDTH) {
            return Err(self.no_information(&fitted.best.found.theta, width));
        }
        let explained = prediction.map_or(1.0, |prediction| prediction.explained);
        let (innovations, points) = result::innovations(
            fitted,
            blocks,
            prepared.start_s,
            (tests, prediction, widened),
        )
        .ok_or(Verdict::NoFit)?;
        Ok(Identified {
            joint_probability: posterior.joint_probability(&estimate),
            step: design
                .and_then(|design| step_response(&undamped, &design.controller).ok())
                .map(|step| step.metrics),
            model,
            estimate,
            posterior,
            specification,
            design,
            phase_margin_rad,
            fit: Fit {
                misfit: (1.0 - explained).max(0.0).sqrt(),
                points,
                evidence: Evidence::Innovations(innovations),
            },
        })
    }
}

impl Fitted {
    fn blocks(&self) -> Blocks<'_> {
        Blocks::new(&self.record, self.samples, self.limits.skip_s)
    }

    /// Adds the nonlinear forces that the record asks for, and fits again.
    fn add_forces(&mut self) -> Option<Remark> {
        let limits = &self.limits;
        let body = Structure::Soiptd;
        if limits.structure.is_some_and(|asked| asked != body) {
            return None;
        }
        let mut of_body = self.choice.candidates.iter();
        let start = of_body.find(|candidate| candidate.structure() == body)?;
        let longest_s = limits.longest_tau_s;
        let rows = (self.samples, limits.skip_s, longest_s);
        let part = self.record.part(self.part.clone());
        let is_whole = part.len() == self.record.len();
        let on_part = Blocks::new(&part, self.samples, limits.skip_s);
        let best = if is_whole {
            self.best.clone()
        } else {
            search::fit(&on_part, &self.best.found.theta, longest_s)?
        };
        let (asked, found) = forces::forces(&part, &best, &start.found.theta, rows)?;
        self.record.forces = asked.of(&self.record);
        let blocks = Blocks::new(&self.record, self.samples, limits.skip_s);
        self.best = if is_whole {
            found
        } else {
            search::fit(&blocks, &found.found.theta, longest_s)?
        };
        self.wider = self.best.clone();
        let found = result::nonlinear(&self.best.found, &self.record.forces);
        Some(Remark::Nonlinear(found))
    }

    /// Step 4: components of the posterior.
    fn posterior(&self, blocks: &Blocks<'_>) -> Vec<Component> {
        let structure = self.wider.structure();
        let bounds = Bounds::new(structure, blocks, self.limits.longest_tau_s);
        mixture(blocks, &self.wider.found, &bounds)
    }
}

/// Whether the innovations are coloured: the largest of twenty autocorrelations exceeds what chance explains. Of white
/// innovations it exceeds 3.5 standard deviations once in a hundred records.
fn is_coloured(tests: &InnovationTests) -> bool {
    tests.autocorrelation > COLOURED.0.max(3.5 / (tests.rows as f64).sqrt())
}

/// The parts of a long record that choose the structure: that with the largest changes of the input, and that with the
/// largest curvature of the output. The rows of a longer part would be longer than the lags. In a chirp the first part has
/// the highest frequencies, to which the process hardly answers.
fn excited_parts(record: &Record) -> Vec<Range<usize>> {
    if record.len() <= CHOOSING {
        return std::iter::once(0..record.len()).collect();
    }
    let of_input = |part: &Range<usize>| -> f64 {
        let pairs = record.input[part.clone()].windows(2);
        pairs.map(|pair| (pair[1] - pair[0]).powi(2)).sum()
    };
    // Second differences, since an output may drift at any rate.
    let of_output = |part: &Range<usize>| -> f64 {
        let triples = record.output[part.clone()].windows(2 * CURVED + 1);
        triples
            .map(|y| (y[0] - 2.0 * y[CURVED] + y[2 * CURVED]).powi(2))
            .sum()
    };
    let largest = |size: &dyn Fn(&Range<usize>) -> f64| {
        (0..=record.len() - CHOOSING)
            .step_by(CHOOSING / 2)
            .map(|start| start..start + CHOOSING)
            .max_by(|a, b| size(a).total_cmp(&size(b)))
    };
    let mut parts: Vec<Range<usize>> = largest(&of_input).into_iter().collect();
    parts.extend(largest(&of_output).filter(|part| !parts.contains(part)));
    parts
}

/// The choice that explains the whole record best.
fn most_likely(
    mut choices: Vec<(Range<usize>, Choice)>,
    record: &Record,
    longest_tau_s: f64,
) -> Option<(Range<usize>, Choice)> {
    if choices.len() == 1 {
        return choices.pop();
    }
    let thetas: Vec<Theta> = (choices.iter())
        .filter_map(|(_, choice)| Some(choice.chosen()?.found.theta))
        .collect();
    // Likelihoods of different rows do not compare.
    let rows = thetas.iter().map(|theta| rows_for(record, theta));
    let (samples, skip_s) = rows.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
    let blocks = Blocks::new(record, samples, skip_s);
    let bic = |theta: &Theta| {
        let found = search::fit(&blocks, theta, longest_tau_s);
        found.map_or(f64::INFINITY, |found| found.bic)
    };
    let bics: Vec<f64> = thetas.iter().map(bic).collect();
    let best = (0..bics.len()).min_by(|a, b| bics[*a].total_cmp(&bics[*b]))?;
    Some(choices.swap_remove(best))
}

/// Samples a row of the fit to a record, and the time at its start (s) whose output is not used.
fn rows_for(record: &Record, theta: &Theta) -> (usize, f64) {
    let length_s = record.time_s(record.len() - 1);
    let tau_s = theta.tau_s().max(0.0);
    let skip_s = (1.5 * tau_s + 2.0 * record.dt_s).min(LONGEST_TAU * length_s);
    let rows = record.len() - record.index_at(skip_s);
    let fastest_noise = NoiseKind::ALL.map(|kind| theta.noise(kind));
    let noise_s = 1.0 / fastest_noise.into_iter().fold(0.0, f64::max);
    let fast_s = theta.shortest_lag_s().min(noise_s).min(length_s) + tau_s;
    let samples = (rows / ROWS).min((fast_s / record.dt_s) as usize);
    (samples.max(rows.div_ceil(MOST_ROWS)).max(1), skip_s)
}

/// Fits to rows of `samples` samples, marks outliers and fits again. Returns the number of outliers too.
fn refine(
    record: &mut Record,
    theta: &Theta,
    limits: &Limits,
    samples: usize,
) -> Option<(Candidate, usize)> {
    let fit = |record: &Record, theta: &Theta| {
        let blocks = Blocks::new(record, samples, limits.skip_s);
        search::fit(&blocks, theta, limits.longest_tau_s)
    };
    let mut best = fit(record, theta)?;
    let mut outliers = 0;
    for _ in 0..ROUNDS {
        let found = outliers::mark_unlikely(record, &best.found.theta, limits.skip_s);
        if found == 0 {
            break;
        }
        outliers += found;
        best = fit(record, &best.found.theta)?;
    }
    Some((best, outliers))
}

/// Gain of the log-likelihood if the input runs straight from sample to sample, where that explains the record better.
/// `None` otherwise, and if the input is piecewise constant or the user has said what it does.
fn straight(record: &Record, choice: &Choice, limits: &Limits, options: &Options) -> Option<f64> {
    let held = record
        .input
        .windows(2)
        .filter(|pair| pair[0] == pair[1])
        .count();
    if options.hold.is_some() || 2 * held > record.len() {
        return None;
    }
    let lead = choice.candidates.first()?;
    let mut other = record.clone();
    other.hold = Hold::Interpolated;
    let blocks = Blocks::new(&other, choice.samples, limits.skip_s);
    // Half a sample lies between the two readings of the input.
    let mut theta = lead.found.theta;
    theta.values[theta.layout().tau()] += 0.5 * record.dt_s;
    let fitted = search::warm(&blocks, &theta, limits.longest_tau_s, search::FINE)?;
    let gain = fitted.at.log_likelihood - lead.found.at.log_likelihood;
    (gain > STRAIGHT).then_some(gain)
}

/// What the record of a fit says about the loop of a controller.
fn recorded_loop(fitted: &Fitted) -> RecordedLoop {
    let record = &fitted.record;
    let (low, high) = (record.input.iter())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (value.min(low), value.max(high))
        });
    RecordedLoop {
        sigma: fitted.best.found.at.variance.sqrt(),
        output_size: record.output_deviation(),
        input_amplitude: 0.5 * (high - low),
        sample_s: record.dt_s,
        hold: record.hold,
    }
}

/// What is known of a record before any fit.
fn describe(prepared: &Prepared, outliers: usize) -> Recorded {
    let record = &prepared.record;
    let deviation = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let squares = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>();
        (squares / values.len() as f64).sqrt()
    };
    let outputs: Vec<f64> = record.present_outputs().collect();
    let present = outputs.len();
    Recorded {
        start_s: prepared.start_s,
        end_s: prepared.start_s + record.time_s(record.len() - 1),
        sample_s: record.dt_s,
        samples: present,
        absent: record.len() - present - outliers,
        outliers,
        samples_per_row: 1,
        hold: record.hold,
        input_deviation: deviation(&record.input),
        output_deviation: deviation(&outputs),
        informative_rad_per_s: None,
    }
}
