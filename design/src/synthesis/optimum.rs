//! Search for the shape of least cost on one process.
//!
//! The search continues from the start of least cost. With an integral term the IAE is at least `1/ki`, so most starts need
//! no simulation. If no start is feasible, a first search looks for a feasible shape.

use super::bands::NoGain;
use super::objective::{Gain, NO_COST, Objective, Problem};
use super::simplex::{Best, Extent, minimise};

/// Step of the grid in the search, and in the check of its result.
const COARSE_GRID: f64 = 0.08;
pub(crate) const FINE_GRID: f64 = 0.04;

/// First and second simplex of a search.
const FIRST: Extent = Extent {
    size: 0.35,
    tolerance: 3e-2,
    evaluations: 120,
};
const SECOND: Extent = Extent {
    size: 0.06,
    tolerance: 1e-2,
    evaluations: 80,
};

/// Simplex of the search for a feasible shape, and the logarithm of the ratio of gains at which it is feasible enough.
const FEASIBILITY: Extent = Extent {
    size: 1.0,
    tolerance: 3e-2,
    evaluations: 150,
};
const WELL_INSIDE: f64 = -0.1;

/// A result whose least gain exceeds its largest one by more than this is infeasible.
pub(crate) const FEASIBLE: f64 = 1e-6;

/// The logarithm of the cost is that of the coarse grid within this. More than that is another range of allowed gains.
const SAME: f64 = 0.05;

/// A shape with its gain.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Optimum {
    /// Variables of the shape.
    pub z: Vec<f64>,
    /// Gain, and the frequency that limits it.
    pub gain: Gain,
    /// Logarithm of the cost.
    pub ln_cost: f64,
}

/// Why there is no optimum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoOptimum {
    /// Nothing limits the gain of any start.
    Unbounded,
    /// No shape keeps the limits.
    Infeasible,
}

/// How far a search goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effort {
    /// To the optimum.
    Full,
    /// Near the optimum: where another search starts.
    Rough,
}

/// Shape of least cost.
pub(crate) fn optimum(problem: Problem, effort: Effort) -> Result<Optimum, NoOptimum> {
    let mut starts = problem.family.starts(&problem.process);
    if let Some(family) = problem.family.without_rate_derivative() {
        // The derivative of the rate starts from the cascade without it.
        let simpler = Problem { family, ..problem };
        let best = search(
            &mut Objective::new(simpler, COARSE_GRID),
            &family.starts(&problem.process),
            effort,
        )?;
        starts = problem
            .family
            .with_rate_derivative(&problem.process, &best.point);
    }
    optimum_from(problem, &starts, effort)
}

/// Shape near that of least cost, from one that is near it within lower limits.
pub(crate) fn optimum_near(problem: Problem, near: &[f64]) -> Result<Optimum, NoOptimum> {
    let found = optimum_from(problem, &[near.to_vec()], Effort::Rough);
    found.or_else(|_| optimum(problem, Effort::Rough))
}

fn optimum_from(
    problem: Problem,
    starts: &[Vec<f64>],
    effort: Effort,
) -> Result<Optimum, NoOptimum> {
    let mut coarse = Objective::new(problem, COARSE_GRID);
    let mut best = search(&mut coarse, starts, effort)?;
    if let Some(other) = problem
        .family
        .exchanged(&best.point)
        .filter(|_| effort == Effort::Full)
    {
        let found = search(&mut coarse, &[other], effort).ok();
        best = found
            .filter(|found| found.value < best.value)
            .unwrap_or(best);
    }
    let mut fine = Objective::new(problem, FINE_GRID);
    let is_same = |found: &Optimum| found.ln_cost < best.value + SAME;
    if let Some(found) = finish(&mut fine, &best.point).ok().filter(is_same) {
        return Ok(found);
    }
    // The coarse grid took a shape for feasible that is not, or that is at lower gains only: again with feasible shapes.
    fine.is_strict = true;
    let start = Best {
        value: fine.cost(&best.point),
        point: best.point.clone(),
    };
    let again = minimise(&mut |z: &[f64]| fine.cost(z), &start, SECOND);
    if again.value < NO_COST {
        return finish(&mut fine, &again.point);
    }
    let excess = fine
        .gain(&best.point)
        .map_or(NO_COST, |gain| (gain.low / gain.k).ln());
    let inside = feasible(&mut fine, &best.point, excess).ok_or(NoOptimum::Infeasible)?;
    let best = minimise(&mut |z: &[f64]| fine.cost(z), &inside, SECOND);
    finish(&mut fine, &best.point)
}

