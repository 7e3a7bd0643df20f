//! Cholesky factor of a covariance matrix.

/// Lower triangular `L` with `L L^T = covariance`. `None` if the matrix is not positive semidefinite.
///
/// A variance of zero (a recording without noise) gives a zero column. Rounding may make a pivot negative by 1e-9 of
/// the variance.
#[must_use]
pub fn cholesky<const N: usize>(covariance: &[[f64; N]; N]) -> Option<[[f64; N]; N]> {
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
