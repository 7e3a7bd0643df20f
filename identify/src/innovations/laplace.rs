//! Gaussian approximation of the posterior about a best point.
//!
//! ```text
//! cov theta = (J'J)^-1 |rho|^2 / m,      var kappa = var(kappa | theta) + k' cov(theta) k,   k = d kappa / d theta
//! ```
//!
//! with the residual `rho` and its Jacobian `J` by central differences. Unknowns at a bound, and lags and negative dead times that
//! the samples do not show, are taken as known. Lags that are nearly equal have the coordinates of [`NearLags`].

use onecycle_design::matrix::inverse_of_positive;

use super::descent::Found;
use super::likelihood::{Memory, evaluate};
use super::near_lags::NearLags;
use super::orthogonal::dot;
use super::record::Blocks;
use super::theta::{Bounds, MOST, Theta};

/// Deviation of the logarithm of a lag below a sample from which the samples do not show the lag: it may be anything down to
/// zero, and the likelihood is no parabola.
const HIDDEN: f64 = 0.5;

/// Covariance of the unknowns.
#[derive(Clone, Debug)]
pub(super) struct Laplace {
    /// Indices of the unknowns, in the order of rows and columns.
    pub(super) free: Vec<usize>,
    pub(super) covariance: Vec<Vec<f64>>,
    /// Unknowns that are not their own coordinates.
    pub(super) near: NearLags,
    /// Derivatives of the gain and of the disturbance at the first block, both times [`NearLags::symmetric`].
    pub(super) slopes: Vec<[f64; 2]>,
    /// Factor on the standard deviation of each unknown if the residual is not white: square root of the ratio of the
    /// sandwich estimator's variance (Newey and West's weights) to the plain one.
    pub(super) coloured: Vec<f64>,
    /// Box of the search.
    pub(super) bounds: Bounds,
}

impl Laplace {
    /// At `found`. Unknowns of which `free` has no entry are fixed; `near`: those that are nearly equal lags. `None` if the
    /// unknowns have no joint maximum.
    pub(super) fn new(
        blocks: &Blocks<'_>,
        found: &Found,
        (free, near): (&[usize], &NearLags),
        bounds: &Bounds,
    ) -> Option<Self> {
        let inside = |index: &usize| !bounds.is_at_edge(&found.theta, *index);
        let free: Vec<usize> = free.iter().copied().filter(inside).collect();
        let near = near.within(&free);
        let mut memory = Memory::default();
        let mut columns = Vec::with_capacity(free.len());
        let mut slopes = Vec::with_capacity(free.len());
        for &index in &free {
            // Forward differences use a tenth of this step.
            let (ends, span) = near.ends(&found.theta, index, 10.0 * bounds.step[index]);
            let mut at = |theta: &Theta| evaluate(blocks, theta, &mut memory);
            let (below, above) = (at(&ends[0])?, at(&ends[1])?);
            let [low, high] = [&below, &above].map(|at| at.residual_near(&found.at));
            let residuals = high.iter().zip(&low);
            columns.push(residuals.map(|(a, b)| (a - b) / span).collect::<Vec<f64>>());
            let [after, before] = [(&above, &ends[1]), (&below, &ends[0])].map(|(at, theta)| {
                let disturbance = at.state[at.state.len() - 1];
                [at.gain, disturbance].map(|value| near.symmetric(theta) * value)
            });
            slopes.push([0, 1].map(|k| (after[k] - before[k]) / span));
        }
        let information: Vec<Vec<f64>> = (columns.iter())
            .map(|a| columns.iter().map(|b| dot(a, b)).collect())
            .collect();
        let inverse = inverse_of_positive(&information)?;
        // Of the innovations, at the scale of the residual.
        let factor = found.at.residual_variance();
        let covariance: Vec<Vec<f64>> = (inverse.iter())
            .map(|row| row.iter().map(|v| v * factor).collect())
            .collect();
        let tau = found.theta.layout().tau();
        let hidden = (0..free.len()).find(|&slot| {
            let (index, variance) = (free[slot], covariance[slot][slot]);
            if index == tau {
                // Before the first row a response may begin at any time.
                let range = bounds.high[tau] - bounds.low[tau];
                return found.theta.tau_s() <= 0.0 && variance > range * range;
            }
            found.theta.is_lag_below(index, blocks.record.dt_s) && variance > HIDDEN * HIDDEN
        });
        if let Some(slot) = hidden {
            let mut others = free;
            others.remove(slot);
            return Self::new(blocks, found, (&others, &near), bounds);
        }
        let coloured = coloured(
            &columns,
            &found.at.residual_near(&found.at),
            &inverse,
            factor,
        );
        Some(Self {
            free,
            covariance,
            near,
            slopes,
            coloured,
            bounds: *bounds,
        })
    }

    /// Relative standard deviation of the gain; where lags are nearly equal, of the gain times their [`NearLags::symmetric`].
    pub(super) fn gain_deviation(&self, found: &Found) -> f64 {
        let (at, symmetric) = (&found.at, self.near.symmetric(&found.theta));
        let n = self.free.len();
        // That of the gain times the factor of the pole, less that of the factor.
        let slope = |i: usize| {
            let of_factor = self.near.slope_of_alone(&found.theta, self.free[i]);
            self.slopes[i][0] - symmetric * at.gain * of_factor
        };
        let through: f64 = (0..n * n)
            .map(|k| slope(k / n) * self.covariance[k / n][k % n] * slope(k % n))
            .sum();
        let own = at.gain_factor * at.variance;
        (own + through / (symmetric * symmetric)).sqrt() / at.gain.abs()
    }

    /// `ln det(covariance) / 2`.
    pub(super) fn half_log_determinant(&self) -> f64 {
        // Of the inverse's Cholesky factor: by elimination without pivots on a scaled copy.
        let n = self.free.len();
        let mut a = self.covariance.clone();
        let mut sum = 0.0;
        for i in 0..n {
            sum += 0.5 * a[i][i].max(f64::MIN_POSITIVE).ln();
            for j in i + 1..n {
                let factor = a[j][i] / a[i][i];
                for k in i..n {
                    a[j][k] -= factor * a[i][k];
                }
            }
        }
        sum
    }
}

/// Ratios of the standard deviations of the sandwich estimator to the plain ones.
fn coloured(columns: &[Vec<f64>], residual: &[f64], inverse: &[Vec<f64>], factor: f64) -> Vec<f64> {
    let n = columns.len();
    let rows = residual.len();
    let lags = (rows / 20).min((4.0 * (rows as f64).cbrt()) as usize);
    let scores: Vec<Vec<f64>> = (columns.iter())
        .map(|column| column.iter().zip(residual).map(|(j, r)| j * r).collect())
        .collect();
    let mut meat = vec![[0.0; MOST]; n];
    for i in 0..n {
        for j in 0..n {
            let at = |lag: usize| dot(&scores[i][lag..], &scores[j][..rows - lag]);
            let weighted = (1..=lags).map(|lag| {
                let weight = 1.0 - lag as f64 / (lags + 1) as f64;
                weight * (at(lag) + dot(&scores[j][lag..], &scores[i][..rows - lag]))
            });
            meat[i][j] = at(0) + weighted.sum::<f64>();
        }
    }
    let variance = |i: usize| -> f64 {
        let pair = |k: usize| inverse[i][k / n] * meat[k / n][k % n] * inverse[k % n][i];
        (0..n * n).map(pair).sum()
    };
    (0..n)
        .map(|i| (variance(i).max(0.0) / (inverse[i][i] * factor)).sqrt())
        .collect()
}
