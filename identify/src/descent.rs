//! Levenberg-Marquardt within bounds, for every fit of this crate.
//!
//! An unknown that a bound holds against the gradient takes no part in a step. References: J. J. More, "The
//! Levenberg-Marquardt algorithm: implementation and theory", Lecture Notes in Mathematics 630 (1978); C. Kanzow, N. Yamashita,
//! M. Fukushima, J. Comput. Appl. Math. 172 (2004), bounds.

use onecycle_design::matrix::solve_positive;

use crate::innovations::dot;

/// Damping at the start, and the factors by which it follows success and failure.
const DAMPING: f64 = 1e-2;
const EASIER: f64 = 0.2;
const HARDER: f64 = 6.0;
const LEAST_DAMPING: f64 = 1e-12;
const MOST_DAMPING: f64 = 1e10;

/// End of a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patience {
    /// Most steps, those that failed included.
    pub(crate) steps: usize,
    /// Relative decrease of the sum of squares below which a step is the last.
    pub(crate) decrease: f64,
}

/// Normal equations `J'J x = -J'r` of the residual `r` with the Jacobian `J`.
pub(crate) struct Normal {
    pub(crate) matrix: Vec<Vec<f64>>,
    pub(crate) gradient: Vec<f64>,
}

impl Normal {
    /// Of the columns of the Jacobian.
    pub(crate) fn new(columns: &[Vec<f64>], residual: &[f64]) -> Self {
        let mut matrix = vec![vec![0.0; columns.len()]; columns.len()];
        for i in 0..columns.len() {
            for j in 0..=i {
                matrix[i][j] = dot(&columns[i], &columns[j]);
                matrix[j][i] = matrix[i][j];
            }
        }
        Self {
            matrix,
            gradient: columns.iter().map(|column| dot(column, residual)).collect(),
        }
    }
}

/// A sum of squares of some unknowns.
pub(crate) trait LeastSquares {
    /// Values of the unknowns, and what is known there.
    type Point;

    /// Normal equations at a point. `None` if a neighbour has no residual.
    fn normal(&mut self, at: &Self::Point) -> Option<Normal>;

    /// Whether a bound holds unknown `index`, which falls with a positive `gradient`.
    fn is_held(&self, at: &Self::Point, index: usize, gradient: f64) -> bool;

    /// The point after a change of the unknowns, within the bounds. `None` if it has no residual.
    fn moved(&mut self, from: &Self::Point, change: &[f64]) -> Option<Self::Point>;

    /// By how much the sum of squares falls from one point to another, relative to it.
    fn decrease(&self, from: &Self::Point, to: &Self::Point) -> f64;
}

/// The best point from `start`.
pub(crate) fn descend<P: LeastSquares>(
    problem: &mut P,
    start: P::Point,
    patience: Patience,
) -> P::Point {
    let mut here = start;
    let mut damping = DAMPING;
    let mut normal: Option<Normal> = None;
    for _ in 0..patience.steps {
        if normal.is_none() {
            normal = problem.normal(&here);
        }
        let change = normal
            .as_ref()
            .and_then(|normal| step(problem, &here, normal, damping));
        let Some(change) = change else {
            break;
        };
        let new = problem.moved(&here, &change);
        match new.map(|point| (problem.decrease(&here, &point), point)) {
            Some((decrease, point)) if decrease > 0.0 => {
                here = point;
                damping = (damping * EASIER).max(LEAST_DAMPING);
                normal = None;
                if decrease < patience.decrease && damping < DAMPING {
                    break;
                }
            }
            _ => {
                damping *= HARDER;
                if damping > MOST_DAMPING {
                    break;
                }
            }
        }
    }
    here
}

/// Change of the unknowns. `None` if none can move.
fn step<P: LeastSquares>(
    problem: &P,
    here: &P::Point,
    normal: &Normal,
    damping: f64,
) -> Option<Vec<f64>> {
    let count = normal.gradient.len();
    let moving: Vec<usize> = (0..count)
        .filter(|i| normal.matrix[*i][*i] > 0.0)
        .filter(|i| !problem.is_held(here, *i, normal.gradient[*i]))
        .collect();
    if moving.is_empty() {
        return None;
    }
    let mut matrix: Vec<Vec<f64>> = (moving.iter())
        .map(|a| moving.iter().map(|b| normal.matrix[*a][*b]).collect())
        .collect();
    for (i, row) in matrix.iter_mut().enumerate() {
        row[i] += damping * row[i];
    }
    let right: Vec<f64> = moving.iter().map(|a| -normal.gradient[*a]).collect();
    let mut change = vec![0.0; count];
    for (index, value) in moving.iter().zip(solve_positive(&matrix, &right)?) {
        change[*index] = value;
    }
    Some(change)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley with the bound `y <= most`.
    struct Valley {
        most: f64,
    }

    fn residual([x, y]: [f64; 2]) -> Vec<f64> {
        vec![10.0 * (y - x * x), 1.0 - x]
    }

    fn cost(at: [f64; 2]) -> f64 {
        residual(at).iter().map(|r| r * r).sum()
    }

    impl LeastSquares for Valley {
        type Point = [f64; 2];

        fn normal(&mut self, at: &Self::Point) -> Option<Normal> {
            let columns = [vec![-20.0 * at[0], -1.0], vec![10.0, 0.0]];
            Some(Normal::new(&columns, &residual(*at)))
        }

        fn is_held(&self, at: &Self::Point, index: usize, gradient: f64) -> bool {
            index == 1 && at[1] >= self.most && gradient < 0.0
        }

        fn moved(&mut self, from: &Self::Point, change: &[f64]) -> Option<Self::Point> {
            Some([from[0] + change[0], (from[1] + change[1]).min(self.most)])
        }

        fn decrease(&self, from: &Self::Point, to: &Self::Point) -> f64 {
            (cost(*from) - cost(*to)) / cost(*from)
        }
    }

    const PATIENCE: Patience = Patience {
        steps: 100,
        decrease: 1e-14,
    };

    #[test]
    fn a_valley_is_followed_to_its_end() {
        let [x, y] = descend(&mut Valley { most: 9.0 }, [-1.2, 1.0], PATIENCE);
        assert!((x - 1.0).abs() < 1e-8 && (y - 1.0).abs() < 1e-8, "{x} {y}");
    }

    // On the bound y = 1/4 the sum is 100 (1/4 - x^2)^2 + (1 - x)^2, whose derivative 400 x^3 - 98 x - 2 vanishes at the least.
    #[test]
    fn a_bound_holds() {
        let [x, y] = descend(&mut Valley { most: 0.25 }, [-1.2, 0.0], PATIENCE);
        assert_eq!(y, 0.25);
        let slope = 400.0 * x.powi(3) - 98.0 * x - 2.0;
        assert!(x > 0.0 && slope.abs() < 1e-3, "{x} {slope}");
    }
}
