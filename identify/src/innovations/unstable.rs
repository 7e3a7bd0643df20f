//! Is the process unstable without its controller, and which one is it?
//!
//! Under feedback a stable structure can fit the record of an unstable process. The prediction of the output from past outputs and
//! inputs shows the pole, whatever the controller is: a root beyond one is not noise's doing. Where the user says that the process
//! is unstable, the structures with one pole and up to one lag are fitted with an unstable pole, from starts about that root.

use std::f64::consts::TAU;
use std::ops::Range;

use onecycle_design::Structure;

use super::arx::Arx;
use super::choose::{Choice, HOPELESS, Limits};
use super::chosen::rows_for;
use super::record::{Blocks, Record};
use super::search::{self, Candidate};
use super::theta::{Bounds, NoiseKind, Theta};
use super::{LONGEST_TAU, spectrum};
use crate::thresholds::SURE;

/// Past outputs of the prediction: two poles, and four for the noise of the sensor and the walk of a disturbance.
const OUTPUTS: usize = 6;
/// Largest ratio of the rates of two halves: coloured noise moves the root outwards by other amounts.
const ALIKE: f64 = 1.5;

/// Growth over a row (powers of e) of the rows in which the root is looked for: in shorter ones noise hides it.
const OVER_A_ROW: f64 = 0.2;
/// Fewest of these rows.
const FEWEST: usize = 300;
/// Starts of the pole, in rates of the growth.
const POLES: [f64; 3] = [0.7, 1.0, 2.0];
/// Starts of lag and dead time, in times of the growth.
const LAGS: [f64; 3] = [0.03, 0.2, 1.0];
const DEAD_TIMES: [f64; 4] = [0.0, 0.03, 0.1, 0.3];
/// What acts on the process keeps its filter stable; a walk of the output would take the place of that.
const NOISES: [NoiseKind; 2] = [NoiseKind::RandomWalk, NoiseKind::WhiteForce];
/// Starts of their frequency, in rates of the growth.
const FREQUENCIES: [f64; 3] = [0.3, 1.0, 5.0];

/// Rate (1/s) at which the output grows without the controller. `None` unless both halves of the record show the same.
///
/// The prediction knows the inputs of the dead time: past outputs would tell what the controller has done since.
pub(super) fn growth_per_s(blocks: &Blocks<'_>, tau_s: f64) -> Option<f64> {
    let half = blocks.len() / 2;
    let past = OUTPUTS + 1 + (tau_s / blocks.block_s()) as usize;
    let growth_in = |part: Range<usize>| {
        let root = Arx::<OUTPUTS>::of(blocks, part, past)?.root_above_one(SURE)?;
        Some(root.ln() / blocks.block_s())
    };
    let (early, late) = (growth_in(0..half)?, growth_in(half..blocks.len())?);
    let is_same = early < ALIKE * late && late < ALIKE * early;
    is_same.then(|| (early * late).sqrt())
}

/// The fits with an unstable pole, and the limits of their search. `None` of uneven samples, whose feedback is sampled in between,
/// and where all hardly grow over the record.
pub(super) fn choose(record: &Record, structure: Option<Structure>) -> Option<(Limits, Choice)> {
    if !record.uneven_s.is_empty() {
        return None;
    }
    let growth_per_s = likely_growth_per_s(record)?;
    let mut fast = Theta::new(Structure::Foptd);
    fast.values[0] = -growth_per_s / OVER_A_ROW;
    let (samples, skip_s) = rows_for(record, &fast);
    let longest_tau_s = LONGEST_TAU * record.time_s(record.len() - 1);
    let limits = Limits {
        skip_s,
        longest_tau_s: longest_tau_s.min(1.0 / growth_per_s),
        slowest_s: f64::INFINITY,
        period_s: f64::INFINITY,
        structure,
        fewest_samples: samples,
    };
    let blocks = Blocks::new(record, samples, skip_s);
    let found: Vec<Candidate> = [Structure::Foptd, Structure::Soptd]
        .into_iter()
        .filter(|of| structure.is_none_or(|asked| asked == *of))
        .filter_map(|of| fit(&blocks, of, growth_per_s, limits.longest_tau_s))
        .filter(|found| !is_at_edge(&found.found.theta, &blocks))
        .collect();
    (!found.is_empty()).then(|| (limits, Choice::of(found, samples)))
}

