//! Choice of the structure: the simplest whose BIC is nearly the best.
//!
//! BIC = -2 ln L + (number of unknowns, the gain included) ln(number of rows), always on the same rows. Reference: G.
//! Schwarz, "Estimating the dimension of a model", Ann. Stat. 6 (1978).

use std::f64::consts::{PI, TAU};

use onecycle_design::Structure;

use super::prepare::FLOOR;
use super::record::{Blocks, Record};
use super::search::{self, Candidate, HEADS};
use super::theta::{Bounds, Theta};
use crate::progress::{one_of, part};

/// Structures explain a record nearly as well up to this difference of the BIC: a likelihood ratio of `e^3`.
pub(super) const NEARLY: f64 = 6.0;
/// A simpler structure is taken up to this difference: the evidence is "not worth more than a bare mention" (R. E. Kass, A.
/// E. Raftery, J. Am. Stat. Assoc. 90 (1995)). A lag too many costs accuracy; a lag too few is found in the dead time.
const EQUAL: f64 = 2.0;
/// Twice the gain of the log-likelihood from which damping shows: 5 % of undamped processes seem damped by as much.
/// The BIC alone would hide damping of two standard deviations, and with it bias the gain.
const SHOWN: f64 = 2.7;
/// Damping ratio from which a resonance may be two equal lags.
const WELL_DAMPED: f64 = 0.9;
/// Structures whose best fit is worse than this are given up: no further noise makes up for it. Their fits are not finished.
pub(super) const HOPELESS: f64 = 80.0;
/// Log-likelihood by which a structure may fall behind its limit.
const STUCK: f64 = 0.05;
/// A structure as the limit of another that has one unknown more, inner ones first.
const LIMITS: [(Structure, Structure); 7] = [
    (Structure::Iptd, Structure::Foptd),
    (Structure::Iptd, Structure::IntegratorLag),
    (Structure::IntegratorLag, Structure::Soptd),
    (Structure::DoubleIntegratorLag, Structure::Soiptd),
    (Structure::Soptd, Structure::Toptd),
    (Structure::Soiptd, Structure::Toiptd),
    (Structure::Soiptd, Structure::ResonantLag),
];
/// Rows of the fit that chooses.
const ROWS: usize = 900;

/// Shares of the time of a choice after the screening, the fits of what it found, and those of the structures.
const SCREENED: f64 = 0.8;
const RACED: f64 = 0.85;
const DERIVED: f64 = 0.95;

/// Candidates of all structures in ascending order of BIC, the best of each structure, on one set of rows.
#[derive(Clone)]
pub(super) struct Choice {
    pub(super) candidates: Vec<Candidate>,
    /// The best fit of each structure, those that a record does not tell from another one too.
    all: Vec<Candidate>,
    /// Samples a row.
    pub(super) samples: usize,
}

impl Choice {
    /// Of fits to rows of `samples` samples.
    pub(super) fn of(all: Vec<Candidate>, samples: usize) -> Self {
        let candidates = best_of_each(all);
        Self {
            all: candidates.clone(),
            candidates,
            samples,
        }
    }

    /// The simplest structure within [`EQUAL`] of the best; with damping, where damping shows.
    pub(super) fn chosen(&self) -> Option<&Candidate> {
        let best = self.candidates.first()?.bic;
        let simplest = (self.candidates.iter())
            .filter(|candidate| candidate.bic <= best + EQUAL)
            .min_by_key(|candidate| simplicity(candidate.structure()))?;
        let simplest = self.real(simplest).unwrap_or(simplest);
        let damped = damped(&self.candidates, simplest.structure()).filter(|damped| {
            let gain = damped.found.at.log_likelihood - simplest.found.at.log_likelihood;
            2.0 * gain > SHOWN && damped.found.theta.process(1.0).pole_per_s() > 0.0
        });
        Some(damped.unwrap_or(simplest))
    }

    /// The same without the structures that have a second-order stage.
    pub(super) fn without_pairs(&self) -> Self {
        let has_none = |of: &&Candidate| of.structure().stages().pairs == 0;
        let of = |all: &[Candidate]| all.iter().filter(has_none).cloned().collect();
        Self {
            candidates: of(&self.candidates),
            all: of(&self.all),
            samples: self.samples,
        }
    }

    /// Each of the other structures that explain the record nearly as well as the best, alone.
    pub(super) fn others_than(&self, chosen: Structure) -> impl Iterator<Item = Self> {
        let others = self.within(NEARLY);
        others
            .filter(move |other| other.structure() != chosen)
            .map(|other| Self {
                candidates: vec![other.clone()],
                all: self.all.clone(),
                samples: self.samples,
            })
    }

