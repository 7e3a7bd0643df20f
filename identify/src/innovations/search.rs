//! Search for the best process of a structure and the noise that goes with it.
//!
//! ```text
//! 1. screen a grid of processes and noises on coarse copies of the record, from the whole of it
//!    to a short part at full resolution                                          screen
//! 2. descend from the best starts of each kind of noise, on these copies         screen
//! 3. descend from the best of these on the record, for each set of noises        heads
//! 4. fit the other structures from the best of a structure that contains them    derive
//! ```

use onecycle_design::Structure;

use super::arx::Arx;
use super::descent::{Found, Patience, descend};
use super::likelihood::{Evaluation, Memory, evaluate};
use super::record::{Blocks, Forces, Record};
use super::theta::{Bounds, NoiseKind, Theta};

/// Structures that are screened. Every other structure is a limit of one of them, or adds one lag.
pub(super) const HEADS: [Structure; 3] =
    [Structure::Soiptd, Structure::Soptd, Structure::ResonantLag];

const COARSE: Patience = Patience {
    steps: 12,
    decrease: 1e-4,
};
pub(super) const FINE: Patience = Patience {
    steps: 40,
    decrease: 1e-7,
};
/// Of the fit that chooses: the last step gains less than 0.01 of the log-likelihood.
pub(super) const CHOOSING: Patience = Patience {
    steps: 40,
    decrease: 1e-5,
};
/// Distance in BIC from the best after a short descent beyond which a start is given up.
const BEHIND: f64 = 40.0;
/// Rows of a coarse copy.
const COARSE_BLOCKS: usize = 500;
/// Ratio of the lengths of the parts that are screened. The grid of a part covers lags over a ratio of 20 at five points, so
/// that neighbours overlap.
pub(super) const ZOOM: usize = 6;
/// Number of different starts for each kind of noise on a coarse copy, and of those that go on to the record.
const STARTS: usize = 4;
const RACED: usize = 2;
/// Frequencies of the noise that are screened, times the length of the record: the first one with every process of the grid,
/// the others with this many of the best processes.
const NOISES: [f64; 3] = [60.0, 8.0, 300.0];
const REFINED: usize = 12;
/// The longest lag of the grid: one over this, as a part of the record. A longer one is hardly told from an integrator's.
pub(super) const LAGS_IN_A_RECORD: f64 = 12.0;

/// Best point of a structure with a set of noises.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) found: Found,
    /// Bayesian information criterion: `-2 ln L + (number of unknowns, the gain included) ln N`.
    pub(super) bic: f64,
}

impl Candidate {
    pub(super) fn new(found: Found) -> Self {
        let unknowns = found.theta.free().len() + 1 + found.at.forces.len();
        let rows = found.at.rows() as f64;
        let bic = -2.0 * found.at.log_likelihood + unknowns as f64 * rows.ln();
        Self { found, bic }
    }

    pub(super) fn log_likelihood(&self) -> f64 {
        self.found.at.log_likelihood
    }

    pub(super) fn structure(&self) -> Structure {
        self.found.theta.structure
    }
}

/// The candidate of least BIC.
pub(super) fn best(candidates: impl IntoIterator<Item = Candidate>) -> Option<Candidate> {
    candidates
        .into_iter()
        .min_by(|a, b| a.bic.total_cmp(&b.bic))
}

/// Copy of a record in even steps of `samples` samples: means of input and output. The output of a step stands at its
/// middle, half a step after its stamp, so the dead time appears shorter by the second value (s).
pub(super) fn coarse(record: &Record, samples: usize) -> (Record, f64) {
    if samples <= 1 {
        return (record.clone(), 0.0);
    }
    // The period of an uneven record is that of the median: of the mean there are as many rows as the samples fill.
    let period_s = match record.uneven_s.last() {
        Some(last_s) => last_s / (record.len() - 1) as f64,
        None => record.dt_s,
    };
    let dt_s = period_s * samples as f64;
    let mut copy = Record {
        uneven_s: vec![],
        dt_s,
        input: vec![],
        output: vec![],
        present: vec![],
        hold: record.hold,
        rest: record.rest,
        forces: Forces::default(),
        floor: record.floor / (samples as f64).sqrt(),
    };
    let length_s = record.time_s(record.len() - 1) + period_s;
    let steps = (length_s / dt_s + 1e-9) as usize;
    let mut start = 0;
    for step in 1..=steps {
        let end = record.index_at(step as f64 * dt_s);
        let range = start..end;
        start = end;
        let outputs = record.output[range.clone()].iter();
        let present = outputs.zip(&record.present[range.clone()]);
        let present = present.filter(|(_, present)| **present).map(|(y, _)| *y);
        let output = mean(present);
        copy.present.push(output.is_some());
        copy.output.push(output.unwrap_or(0.0));
        // A step between two uneven samples keeps the input.
        let input = mean(record.input[range].iter().copied());
        copy.input
            .push(input.unwrap_or(record.input[end.max(1) - 1]));
    }
    (copy, 0.5 * (samples - 1) as f64 * period_s)
}