/// Whether the pole is on a boundary: as slow as it may be, or faster than a sample.
pub(super) fn is_at_edge(theta: &Theta, blocks: &Blocks<'_>) -> bool {
    let bounds = Bounds::new(theta, blocks, theta.tau_s());
    let pole = theta.layout().pole();
    pole.is_some_and(|pole| bounds.is_at_edge(theta, pole))
}

/// Rate (1/s) of a process whose unstable pole explains the record better than a stable fit does, on the rows of the former, and by
/// more than any further noise makes up for.
pub(super) fn explains_better(record: &Record, stable: &Theta, longest_tau_s: f64) -> Option<f64> {
    let (limits, choice) = choose(record, None)?;
    let blocks = Blocks::new(record, choice.samples, limits.skip_s);
    let unstable = choice.chosen()?;
    let stable = search::fit(&blocks, stable, longest_tau_s)?;
    let is_better = unstable.bic + HOPELESS < stable.bic;
    is_better.then(|| -unstable.found.theta.process(1.0).pole_per_s())
}

/// Rate (1/s) at which the output may grow: of a root for sure above one, of any such root, or the frequency of the input.
fn likely_growth_per_s(record: &Record) -> Option<f64> {
    let lengths = (0..).map(|power| 1_usize << power);
    let rows: Vec<Blocks<'_>> = lengths
        .take_while(|samples| *samples == 1 || record.len() / samples >= FEWEST)
        .map(|samples| Blocks::new(record, samples, 0.0))
        .collect();
    let fits: Vec<(Arx<OUTPUTS>, f64)> = rows
        .iter()
        .filter_map(|blocks| {
            let fit = Arx::of(blocks, 0..blocks.len(), 2 * OUTPUTS)?;
            Some((fit, blocks.block_s()))
        })
        .collect();
    let of = |sure: f64| {
        let growths = fits.iter().filter_map(|(fit, block_s)| {
            let over_a_row = fit.root_above_one(sure)?.ln();
            Some((over_a_row / block_s, over_a_row))
        });
        let off = |over_a_row: f64| (over_a_row / OVER_A_ROW).ln().abs();
        let nearest = growths.min_by(|a, b| off(a.1).total_cmp(&off(b.1)));
        nearest.map(|(growth, _)| growth)
    };
    let of_input = || Some(TAU / spectrum::period_s(rows.first()?)?);
    of(SURE).or_else(|| of(0.0)).or_else(of_input)
}

/// The best fit of a structure.
fn fit(
    blocks: &Blocks<'_>,
    structure: Structure,
    growth_per_s: f64,
    longest_tau_s: f64,
) -> Option<Candidate> {
    let starts = processes(structure, growth_per_s).flat_map(|theta| {
        let of_kind =
            move |kind| FREQUENCIES.map(|times| theta.with_noise(kind, times * growth_per_s));
        NOISES.into_iter().flat_map(of_kind)
    });
    let starts = search::promising(blocks, starts.collect(), longest_tau_s);
    let best = search::best(search::race(blocks, &starts, None, longest_tau_s))?;
    // With the other noise beside its own.
    let theta = best.found.theta;
    let other = NOISES.into_iter().find(|kind| theta.noise(*kind) == 0.0);
    let both = other.map(|kind| theta.with_noise(kind, 0.1 * growth_per_s));
    let both = both.and_then(|theta| search::fit(blocks, &theta, longest_tau_s));
    search::best(both.into_iter().chain([best]))
}

/// Processes of a structure that grow at about this rate.
fn processes(structure: Structure, growth_per_s: f64) -> impl Iterator<Item = Theta> {
    let mut base = Theta::new(structure);
    base.grows = true;
    let lags = if base.layout().stages.lags > 0 {
        &LAGS[..]
    } else {
        &[1.0]
    };
    let with = move |lag: f64, pole: f64, dead_time: f64| {
        let (mut theta, layout) = (base, base.layout());
        if layout.stages.lags > 0 {
            theta.values[0] = (lag / growth_per_s).ln();
        }
        if let Some(index) = layout.pole() {
            theta.values[index] = -pole * growth_per_s;
        }
        theta.values[layout.tau()] = dead_time / growth_per_s;
        theta
    };
    lags.iter().flat_map(move |lag| {
        let with_lag = move |pole| DEAD_TIMES.map(|dead_time| with(*lag, pole, dead_time));
        POLES.into_iter().flat_map(with_lag)
    })
}
