//! Least squares for a few columns by modified Gram-Schmidt orthogonalisation.
//!
//! The columns are orthogonalised in order and the right-hand side last. That is as stable as Householder's
//! method, and it gives the orthonormal basis that the estimator projects onto.
//!
//! Reference: A. Bjorck, "Solving linear least squares problems by Gram-Schmidt orthogonalization", BIT 7
//! (1967).

/// `M` columns of `N` rows, of which the first `rows` are used.
#[derive(Clone, Debug)]
pub(crate) struct Columns<const M: usize, const N: usize> {
    pub(crate) column: [[f64; N]; M],
    pub(crate) rows: usize,
}

/// Upper triangular factor: `r[i][j]` is the component of column `j` along basis vector `i`.
pub(crate) type Triangle<const M: usize> = [[f64; M]; M];

/// Relative length below which the remainder of a column counts as zero (the column is a combination of those
/// before it): a few hundred roundings.
const DEPENDENT: f64 = 1e-13;

impl<const M: usize, const N: usize> Columns<M, N> {
    pub(crate) const NONE: Self = Self {
        column: [[0.0; N]; M],
        rows: 0,
    };

    /// Length of column `j`.
    pub(crate) fn length(&self, j: usize) -> f64 {
        norm(&self.column[j][..self.rows])
    }

    /// Removes the component along the unit vector in column `i` from the later column `j` and returns it.
    pub(crate) fn remove(&mut self, i: usize, j: usize) -> f64 {
        let (basis, rest) = self.column.split_at_mut(j);
        remove(&basis[i][..self.rows], &mut rest[0][..self.rows])
    }

    /// Removes the component along the unit vector in column `i` from a vector and returns it.
    pub(crate) fn remove_from(&self, i: usize, vector: &mut [f64]) -> f64 {
        remove(&self.column[i][..self.rows], vector)
    }

    /// Makes column `j` a unit vector and returns its length. A column that is negligible compared with its
    /// length `before` depends on the columns before it: it becomes zero, and so does its length.
    pub(crate) fn normalise(&mut self, j: usize, before: f64) -> f64 {
        let length = self.length(j);
        let column = &mut self.column[j][..self.rows];
        if length > DEPENDENT * before {
            column.iter_mut().for_each(|value| *value /= length);
            length
        } else {
            column.fill(0.0);
            0.0
        }
    }
}

/// Removes the component along the unit vector `q` from `vector` and returns it.
fn remove(q: &[f64], vector: &mut [f64]) -> f64 {
    let part = dot(q, vector);
    for (value, q) in vector.iter_mut().zip(q) {
        *value -= part * q;
    }
    part
}

/// Inner product, in four partial sums so that the processor need not wait for each addition.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = a4
        .remainder()
        .iter()
        .zip(b4.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a4.zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + tail
}

pub(crate) fn norm(vector: &[f64]) -> f64 {
    libm::sqrt(dot(vector, vector))
}

/// Solves `r x = right` for the first `N` rows and columns of the upper triangular `r`. A zero on the diagonal
/// gives a zero.
pub(crate) fn back_substitute<const M: usize, const N: usize>(
    r: &Triangle<M>,
    right: &[f64; N],
) -> [f64; N] {
    let mut x = [0.0; N];
    for i in (0..N).rev() {
        let known: f64 = (i + 1..N).map(|j| r[i][j] * x[j]).sum();
        x[i] = if r[i][i] == 0.0 {
            0.0
        } else {
            (right[i] - known) / r[i][i]
        };
    }
    x
}

/// Solves the symmetric positive definite system `a x = right` by Cholesky's method; `None` if `a` is not
/// positive definite.
pub(crate) fn solve_symmetric(a: &[[f64; 3]; 3], right: &[f64; 3]) -> Option<[f64; 3]> {
    let mut l = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            if i == j {
                let pivot = a[i][i] - known;
                if pivot <= 0.0 || !pivot.is_finite() {
                    return None;
                }
                l[i][i] = libm::sqrt(pivot);
            } else {
                l[i][j] = (a[i][j] - known) / l[j][j];
            }
        }
    }
    let mut y = [0.0; 3];
    for i in 0..3 {
        let known: f64 = (0..i).map(|k| l[i][k] * y[k]).sum();
        y[i] = (right[i] - known) / l[i][i];
    }
    let mut x = [0.0; 3];
    for i in (0..3).rev() {
        let known: f64 = (i + 1..3).map(|k| l[k][i] * x[k]).sum();
        x[i] = (y[i] - known) / l[i][i];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn orthonormalise<const M: usize, const N: usize>(columns: &mut Columns<M, N>) -> Triangle<M> {
        let mut r = [[0.0; M]; M];
        for j in 0..M {
            let before = columns.length(j);
            for i in 0..j {
                r[i][j] = columns.remove(i, j);
            }
            r[j][j] = columns.normalise(j, before);
        }
        r
    }

    // Fit of a + b t to 1, 3, 2, 5 at t = 0..3 by hand: b = 5.5/5 = 1.1, a = 2.75 - 1.65 = 1.1.
    #[test]
    fn straight_line_by_hand() {
        let mut columns = Columns::<2, 8> {
            rows: 4,
            ..Columns::NONE
        };
        columns.column[0][..4].fill(1.0);
        columns.column[1][..4].copy_from_slice(&[0.0, 1.0, 2.0, 3.0]);
        let r = orthonormalise(&mut columns);
        let mut y = [1.0, 3.0, 2.0, 5.0];
        let parts = [0, 1].map(|i| columns.remove_from(i, &mut y));
        let [a, b] = back_substitute(&r, &parts);
        assert!((a - 1.1).abs() < 1e-14 && (b - 1.1).abs() < 1e-14);
        // Residuals by hand: -0.1, 0.8, -1.3, 0.6; sum of squares 2.70.
        assert!((dot(&y, &y) - 2.70).abs() < 1e-13);
    }

    #[test]
    fn dependent_column_is_dropped() {
        let mut columns = Columns::<2, 4> {
            rows: 3,
            ..Columns::NONE
        };
        columns.column[0][..3].copy_from_slice(&[1.0, 2.0, 3.0]);
        columns.column[1][..3].copy_from_slice(&[2.0, 4.0, 6.0]);
        let r = orthonormalise(&mut columns);
        assert_eq!(r[1][1], 0.0);
        assert_eq!(back_substitute(&r, &[1.0, 1.0])[1], 0.0);
    }

    #[test]
    fn symmetric_system_by_hand() {
        // x = (1, -1, 2) in a = [[4,1,0],[1,3,1],[0,1,2]]: right = (3, 0, 3).
        let a = [[4.0, 1.0, 0.0], [1.0, 3.0, 1.0], [0.0, 1.0, 2.0]];
        let x = solve_symmetric(&a, &[3.0, 0.0, 3.0]).unwrap();
        for (x, expected) in x.iter().zip([1.0, -1.0, 2.0]) {
            assert!((x - expected).abs() < 1e-14);
        }
        assert!(solve_symmetric(&[[0.0; 3]; 3], &[1.0; 3]).is_none());
    }
}