/// Mean of values. `None` of none.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0, 0.0), |(count, sum), value| (count + 1, sum + value));
    (count > 0).then(|| sum / f64::from(count))
}

/// Starts for a structure: those of the whole record, then of shorter and shorter parts at a finer and finer resolution. So
/// the lags that can be found do not depend on the length of the record.
pub(super) fn screen(
    record: &Record,
    structure: Structure,
    skip_s: f64,
    longest_tau_s: f64,
) -> Vec<Vec<Theta>> {
    let mut samples = coarse_samples(record, skip_s);
    let mut scales = vec![screen_at(
        record,
        structure,
        samples,
        (skip_s, longest_tau_s),
    )];
    while samples > 1 {
        samples = (samples / ZOOM).max(1);
        let length = (COARSE_BLOCKS * samples).min(record.len());
        let part = record.part(liveliest(record, length));
        let part_s = part.time_s(part.len() - 1);
        let limits = (skip_s.min(part_s / 40.0), longest_tau_s.min(part_s / 4.0));
        scales.push(screen_at(&part, structure, samples, limits));
    }
    scales
}

/// Structures to screen: all heads, or those that lead to the one asked for.
pub(super) fn heads(structure: Option<Structure>) -> Vec<Structure> {
    let Some(structure) = structure else {
        return HEADS.to_vec();
    };
    match structure {
        Structure::Resonant | Structure::ResonantLag => vec![Structure::ResonantLag],
        Structure::Foptd | Structure::Soptd | Structure::Toptd => vec![Structure::Soptd],
        Structure::IntegratorLag | Structure::Iptd => vec![Structure::Soptd, Structure::Soiptd],
        _ => vec![Structure::Soiptd],
    }
}

/// The best start of each structure on a coarse copy of the whole record, whose start is at rest.
pub(super) fn screen_whole(
    record: &Record,
    structure: Option<Structure>,
    longest_tau_s: f64,
) -> Vec<Theta> {
    let samples = coarse_samples(record, 0.0);
    (heads(structure).into_iter())
        .filter_map(|head| {
            let starts = screen_at(record, head, samples, (0.0, longest_tau_s));
            starts.first().copied()
        })
        .collect()
}

/// Samples a row of a coarse copy of the whole record.
fn coarse_samples(record: &Record, skip_s: f64) -> usize {
    ((record.len() - record.skipped(skip_s)) / COARSE_BLOCKS).max(1)
}

/// The part of `length` samples whose input changes most, relative to its own steps over a tenth of the part.
pub(super) fn liveliest(record: &Record, length: usize) -> std::ops::Range<usize> {
    let lag = (length / 10).max(1);
    let change = |start: usize| -> f64 {
        let input = &record.input[start..start + length];
        let pairs = input.iter().zip(&input[lag..]);
        pairs.map(|(a, b)| (b - a).powi(2)).sum()
    };
    let last = record.len() - length;
    let starts = (0..=last).step_by((length / 2).max(1));
    let best = starts.map(|start| (start, change(start)));
    let best = best.reduce(|a, b| if b.1 > a.1 { b } else { a });
    let start = best.map_or(0, |(start, _)| start);
    start..start + length
}

