//! Optimum to six digits.
//!
//! Near the optimum the problem is smooth in `x = (ln k, z)`: the logarithm of the IAE is least, and each local extremum of
//! the forbidden gains is one constraint, `ln(low) - ln k >= 0` or `ln k - ln(high) >= 0`. Newton's method on the conditions
//! of Karush, Kuhn and Tucker; derivatives are central differences. With at most four variables and a few constraints
//! all sets of active constraints are tried.

use super::objective::{NO_COST, Objective};
use super::optimum::Optimum;
use crate::matrix::solve;

/// Extrema within this share of the limit may be active.
const NEAR: f64 = 0.05;

/// Most constraints.
const MOST_CONSTRAINTS: usize = 6;

/// Step of the first differences: short, as the second derivative jumps where a zero crossing of the response appears.
const SHORT_DIFFERENCE: f64 = 1e-4;

/// Step of the second differences.
const DIFFERENCE: f64 = 1e-3;

/// Longest step, and step at which the iteration ends.
const LONGEST: f64 = 0.1;
const CONVERGED: f64 = 3e-8;
const MOST_STEPS: usize = 25;

/// Refinement of the simulations over those of the search.
const REFINEMENT: f64 = 4.0;

/// Tolerance of a linearised constraint that is not in the active set, and of the sign of its multiplier.
const TOLERANCE: f64 = 1e-7;

type Matrix = Vec<Vec<f64>>;

/// Value, gradient and second derivatives.
struct Expansion {
    value: f64,
    gradient: Vec<f64>,
    hessian: Matrix,
}

/// The optimum of `start` with more digits; `start` itself if the iteration finds no better one.
pub(crate) fn polish(objective: &mut Objective, start: &Optimum) -> Optimum {
    let omega = start.gain.omega;
    let constraints = objective.constraints(&start.z, start.gain.k, NEAR);
    if constraints.is_empty() || constraints.len() > MOST_CONSTRAINTS {
        return start.clone();
    }
    let mut x = vec![start.gain.k.ln()];
    x.extend(&start.z);
    for _ in 0..MOST_STEPS {
        let cost = expansion(&x, |x| {
            objective.fine_cost(&x[1..], x[0].exp(), omega, REFINEMENT)
        });
        let limits: Vec<Expansion> = (constraints.iter())
            .map(|constraint| expansion(&x, |x| objective.distance(constraint, x)))
            .collect();
        let Some(step) = newton(&cost, &limits) else {
            return start.clone();
        };
        let size = step.iter().fold(0.0, |size: f64, d| size.max(d.abs()));
        let factor = (LONGEST / size).min(1.0);
        for (x, d) in x.iter_mut().zip(&step) {
            *x += factor * d;
        }
        if size < CONVERGED {
            break;
        }
    }
    accepted(objective, start, &x).unwrap_or_else(|| start.clone())
}

/// The optimum at `x`, if it keeps the limits and costs no more than `start`.
fn accepted(objective: &mut Objective, start: &Optimum, x: &[f64]) -> Option<Optimum> {
    let z = x[1..].to_vec();
    let limit = objective.gain(&z).ok()?;
    let k = x[0].exp().min(limit.k);
    let omega = start.gain.omega;
    let before = objective.fine_cost(&start.z, start.gain.k, omega, REFINEMENT);
    let ln_cost = objective.fine_cost(&z, k, omega, REFINEMENT);
    let is_kept = limit.low <= k * (1.0 + 1e-6) && ln_cost <= before + 1e-4;
    is_kept.then(|| {
        let mut found = start.clone();
        (found.z, found.ln_cost) = (z, ln_cost);
        (found.gain.k, found.gain.low) = (k, limit.low);
        found
    })
}

/// Second-order expansion by central differences.
fn expansion(x: &[f64], mut f: impl FnMut(&[f64]) -> f64) -> Expansion {
    let n = x.len();
    let mut at = |steps: &[(usize, f64)]| {
        let mut point = x.to_vec();
        for (i, step) in steps {
            point[*i] += step;
        }
        f(&point)
    };
    let (h, value) = (DIFFERENCE, at(&[]));
    let mut found = Expansion {
        value,
        gradient: vec![0.0; n],
        hessian: vec![vec![0.0; n]; n],
    };
    for i in 0..n {
        let (up, down) = (at(&[(i, h)]), at(&[(i, -h)]));
        let short = at(&[(i, SHORT_DIFFERENCE)]) - at(&[(i, -SHORT_DIFFERENCE)]);
        found.gradient[i] = short / (2.0 * SHORT_DIFFERENCE);
        found.hessian[i][i] = (up - 2.0 * value + down) / (h * h);
        for j in 0..i {
            let mixed = at(&[(i, h), (j, h)]) - at(&[(i, h), (j, -h)]) - at(&[(i, -h), (j, h)])
                + at(&[(i, -h), (j, -h)]);
            found.hessian[i][j] = mixed / (4.0 * h * h);
            found.hessian[j][i] = found.hessian[i][j];
        }
    }
    found
}

