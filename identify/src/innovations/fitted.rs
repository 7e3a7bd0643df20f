//! A record with its fit to finer rows: step 3 of the [module](super), after the choice of the structure.

use std::ops::Range;

use onecycle_design::{LowPass, Structure};

use super::choose::{Choice, Limits, NEARLY};
use super::chosen::{choose_on_parts, choose_start, rows_for, straight};
use super::mixture::{self, Component};
use super::prepare::Prepared;
use super::record::{Blocks, Hold, Record};
use super::search::{self, Candidate};
use super::theta::{Bounds, Theta};
use super::{forces, outliers, output_error, spectrum, unstable, validate};
use crate::assumed::RecordedLoop;
use crate::outcome::Prediction;
use crate::progress;
use crate::remark::Remark;
use crate::settings::Options;
use crate::signals::range;
use crate::thresholds::{LEAST_PREDICTED, MOST_ERROR_RATIO, WELL_PREDICTED};
use crate::verdict::Verdict;

/// Rounds of outliers.
const ROUNDS: usize = 3;
/// Rows that are tried where the innovations of shorter rows are coloured, in lengths of these.
const LONGER: [usize; 8] = [2, 3, 4, 6, 8, 12, 16, 24];
/// Longest of them, as a share of the shortest period of the input.
const LONGEST_ROW: f64 = 1.0 / 6.0;
/// Fewest of them.
const FEWEST_LONG_ROWS: usize = 300;

/// Share of the time after the choice of the structure.
const CHOSEN: f64 = 0.9;

/// What the disturbances are worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Disturbances {
    /// They are part of the best fit, or it needs none.
    Kept,
    /// They wrongly take what the input explains: the best fit is one without. The posterior has both.
    Doubted,
    /// The same, and the innovations refute the fit with disturbances: the posterior has the other alone.
    Refuted,
}

/// A fit and all that the result needs of it.
pub(super) struct Fitted {
    /// Samples that chose the structure.
    pub(super) part: Range<usize>,
    pub(super) choice: Choice,
    pub(super) record: Record,
    pub(super) limits: Limits,
    /// Samples a row.
    pub(super) samples: usize,
    pub(super) best: Candidate,
    /// Fit of the structure that contains the best one and has its damping as a further unknown. The posterior is that
    /// of this structure: damping that a record does not show may be there.
    pub(super) wider: Candidate,
    pub(super) disturbances: Disturbances,
    /// Prediction of the last third of the record by the best fit.
    pub(super) prediction: Option<Prediction>,
    pub(super) outliers: usize,
}

impl Fitted {
    /// Steps 2 and 3 of the [module](super): the structure, and its fit to finer rows.
    pub(super) fn new(
        prepared: &Prepared,
        outliers: usize,
        options: &Options,
        remarks: &mut Vec<Remark>,
    ) -> Result<Self, Verdict> {
        let mut record = prepared.record.clone();
        let limits = Limits {
            skip_s: 0.0,
            longest_tau_s: prepared.longest_tau_s,
            slowest_s: f64::INFINITY,
            period_s: f64::INFINITY,
            structure: options.structure,
            fewest_samples: 1,
        };
        let choice = progress::part(0.0..CHOSEN, || {
            choose_start(&mut record, &limits, options, remarks)
        });
        let (part, choice) = choice.ok_or(Verdict::NoFit)?;
        let fit = |choice: Choice| {
            let mut own = vec![];
            let start = (part.clone(), choice);
            Self::of_choice(record.clone(), start, limits, options, &mut own)
                .map(|fitted| (fitted, own))
        };
        let (mut fitted, mut own) = fit(choice.clone())?;
        if options.structure.is_none() {
            let without = choice.without_pairs();
            if fitted.has_no_resonance() && without.chosen().is_some() {
                (fitted, own) = fit(without)?;
            }
            // Of structures that explain the record nearly as well, the one that predicts.
            if !fitted.predicts_well() && !fitted.is_fed_back(options) {
                let others = choice.others_than(fitted.best.structure());
                let fits = others.filter_map(|other| fit(other).ok());
                let explained = |of: &Self| of.prediction.map_or(0.0, |found| found.explained);
                let better = fits.filter(|(other, _)| explained(other) >= WELL_PREDICTED);
                (fitted, own) = better
                    .max_by(|(a, _), (b, _)| explained(a).total_cmp(&explained(b)))
                    .unwrap_or((fitted, own));
            }
        }
        remarks.append(&mut own);
        fitted.outliers += outliers;
        Ok(fitted)
    }