/// Starts for a structure: the best points of a coarse grid, after a few steps of descent on a copy of the record in steps of
/// `samples` samples.
fn screen_at(
    record: &Record,
    structure: Structure,
    samples: usize,
    (skip_s, longest_tau_s): (f64, f64),
) -> Vec<Theta> {
    let (copy, early_s) = coarse(record, samples);
    let blocks = Blocks::new(&copy, 1, skip_s);
    if blocks.len() < 30 {
        return vec![];
    }
    let bounds = Bounds::new(&Theta::new(structure), &blocks, longest_tau_s);
    let length = blocks.length_s();
    let with = |theta: Theta, kind, of: &'static [f64]| {
        of.iter()
            .map(move |over_length| theta.with_noise(kind, over_length / length))
    };
    let likely = |thetas: Vec<Theta>| ranked(&blocks, thetas, longest_tau_s, unlikely);
    let processes = grid(structure, &blocks, early_s, longest_tau_s);
    let of_process = |theta| {
        NoiseKind::ALL
            .into_iter()
            .flat_map(move |kind| with(theta, kind, &NOISES[..1]))
    };
    let mut screened = likely(processes.into_iter().flat_map(of_process).collect());
    // The frequency of the noise hardly changes which processes explain a record: the others for the best of them.
    let of_kind = |kind| {
        let own = screened
            .iter()
            .filter(move |(_, theta)| theta.noise(kind) > 0.0);
        own.take(REFINED)
            .flat_map(move |(_, theta)| with(*theta, kind, &NOISES[1..]))
    };
    let others = NoiseKind::ALL.into_iter().flat_map(of_kind).collect();
    screened.extend(likely(others));
    screened.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut starts = Vec::new();
    for kind in NoiseKind::ALL {
        let of_kind = screened.iter().filter(|(_, theta)| theta.noise(kind) > 0.0);
        let mut chosen: Vec<Theta> = Vec::new();
        for (_, theta) in of_kind {
            if chosen
                .iter()
                .all(|other| differ(theta, other, longest_tau_s))
            {
                chosen.push(*theta);
            }
            if chosen.len() == STARTS {
                break;
            }
        }
        let descended = chosen.iter().filter_map(|theta| {
            let free = theta.free();
            descend(&blocks, theta, &free, &bounds, COARSE)
        });
        starts.extend(descended);
    }
    starts.sort_by(|a, b| b.at.log_likelihood.total_cmp(&a.at.log_likelihood));
    starts
        .into_iter()
        .map(|found| {
            let mut theta = found.theta;
            theta.values[theta.layout().tau()] += early_s;
            theta
        })
        .collect()
}

/// Whether two starts are far enough apart to lead to different basins.
fn differ(a: &Theta, b: &Theta, longest_tau_s: f64) -> bool {
    let lags = 0..a.layout().stages.lags;
    let lag = lags
        .map(|i| (a.values[i] - b.values[i]).abs())
        .fold(0.0, f64::max);
    lag + 5.0 * (a.tau_s() - b.tau_s()).abs() / longest_tau_s > 0.9
}

/// Grid of processes: lags and poles from two steps to a twelfth of the record, dead times to 0.4 of the longest.
fn grid(structure: Structure, blocks: &Blocks<'_>, early_s: f64, longest_tau_s: f64) -> Vec<Theta> {
    let (dt, length) = (blocks.record.dt_s, blocks.length_s());
    let (shortest, longest) = (2.0 * dt, length / LAGS_IN_A_RECORD);
    let times: Vec<f64> = (0..5)
        .map(|i| shortest * (longest / shortest).powf(f64::from(i) / 4.0))
        .collect();
    let mut processes = Vec::new();
    let base = Theta::new(structure);
    let layout = base.layout();
    for &t_s in &times {
        let mut theta = base;
        if let Some(pair) = layout.pair() {
            theta.values[0] = dt.ln();
            for zeta in [0.1, 0.7] {
                theta.values[pair] = 2.0 * zeta / t_s;
                theta.values[pair + 1] = 1.0 / (t_s * t_s);
                processes.push(theta);
            }
            continue;
        }
        theta.values[0] = t_s.ln();
        let Some(pole) = layout.pole() else {
            processes.push(theta);
            continue;
        };
        let slow = times
            .iter()
            .filter(|slow| **slow > 1.5 * t_s)
            .map(|slow| 1.0 / slow);
        for a in slow.chain([0.3 / length]) {
            theta.values[pole] = a;
            processes.push(theta);
        }
    }
    processes.extend(predicted(base, blocks));
    let with_tau = |process: Theta| {
        [0.0, 0.05, 0.15, 0.4].map(|part| {
            let mut theta = process;
            theta.values[layout.tau()] = part * longest_tau_s - early_s;
            theta
        })
    };
    processes.into_iter().flat_map(with_tau).collect()
}

