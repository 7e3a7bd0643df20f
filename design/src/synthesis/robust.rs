//! Shape and gain of least expected cost that keep the limits on most draws of a posterior.
//!
//! Each draw gives its own interval of gains of a shape. At most `r` draws may be given up, `j` of them at the upper end and
//! `r - j` at the lower one. So the gain is an order statistic of the upper ends: the highest one for which an allowed
//! split exists.
//!
//! `r` is the largest number for which at least the specified share of the posterior keeps the limits with a probability
//! of 93 %: with 200 draws and 95 % it is 5, not 10. The expected cost is the mean over the first draws.
//!
//! Few draws limit the gain, and about the same ones for all shapes near each other. The search *watches* those: a shape
//! that the watched draws forbid is forbidden by all draws, whichever the others are. What it finds is confirmed on all
//! draws; where other draws forbid it or leave it less gain, they are watched too and the search goes on.
//!
//! The limits of many draws make the cost a landscape of valleys with kinks, in which one simplex ends anywhere. So a search begins
//! on three sides, and that of least cost goes on until another simplex lowers the cost no further.

use crate::analysis::process::Process;

use super::limits::Limits;
use super::objective::{NO_COST, NoiseLimit, Objective, PENALTY, Problem};
use super::optimum::{Effort, NoOptimum, Optimum, optimum};
use super::simplex::{Best, Extent, minimise};

/// Draws over which the cost is averaged: in the first simplex, in the others, and in the result. They come in pairs on
/// opposite sides of the most probable process, so that a pair has its cost but for the curvature.
const FIRST_COST_DRAWS: usize = 2;
const SECOND_COST_DRAWS: usize = 6;
const COST_DRAWS: usize = 12;

/// Step of the grids of the draws. The extrema are refined, so it only has to find each band.
const GRID: f64 = 0.15;

/// Probability that fewer draws miss the limits than the share of the posterior that does.
const DOUBT: f64 = 0.07;

/// Draws watched at either end of the gain, beside those that may be given up.
const SPARE: usize = 4;

/// Simplices with more watched draws each, before the result is moved back to where all draws keep the limits.
const ROUNDS: usize = 12;

/// Halvings of the way back.
const HALVINGS: usize = 8;

const FIRST: Extent = Extent {
    size: 0.3,
    tolerance: 3e-2,
    evaluations: 40,
};
const SECOND: Extent = Extent {
    size: 0.1,
    tolerance: 3e-3,
    evaluations: 50,
};
/// A search begins with a large simplex to either side, and with none.
const SIDES: [f64; 3] = [1.0, -1.0, 0.0];
/// The second simplex begins anew where it ended while that lowers the cost by this share: one that is flat along a limit ends far
/// from the optimum.
const LOWER: f64 = 1e-3;
const FEASIBILITY: Extent = Extent {
    size: 0.4,
    tolerance: 3e-3,
    evaluations: 120,
};
const WELL_INSIDE: f64 = -0.05;

/// Starts from which the search for a feasible shape goes on.
const TRIES: usize = 3;

/// Logarithms of the factors of the times of integral and angle loop that are tried first.
const LONGER: [f64; 6] = [0.0, 0.15, 0.4, 0.8, 1.4, 2.2];

/// The same where none of these is feasible.
const MUCH_LONGER: [f64; 4] = [0.0, 1.5, 3.0, 4.5];

/// Limits of `Ms` and `Mt`, less 1, as shares of those asked for: an optimum for one process at a lower peak keeps the
/// higher one on many.
const LOWER_PEAKS: [f64; 3] = [0.7, 0.45, 0.25];

/// Draws of a posterior in the units of the nominal process.
pub(crate) struct Draws {
    objectives: Vec<Objective>,
    /// Gain of each draw per gain of the nominal process.
    ratios: Vec<f64>,
    nominal: Problem,
    /// Draws that may be given up.
    given_up: usize,
    /// Draws that the search looks at.
    watched: Vec<usize>,
}

/// How a shape with its gain does on the draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Performance {
    /// Share of the draws on which the limits hold.
    pub coverage: f64,
    /// Mean cost over the first draws. Infinite if one of these loops is unstable.
    pub mean_cost: f64,
}

