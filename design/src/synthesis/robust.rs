//! Shape and gain of least expected cost that keep the limits on most draws of a posterior.
//!
//! Each draw gives its own interval of gains of a shape. At most `r` draws may be given up, `j` of them at the upper end and
//! `r - j` at the lower one. So the gain is an order statistic of the upper ends: the highest one for which an allowed
//! split exists.
//!
//! `r` is the largest number for which at least the specified share of the posterior keeps the limits with a probability
//! of 93 %: with 200 draws and 95 % it is 5, not 10. The expected cost is the mean over the first draws.

use crate::analysis::process::Process;

use super::objective::{NO_COST, Objective, PENALTY, Problem};
use super::optimum::{NoOptimum, Optimum};
use super::simplex::{Best, Extent, minimise};

/// Draws over which the cost is averaged: in the first simplex, and in the second one and the result.
const FIRST_COST_DRAWS: usize = 4;
const COST_DRAWS: usize = 12;

/// Step of the grids of the draws. The extrema are refined, so it only has to find each band.
const GRID: f64 = 0.15;

/// Probability that fewer draws miss the limits than the share of the posterior that does.
const DOUBT: f64 = 0.07;

const FIRST: Extent = Extent {
    size: 0.3,
    tolerance: 3e-2,
    evaluations: 30,
};
const SECOND: Extent = Extent {
    size: 0.1,
    tolerance: 2e-2,
    evaluations: 15,
};
const FEASIBILITY: Extent = Extent {
    size: 0.3,
    tolerance: 3e-2,
    evaluations: 40,
};
const WELL_INSIDE: f64 = -0.05;

/// Logarithms of the factors of the times of integral and angle loop that are tried first.
const LONGER: [f64; 6] = [0.0, 0.15, 0.4, 0.8, 1.4, 2.2];

/// Draws of a posterior in the units of the nominal process.
pub(crate) struct Draws {
    objectives: Vec<Objective>,
    /// Gain of each draw per gain of the nominal process.
    ratios: Vec<f64>,
    nominal: Problem,
    /// Draws that may be given up.
    given_up: usize,
}

/// How a shape with its gain does on the draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Performance {
    /// Share of the draws on which the limits hold.
    pub coverage: f64,
    /// Mean cost over the first draws. Infinite if one of these loops is unstable.
    pub mean_cost: f64,
}

impl Draws {
    /// Draws that have the sign of gain and the stability of the nominal process; the others count as given up.
    pub(crate) fn new(nominal: Problem, draws: &[Process], coverage: f64) -> Self {
        let mut ratios = Vec::with_capacity(draws.len());
        let mut objectives = Vec::with_capacity(draws.len());
        for draw in draws {
            let process = draw.in_unit(nominal.process.unit_s);
            let ratio = process.gain / nominal.process.gain;
            if ratio > 0.0 && process.is_stable() {
                objectives.push(Objective::new(Problem { process, ..nominal }, GRID));
                ratios.push(ratio);
            }
        }
        let lost = draws.len() - ratios.len();
        let given_up = most_given_up(draws.len(), 1.0 - coverage).saturating_sub(lost);
        Self {
            objectives,
            ratios,
            nominal,
            given_up,
        }
    }

    /// Intervals of the gain of a shape, per gain of the nominal process: ends, and whether there is one.
    fn intervals(&mut self, z: &[f64]) -> Vec<(f64, f64)> {
        let draws = self.objectives.iter_mut().zip(&self.ratios);
        draws
            .map(|(objective, ratio)| match objective.allowed(z) {
                Ok((whole, inner)) => {
                    let (low, high) =
                        inner.map_or((0.0, f64::INFINITY), |inner| (inner.low, inner.high));
                    (whole.low.max(low) / ratio, whole.high.min(high) / ratio)
                }
                Err(_) => (f64::INFINITY, 0.0),
            })
            .collect()
    }