/// The process `base` with the poles of the prediction from past outputs: the resonance of a light damping lies between the
/// points of any grid.
fn predicted(base: Theta, blocks: &Blocks<'_>) -> Option<Theta> {
    let dt_s = blocks.block_s();
    // Two poles, and four inputs for a dead time of up to two blocks.
    let [c1, c0] = Arx::<2>::of(blocks, 0..blocks.len(), 4)?.pair(dt_s)?;
    let layout = base.layout();
    let mut theta = base;
    if let Some(pair) = layout.pair() {
        theta.values[0] = dt_s.ln();
        theta.values[pair] = c1;
        theta.values[pair + 1] = c0;
        return Some(theta);
    }
    let root = (0.25 * c1 * c1 - c0).sqrt();
    let pole = layout.pole().filter(|_| root >= 0.0)?;
    theta.values[0] = -(0.5 * c1 + root).ln();
    theta.values[pole] = 0.5 * c1 - root;
    Some(theta)
}

/// Descends on the record, and puts the lags in order.
pub(super) fn fit(blocks: &Blocks<'_>, start: &Theta, longest_tau_s: f64) -> Option<Candidate> {
    fit_within(blocks, start, longest_tau_s, FINE)
}

fn fit_within(
    blocks: &Blocks<'_>,
    start: &Theta,
    longest_tau_s: f64,
    patience: Patience,
) -> Option<Candidate> {
    let bounds = Bounds::new(start, blocks, longest_tau_s);
    let free = start.free();
    let down = |start: &Theta| {
        let found = descend(blocks, start, &free, &bounds, patience)?;
        match ordered(&found.theta) {
            Some(theta) => descend(blocks, &theta, &free, &bounds, patience),
            None => Some(found),
        }
    };
    let mut found = down(start)?;
    let other = hidden_in_the_dead_time(&found.theta, &bounds).and_then(|theta| down(&theta));
    if let Some(other) = other.filter(|it| it.at.log_likelihood > found.at.log_likelihood) {
        found = other;
    }
    // Without a lag the response has a kink where a delayed step of the input meets a sample, and a search may stop there.
    let tau = start.layout().tau();
    if start.layout().stages.lags + start.layout().stages.pairs == 0 {
        let others: Vec<usize> = free.iter().copied().filter(|index| *index != tau).collect();
        let along = descend(blocks, &found.theta, &others, &bounds, patience)?;
        found = descend(blocks, &along.theta, &free, &bounds, patience)?;
    }
    Some(Candidate::new(found))
}

/// A start for a process whose first lag lies on a bound: the lag in the place of the dead time. A descent that passes a gain of zero ends
/// in a basin of the other sign, with a lag as long as the record and half a period in the dead time; one whose lag vanishes leaves
/// it there too.
fn hidden_in_the_dead_time(theta: &Theta, bounds: &Bounds) -> Option<Theta> {
    let tau = theta.layout().tau();
    if theta.layout().stages.lags == 0 || !bounds.is_at_edge(theta, 0) || theta.values[tau] <= 0.0 {
        return None;
    }
    let mut other = *theta;
    other.values[0] = theta.values[tau].ln();
    other.values[tau] = 0.0;
    Some(bounds.clamp(&other))
}

/// The same process with the actuator lag shorter than the body's. `None` if it is in order.
fn ordered(theta: &Theta) -> Option<Theta> {
    let layout = theta.layout();
    let mut swapped = *theta;
    if layout.stages.lags == 2 && theta.values[1] > theta.values[0] {
        swapped.values.swap(0, 1);
    }
    if let (Some(pole), 1..) = (layout.pole(), layout.stages.lags) {
        let a = swapped.values[pole];
        if a > 0.0 && swapped.values[0] > -a.ln() {
            swapped.values[pole] = (-swapped.values[0]).exp();
            swapped.values[0] = -a.ln();
        }
    }
    if let (Some(pair), 1) = (layout.pair(), layout.stages.lags) {
        let (c1, c0) = (swapped.values[pair], swapped.values[pair + 1]);
        let root = (0.25 * c1 * c1 - c0).sqrt();
        let (fast, slow) = (0.5 * c1 + root, 0.5 * c1 - root);
        let lag_per_s = (-swapped.values[0]).exp();
        // The disturbance enters behind the lag, so the fastest of three real lags is the actuator's.
        if fast > lag_per_s {
            swapped.values[0] = -fast.ln();
            swapped.values[pair] = lag_per_s + slow;
            swapped.values[pair + 1] = lag_per_s * slow;
        }
    }
    (swapped != *theta).then_some(swapped)
}