/// Gains of a shape that a draw allows, per gain of the nominal process, and the frequency that limits them.
#[derive(Clone, Copy, Debug)]
struct Ends {
    low: f64,
    high: f64,
    omega: f64,
}

/// Gain of a shape over the draws.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    pub k: f64,
    pub omega: f64,
    /// Logarithm by which the gain is infeasible.
    pub excess: f64,
}

/// A shape that keeps the limits on enough draws, with the logarithm of its cost.
#[derive(Clone)]
struct Kept {
    cost: f64,
    z: Vec<f64>,
    found: Found,
}

/// The feasible gain that is highest; if none is, the least infeasible one.
fn better(found: impl Iterator<Item = Found>) -> Option<Found> {
    found.reduce(|a, b| match (a.excess <= 0.0, b.excess <= 0.0) {
        (true, true) if b.k > a.k => b,
        (false, true) => b,
        (false, false) if b.excess < a.excess => b,
        _ => a,
    })
}

/// Gains that some draws allow, where a number of draws may be given up: some at the upper end and the others at the lower
/// one.
struct Split {
    /// In ascending order of the upper ends.
    ends: Vec<Ends>,
    /// Lower ends in descending order.
    lows: Vec<f64>,
    given_up: usize,
}

impl Split {
    fn new(ends: &[Ends], given_up: usize) -> Self {
        let mut ends = ends.to_vec();
        let mut lows: Vec<f64> = ends.iter().map(|ends| ends.low).collect();
        lows.sort_by(|a, b| b.total_cmp(a));
        ends.sort_by(|a, b| a.high.total_cmp(&b.high));
        Self {
            ends,
            lows,
            given_up,
        }
    }

    /// Highest gain up to `cap`.
    fn most(&self, cap: f64) -> Option<Found> {
        let split = |j: usize| {
            let (end, low) = (self.ends.get(j)?, self.lows.get(self.given_up - j)?);
            let k = end.high.min(cap);
            let found = Found {
                k,
                omega: end.omega * (k / end.high).sqrt(),
                excess: (low / k).ln(),
            };
            (k > 0.0 && found.excess < f64::INFINITY).then_some(found)
        };
        better((0..=self.given_up).filter_map(split))
    }
}

/// Which draws.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Over {
    All,
    Watched,
}

impl Draws {
    /// Draws that have the sign of gain and the stability of the nominal process; the others of `count` are given up.
    pub(crate) fn new(nominal: Problem, draws: &[Process], count: usize, coverage: f64) -> Self {
        let mut ratios = Vec::with_capacity(draws.len());
        let mut objectives = Vec::with_capacity(draws.len());
        for draw in draws {
            let process = draw.in_unit(nominal.process.unit_s);
            let ratio = process.gain / nominal.process.gain;
            if ratio > 0.0 && process.unstable_poles() == nominal.process.unstable_poles() {
                objectives.push(Objective::new(Problem { process, ..nominal }, GRID));
                ratios.push(ratio);
            }
        }
        let lost = count - ratios.len();
        let given_up = most_given_up(count, 1.0 - coverage).saturating_sub(lost);
        Self {
            objectives,
            ratios,
            nominal,
            given_up,
            watched: Vec::new(),
        }
    }

    /// Sets the limits of the loop and of the noise.
    pub(crate) fn set_limits(&mut self, limits: Limits, noise: Option<NoiseLimit>) {
        let problems = self.objectives.iter_mut().map(|draw| &mut draw.problem);
        for problem in problems.chain([&mut self.nominal]) {
            (problem.limits, problem.noise) = (limits, noise);
        }
    }

    /// Gains of a shape that one draw allows.
    fn ends(&mut self, draw: usize, z: &[f64]) -> Ends {
        let ratio = self.ratios[draw];
        let Ok((whole, inner)) = self.objectives[draw].allowed(z) else {
            return Ends {
                low: f64::INFINITY,
                high: 0.0,
                omega: 0.0,
            };
        };
        let (mut low, mut high, mut omega) = (whole.low, whole.high, whole.omega);
        if let Some(inner) = inner {
            low = low.max(inner.low);
            if inner.high < high {
                (high, omega) = (inner.high, inner.omega);
            }
        }
        Ends {
            low: low / ratio,
            high: high / ratio,
            omega,
        }
    }

    fn all_ends(&mut self, z: &[f64]) -> Vec<Ends> {
        (0..self.objectives.len())
            .map(|draw| self.ends(draw, z))
            .collect()
    }