    /// Candidates up to `span` behind the best.
    pub(super) fn within(&self, span: f64) -> impl Iterator<Item = &Candidate> {
        let best = self.candidates.first().map_or(0.0, |best| best.bic);
        let candidates = self.candidates.iter();
        candidates.filter(move |candidate| candidate.bic < best + span)
    }

    /// The best fit of each structure.
    pub(super) fn thetas(&self) -> Vec<Theta> {
        let candidates = self.candidates.iter();
        candidates.map(|candidate| candidate.found.theta).collect()
    }

    /// Fit of real lags that explains a record nearly as well as a resonance without a peak: the poles of equal lags seem complex
    /// every second time.
    fn real(&self, resonance: &Candidate) -> Option<&Candidate> {
        let structure = match resonance.structure() {
            Structure::Resonant => Structure::Soptd,
            Structure::ResonantLag => Structure::Toptd,
            _ => return None,
        };
        let [c1, c0] = resonance.found.theta.process(1.0).pair();
        let is_well_damped = c1 > 2.0 * WELL_DAMPED * c0.max(0.0).sqrt();
        self.within(f64::INFINITY).find(|real| {
            let is_as_good = real.bic <= resonance.bic + NEARLY;
            is_well_damped && real.structure() == structure && is_as_good
        })
    }

    /// Fit of the structure that has the damping which `structure` lacks, told or not.
    pub(super) fn wider(&self, structure: Structure) -> Option<&Candidate> {
        damped(&self.all, structure)
    }
}

/// Fit of the structure that has the damping which `structure` lacks.
fn damped(candidates: &[Candidate], structure: Structure) -> Option<&Candidate> {
    let damped = match structure {
        Structure::DoubleIntegratorLag => Structure::Soiptd,
        Structure::IntegratorLag => Structure::Soptd,
        Structure::Iptd => Structure::Foptd,
        _ => return None,
    };
    (candidates.iter()).find(|candidate| candidate.structure() == damped)
}

/// Rank of a structure: number of unknowns; of two with equal numbers the one with real lags is simpler.
fn simplicity(structure: Structure) -> (usize, usize) {
    let stages = structure.stages();
    (stages.lags + stages.poles + 2 * stages.pairs, stages.pairs)
}

/// Where the search starts and ends.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// Time at the start whose output is not used (s).
    pub(super) skip_s: f64,
    /// Longest dead time (s).
    pub(super) longest_tau_s: f64,
    /// Inverse of the lowest frequency of the excitation (s).
    pub(super) slowest_s: f64,
    /// Period (s) of the frequency below and above which the input has half of its power each. Infinite for an input that never changes.
    pub(super) period_s: f64,
    /// The only structure to fit.
    pub(super) structure: Option<Structure>,
    /// Fewest samples a row.
    pub(super) fewest_samples: usize,
}

/// Fits the structures to a record, from `starts`, or from those that a screening finds if the list is empty.
pub(super) fn choose(record: &Record, limits: &Limits, starts: &[Theta]) -> Choice {
    let rows = record.len() - record.skipped(limits.skip_s);
    let samples = (rows / ROWS).max(limits.fewest_samples);
    let blocks = Blocks::new(record, samples, limits.skip_s);
    let tau_s = limits.longest_tau_s;
    let starts = match starts {
        [] => part(0.0..SCREENED, || screened(record, limits)),
        _ => starts.to_vec(),
    };
    let starts = search::promising(&blocks, starts, tau_s);
    let mut all = part(SCREENED..RACED, || {
        let mut all = search::race(&blocks, &starts, None, tau_s);
        let aliases = aliases(&all, limits.period_s);
        all.extend(search::race(&blocks, &aliases, None, tau_s));
        if let Some(lead) = search::best(all.clone()) {
            let starts = search::noise_sets(lead.found.theta);
            all.extend(search::race(&blocks, &starts, Some(&lead), tau_s));
        }
        all
    });
    part(RACED..DERIVED, || derive(&blocks, &mut all, limits));
    lift(&blocks, &mut all, limits);
    quieten(&blocks, &mut all, limits);
    all.retain(|candidate| (limits.structure).is_none_or(|asked| asked == candidate.structure()));
    let mut candidates = all.clone();
    if limits.structure.is_none() {
        let are_longer = limits.fewest_samples > 1;
        candidates.retain(|candidate| {
            let theta = &candidate.found.theta;
            let bounds = Bounds::new(theta, &blocks, tau_s);
            let is_hidden = has_hidden_lag(theta, record.dt_s)
                || bounds.has_fastest_pair(theta)
                || is_slower_than(theta, (blocks.length_s(), limits.slowest_s))
                || is_integrating(theta, blocks.length_s())
                || are_longer && is_aliased(theta, blocks.block_s());
            !is_hidden && !is_of_a_force(theta, limits.slowest_s)
        });
    }
    Choice {
        candidates: best_of_each(candidates),
        all: best_of_each(all),
        samples,
    }
}

