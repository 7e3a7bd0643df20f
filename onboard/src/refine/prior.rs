//! Prior distribution of the shape: a Gaussian over the unknowns of the search, as three rows of the equations.
//! With them the estimate is the most probable process instead of the least-squares one.
//!
//! ```text
//! rows = sigma W (shape - mean),   W^T W = covariance^-1
//! ```

use super::domain::{SHAPE, Shape};
use crate::pack::Pack;

/// Gaussian over [`Shape`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapePrior {
    mean: Shape,
    /// `W`, lower triangular: the inverse of the covariance's root.
    whitening: [Shape; SHAPE],
}

impl ShapePrior {
    /// From the mean and the lower triangular root of the covariance; `None` unless its diagonal is positive and
    /// all numbers are finite.
    #[must_use]
    pub fn new(mean: Shape, root: &[Shape; SHAPE]) -> Option<Self> {
        let mut whitening = [[0.0; SHAPE]; SHAPE];
        for column in 0..SHAPE {
            for row in column..SHAPE {
                let unit = f64::from(u8::from(row == column));
                let known: f64 = (column..row)
                    .map(|k| root[row][k] * whitening[k][column])
                    .sum();
                whitening[row][column] = (unit - known) / root[row][row];
            }
        }
        let is_right = (0..SHAPE).all(|i| root[i][i] > 0.0)
            && whitening
                .iter()
                .flatten()
                .chain(&mean)
                .all(|v| v.is_finite());
        is_right.then_some(Self { mean, whitening })
    }

    /// The prior of a pack's family; `None` if its numbers are not a Gaussian.
    #[must_use]
    pub fn of_pack(pack: &Pack<'_>) -> Option<Self> {
        let prior = pack.prior();
        let root = prior.root.map(|row| row.map(f64::from));
        Self::new(prior.mean.map(f64::from), &root)
    }

    /// Rows of the prior at a shape, in standard deviations.
    #[must_use]
    pub fn deviations(&self, shape: &Shape) -> Shape {
        self.whitening
            .map(|row| (0..SHAPE).map(|k| row[k] * (shape[k] - self.mean[k])).sum())
    }

    /// Writes the derivatives of the rows, times `sigma`, from row `first` on.
    pub(super) fn add_to<const BINS: usize>(
        &self,
        jacobian: &mut [[f64; BINS]],
        first: usize,
        sigma: f64,
    ) {
        for (index, column) in jacobian.iter_mut().enumerate() {
            for (row, whitening) in column[first..].iter_mut().zip(&self.whitening) {
                *row = sigma * whitening[index];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Root [[2,0,0],[1,3,0],[0,-1,0.5]]: the shape mean + root z has the deviations z.
    #[test]
    fn deviations_undo_the_root() {
        let root = [[2.0, 0.0, 0.0], [1.0, 3.0, 0.0], [0.0, -1.0, 0.5]];
        let mean = [1.0, 0.1, 0.05];
        let prior = ShapePrior::new(mean, &root).unwrap();
        let z = [0.5, -1.5, 2.0];
        let shape: Shape =
            core::array::from_fn(|i| mean[i] + (0..SHAPE).map(|k| root[i][k] * z[k]).sum::<f64>());
        for (found, expected) in prior.deviations(&shape).iter().zip(z) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
        let flat = [[1.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]];
        assert_eq!(ShapePrior::new(mean, &flat), None);
        assert_eq!(ShapePrior::new([f64::NAN; 3], &root), None);
    }
}