/// Candidates from `starts`: a short descent from each, and a long one from those that are not far behind the best, or
/// behind `lead`.
pub(super) fn race(
    blocks: &Blocks<'_>,
    starts: &[Theta],
    lead: Option<&Candidate>,
    longest_tau_s: f64,
) -> Vec<Candidate> {
    let short = starts
        .iter()
        .filter_map(|theta| fit_within(blocks, theta, longest_tau_s, COARSE));
    let mut candidates: Vec<Candidate> = short.collect();
    let bics = candidates.iter().chain(lead).map(|candidate| candidate.bic);
    let limit = bics.fold(f64::INFINITY, f64::min) + BEHIND;
    for candidate in &mut candidates {
        if candidate.bic < limit {
            let theta = candidate.found.theta;
            if let Some(better) = fit_within(blocks, &theta, longest_tau_s, CHOOSING) {
                *candidate = better;
            }
        }
    }
    candidates
}

/// Points within the bounds as they are, without a descent, by their cost; those without a likelihood are left out.
pub(super) fn ranked(
    blocks: &Blocks<'_>,
    thetas: impl IntoIterator<Item = Theta>,
    longest_tau_s: f64,
    cost: impl Fn(&Theta, &Evaluation) -> f64,
) -> Vec<(f64, Theta)> {
    let mut memory = Memory::default();
    let mut found: Vec<(f64, Theta)> = (thetas.into_iter())
        .filter_map(|theta| {
            let theta = Bounds::new(&theta, blocks, longest_tau_s).clamp(&theta);
            Some((cost(&theta, &evaluate(blocks, &theta, &mut memory)?), theta))
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

fn unlikely(_: &Theta, at: &Evaluation) -> f64 {
    -at.log_likelihood
}

/// The starts of each structure that explain the record best as they are, those that lead to the same fit once.
pub(super) fn promising(blocks: &Blocks<'_>, starts: Vec<Theta>, longest_tau_s: f64) -> Vec<Theta> {
    let found = ranked(blocks, starts, longest_tau_s, unlikely);
    let mut kept: Vec<Theta> = Vec::new();
    for (_, theta) in found {
        let alike = || {
            kept.iter()
                .filter(|other| other.structure == theta.structure)
        };
        if alike().count() < STARTS && alike().all(|other| differ(&theta, other, longest_tau_s)) {
            kept.push(theta);
        }
    }
    kept
}

/// The best starts of each kind of noise.
pub(super) fn best_of_each_noise(starts: &[Theta]) -> Vec<Theta> {
    let of_kind = |kind: NoiseKind| {
        let own = starts.iter().filter(move |theta| theta.noise(kind) > 0.0);
        own.take(RACED).copied()
    };
    NoiseKind::ALL.into_iter().flat_map(of_kind).collect()
}

/// Starts from the fit `theta`, which has one noise, with another in its place, with a second one, and without any.
pub(super) fn noise_sets(theta: Theta) -> Vec<Theta> {
    let Some(own) = theta.noises().next() else {
        return vec![];
    };
    let mut without = theta;
    without.set_noise(own, 0.0);
    let mut starts = vec![without];
    for kind in NoiseKind::ALL.into_iter().filter(|kind| *kind != own) {
        let (mut beside, mut instead) = (theta, without);
        beside.set_noise(kind, 0.1 * theta.noise(own));
        instead.set_noise(kind, theta.noise(own));
        starts.extend([beside, instead]);
    }
    starts
}

/// Starts for `structure` from the best point of a structure that contains it, is a limit of it or lacks one lag.
pub(super) fn derive(from: &Theta, structure: Structure, dt_s: f64) -> Vec<Theta> {
    let old = from.layout();
    let theta = Theta::new(structure).with_noises_of(from);
    let layout = theta.layout();
    let lag_s = |i: usize| from.values[i].exp();
    let lag = if old.stages.lags > 0 { lag_s(0) } else { dt_s };
    let body_s = match (old.pole(), old.pair()) {
        (Some(pole), _) => 1.0 / from.values[pole].max(1e-9 / dt_s),
        (_, Some(pair)) => from.values[pair].max(0.0) / from.values[pair + 1].abs().max(1e-18),
        _ => f64::INFINITY,
    };
    // Lags that the structure lacks lengthen its dead time.
    let lost_s = if old.stages.lags > 0 { lag } else { 0.0 };
    let mut starts = Vec::new();
    let mut with = |lags: &[f64], body: f64, lost_s: f64| {
        let mut start = theta;
        for (i, lag) in lags.iter().enumerate() {
            start.values[i] = lag.max(dt_s / 10.0).ln();
        }
        if let Some(pole) = layout.pole() {
            start.values[pole] = 1.0 / body;
        }
        start.values[layout.tau()] = from.tau_s() + lost_s;
        starts.push(start);
    };
    match structure {
        Structure::Iptd => with(&[], 0.0, lost_s),
        Structure::Foptd => with(&[], body_s, lost_s),
        Structure::IntegratorLag => {
            with(&[lag], 0.0, 0.0);
            if body_s.is_finite() {
                with(&[body_s], 0.0, lag);
            }
        }
        Structure::DoubleIntegratorLag => with(&[lag], 0.0, 0.0),
        Structure::Toptd if old.pair().is_some() => {
            if let Some((slow_s, fast_s)) = from.real_lags_s().or_else(|| nearly_real_s(from)) {
                with(&[lag, fast_s], slow_s, 0.0);
            }
        }
        Structure::Toiptd if old.pair().is_some() => {
            if let Some([long_s, middle_s, short_s]) = thirds_s(lag, body_s) {
                with(&[middle_s, short_s], long_s, 0.0);
            }
        }
        Structure::Toiptd | Structure::Toptd => with(&[lag, 0.3 * lag], body_s, -0.3 * lag),
        Structure::Resonant => {
            if let (Some(pair), Some(own)) = (layout.pair(), old.pair()) {
                with(&[], 0.0, lag);
                starts[0].values[pair] = from.values[own];
                starts[0].values[pair + 1] = from.values[own + 1];
            }
        }
        Structure::Soiptd | Structure::Soptd => with(&[lag], body_s, 0.0),
        Structure::ResonantLag => {
            if let (Some(pair), None) = (layout.pair(), old.pair()) {
                with(&[lag], 0.0, 0.0);
                starts[0].values[pair] = 1.0 / body_s;
            }
        }
        _ => {}
    }
    starts
}

/// Relative distance of the lags of a start from their mean: the slope is zero where they are equal.
const APART: f64 = 0.1;
/// Ratio of lags above which the longer one is as good as an integrator.
const INTEGRATING: f64 = 10.0;

/// Three lags (s) with the sum of those of a second-order stage, beside a lag that stands for an integrator.
fn thirds_s(lag_s: f64, sum_s: f64) -> Option<[f64; 3]> {
    let is_integrating = sum_s > 0.0 && lag_s > INTEGRATING * sum_s;
    is_integrating.then_some([1.0 + APART, 1.0, 1.0 - APART].map(|part| part * sum_s / 3.0))
}

/// Two lags (s) with the sum of those of a second-order stage with complex but well damped poles.
fn nearly_real_s(theta: &Theta) -> Option<(f64, f64)> {
    let pair = theta.layout().pair()?;
    let (c1, c0) = (theta.values[pair], theta.values[pair + 1]);
    let mean_s = 0.5 * c1 / c0;
    let is_damped = c1 > 0.0 && (2.0 * c0..4.0 * c0).contains(&(c1 * c1));
    is_damped.then_some((mean_s * (1.0 + APART), mean_s * (1.0 - APART)))
}

/// Fit from a point that is nearly right, without putting the lags in order.
pub(super) fn warm(
    blocks: &Blocks<'_>,
    theta: &Theta,
    longest_tau_s: f64,
    patience: Patience,
) -> Option<Found> {
    let bounds = Bounds::new(theta, blocks, longest_tau_s);
    descend(blocks, theta, &theta.free(), &bounds, patience)
}