/// Starts half a period of the input, or several, before the best fit of each structure: after the first of them a periodic input tells a
/// dead time only up to half a period, with the sign of the gain.
fn aliases(all: &[Candidate], period_s: f64) -> Vec<Theta> {
    let half_s = 0.5 * period_s;
    let earlier = |mut theta: Theta| {
        let tau = theta.layout().tau();
        let halves = (theta.values[tau] / half_s).round();
        (halves > 0.0).then(|| {
            theta.values[tau] = (theta.values[tau] - halves * half_s).max(0.0);
            theta
        })
    };
    let best = best_of_each(all.to_vec()).into_iter();
    best.filter_map(|found| earlier(found.found.theta))
        .collect()
}

/// The best starts of each kind of noise and structure, on each part that is screened.
fn screened(record: &Record, limits: &Limits) -> Vec<Theta> {
    let heads = search::heads(limits.structure);
    (heads.iter().enumerate())
        .flat_map(|(at, head)| {
            one_of(at, heads.len(), || {
                search::screen(record, *head, limits.skip_s, limits.longest_tau_s)
            })
        })
        .flat_map(|starts| search::best_of_each_noise(&starts))
        .collect()
}

/// Adds the structures that are not screened, from the best of those that contain them; and the screened ones with the
/// noises that proved best in another. These come first: what they find leads to the others.
fn derive(blocks: &Blocks<'_>, all: &mut Vec<Candidate>, limits: &Limits) {
    let others = (Structure::ALL.into_iter()).filter(|structure| !HEADS.contains(structure));
    for (at, structure) in HEADS.into_iter().chain(others).enumerate() {
        let best = all.iter().min_by(|a, b| a.bic.total_cmp(&b.bic));
        let Some(lead) = best.cloned() else {
            return;
        };
        if limits.structure.is_some_and(|asked| asked != structure) {
            continue;
        }
        let mut sources: Vec<&Candidate> = (all.iter())
            .filter(|from| from.structure() != structure && contains(from.structure(), structure))
            .filter(|from| from.bic < lead.bic + HOPELESS)
            .collect();
        sources.sort_by(|a, b| a.bic.total_cmp(&b.bic));
        sources.truncate(2);
        let mut starts: Vec<Theta> = sources
            .iter()
            .flat_map(|from| search::derive(&from.found.theta, structure, blocks.record.dt_s))
            .collect();
        // A head keeps its own fits and is tried with the noises of the lead.
        if HEADS.contains(&structure) {
            for start in &mut starts {
                *start = start.with_noises_of(&lead.found.theta);
            }
        }
        let tau_s = limits.longest_tau_s;
        all.extend(one_of(at, Structure::ALL.len(), || {
            search::race(blocks, &starts, Some(&lead), tau_s)
        }));
    }
}

/// Whether starts for `inner` can be derived from a fit of `outer`.
fn contains(outer: Structure, inner: Structure) -> bool {
    use Structure::{
        DoubleIntegratorLag, Foptd, IntegratorLag, Iptd, Resonant, ResonantLag, Soiptd, Soptd,
        Toiptd, Toptd,
    };
    matches!(
        (outer, inner),
        (Soiptd, Iptd | IntegratorLag | DoubleIntegratorLag | Toiptd)
            | (Soptd, Iptd | Foptd | IntegratorLag | Toptd)
            | (ResonantLag, Resonant | Soptd | Soiptd | Toptd | Toiptd)
    )
}