    /// Step 3: the fit of the structure that is chosen to finer rows.
    fn of_choice(
        mut record: Record,
        (mut part, mut choice): (Range<usize>, Choice),
        mut limits: Limits,
        options: &Options,
        remarks: &mut Vec<Remark>,
    ) -> Result<Self, Verdict> {
        let theta = choice.chosen().ok_or(Verdict::NoFit)?.found.theta;
        let (mut samples, skip_s) = rows_for(&record, &theta);
        limits.skip_s = skip_s;
        let fit = refine(&mut record, &theta, &limits, samples);
        let (mut best, mut found) = fit.ok_or(Verdict::NoFit)?;
        if let Some(longer) = whiter(&record, &best, &limits, samples) {
            limits.fewest_samples = longer;
            let again = match longer > choice.samples {
                true => choose_on_parts(&mut record, &limits, options, &choice.thetas(), remarks),
                false => Some((part.clone(), choice.clone())),
            };
            let fit = again.and_then(|(part, choice)| {
                let theta = choice.chosen()?.found.theta;
                Some((part, choice, refine(&mut record, &theta, &limits, longer)?))
            });
            if let Some((of, with, (fit, more))) = fit {
                (part, choice, best) = (of, with, fit);
                samples = longer;
                found += more;
            }
        }
        let blocks = Blocks::new(&record, samples, limits.skip_s);
        // Not one that explains less: its limit is the best fit, so it is in another basin.
        let wider = (choice.wider(best.structure()))
            .and_then(|wider| search::fit(&blocks, &wider.found.theta, limits.longest_tau_s))
            .filter(|wider| wider.log_likelihood() > best.log_likelihood() - NEARLY);
        let mut fitted = Self {
            part,
            choice,
            limits,
            samples,
            wider: wider.unwrap_or_else(|| best.clone()),
            best,
            disturbances: Disturbances::Kept,
            prediction: None,
            outliers: found,
            record,
        };
        if let Some(remark) = fitted.add_forces() {
            remarks.push(remark);
        }
        let without = output_error::instead(
            &fitted.blocks(),
            &fitted.best,
            (options.is_fed_back, limits.longest_tau_s),
        );
        if let Some((found, is_refuted)) = without {
            fitted.replace_by(found, is_refuted);
        }
        if fitted.disturbances == Disturbances::Doubted {
            remarks.push(Remark::DriftOrGain);
        }
        if fitted.disturbances == Disturbances::Kept {
            fitted.prediction = fitted.prediction_by(&fitted.best.found.theta);
        }
        Ok(fitted)
    }

    /// Steps 2 and 3 for a process that is known to be unstable without its controller.
    pub(super) fn unstable(
        prepared: &Prepared,
        outliers: usize,
        options: &Options,
        remarks: &mut Vec<Remark>,
    ) -> Result<Self, Verdict> {
        let mut record = Record {
            // It is not at rest anywhere.
            rest: None,
            ..prepared.record.clone()
        };
        let chosen = |record: &Record| {
            let found = unstable::choose(record, options.structure);
            found.ok_or(Verdict::NothingGrows)
        };
        let (mut limits, mut choice) = chosen(&record)?;
        if record.hold == Hold::Held
            && let Some(gain) = straight(&record, &choice, &limits, options)
        {
            record.hold = Hold::Interpolated;
            remarks.push(Remark::Interpolated(gain));
            (limits, choice) = chosen(&record)?;
        }
        let samples = choice.samples;
        let theta = choice.chosen().ok_or(Verdict::NoFit)?.found.theta;
        let fit = refine(&mut record, &theta, &limits, samples);
        let (best, found) = fit.ok_or(Verdict::NoFit)?;
        let mut fitted = Self {
            part: 0..record.len(),
            choice,
            limits,
            samples,
            wider: best.clone(),
            best,
            disturbances: Disturbances::Kept,
            prediction: None,
            outliers: outliers + found,
            record,
        };
        fitted.prediction = fitted.prediction_by(&fitted.best.found.theta);
        Ok(fitted)
    }

    fn predicts_well(&self) -> bool {
        self.prediction.is_none_or(|found| found.is_good())
    }

    fn is_fed_back(&self, options: &Options) -> bool {
        options.is_fed_back || validate::is_fed_back(&self.blocks())
    }

    /// Whether the second-order stage, if there is one, is faster than the samples show, which is dead time or a lag, or holds a lag that
    /// is longer than the record, which has no gain at rest but a first slope.
    fn has_no_resonance(&self) -> bool {
        let theta = &self.best.found.theta;
        let blocks = self.blocks();
        let bounds = Bounds::new(theta, &blocks, self.limits.longest_tau_s);
        let [c1, c0] = theta.process(1.0).pair();
        let is_real = c1 * c1 > 4.0 * c0;
        let is_slow = is_real && c0 * blocks.length_s() < c1;
        theta.structure.stages().pairs > 0 && (is_slow || bounds.has_fastest_pair(theta))
    }

