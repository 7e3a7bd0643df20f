//! Disturbances of a process: random walk, white noise and gusts at its input, random walk of its measured output.
//!
//! ```text
//! body input = lagged input + b + g + n0,    db/dt = n1,    dg/dt = -g/T + n2
//! measured output = output + e,              de/dt = ny
//! ```
//!
//! `n0`, `n1`, `n2` and `ny` are white. `b`, `g` and `n0` are in input units and enter where the actuator lags end: wind
//! acts on the body, not on the motor. The gusts `g` have the spectrum of the Dryden model (MIL-F-8785C) along the flight
//! path.
//!
//! An estimator gives intensities relative to the white measurement noise of variance `r` per sample of `dt` seconds, as
//! bandwidths `w1`, `w0`, `wy`: with `m` states behind the actuator lags and gain `kappa`,
//!
//! ```text
//! kappa^2 intensity(n1) = r dt w1^(2 m + 2),    kappa^2 intensity(n0) = r dt w0^(2 m),    intensity(ny) = r dt wy^2
//! ```

use onecycle_design::Linear;
use onecycle_design::matrix::Matrix;

use crate::NoiseSource;

/// Disturbances of a process. The default is none. Symbols: [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Disturbances {
    /// Standard deviation, after one second, of the random walk `b` added to the input (input unit).
    pub input_walk: f64,
    /// White noise `n0` added to the input: standard deviation of its average over one second (input unit).
    pub input_white: f64,
    /// Random walk `e` of the measured output: its standard deviation after one second (output unit).
    pub output_walk: f64,
    /// Gusts `g`: their standard deviation (input unit).
    pub gust_sigma: f64,
    /// Correlation time `T` of the gusts (s): their length over the airspeed. Not used if `gust_sigma` is zero.
    pub gust_correlation_s: f64,
}

/// Bandwidths of disturbances relative to the measurement noise (rad/s): below them the disturbance is stronger. Zero:
/// none. Symbols: [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Bandwidths {
    /// `w1`: random walk at the input.
    pub w1_rad_per_s: f64,
    /// `w0`: white noise at the input.
    pub w0_rad_per_s: f64,
    /// `wy`: random walk of the measured output.
    pub wy_rad_per_s: f64,
}

impl Disturbances {
    /// The same disturbances with gusts of this standard deviation (input unit) and correlation time (s).
    #[must_use]
    pub fn with_gusts(self, gust_sigma: f64, gust_correlation_s: f64) -> Self {
        Self {
            gust_sigma,
            gust_correlation_s,
            ..self
        }
    }

    /// The same disturbances with a random walk at the input that has this standard deviation after one second.
    #[must_use]
    pub fn with_input_walk(self, input_walk: f64) -> Self {
        Self { input_walk, ..self }
    }

    /// The same disturbances with white noise at the input whose mean over one second has this standard deviation.
    #[must_use]
    pub fn with_input_white(self, input_white: f64) -> Self {
        Self {
            input_white,
            ..self
        }
    }

    /// The same disturbances with a random walk of the measured output that has this standard deviation after one
    /// second.
    #[must_use]
    pub fn with_output_walk(self, output_walk: f64) -> Self {
        Self {
            output_walk,
            ..self
        }
    }

    /// Disturbances of `process` with these bandwidths, beside measurement noise of standard deviation `noise_sigma`
    /// (output unit) at every `sample_s` (s).
    #[must_use]
    pub fn from_bandwidths(
        bandwidths: &Bandwidths,
        process: &Linear,
        noise_sigma: f64,
        sample_s: f64,
    ) -> Self {
        let order = behind_the_lags(process);
        let noise = noise_sigma * sample_s.sqrt();
        let input_noise = noise / process.gain().abs();
        let white = |w: f64, order: i32| if w > 0.0 { w.powi(order) } else { 0.0 };
        Self {
            input_walk: input_noise * white(bandwidths.w1_rad_per_s, order + 1),
            input_white: input_noise * white(bandwidths.w0_rad_per_s, order),
            output_walk: noise * bandwidths.wy_rad_per_s,
            ..Self::default()
        }
    }

    /// Bandwidths of the random walks and the white noise; the inverse of [`Self::from_bandwidths`]. `None` without
    /// measurement noise.
    #[must_use]
    pub fn bandwidths(
        &self,
        process: &Linear,
        noise_sigma: f64,
        sample_s: f64,
    ) -> Option<Bandwidths> {
        let order = f64::from(behind_the_lags(process));
        let noise = noise_sigma * sample_s.sqrt();
        let per_noise = process.gain().abs() / noise;
        (noise > 0.0).then(|| Bandwidths {
            w1_rad_per_s: (self.input_walk * per_noise).powf(1.0 / (order + 1.0)),
            w0_rad_per_s: (self.input_white * per_noise).powf(1.0 / order),
            wy_rad_per_s: self.output_walk / noise,
        })
    }

    /// Whether there is no disturbance.
    #[must_use]
    pub fn is_none(&self) -> bool {
        let sum = self.input_walk + self.input_white + self.output_walk + self.gust_sigma;
        sum == 0.0
    }
}

fn behind_the_lags(process: &Linear) -> i32 {
    process.structure().stages().behind_the_lags() as i32
}

/// Lower triangular root of a covariance: random numbers with that covariance.
#[derive(Clone, Debug)]
pub(crate) struct Root<const N: usize> {
    root: Matrix<N>,
    /// Columns that are not zero: each takes one random number.
    columns: Vec<usize>,
}

impl<const N: usize> Root<N> {
    /// Cholesky factor of a positive semidefinite matrix. A pivot that is only rounding error counts as zero.
    pub(crate) fn of(covariance: &Matrix<N>) -> Self {
        let mut root = [[0.0; N]; N];
        let mut columns = Vec::new();
        for j in 0..N {
            let explained: f64 = root[j].iter().map(|v: &f64| v * v).sum();
            let pivot = covariance[j][j] - explained;
            if pivot <= ROUNDING * covariance[j][j] {
                continue;
            }
            columns.push(j);
            root[j][j] = pivot.sqrt();
            for i in j + 1..N {
                let explained: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
                root[i][j] = (covariance[i][j] - explained) / root[j][j];
            }
        }
        Self { root, columns }
    }

    /// Adds a random vector with the covariance to `x`.
    #[inline]
    pub(crate) fn add_to(&self, x: &mut [f64; N], noise: &mut impl NoiseSource) {
        for &j in &self.columns {
            let number = noise.standard_normal();
            for i in j..N {
                x[i] += self.root[i][j] * number;
            }
        }
    }
}

/// Rounding error of a covariance relative to its diagonal. A true pivot is larger: that of the last of `n` integrators in a
/// chain is `1 / binomial(2 n - 2, n - 1)^2` of its diagonal (Hilbert matrix), 1/400 for four.
const ROUNDING: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;

    // By hand: [[4, 2, 2], [2, 1, 1], [2, 1, 5]] has rank 2 and the root [[2, 0, 0], [1, 0, 0], [1, 0, 2]].
    #[test]
    fn root_of_a_semidefinite_matrix_by_hand() {
        let root = Root::of(&[[4.0, 2.0, 2.0], [2.0, 1.0, 1.0], [2.0, 1.0, 5.0]]);
        assert_eq!(root.columns, [0, 2]);
        assert_eq!(
            root.root,
            [[2.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 2.0]]
        );
    }
}