/// Step of Newton's method: the best among the sets of active constraints whose multipliers and inactive constraints have
/// the right signs. Of the sets without, the one that violates least.
fn newton(cost: &Expansion, limits: &[Expansion]) -> Option<Vec<f64>> {
    let n = cost.gradient.len();
    let mut best: Option<(f64, f64, Vec<f64>)> = None;
    for set in 0..1_u32 << limits.len() {
        let active: Vec<&Expansion> = (0..limits.len())
            .filter(|i| set >> i & 1 == 1)
            .map(|i| &limits[i])
            .collect();
        if active.len() > n {
            continue;
        }
        let Some((step, multipliers)) = stationary(cost, &active) else {
            continue;
        };
        let wrong = multipliers.iter().fold(0.0, |worst: f64, m| worst.max(-m));
        let violated = limits.iter().fold(0.0, |worst: f64, limit| {
            let linear: f64 = limit.gradient.iter().zip(&step).map(|(g, d)| g * d).sum();
            worst.max(-(limit.value + linear))
        });
        let violation = (wrong + violated - TOLERANCE).max(0.0);
        let change: f64 = (0..n)
            .map(|i| {
                let row: f64 = (0..n).map(|j| cost.hessian[i][j] * step[j]).sum();
                step[i] * (cost.gradient[i] + 0.5 * row)
            })
            .sum();
        let is_better = best.as_ref().is_none_or(|(least, value, _)| {
            violation < *least || violation == *least && change < *value
        });
        if is_better {
            best = Some((violation, change, step));
        }
    }
    best.map(|best| best.2)
}

/// Stationary point of the Lagrangian with these constraints active: step and multipliers. The second derivatives of the
/// constraints enter with the multipliers of a first solution without them.
fn stationary(cost: &Expansion, active: &[&Expansion]) -> Option<(Vec<f64>, Vec<f64>)> {
    let n = cost.gradient.len();
    let mut multipliers = vec![0.0; active.len()];
    let mut step = vec![0.0; n];
    for _ in 0..4 {
        let size = n + active.len();
        let mut matrix = vec![vec![0.0; size + 1]; size];
        for i in 0..n {
            for j in 0..n {
                let curved: f64 = active
                    .iter()
                    .zip(&multipliers)
                    .map(|(c, m)| c.hessian[i][j] * m)
                    .sum();
                matrix[i][j] = cost.hessian[i][j] - curved;
            }
            for (a, constraint) in active.iter().enumerate() {
                matrix[i][n + a] = -constraint.gradient[i];
                matrix[n + a][i] = constraint.gradient[i];
            }
            matrix[i][size] = -cost.gradient[i];
        }
        for (a, constraint) in active.iter().enumerate() {
            matrix[n + a][size] = -constraint.value;
        }
        let solution = solve(matrix)?;
        step.copy_from_slice(&solution[..n]);
        multipliers.copy_from_slice(&solution[n..]);
    }
    Some((step, multipliers))
}

impl Objective {
    /// Logarithm of the cost of a shape with gain `k`, from a refined simulation.
    pub(super) fn fine_cost(&self, z: &[f64], k: f64, omega: f64, refinement: f64) -> f64 {
        let law = self.problem.family.law(&self.problem.process, z).scaled(k);
        let found = self.problem.integrals(&law, omega, refinement);
        found.map_or(NO_COST, |found| found.iae.ln())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // (x - 2)^2 + (y - 1)^2 with x + y <= 2: least at (1.5, 0.5), multiplier 1. A second constraint x <= 5 stays inactive.
    #[test]
    fn a_quadratic_with_one_active_constraint() {
        let x = [0.0, 0.0];
        let cost = expansion(&x, |x| (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2));
        let limits = [
            expansion(&x, |x| 2.0 - x[0] - x[1]),
            expansion(&x, |x| 5.0 - x[0]),
        ];
        let step = newton(&cost, &limits).unwrap();
        assert!(
            (step[0] - 1.5).abs() < 1e-8 && (step[1] - 0.5).abs() < 1e-8,
            "{step:?}"
        );
    }
}
