//! Regularised least squares: the minimum of `|y - A x|^2 + |x|^2`, which is `|y|^2 - b^T (A^T A + 1)^-1 b` with
//! `b = A^T y`, by Cholesky factorisation, some rows per slice.

use libm::sqrt;

use super::{COLUMNS, ROWS, Rows};
use crate::pack::VALUES;

/// Inner products per slice; a row that has begun is completed.
const PRODUCTS: usize = 16;

#[derive(Clone, Copy, Debug)]
pub(super) struct Explained {
    /// Right-hand side `y`.
    left: Rows,
    factor: [[f64; COLUMNS]; COLUMNS],
    forward: [f64; COLUMNS],
    /// Number of rows of the factor computed.
    rows: usize,
    /// Solution `x`.
    x: [f64; COLUMNS],
}

impl Explained {
    pub(super) const NONE: Self = Self {
        left: [0.0; ROWS],
        factor: [[0.0; COLUMNS]; COLUMNS],
        forward: [0.0; COLUMNS],
        rows: 0,
        x: [0.0; COLUMNS],
    };

    pub(super) fn begin(&mut self, left: Rows) {
        self.left = left;
        self.rows = 0;
    }

    /// Does one slice; returns the minimum after the last.
    pub(super) fn advance(&mut self, columns: &[Rows; COLUMNS]) -> Option<f64> {
        let mut products = 0;
        while self.rows < COLUMNS {
            self.add_row(self.rows, columns);
            products += self.rows + 2;
            self.rows += 1;
            if products >= PRODUCTS {
                return None;
            }
        }
        let explained: f64 = self.forward.iter().map(|value| value * value).sum();
        self.x = self.forward;
        for i in (0..COLUMNS).rev() {
            let known: f64 = (i + 1..COLUMNS)
                .map(|k| self.factor[k][i] * self.x[k])
                .sum();
            self.x[i] = (self.forward[i] - known) / self.factor[i][i];
        }
        Some(dot(&self.left, &self.left) - explained)
    }

    fn add_row(&mut self, i: usize, columns: &[Rows; COLUMNS]) {
        let factor = &mut self.factor;
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = dot(&columns[i], &columns[j]) - known;
            factor[i][j] = if i == j {
                sqrt(rest + 1.0)
            } else {
                rest / factor[j][j]
            };
        }
        let known: f64 = (0..i).map(|k| factor[i][k] * self.forward[k]).sum();
        self.forward[i] = (dot(&columns[i], &self.left) - known) / factor[i][i];
    }

    /// The values at the minimum.
    pub(super) fn values(&self) -> [f64; VALUES] {
        core::array::from_fn(|k| self.x[k])
    }
}

pub(super) fn dot(a: &Rows, b: &Rows) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