    /// Highest gain that at most the allowed number of draws forbid, and the logarithm by which it is infeasible.
    fn gain(&mut self, z: &[f64]) -> (f64, f64) {
        let intervals = self.intervals(z);
        let mut highs: Vec<f64> = intervals.iter().map(|interval| interval.1).collect();
        let mut lows: Vec<f64> = intervals.iter().map(|interval| interval.0).collect();
        highs.sort_by(f64::total_cmp);
        lows.sort_by(|a, b| b.total_cmp(a));
        let split = |j: usize| {
            let (high, low) = (highs.get(j)?, lows.get(self.given_up - j)?);
            Some((*high, (low / high).ln()))
        };
        let splits: Vec<(f64, f64)> = (0..=self.given_up).filter_map(split).collect();
        let feasible = splits.iter().rev().find(|(_, excess)| *excess <= 0.0);
        let nearest = || splits.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        feasible
            .or_else(nearest)
            .copied()
            .unwrap_or((0.0, f64::INFINITY))
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

    /// Coverage and mean cost of an optimum.
    pub(crate) fn performance(&mut self, best: &Optimum, count: usize) -> Performance {
        let k = best.gain.k;
        let intervals = self.intervals(&best.z);
        let rounding = 1e-6;
        let is_kept = |(low, high): &&(f64, f64)| {
            *low <= k * (1.0 + rounding) && k <= *high * (1.0 + rounding)
        };
        let kept = intervals.iter().filter(is_kept).count();
        Performance {
            coverage: kept as f64 / count.max(1) as f64,
            mean_cost: self.mean_cost(&best.z, (k, best.gain.omega), COST_DRAWS),
        }
    }

    /// Gain of a shape with the limits of noise and input, and its infeasibility.
    fn limited(&mut self, z: &[f64], omega: f64) -> Option<(f64, f64)> {
        if !self.nominal.family.is_in_range(&self.nominal.process, z) {
            return None;
        }
        let (high, excess) = self.gain(z);
        if !(high > 0.0 && excess < f64::INFINITY) {
            return None;
        }
        let k = self.nominal.limited(z, high, omega)?;
        Some((k, excess + (high / k).ln()))
    }

    /// Sets the limits of `Ms` and `Mt`.
    pub(crate) fn set_peak(&mut self, peak: f64) {
        let problems = self.objectives.iter_mut().map(|draw| &mut draw.problem);
        for problem in problems.chain([&mut self.nominal]) {
            (problem.limits.ms, problem.limits.mt) = (peak, peak);
        }
    }

    /// Logarithm of the mean cost of a shape over the first draws, with the penalty of an infeasible gain.
    fn cost(&mut self, z: &[f64], omega: f64, most: usize) -> f64 {
        let Some((k, excess)) = self.limited(z, omega) else {
            return NO_COST;
        };
        let mean = self.mean_cost(z, (k, omega), most);
        if mean.is_finite() {
            mean.ln() + PENALTY * excess.max(0.0)
        } else {
            NO_COST
        }
    }

    /// Optimum over the draws, from the nominal one.
    pub(crate) fn optimum(&mut self, nominal: &Optimum) -> Result<Optimum, NoOptimum> {
        let omega = nominal.gain.omega;
        let start = self.feasible(&nominal.z, omega);
        let mut point = start.ok_or(NoOptimum::Infeasible)?;
        let mut value = NO_COST;
        for (extent, most) in [(FIRST, FIRST_COST_DRAWS), (SECOND, COST_DRAWS)] {
            value = self.cost(&point, omega, most);
            let mut cost = |z: &[f64]| self.cost(z, omega, most);
            let best = minimise(&mut cost, &Best { value, point }, extent);
            (value, point) = (best.value, best.point);
        }
        let (k, excess) = self.limited(&point, omega).ok_or(NoOptimum::Infeasible)?;
        let mut found = nominal.clone();
        (found.z, found.gain.k, found.ln_cost) = (point, k, value);
        if excess <= 0.0 && value < NO_COST {
            Ok(found)
        } else {
            Err(NoOptimum::Infeasible)
        }
    }

    /// A shape that keeps the limits on enough draws, from a shape that does on fewer. The simulations have the frequency
    /// `omega`.
    pub(crate) fn feasible(&mut self, from: &[f64], omega: f64) -> Option<Vec<f64>> {
        // Longer times of integral and angle loop separate the ends of the gain.
        let slow = self.nominal.family.slow_variables();
        let longer = LONGER.iter().map(|longer| {
            let mut point = from.to_vec();
            point.iter_mut().take(slow).for_each(|z| *z += longer);
            point
        });
        let near = self.feasible_from(longer, omega);
        // A wide posterior has its shapes far from that of one process.
        let starts = |draws: &Self| draws.nominal.family.starts(&draws.nominal.process);
        near.or_else(|| self.feasible_from(starts(self).into_iter(), omega))
    }

    /// A shape that keeps the limits on enough draws: a search from the first start that does, else from the nearest one.
    fn feasible_from(
        &mut self,
        starts: impl Iterator<Item = Vec<f64>>,
        omega: f64,
    ) -> Option<Vec<f64>> {
        let mut excess = |z: &[f64]| {
            self.limited(z, omega)
                .map_or(NO_COST, |(_, excess)| excess.max(WELL_INSIDE))
        };
        let mut nearest: Option<Best> = None;
        for point in starts {
            let value = excess(&point);
            if value <= 0.0 {
                return Some(point);
            }
            if value < nearest.as_ref().map_or(f64::INFINITY, |best| best.value) {
                nearest = Some(Best { value, point });
            }
        }
        let found = minimise(&mut excess, &nearest?, FEASIBILITY);
        (found.value <= 0.0).then_some(found.point)
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