    /// Highest gain of a shape that at most the allowed number of draws forbid, within the limits of noise and input. `None`
    /// if the shape is out of range, or if no gain is near the limits.
    fn gain(&mut self, z: &[f64], over: Over) -> Option<Found> {
        if !self.nominal.family.is_in_range(&self.nominal.process, z) {
            return None;
        }
        let ends = match over {
            Over::All => {
                let ends = self.all_ends(z);
                self.watch(&ends);
                ends
            }
            Over::Watched => {
                let watched = std::mem::take(&mut self.watched);
                let ends = watched.iter().map(|draw| self.ends(*draw, z)).collect();
                self.watched = watched;
                ends
            }
        };
        self.of_ends(z, ends)
    }

    fn of_ends(&self, z: &[f64], mut ends: Vec<Ends>) -> Option<Found> {
        // A draw without any gain is given up once, and not at both ends.
        let emptiness = |ends: &Ends| ends.low / ends.high;
        ends.sort_by(|a, b| emptiness(b).total_cmp(&emptiness(a)));
        let empty = ends.iter().filter(|ends| ends.low > ends.high).count();
        let empty = empty.min(self.given_up);
        let ways = [
            Split::new(&ends, self.given_up),
            Split::new(&ends[empty..], self.given_up - empty),
        ];
        let ways = &ways[..if empty > 0 { 2 } else { 1 }];
        let most = |cap: f64| better(ways.iter().filter_map(|way| way.most(cap)));
        let found = most(f64::INFINITY)?;
        let cap = self.nominal.limited(z, found.k, found.omega)?;
        // With less gain fewer draws are given up at the upper end, and more may be at the lower one.
        if cap == found.k {
            Some(found)
        } else {
            most(cap)
        }
    }

    /// Watches the draws with the lowest upper ends and those with the highest lower ends.
    fn watch(&mut self, ends: &[Ends]) {
        let count = (self.given_up + 1 + SPARE).min(ends.len());
        let mut order: Vec<usize> = (0..ends.len()).collect();
        order.sort_by(|a, b| ends[*a].high.total_cmp(&ends[*b].high));
        self.watched.extend(&order[..count]);
        order.sort_by(|a, b| ends[*b].low.total_cmp(&ends[*a].low));
        self.watched.extend(&order[..count]);
        self.watched.sort_unstable();
        self.watched.dedup();
    }

    /// Mean cost of a shape with gain `k` over the first draws, at most this many.
    fn mean_cost(&self, z: &[f64], (k, omega): (f64, f64), most: usize) -> f64 {
        let count = self.objectives.len().min(most);
        let costs =
            self.objectives
                .iter()
                .zip(&self.ratios)
                .take(count)
                .map(|(objective, ratio)| {
                    let problem = &objective.problem;
                    let law = problem.family.law(&problem.process, z).scaled(k * ratio);
                    // The output after a step of the load is in units of the gain of the draw.
                    let unit = if problem.family.form.has_integral() {
                        *ratio
                    } else {
                        1.0
                    };
                    let found = problem.integrals(&law, omega, 1.0);
                    found.map_or(f64::INFINITY, |found| found.iae * unit)
                });
        costs.sum::<f64>() / count.max(1) as f64
    }

    /// Coverage and mean cost of an optimum among `count` draws.
    pub(crate) fn performance(&mut self, best: &Optimum, count: usize) -> Performance {
        let k = best.gain.k;
        let rounding = 1e-6;
        let is_kept =
            |ends: &&Ends| ends.low <= k * (1.0 + rounding) && k <= ends.high * (1.0 + rounding);
        let kept = self.all_ends(&best.z).iter().filter(is_kept).count();
        Performance {
            coverage: kept as f64 / count.max(1) as f64,
            mean_cost: self.mean_cost(&best.z, (k, best.gain.omega), COST_DRAWS),
        }
    }

    /// Logarithm of the mean cost of a shape over the first draws, with the penalty of an infeasible gain.
    fn cost(&mut self, z: &[f64], most: usize) -> f64 {
        let Some(found) = self.gain(z, Over::Watched) else {
            return NO_COST;
        };
        let mean = self.mean_cost(z, (found.k, found.omega), most);
        if mean.is_finite() {
            let Problem {
                process, family, ..
            } = &self.nominal;
            let law = family.law(process, z).scaled(found.k);
            let overshoot = self.nominal.overshoot_penalty(&law, found.omega);
            mean.ln() + PENALTY * found.excess.max(0.0) + overshoot
        } else {
            NO_COST
        }
    }