/// Fits a structure again, from a limit of it that explains the record better than it does: it cannot be worse than its
/// limit, so it was stuck.
fn lift(blocks: &Blocks<'_>, all: &mut Vec<Candidate>, limits: &Limits) {
    let least = all.iter().map(|candidate| candidate.bic);
    let hopeless = least.fold(f64::INFINITY, f64::min) + HOPELESS;
    for (limit, structure) in LIMITS {
        if limits.structure.is_some_and(|asked| asked != structure) {
            continue;
        }
        let best = |of: Structure| {
            let own = all.iter().filter(|candidate| candidate.structure() == of);
            own.max_by(|a, b| a.log_likelihood().total_cmp(&b.log_likelihood()))
        };
        let (Some(inner), found) = (best(limit), best(structure)) else {
            continue;
        };
        if inner.bic > hopeless
            || found.is_some_and(|found| found.log_likelihood() > inner.log_likelihood() - STUCK)
        {
            continue;
        }
        let starts = search::derive(&inner.found.theta, structure, blocks.record.dt_s);
        all.extend(search::race(blocks, &starts, None, limits.longest_tau_s));
    }
}

/// Fits the best of each structure again without disturbances. Those of the lead may make up for what it lacks, as a walk does
/// for the damping of a process that is taken for an integrator; the structure that has it needs none.
fn quieten(blocks: &Blocks<'_>, all: &mut Vec<Candidate>, limits: &Limits) {
    let Some(lead) = search::best(all.clone()) else {
        return;
    };
    let mut starts: Vec<Theta> = Vec::new();
    for structure in Structure::ALL {
        let own = all
            .iter()
            .filter(|candidate| candidate.structure() == structure);
        let best = own.min_by(|a, b| a.bic.total_cmp(&b.bic));
        let hopeful = best.filter(|best| best.bic < lead.bic + HOPELESS);
        starts.extend(hopeful.and_then(|best| {
            let theta = best.found.theta;
            theta.noises().next()?;
            Some(theta.without_noises())
        }));
    }
    all.extend(search::race(
        blocks,
        &starts,
        Some(&lead),
        limits.longest_tau_s,
    ));
}

/// Whether a second lag is shorter than a sample: no output shows it, it stands for an error of the samples' times.
fn has_hidden_lag(theta: &Theta, sample_s: f64) -> bool {
    theta.structure.stages().lags > 1 && theta.shortest_lag_s() < sample_s
}

/// Whether a resonance is above the Nyquist frequency of rows of `row_s`, which show its alias. Rows that were made longer for the
/// sake of their innovations must not show what shorter ones did not.
fn is_aliased(theta: &Theta, row_s: f64) -> bool {
    let Some(pair) = theta.layout().pair() else {
        return false;
    };
    let (c1, c0) = (theta.values[pair], theta.values[pair + 1]);
    let is_complex = c1 * c1 < 4.0 * c0;
    is_complex && c0.sqrt() * row_s > PI
}

/// Whether a record does not show a resonance, whose limit is an integrator: its period is longer than the record, or it is below a
/// fifth of the lowest frequency of the excitation, where it changes the response by less than 4 %.
fn is_slower_than(theta: &Theta, (length_s, slowest_s): (f64, f64)) -> bool {
    let least_per_s = (TAU / length_s).max(0.2 / slowest_s);
    let pair = theta.layout().pair();
    pair.is_some_and(|pair| theta.values[pair + 1] < least_per_s * least_per_s)
}

/// Whether the pole of a process that comes to rest changes its response over a record by less than is believed: its limit is an
/// integrator.
fn is_integrating(theta: &Theta, length_s: f64) -> bool {
    let stages = theta.structure.stages();
    let comes_to_rest = stages.integrators == 0 && stages.poles > 0;
    comes_to_rest && theta.process(1.0).pole_per_s().abs() * length_s < 2.0 * FLOOR
}

/// Whether all lags before an integrator, or before what cannot be told from one, turn the phase by more than 70 degrees at the
/// lowest frequency of the excitation, which then shows `K/T` and not `K`: that is a body behind a force, with its actuator's
/// lag in the dead time.
fn is_of_a_force(theta: &Theta, slowest_s: f64) -> bool {
    let is_integrating = match theta.structure {
        Structure::IntegratorLag => true,
        Structure::Soptd => theta.process(1.0).pole_per_s() * slowest_s < 0.1,
        _ => false,
    };
    is_integrating && theta.delay_and_lag_s().1 > 3.0 * slowest_s
}

fn best_of_each(mut all: Vec<Candidate>) -> Vec<Candidate> {
    all.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    let mut seen: Vec<Structure> = Vec::new();
    all.retain(|candidate| {
        let is_new = !seen.contains(&candidate.structure());
        seen.push(candidate.structure());
        is_new
    });
    all
}