/// Search from the best of the starts, from the least infeasible one if none is feasible.
fn search(
    objective: &mut Objective,
    starts: &[Vec<f64>],
    effort: Effort,
) -> Result<Best, NoOptimum> {
    let mut ranked = Vec::with_capacity(starts.len());
    let mut reason = NoOptimum::Infeasible;
    for start in starts {
        match objective.gain(start) {
            Ok(gain) => {
                let excess = (gain.low / gain.k).ln();
                ranked.push((
                    start.clone(),
                    excess,
                    objective.problem.least_cost(start, gain.k),
                ));
            }
            Err(NoGain::Unbounded) => reason = NoOptimum::Unbounded,
            Err(NoGain::Unstable) => {}
        }
    }
    if ranked.is_empty() {
        return Err(reason);
    }
    let mut best: Option<Best> = None;
    ranked.sort_by(|a, b| a.2.total_cmp(&b.2));
    for (start, excess, bound) in &ranked {
        let least = best.as_ref().map_or(NO_COST, |best| best.value);
        if *excess > 0.0 || *bound >= least {
            continue;
        }
        let value = objective.cost(start);
        if value < least {
            best = Some(Best {
                value,
                point: start.clone(),
            });
        }
    }
    let best = match best {
        Some(best) => best,
        None => {
            let nearest = ranked.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            nearest
                .and_then(|(start, excess, _)| feasible(objective, start, *excess))
                .ok_or(NoOptimum::Infeasible)?
        }
    };
    let mut cost = |z: &[f64]| objective.cost(z);
    let mut best = minimise(&mut cost, &best, FIRST);
    if effort == Effort::Rough {
        return Ok(best);
    }
    if best.point.len() > 2 {
        // With more variables the simplex may collapse on a kink.
        best = minimise(&mut cost, &best, FIRST);
    }
    Ok(minimise(&mut cost, &best, SECOND))
}

/// A feasible shape with a cost, from an infeasible start: the search minimises the excess of the least gain.
fn feasible(objective: &mut Objective, start: &[f64], excess: f64) -> Option<Best> {
    let mut of = |z: &[f64]| {
        if !objective
            .problem
            .family
            .is_in_range(&objective.problem.process, z)
        {
            return NO_COST;
        }
        let gain = objective.gain(z);
        gain.map_or(NO_COST, |gain| (gain.low / gain.k).ln().max(WELL_INSIDE))
    };
    let start = Best {
        value: excess,
        point: start.to_vec(),
    };
    let found = minimise(&mut of, &start, FEASIBILITY);
    let value = objective.cost(&found.point);
    (found.value <= 0.0 && value < NO_COST).then_some(Best {
        value,
        point: found.point,
    })
}

/// Gain of the shape on the fine grid.
fn finish(fine: &mut Objective, z: &[f64]) -> Result<Optimum, NoOptimum> {
    let gain = fine.gain(z).map_err(|_| NoOptimum::Infeasible)?;
    if gain.low > gain.k * (1.0 + FEASIBLE) {
        return Err(NoOptimum::Infeasible);
    }
    let ln_cost = fine.cost(z);
    if ln_cost >= NO_COST {
        return Err(NoOptimum::Infeasible);
    }
    Ok(Optimum {
        z: z.to_vec(),
        gain,
        ln_cost,
    })
}
