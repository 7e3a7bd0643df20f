//! Step of the search: Levenberg-Marquardt with box constraints and Marquardt's scaling.

use super::domain::{HIGHEST, LOWEST, Shape};
use crate::least_squares::{dot, solve_symmetric};

/// Gradient and approximate Hessian of the sum of squares in the free coordinates.
#[derive(Clone, Copy)]
pub(super) struct NormalEquations {
    curvature: [[f64; 3]; 3],
    gradient: [f64; 3],
    free: [bool; 3],
}

impl NormalEquations {
    /// All zeros: memory before the first use.
    pub(super) const NONE: Self = Self {
        curvature: [[0.0; 3]; 3],
        gradient: [0.0; 3],
        free: [false; 3],
    };

    /// From the columns of derivatives and the residual; its length is the number of rows used.
    pub(super) fn new<const BINS: usize>(
        jacobian: &[[f64; BINS]],
        residual: &[f64],
        shape: &Shape,
    ) -> Self {
        let column = |i: usize| &jacobian[i][..residual.len()];
        let mut this = Self::NONE;
        for i in 0..3 {
            this.gradient[i] = dot(column(i), residual);
            let outwards = (shape[i] <= LOWEST[i] && this.gradient[i] < 0.0)
                || (shape[i] >= HIGHEST[i] && this.gradient[i] > 0.0);
            this.free[i] = !outwards;
            for j in 0..3 {
                this.curvature[i][j] = dot(column(i), column(j));
            }
        }
        this
    }

    /// Shape after a damped step of the free coordinates (Marquardt's scaling).
    pub(super) fn step(&self, shape: &Shape, damping: f64) -> Shape {
        let mut matrix = self.curvature;
        let mut right = self.gradient;
        for i in 0..3 {
            matrix[i][i] += damping * self.curvature[i][i] + f64::MIN_POSITIVE;
            if !self.free[i] {
                for j in 0..3 {
                    matrix[i][j] = 0.0;
                    matrix[j][i] = 0.0;
                }
                matrix[i][i] = 1.0;
                right[i] = 0.0;
            }
        }
        let step = solve_symmetric(&matrix, &right).unwrap_or([0.0; 3]);
        [shape[0] + step[0], shape[1] + step[1], shape[2] + step[2]]
    }

    pub(super) fn step_is_negligible(&self, damping: f64) -> bool {
        let moved = self.step(&[0.0; 3], damping);
        moved.iter().all(|step| step.abs() < 1e-12)
    }
}
