//! A network's outputs as a density: a Gaussian of any dimension.
//!
//! ```text
//! outputs of a Gaussian of dimension D:
//!     mu_1 .. mu_D,  l_1 .. l_D,  L_21, L_31, L_32, L_41, ..       D + D + D (D - 1) / 2 numbers
//! precision = L L^T,   L_ii = exp(l_i),   w = L^T (y - mu)
//!
//! -ln N(y) = D/2 ln(2 pi) - sum_i l_i + w^T w / 2
//! d/dmu = -L w,   d/dl_i = w_i (y - mu)_i L_ii - 1,   d/dL_ij = w_j (y - mu)_i
//! ```
//!
//! The outputs hold the factor of the precision, not of the covariance, which avoids divisions.
//! Reference: P. M. Williams, "Using neural networks to model conditional multivariate densities", Neural
//! Computation 8 (1996).

use std::f64::consts::TAU;

/// A Gaussian from the outputs of a network: for dimension `D` the mean, the logarithms of the diagonal
/// of `L`, then the elements below the diagonal row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussian {
    /// Mean, `D` numbers.
    pub mean: Vec<f64>,
    /// `L` with `precision = L L^T`: lower triangular, row by row, `D x D` numbers.
    pub factor: Vec<f64>,
}

impl Gaussian {
    /// Number of outputs for this dimension.
    #[must_use]
    pub fn outputs(dimension: usize) -> usize {
        2 * dimension + dimension * dimension.saturating_sub(1) / 2
    }

    /// A Gaussian from outputs; `None` if the number of outputs is not that of this dimension.
    #[must_use]
    pub fn from_outputs(dimension: usize, outputs: &[f32]) -> Option<Self> {
        (outputs.len() == Self::outputs(dimension)).then(|| Self {
            mean: outputs[..dimension]
                .iter()
                .copied()
                .map(f64::from)
                .collect(),
            factor: (0..dimension * dimension)
                .map(|ij| factor(dimension, outputs, ij / dimension, ij % dimension))
                .collect(),
        })
    }

    /// `-ln N(y)`; `y` has as many numbers as the mean.
    #[must_use]
    pub fn negative_log_likelihood(&self, y: &[f64]) -> f64 {
        let dimension = self.mean.len();
        let mut sum = 0.5 * dimension as f64 * TAU.ln();
        for j in 0..dimension {
            let w: f64 = (j..dimension)
                .map(|i| self.factor[i * dimension + j] * (y[i] - self.mean[i]))
                .sum();
            sum += 0.5 * w * w - self.factor[j * dimension + j].ln();
        }
        sum
    }
}

/// Element `(i, j)` of the factor.
fn factor(dimension: usize, outputs: &[f32], i: usize, j: usize) -> f64 {
    match i.cmp(&j) {
        std::cmp::Ordering::Less => 0.0,
        std::cmp::Ordering::Equal => f64::from(outputs[dimension + i]).exp(),
        std::cmp::Ordering::Greater => f64::from(outputs[below(dimension, i, j)]),
    }
}

/// Index of `L_ij` below the diagonal among the outputs.
fn below(dimension: usize, i: usize, j: usize) -> usize {
    2 * dimension + i * (i - 1) / 2 + j
}

/// `-ln N(y)` and its derivatives with respect to the outputs.
pub(super) fn gaussian(outputs: &[f32], y: &[f32], gradient: &mut [f64]) -> f64 {
    let dimension = y.len();
    let off = |i: usize| f64::from(y[i]) - f64::from(outputs[i]);
    gradient[..dimension].fill(0.0);
    let mut loss = 0.5 * dimension as f64 * TAU.ln();
    for j in 0..dimension {
        let diagonal = factor(dimension, outputs, j, j);
        let w = (j + 1..dimension).fold(diagonal * off(j), |w, i| {
            w + factor(dimension, outputs, i, j) * off(i)
        });
        loss += 0.5 * w * w - f64::from(outputs[dimension + j]);
        gradient[j] -= diagonal * w;
        gradient[dimension + j] = w * off(j) * diagonal - 1.0;
        for i in j + 1..dimension {
            gradient[i] -= factor(dimension, outputs, i, j) * w;
            gradient[below(dimension, i, j)] = w * off(i);
        }
    }
    loss
}

/// `w (sqrt(1 + (e / c)^2) - 1)`, `e = g . (mu - y)`, of `(y, g)` and `(w, c)`; its derivatives with
/// respect to the mean, `w e / c^2 / sqrt(1 + (e / c)^2) g`, are added.
pub(super) fn cost_of_mean(
    outputs: &[f32],
    (y, slopes): (&[f32], &[f32]),
    (weight, scale): (f64, f64),
    gradient: &mut [f64],
) -> f64 {
    let errors = outputs.iter().zip(y);
    let cost: f64 = (errors.zip(slopes))
        .map(|((mean, y), slope)| (f64::from(*mean) - f64::from(*y)) * f64::from(*slope))
        .sum();
    let by_scale = cost / scale;
    let length = 1.0_f64.hypot(by_scale);
    for (to, slope) in gradient.iter_mut().zip(slopes) {
        *to += weight * by_scale / (scale * length) * f64::from(*slope);
    }
    weight * (length - 1.0)
}
