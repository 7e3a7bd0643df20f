//! Small dense matrices, by rows: products, inverses and roots of a fixed or a given size.

/// Square matrix, by rows.
pub type Matrix<const N: usize> = [[f64; N]; N];

/// Identity matrix.
#[must_use]
pub fn identity<const N: usize>() -> Matrix<N> {
    let mut matrix = [[0.0; N]; N];
    for i in 0..N {
        matrix[i][i] = 1.0;
    }
    matrix
}

/// `A B`.
#[must_use]
pub fn product<const N: usize>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    let mut out = [[0.0; N]; N];
    for i in 0..N {
        for k in 0..N {
            for j in 0..N {
                out[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    out
}

/// `A x`.
#[must_use]
pub fn times<const N: usize>(a: &Matrix<N>, x: &[f64; N]) -> [f64; N] {
    let mut out = [0.0; N];
    for i in 0..N {
        for k in 0..N {
            out[i] += a[i][k] * x[k];
        }
    }
    out
}

/// `A X A'` for a symmetric `X`, symmetric to the last bit.
#[must_use]
pub fn congruent<const N: usize>(a: &Matrix<N>, x: &Matrix<N>) -> Matrix<N> {
    let left = product(a, x);
    let mut out = [[0.0; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let sum = (0..N).map(|k| left[i][k] * a[j][k]).sum();
            out[i][j] = sum;
            out[j][i] = sum;
        }
    }
    out
}

/// `A += B`.
pub fn add<const N: usize>(a: &mut Matrix<N>, b: &Matrix<N>) {
    for i in 0..N {
        for j in 0..N {
            a[i][j] += b[i][j];
        }
    }
}

/// Inverse by elimination with row pivots. `None` if the matrix is singular or not finite.
#[must_use]
pub fn inverse<const N: usize>(mut a: Matrix<N>) -> Option<Matrix<N>> {
    let mut out = identity();
    for column in 0..N {
        let pivot =
            (column..N).max_by(|&i, &j| a[i][column].abs().total_cmp(&a[j][column].abs()))?;
        a.swap(column, pivot);
        out.swap(column, pivot);
        let scale = 1.0 / a[column][column];
        if !scale.is_finite() {
            return None;
        }
        for j in 0..N {
            a[column][j] *= scale;
            out[column][j] *= scale;
        }
        for i in 0..N {
            if i != column {
                let factor = a[i][column];
                for j in 0..N {
                    a[i][j] -= factor * a[column][j];
                    out[i][j] -= factor * out[column][j];
                }
            }
        }
    }
    Some(out)
}

/// Lower triangular `L` with `L L^T = covariance`. `None` if the matrix is not positive semidefinite.
///
/// A variance of zero (a recording without noise) gives a zero column. Rounding may make a pivot negative by 1e-9 of
/// the variance.
#[must_use]
pub fn cholesky<const N: usize>(covariance: &Matrix<N>) -> Option<Matrix<N>> {
    let mut root = [[0.0; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
            let rest = covariance[i][j] - known;
            if i == j {
                if rest < -1e-9 * covariance[i][i] || !rest.is_finite() {
                    return None;
                }
                root[i][i] = rest.max(0.0).sqrt();
            } else {
                root[i][j] = if root[j][j] > 0.0 {
                    rest / root[j][j]
                } else {
                    0.0
                };
            }
        }
    }
    Some(root)
}

/// Solution of linear equations, the right side as the last column. `None` if they are singular.
#[must_use]
pub fn solve(mut matrix: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let n = matrix.len();
    for column in 0..n {
        let pivot = (column..n)
            .max_by(|&a, &b| matrix[a][column].abs().total_cmp(&matrix[b][column].abs()))?;
        matrix.swap(column, pivot);
        let lead = matrix[column].clone();
        if lead[column].abs() < 1e-12 || !lead[column].is_finite() {
            return None;
        }
        for row in (0..n).filter(|row| *row != column) {
            let factor = matrix[row][column] / lead[column];
            for j in column..=n {
                matrix[row][j] -= factor * lead[j];
            }
        }
    }
    Some((0..n).map(|i| matrix[i][n] / matrix[i][i]).collect())
}

/// Inverse of a symmetric positive definite matrix by Cholesky's decomposition, scaled to a unit diagonal. `None` if it is not
/// positive definite.
#[must_use]
pub fn inverse_of_positive(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = matrix.len();
    let scale: Vec<f64> = (0..n).map(|i| 1.0 / matrix[i][i].sqrt()).collect();
    // L of the scaled matrix, then its inverse, row by row.
    let mut l = vec![vec![0.0; n]; n];
    let mut inverse_l = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let rest = matrix[i][j] * scale[i] * scale[j] - sum;
            if i > j {
                l[i][j] = rest / l[j][j];
            } else if rest > 1e-14 {
                l[i][i] = rest.sqrt();
            } else {
                return None;
            }
        }
        inverse_l[i][i] = 1.0 / l[i][i];
        for j in 0..i {
            let sum: f64 = (j..i).map(|k| l[i][k] * inverse_l[k][j]).sum();
            inverse_l[i][j] = -sum / l[i][i];
        }
    }
    let entry = |i: usize, j: usize| {
        let sum: f64 = (i.max(j)..n)
            .map(|k| inverse_l[k][i] * inverse_l[k][j])
            .sum();
        sum * scale[i] * scale[j]
    };
    Some(
        (0..n)
            .map(|i| (0..n).map(|j| entry(i, j)).collect())
            .collect(),
    )
}

/// Solution of a system with a symmetric positive definite matrix. `None` if it is not positive definite.
#[must_use]
pub fn solve_positive(matrix: &[Vec<f64>], right: &[f64]) -> Option<Vec<f64>> {
    let inverse = inverse_of_positive(matrix)?;
    let row = |row: &Vec<f64>| row.iter().zip(right).map(|(a, b)| a * b).sum();
    Some(inverse.iter().map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    // Hilbert's matrix of three has the inverse [[9, -36, 30], [-36, 192, -180], [30, -180, 180]].
    #[test]
    fn inverses_of_a_known_matrix() {
        let of = |i: usize, j: usize| 1.0 / (i + j + 1) as f64;
        let fixed: Matrix<3> = std::array::from_fn(|i| std::array::from_fn(|j| of(i, j)));
        let rows: Vec<Vec<f64>> = fixed.iter().map(|row| row.to_vec()).collect();
        let exact = [
            [9.0, -36.0, 30.0],
            [-36.0, 192.0, -180.0],
            [30.0, -180.0, 180.0],
        ];
        let (by_pivots, by_root) = (inverse(fixed), inverse_of_positive(&rows));
        let (by_pivots, by_root) = (by_pivots.unwrap(), by_root.unwrap());
        for i in 0..3 {
            for j in 0..3 {
                assert!((by_pivots[i][j] - exact[i][j]).abs() < 1e-10);
                assert!((by_root[i][j] - exact[i][j]).abs() < 1e-10);
            }
        }
        let right = [1.0, 0.0, 0.0];
        let augmented = (rows.iter().zip(right)).map(|(row, b)| [row.as_slice(), &[b]].concat());
        let solved = [solve(augmented.collect()), solve_positive(&rows, &right)];
        for x in solved.map(Option::unwrap) {
            assert!(
                x.iter().zip(exact[0]).all(|(x, e)| (x - e).abs() < 1e-10),
                "{x:?}"
            );
        }
    }

    #[test]
    fn singular_and_indefinite_matrices_have_no_inverse() {
        assert_eq!(inverse([[1.0, 2.0], [2.0, 4.0]]), None);
        assert_eq!(inverse_of_positive(&[vec![1.0, 2.0], vec![2.0, 1.0]]), None);
        assert_eq!(cholesky(&[[1.0, 2.0], [2.0, 1.0]]), None);
        assert_eq!(solve(vec![vec![1.0, 2.0, 1.0], vec![2.0, 4.0, 1.0]]), None);
    }
}
