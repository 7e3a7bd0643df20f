//! Normal equations of a few linear unknowns, by Cholesky's decomposition.
//!
//! The columns are scaled to unit length. The decomposition squares their condition, so it is refused where a column is
//! nearly a combination of those before it: [`Orthogonal`](super::orthogonal::Orthogonal) is exact there, but slower.

/// Most unknowns.
pub(super) const MOST: usize = 8;
/// Least square of the part of a scaled column that is its own. With rounding of 1e-15 in the products, the logarithm of
/// the determinant is then right to 1e-8, and the residual, whose length is at its least, to the square of that.
const LEAST: f64 = 1e-7;

/// Products of columns. Entries above the diagonal are not used.
#[derive(Clone, Copy, Debug)]
pub(super) struct Normal {
    pub(super) count: usize,
    pub(super) products: [[f64; MOST]; MOST],
}

/// Triangular root of the scaled products: `X'X = D L L' D`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Root {
    count: usize,
    l: [[f64; MOST]; MOST],
    scale: [f64; MOST],
}

impl Normal {
    pub(super) fn new(count: usize) -> Self {
        Self {
            count,
            products: [[0.0; MOST]; MOST],
        }
    }

    /// `None` if a column is zero, not finite, or nearly a combination of those before it.
    pub(super) fn root(&self) -> Option<Root> {
        let mut root = Root {
            count: self.count,
            l: [[0.0; MOST]; MOST],
            scale: [1.0; MOST],
        };
        for i in 0..self.count {
            root.scale[i] = self.products[i][i].sqrt();
            let factor = 1.0 / root.scale[i];
            if !(factor.is_finite() && factor > 0.0) {
                return None;
            }
            for j in 0..=i {
                let mut rest = self.products[i][j] * factor / root.scale[j];
                for k in 0..j {
                    rest -= root.l[i][k] * root.l[j][k];
                }
                root.l[i][j] = if i > j {
                    rest / root.l[j][j]
                } else if rest > LEAST {
                    rest.sqrt()
                } else {
                    return None;
                };
            }
        }
        Some(root)
    }
}

impl Root {
    /// `ln|X'X| / 2`.
    pub(super) fn log_determinant(&self) -> f64 {
        (0..self.count)
            .map(|i| (self.l[i][i] * self.scale[i]).ln())
            .sum()
    }

    /// Solution of `X'X x = right`.
    pub(super) fn solve(&self, right: &[f64; MOST]) -> [f64; MOST] {
        let mut x = *right;
        for i in 0..self.count {
            x[i] /= self.scale[i];
            for k in 0..i {
                x[i] -= self.l[i][k] * x[k];
            }
            x[i] /= self.l[i][i];
        }
        for i in (0..self.count).rev() {
            for k in i + 1..self.count {
                x[i] -= self.l[k][i] * x[k];
            }
            x[i] /= self.l[i][i];
        }
        for i in 0..self.count {
            x[i] /= self.scale[i];
        }
        x
    }

    /// The rows and columns `which` of `(X'X)^-1`.
    pub(super) fn covariance<const M: usize>(&self, which: &[usize; M]) -> [[f64; M]; M] {
        which.map(|i| {
            let mut unit = [0.0; MOST];
            unit[i] = 1.0;
            let column = self.solve(&unit);
            which.map(|j| column[j])
        })
    }
}
