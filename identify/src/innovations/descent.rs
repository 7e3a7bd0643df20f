//! Levenberg-Marquardt within bounds on the residual of the likelihood.
//!
//! The Jacobian is made of forward differences of the residual, in which the linear unknowns are at their best: one
//! evaluation an unknown. An unknown that a bound holds against the gradient takes no part in a step. References: J. J.
//! More, "The Levenberg-Marquardt algorithm: implementation and theory", Lecture Notes in Mathematics 630 (1978); C.
//! Kanzow, N. Yamashita, M. Fukushima, J. Comput. Appl. Math. 172 (2004), bounds.

use onecycle_design::matrix::solve_positive;

use super::likelihood::{Evaluation, Memory, evaluate};
use super::orthogonal::dot;
use super::record::Blocks;
use super::theta::{Bounds, MOST, Theta};

/// Damping at the start, and the factors by which it follows success and failure.
const DAMPING: f64 = 1e-2;
const EASIER: f64 = 0.2;
const HARDER: f64 = 6.0;
const MOST_DAMPING: f64 = 1e10;

/// End of a search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// Most steps.
    pub(super) steps: usize,
    /// Relative decrease of the sum of squares, `2 ln L` over the rows, below which a step is the last.
    pub(super) decrease: f64,
}

/// Point with its likelihood.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) theta: Theta,
    pub(super) at: Evaluation,
}

/// Normal equations of the unknowns `free`.
struct Normal {
    matrix: [[f64; MOST]; MOST],
    gradient: [f64; MOST],
}

/// Best point from `start` over the unknowns `free`. `None` if the start has no likelihood.
pub(super) fn descend(
    blocks: &Blocks<'_>,
    start: &Theta,
    free: &[usize],
    bounds: &Bounds,
    patience: Patience,
) -> Option<Found> {
    let mut memory = Memory::default();
    let theta = bounds.clamp(start);
    let at = evaluate(blocks, &theta, &mut memory)?;
    let mut here = Found { theta, at };
    let mut damping = DAMPING;
    let mut normal: Option<Normal> = None;
    for _ in 0..patience.steps {
        if normal.is_none() {
            normal = linearise(blocks, &here, free, bounds, &mut memory);
        }
        let Some(equations) = &normal else {
            break;
        };
        let Some(theta) = step(equations, &here.theta, free, bounds, damping) else {
            break;
        };
        let new = evaluate(blocks, &theta, &mut memory);
        let gain = |at: &Evaluation| at.log_likelihood - here.at.log_likelihood;
        match new.map(|at| (gain(&at), at)) {
            Some((gain, at)) if gain > 0.0 => {
                let decrease = 2.0 * gain / at.rows() as f64;
                here = Found { theta, at };
                damping = (damping * EASIER).max(1e-12);
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
    Some(here)
}

/// Normal equations at a point.
fn linearise(
    blocks: &Blocks<'_>,
    here: &Found,
    free: &[usize],
    bounds: &Bounds,
    memory: &mut Memory,
) -> Option<Normal> {
    let mut columns = vec![vec![]; free.len()];
    let residual = here.at.residual_near(&here.at);
    // Noises first: they stand last, and the response of `here` is still in the memory.
    for (slot, &index) in free.iter().enumerate().rev() {
        let room = bounds.high[index] - here.theta.values[index];
        let step = if bounds.step[index] <= room {
            bounds.step[index]
        } else {
            -bounds.step[index]
        };
        let mut theta = here.theta;
        theta.values[index] += step;
        let moved = evaluate(blocks, &theta, memory)?.residual_near(&here.at);
        let difference = moved.iter().zip(&residual);
        columns[slot] = difference
            .map(|(a, b)| (a - b) / step)
            .collect::<Vec<f64>>();
    }
    let mut normal = Normal {
        matrix: [[0.0; MOST]; MOST],
        gradient: [0.0; MOST],
    };
    for i in 0..free.len() {
        normal.gradient[i] = dot(&columns[i], &residual);
        for j in 0..=i {
            normal.matrix[i][j] = dot(&columns[i], &columns[j]);
            normal.matrix[j][i] = normal.matrix[i][j];
        }
    }
    Some(normal)
}

/// Next point, or `None` if no unknown can move.
fn step(
    normal: &Normal,
    here: &Theta,
    free: &[usize],
    bounds: &Bounds,
    damping: f64,
) -> Option<Theta> {
    let can_move = |slot: &usize| {
        let (index, gradient) = (free[*slot], normal.gradient[*slot]);
        let held_below = here.values[index] <= bounds.low[index] && gradient > 0.0;
        let held_above = here.values[index] >= bounds.high[index] && gradient < 0.0;
        !(held_below || held_above) && normal.matrix[*slot][*slot] > 0.0
    };
    let moving: Vec<usize> = (0..free.len()).filter(can_move).collect();
    if moving.is_empty() {
        return None;
    }
    let mut matrix = vec![vec![0.0; moving.len()]; moving.len()];
    let mut right = vec![0.0; moving.len()];
    for (i, &a) in moving.iter().enumerate() {
        for (j, &b) in moving.iter().enumerate() {
            matrix[i][j] = normal.matrix[a][b];
        }
        matrix[i][i] += damping * normal.matrix[a][a];
        right[i] = -normal.gradient[a];
    }
    let change = solve_positive(&matrix, &right)?;
    let mut next = *here;
    for (&slot, change) in moving.iter().zip(change) {
        next.values[free[slot]] += change;
    }
    Some(bounds.clamp(&next))
}
