//! Descent on the residual of the likelihood, in which the linear unknowns are at their best.

use super::likelihood::{Evaluation, Memory, evaluate};
use super::record::Blocks;
use super::theta::{Bounds, Theta};
use crate::descent::{self, LeastSquares, Normal};

pub(super) use crate::descent::Patience;

/// Point with its likelihood.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) theta: Theta,
    pub(super) at: Evaluation,
}

/// The likelihood of a record as a sum of squares of the unknowns `free`.
struct Problem<'a> {
    blocks: &'a Blocks<'a>,
    free: &'a [usize],
    bounds: &'a Bounds,
    memory: Memory,
}

/// Best point from `start` over the unknowns `free`. `None` if the start has no likelihood.
pub(super) fn descend(
    blocks: &Blocks<'_>,
    start: &Theta,
    free: &[usize],
    bounds: &Bounds,
    patience: Patience,
) -> Option<Found> {
    let mut problem = Problem {
        blocks,
        free,
        bounds,
        memory: Memory::default(),
    };
    let start = problem.at(bounds.clamp(start))?;
    Some(descent::descend(&mut problem, start, patience))
}

impl Problem<'_> {
    fn at(&mut self, theta: Theta) -> Option<Found> {
        let at = evaluate(self.blocks, &theta, &mut self.memory)?;
        Some(Found { theta, at })
    }
}

impl LeastSquares for Problem<'_> {
    type Point = Found;

    /// From forward differences: one evaluation an unknown.
    fn normal(&mut self, here: &Found) -> Option<Normal> {
        let mut columns = vec![vec![]; self.free.len()];
        let residual = here.at.residual_near(&here.at);
        // Noises first: they stand last, and the response of `here` is still in the memory.
        for (slot, &index) in self.free.iter().enumerate().rev() {
            let step = self.bounds.step[index];
            let room = self.bounds.high[index] - here.theta.values[index];
            let step = if step <= room { step } else { -step };
            let mut theta = here.theta;
            theta.values[index] += step;
            let moved = self.at(theta)?.at.residual_near(&here.at);
            let difference = moved.iter().zip(&residual);
            columns[slot] = difference.map(|(a, b)| (a - b) / step).collect();
        }
        Some(Normal::new(&columns, &residual))
    }

    fn is_held(&self, at: &Found, index: usize, gradient: f64) -> bool {
        let index = self.free[index];
        let value = at.theta.values[index];
        value <= self.bounds.low[index] && gradient > 0.0
            || value >= self.bounds.high[index] && gradient < 0.0
    }

    fn moved(&mut self, from: &Found, change: &[f64]) -> Option<Found> {
        let mut theta = from.theta;
        for (&index, change) in self.free.iter().zip(change) {
            theta.values[index] += change;
        }
        self.at(self.bounds.clamp(&theta))
    }

    /// `2 ln L` over the rows is the logarithm of the mean square.
    fn decrease(&self, from: &Found, to: &Found) -> f64 {
        2.0 * (to.at.log_likelihood - from.at.log_likelihood) / to.at.rows() as f64
    }
}