    /// Optimum over the draws, from the nominal one and from shapes that are near the optimum.
    pub(crate) fn optimum(
        &mut self,
        nominal: &Optimum,
        near: Option<&[f64]>,
    ) -> Result<Optimum, NoOptimum> {
        let start = self.feasible(&nominal.z, near);
        let (z, found) = start.ok_or(NoOptimum::Infeasible)?;
        let cost = self.cost(&z, SECOND_COST_DRAWS);
        let start = Kept { cost, z, found };
        let mut least = start.clone();
        for side in SIDES {
            let mut point = start.z.clone();
            if side != 0.0 {
                let size = side * FIRST.size;
                let extent = Extent { size, ..FIRST };
                point = self.lower(point, extent, FIRST_COST_DRAWS).point;
            }
            let found = self.descended(start.clone(), point, 1);
            if found.cost < least.cost {
                least = found;
            }
        }
        let point = least.z.clone();
        let Kept { z, found, .. } = self.descended(least, point, ROUNDS);
        let mut best = nominal.clone();
        best.ln_cost = self.mean_cost(&z, (found.k, found.omega), COST_DRAWS).ln();
        (best.z, best.gain.k, best.gain.omega) = (z, found.k, found.omega);
        if best.ln_cost < NO_COST {
            Ok(best)
        } else {
            Err(NoOptimum::Infeasible)
        }
    }

    /// The end of a search from `point`, or `best` where that costs less. What a simplex finds with the watched draws counts by its
    /// cost with all of them: others may leave it less gain.
    fn descended(&mut self, mut best: Kept, mut point: Vec<f64>, rounds: usize) -> Kept {
        let mut is_confirmed = false;
        for _ in 0..rounds {
            let on_watched = self.lower(point, SECOND, SECOND_COST_DRAWS);
            point = on_watched.point;
            let confirmed = self.confirmed(&point);
            is_confirmed = confirmed.is_some();
            let Some(found) = confirmed else {
                continue;
            };
            let cost = self.cost(&point, SECOND_COST_DRAWS);
            let fell = best.cost - cost;
            if fell > 0.0 {
                let z = point.clone();
                best = Kept { cost, z, found };
            } else {
                point.clone_from(&best.z);
            }
            if fell < LOWER && cost - on_watched.value < LOWER {
                break;
            }
        }
        if !is_confirmed {
            let (z, found) = self.towards(&point, (best.z.clone(), best.found));
            let cost = self.cost(&z, SECOND_COST_DRAWS);
            if cost < best.cost {
                best = Kept { cost, z, found };
            }
        }
        best
    }

    /// The end of a simplex from a shape, with the logarithm of its cost.
    fn lower(&mut self, point: Vec<f64>, extent: Extent, most: usize) -> Best {
        let value = self.cost(&point, most);
        let mut cost = |z: &[f64]| self.cost(z, most);
        minimise(&mut cost, &Best { value, point }, extent)
    }

    /// Gain of a shape if enough of all draws keep the limits. The draws that limit it are watched from then on.
    fn confirmed(&mut self, z: &[f64]) -> Option<Found> {
        self.gain(z, Over::All).filter(|found| found.excess <= 0.0)
    }