    pub(super) fn blocks(&self) -> Blocks<'_> {
        Blocks::new(&self.record, self.samples, self.limits.skip_s)
    }

    /// Takes a fit without disturbances in the place of the best one, unless it does not predict the last third of the record.
    fn replace_by(&mut self, found: Candidate, is_refuted: bool) {
        let prediction = self.prediction_by(&found.found.theta);
        let fails = |found: Prediction| {
            found.explained < LEAST_PREDICTED && found.error_ratio > MOST_ERROR_RATIO
        };
        if prediction.is_some_and(fails) {
            return;
        }
        self.best = found;
        self.prediction = prediction;
        self.disturbances = match is_refuted {
            true => Disturbances::Refuted,
            false => Disturbances::Doubted,
        };
    }

    fn prediction_by(&self, theta: &Theta) -> Option<Prediction> {
        let blocks = self.blocks();
        let horizon_s = spectrum::period_s(&blocks).unwrap_or(blocks.length_s() / 10.0);
        // An unstable process is not predicted beyond the time in which it grows.
        let horizon_s = match theta.grows {
            true => horizon_s.min(-1.0 / theta.process(1.0).pole_per_s()),
            false => horizon_s,
        };
        validate::prediction(&self.record, theta, &self.limits, self.samples, horizon_s)
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
        self.best = search::fit(&blocks, &found.found.theta, longest_s)?;
        self.wider = self.best.clone();
        let found = forces::nonlinear(&self.best.found, &self.record.forces);
        Some(Remark::Nonlinear(found))
    }

    /// Step 4: components of the posterior.
    pub(super) fn posterior(&self, blocks: &Blocks<'_>) -> Vec<Component> {
        let bounds = Bounds::new(&self.wider.found.theta, blocks, self.limits.longest_tau_s);
        let with = || mixture::mixture(blocks, &self.wider.found, &bounds);
        if self.disturbances == Disturbances::Kept {
            return with();
        }
        let found = &self.best.found;
        let bounds = Bounds::new(&found.theta, blocks, self.limits.longest_tau_s);
        let without = mixture::of_one(blocks, found, &bounds);
        if self.disturbances == Disturbances::Refuted {
            return without.into_iter().collect();
        }
        let both = without.into_iter().chain(with());
        both.map(|component| Component {
            weight: 0.5 * component.weight,
            ..component
        })
        .collect()
    }

    /// What the record says about the loop of a controller, with the known rounding and filter of its output.
    pub(super) fn recorded_loop(
        &self,
        excited_rad_per_s: Option<f64>,
        rounding: f64,
        filter: Option<LowPass>,
    ) -> RecordedLoop {
        let record = &self.record;
        let (low, high) = range(&record.input);
        RecordedLoop {
            // A controller sees the steps of a display.
            sigma: self.best.found.at.seen_deviation().max(rounding),
            output_size: record.output_deviation(),
            input_amplitude: 0.5 * (high - low),
            sample_s: record.dt_s,
            hold: record.hold,
            excited_rad_per_s,
            filter,
        }
    }
}

/// Samples a row that make the innovations white, where rows of `samples` samples leave them coloured: noise that passed a
/// filter, as that of a gyro, is coloured over a few samples and white over longer times. `None` if the innovations are
/// white already, or if no rows that are short beside the lags make them white.
fn whiter(record: &Record, best: &Candidate, limits: &Limits, samples: usize) -> Option<usize> {
    let tests = |samples: usize, theta: &Theta| {
        let blocks = Blocks::new(record, samples, limits.skip_s);
        let found = search::warm(&blocks, theta, limits.longest_tau_s, search::FINE)?;
        Some(validate::tests(&blocks, &found.at))
    };
    let theta = &best.found.theta;
    let blocks = Blocks::new(record, samples, limits.skip_s);
    if !validate::is_coloured(&validate::tests(&blocks, &best.found.at)) {
        return None;
    }
    let fast_s = theta.shortest_lag_s() + theta.tau_s().max(0.0);
    let longest_s = fast_s.min(LONGEST_ROW * spectrum::shortest_period_s(&blocks)?);
    let is_short = |count: &usize| {
        *count as f64 * record.dt_s < longest_s && record.len() / count >= FEWEST_LONG_ROWS
    };
    LONGER
        .into_iter()
        .map(|factor| factor * samples)
        .take_while(is_short)
        .find(|count| {
            tests(*count, theta).is_some_and(|tests| {
                !validate::is_coloured(&tests) && !validate::is_left_to_the_input(&tests)
            })
        })
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