    /// The shape nearest to `point`, on the way from one that keeps the limits, that still does.
    fn towards(
        &mut self,
        point: &[f64],
        (mut kept, mut found): (Vec<f64>, Found),
    ) -> (Vec<f64>, Found) {
        let from = kept.clone();
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let share = 0.5 * (low + high);
            let between = |(a, b): (&f64, &f64)| a + share * (b - a);
            let z: Vec<f64> = from.iter().zip(point).map(between).collect();
            if let Some(confirmed) = self.confirmed(&z) {
                (low, kept, found) = (share, z, confirmed);
            } else {
                high = share;
            }
        }
        (kept, found)
    }

    /// A shape that keeps the limits on enough draws, with its gain, from shapes that do on fewer.
    pub(crate) fn feasible(
        &mut self,
        from: &[f64],
        near: Option<&[f64]>,
    ) -> Option<(Vec<f64>, Found)> {
        if self.watched.is_empty() {
            self.confirmed(from);
        }
        // Longer times of integral and angle loop separate the ends of the gain.
        let slow = self.nominal.family.slow_variables();
        let longer = LONGER.iter().map(|longer| {
            let mut point = from.to_vec();
            point.iter_mut().take(slow).for_each(|z| *z += longer);
            point
        });
        let starts = longer.chain(near.map(<[f64]>::to_vec)).collect();
        if let Some(found) = self.feasible_from(starts) {
            return Some(found);
        }
        // A wide posterior has its shapes far from that of one process.
        let mut starts = self.nominal.family.starts(&self.nominal.process);
        starts.extend(LOWER_PEAKS.iter().filter_map(|share| {
            let mut problem = self.nominal;
            let lower = |peak: f64| 1.0 + share * (peak - 1.0);
            problem.limits.ms = lower(problem.limits.ms);
            problem.limits.mt = lower(problem.limits.mt);
            optimum(problem, Effort::Rough).ok().map(|found| found.z)
        }));
        let longer = starts.iter().flat_map(|z| {
            MUCH_LONGER.map(|longer| {
                let mut point = z.clone();
                point.iter_mut().take(slow).for_each(|z| *z += longer);
                point
            })
        });
        let starts = longer.collect();
        self.feasible_from(starts)
    }

    /// The start of least cost that keeps the limits on enough draws; if none does, a shape that does, from the nearest
    /// starts.
    fn feasible_from(&mut self, starts: Vec<Vec<f64>>) -> Option<(Vec<f64>, Found)> {
        let mut kept = Vec::new();
        let mut missed = Vec::new();
        for point in starts {
            match self.gain(&point, Over::Watched) {
                Some(found) if found.excess <= 0.0 => {
                    kept.push((self.nominal.least_cost(&point, found.k), point));
                }
                Some(found) => missed.push((found.excess, point)),
                None => {}
            }
        }
        for list in [&mut kept, &mut missed] {
            list.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        let best = kept
            .iter()
            .find_map(|(_, point)| Some((point.clone(), self.confirmed(point)?)));
        best.or_else(|| {
            let near = kept.iter().chain(&missed).take(TRIES);
            near.filter_map(|(_, point)| self.feasible_near(point.clone()))
                .next()
        })
    }

    /// A shape that keeps the limits on enough draws: a search for the least excess from one that does not.
    fn feasible_near(&mut self, mut point: Vec<f64>) -> Option<(Vec<f64>, Found)> {
        for _ in 0..ROUNDS {
            let mut excess = |z: &[f64]| {
                let found = self.gain(z, Over::Watched);
                found.map_or(NO_COST, |found| found.excess.max(WELL_INSIDE))
            };
            let value = excess(&point);
            let found = minimise(&mut excess, &Best { value, point }, FEASIBILITY);
            if found.value > 0.0 {
                return None;
            }
            point = found.point;
            if let Some(found) = self.confirmed(&point) {
                return Some((point, found));
            }
        }
        None
    }
}

/// Largest number of `draws` that may miss a limit which a share `missing` of the posterior misses.
fn most_given_up(draws: usize, missing: f64) -> usize {
    if missing <= 0.0 {
        return 0;
    }
    let n = draws as f64;
    let mut term = (n * (1.0 - missing).ln()).exp();
    let mut sum = term;
    let mut given_up = 0;
    for r in 1..=draws {
        term *= (n - r as f64 + 1.0) / r as f64 * missing / (1.0 - missing);
        sum += term;
        if sum > DOUBT || sum.is_nan() {
            break;
        }
        given_up = r;
    }
    given_up
}

#[cfg(test)]
mod tests {
    use super::*;

    // P[Bin(200, 0.05) <= 5] = 6.2 %, P[... <= 6] = 12 %; P[Bin(96, 0.05) <= 1] = 4.4 %, P[... <= 2] = 14 %.
    #[test]
    fn draws_that_may_be_given_up() {
        assert_eq!(most_given_up(200, 0.05), 5);
        assert_eq!(most_given_up(96, 0.05), 1);
        assert_eq!(most_given_up(10, 0.05), 0);
        assert_eq!(most_given_up(10, 0.0), 0);
    }
}
