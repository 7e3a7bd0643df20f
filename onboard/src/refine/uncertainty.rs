//! How well the process is known: from the noise, and from what the model cannot be.
//!
//! To first order a disturbance `d` of the fitted rows moves the unknowns by `R^-1 Q^T d` and
//! leaves `d - Q Q^T d` in the residual, with `Q R` the derivatives of the model by all unknowns.
//!
//! White noise gives the usual covariance. A process that is not quite of this kind errs by some
//! part `e` of its response at each harmonic of the oscillation. The unknowns take up nearly all of
//! that at the large low harmonics, so the residual shows next to nothing of it: `e` is found from
//! the little that is left at each harmonic, by maximum likelihood, and its full effect on the
//! unknowns added. An even harmonic that a symmetric relay does not excite is measured against its
//! neighbours: what is found there is distortion. What else is in the residual and is not white counts by its degrees of freedom.

use core::f64::consts::TAU;

use libm::{cos, log, sin};

use super::{ALL, Estimator, KNOWN, LINEAR, LinearFit, Shape, coordinate};
use crate::least_squares::{Columns, Triangle, back_substitute, dot};

/// Harmonics that are looked at; beyond them a relay oscillation has less than 1/1000 of its
/// amplitude.
const HARMONICS: usize = 9;
/// Part of a harmonic that must be left in the residual for it to tell anything.
const LEAST_LEFT: f64 = 1e-4;
/// Gain in log likelihood that makes an error of the model more than chance (1 % of white noises).
const SIGNIFICANT: f64 = 2.7;
/// Relative errors of the response that are tried: from 1e-5 to 1, twelve a decade.
const TRIED: usize = 61;

impl<const BINS: usize, const EDGES: usize> Estimator<'_, BINS, EDGES> {
    /// The derivatives of the fitted model by all unknowns, orthonormalised, into `tangent`.
    fn tangent(
        &self,
        shape: &Shape,
        fit: &LinearFit<BINS>,
        tangent: &mut Tangent<'_, BINS>,
    ) -> Option<()> {
        for (row, known) in tangent.triangle.iter_mut().zip(&fit.triangle) {
            row[..LINEAR].copy_from_slice(known);
        }
        let (linear, by_shape) = tangent.basis.column.split_at_mut(LINEAR);
        linear.copy_from_slice(&fit.basis.column);
        self.jacobian(shape, &fit.coefficients, by_shape)?;
        tangent
            .basis
            .orthonormalise_from(LINEAR, &mut tangent.triangle);
        Some(())
    }

    /// Covariance of the coordinates, and relative error of the response.
    #[inline(never)]
    pub(super) fn covariance(
        &self,
        shape: &Shape,
        fit: &LinearFit<BINS>,
    ) -> Option<([[f64; 5]; 5], f64)> {
        let mut output = [0.0; BINS];
        for (k, bin) in self.window.bins().iter().enumerate() {
            if self.weight[k] > 0.0 {
                output[k] = bin.output_sum / self.weight[k] - fit.residual[k];
            }
        }
        let [.., bias_gain, gain] = fit.coefficients;
        let map = coordinate_map(bias_gain, gain, self.period_s);
        let noise_sigma = self.window.noise_sigma();
        let mut tangent = Tangent {
            basis: Columns::zero(self.rows),
            triangle: [[0.0; ALL]; ALL],
            weight: &self.weight,
            bin_rad: TAU * self.window.bin_s() / self.period_s,
        };
        self.tangent(shape, fit, &mut tangent)?;
        tangent.covariance(&fit.residual, &output, noise_sigma, &map)
    }
}

/// The fit's surroundings to first order.
pub(super) struct Tangent<'a, const BINS: usize> {
    /// Orthonormal basis of the model's derivatives: initial state, bias, gain, shape.
    pub(super) basis: Columns<ALL, BINS>,
    pub(super) triangle: Triangle<ALL>,
    /// Square roots of the numbers of samples of the bins.
    pub(super) weight: &'a [f64; BINS],
    /// Phase of the fundamental from one bin to the next (rad).
    pub(super) bin_rad: f64,
}

/// A cosine or sine over the bins, as far as the fit is concerned.
struct Wave {
    /// Change of the unknowns per unit of the wave.
    shift: [f64; ALL],
    /// Part of its energy that the residual keeps.
    left: f64,
    /// Its amplitude in the output and in the residual (output unit).
    output: f64,
    residual: f64,
    /// Root mean square of the amplitudes that an error of one would give it (output unit).
    scale: f64,
}

impl<const BINS: usize> Tangent<'_, BINS> {
    /// Covariance over the coordinates of [`coordinate`] and relative error of the response:
    /// `residual` and `output` are the weighted rows of the fit, `noise_sigma` the white noise of a
    /// sample; `None` where an unknown has no influence.
    pub(super) fn covariance(
        &self,
        residual: &[f64; BINS],
        output: &[f64; BINS],
        noise_sigma: f64,
        map: &[[f64; 5]; 5],
    ) -> Option<([[f64; 5]; 5], f64)> {
        if (0..ALL).any(|i| self.triangle[i][i] == 0.0) {
            return None;
        }
        let rows = self.basis.rows - KNOWN;
        let noise = noise_sigma * noise_sigma;
        let mut rest = *residual;
        let mut shifts = [[0.0; ALL]; 2 * HARMONICS];
        let mut waves: [Option<Wave>; 2 * HARMONICS] = [const { None }; 2 * HARMONICS];
        for (n, slot) in waves.iter_mut().enumerate() {
            *slot = self.wave(n, residual, output, &mut rest);
        }
        set_scales(&mut waves);
        let error = self.response_error(&waves, noise);
        for (shift, wave) in shifts.iter_mut().zip(waves.iter().flatten()) {
            *shift = wave.shift.map(|value| value * error * wave.scale);
        }
        // Harmonics that are explained as error of the model are no noise any more.
        let rest = if error > 0.0 { &rest } else { residual };
        let variance = dot(&rest[..rows], &rest[..rows]) / (rows - ALL) as f64;
        let variance = variance * redundancy(&rest[..rows], noise / variance);
        let mut all = [[0.0; ALL]; ALL];
        for row in 0..ALL {
            let mut unit = [0.0; ALL];
            unit[row] = libm::sqrt(variance);
            add_square(&mut all, &back_substitute(&self.triangle, &unit));
        }
        for shift in &shifts {
            add_square(&mut all, shift);
        }
        Some((mapped(&all, map), error))
    }

    /// Wave `n` (cosine and sine of each harmonic in turn); `None` beyond half the bins' rate. Takes
    /// what the residual keeps of it out of `rest`.
    fn wave(
        &self,
        n: usize,
        residual: &[f64; BINS],
        output: &[f64; BINS],
        rest: &mut [f64; BINS],
    ) -> Option<Wave> {
        let rows = self.basis.rows - KNOWN;
        let step_rad = (n / 2 + 1) as f64 * self.bin_rad;
        if step_rad > 0.25 * TAU {
            return None;
        }
        let mut wave = [0.0; BINS];
        for (k, value) in wave[..rows].iter_mut().enumerate() {
            let angle = step_rad * k as f64;
            *value = self.weight[k]
                * if n.is_multiple_of(2) {
                    cos(angle)
                } else {
                    sin(angle)
                };
        }
        let energy = dot(&wave[..rows], &wave[..rows]);
        let in_output = dot(&wave[..rows], &output[..rows]) / energy;
        let parts = self.basis.project_out(&mut wave[..rows + KNOWN]);
        let kept = dot(&wave[..rows], &wave[..rows]);
        let in_residual = dot(&wave[..rows], &residual[..rows]);
        let again = dot(&wave[..rows], &rest[..rows]) / kept.max(f64::MIN_POSITIVE);
        for (value, wave) in rest[..rows].iter_mut().zip(&wave) {
            *value -= again * wave;
        }
        Some(Wave {
            shift: back_substitute(&self.triangle, &parts),
            left: kept / energy,
            output: in_output,
            residual: in_residual / energy,
            scale: 0.0,
        })
    }

    /// Relative error of the response that the harmonics left in the residual speak for; zero where
    /// noise explains them.
    fn response_error(&self, waves: &[Option<Wave>; 2 * HARMONICS], noise: f64) -> f64 {
        let rows = self.basis.rows - KNOWN;
        let samples = dot(&self.weight[..rows], &self.weight[..rows]);
        // Rounding of the fit itself, for recordings without any noise.
        let floor = 1e-12;
        let log_likelihood = |error: f64| {
            let mut sum = 0.0;
            for pair in waves.chunks_exact(2) {
                let [Some(cosine), Some(sine)] = pair else {
                    continue;
                };
                for wave in [cosine, sine] {
                    if wave.left > LEAST_LEFT {
                        let size = wave.scale * wave.scale;
                        let error_variance = wave.left * error * error * size;
                        let variance =
                            wave.left * (error_variance + 2.0 * noise / samples + floor * size);
                        sum -= 0.5 * (log(variance) + wave.residual * wave.residual / variance);
                    }
                }
            }
            sum
        };
        let without = log_likelihood(0.0);
        let mut best = (without + SIGNIFICANT, 0.0);
        for n in 0..TRIED {
            let error = libm::exp10(n as f64 / 12.0 - 5.0);
            let likelihood = log_likelihood(error);
            if likelihood > best.0 {
                best = (likelihood, error);
            }
        }
        best.1
    }
}

/// The scale of a harmonic is its size in the output, or the geometric mean of its neighbours'
/// sizes where that is larger; half of the energy for the cosine and half for the sine.
fn set_scales(waves: &mut [Option<Wave>; 2 * HARMONICS]) {
    let mut size = [0.0; HARMONICS];
    for (size, pair) in size.iter_mut().zip(waves.chunks_exact(2)) {
        if let [Some(cosine), Some(sine)] = pair {
            *size = libm::hypot(cosine.output, sine.output);
        }
    }
    for (k, pair) in waves.chunks_exact_mut(2).enumerate() {
        let neighbours = match (k.checked_sub(1).map(|j| size[j]), size.get(k + 1)) {
            (Some(before), Some(behind)) => libm::sqrt(before * behind),
            _ => 0.0,
        };
        for wave in pair.iter_mut().flatten() {
            wave.scale = size[k].max(neighbours) * core::f64::consts::FRAC_1_SQRT_2;
        }
    }
}

/// How much less a residual tells than white noise of its size: the bins over its degrees of
/// freedom, which are the bins over the sum of the squared autocorrelations (a pure harmonic has
/// two). Only for the part that white noise, `noise_part` of it, does not explain.
fn redundancy(residual: &[f64], noise_part: f64) -> f64 {
    let unexplained = (1.0 - noise_part).max(0.0);
    let mut sum = 1.0;
    for lag in 1..residual.len() / 2 {
        let pairs = (residual.len() - lag) as f64;
        let correlation = autocorrelation(residual, lag);
        // White noise alone has a mean square of one over the number of pairs.
        sum += 2.0 * (correlation * correlation - 1.0 / pairs) * pairs / residual.len() as f64;
    }
    1.0 + unexplained * (sum.max(1.0) - 1.0)
}

/// Mean product of values `lag` apart over the mean square.
fn autocorrelation(values: &[f64], lag: usize) -> f64 {
    let mean_square = dot(values, values) / values.len() as f64;
    let product = dot(&values[..values.len() - lag], &values[lag..]) / (values.len() - lag) as f64;
    if mean_square > 0.0 {
        product / mean_square
    } else {
        0.0
    }
}

fn add_square(sum: &mut [[f64; ALL]; ALL], vector: &[f64; ALL]) {
    for (row, a) in sum.iter_mut().zip(vector) {
        for (value, b) in row.iter_mut().zip(vector) {
            *value += a * b;
        }
    }
}

/// The covariance of `map` times the unknowns behind the initial state.
fn mapped(all: &[[f64; ALL]; ALL], map: &[[f64; 5]; 5]) -> [[f64; 5]; 5] {
    const BEFORE: usize = LINEAR - 2;
    let mut mapped = [[0.0; 5]; 5];
    for i in 0..5 {
        for j in 0..5 {
            for k in 0..5 {
                for l in 0..5 {
                    mapped[i][j] += map[i][k] * all[BEFORE + k][BEFORE + l] * map[j][l];
                }
            }
        }
    }
    mapped
}

/// Derivatives of the coordinates of [`coordinate`] by (bias times gain, gain, shape).
pub(super) fn coordinate_map(bias_gain: f64, gain: f64, period_s: f64) -> [[f64; 5]; 5] {
    let mut map = [[0.0; 5]; 5];
    map[coordinate::LN_POLE_SUM][2] = 1.0;
    map[coordinate::POLE_RATIO][3] = 1.0;
    map[coordinate::TAU_S][4] = period_s;
    map[coordinate::LN_JERK_GAIN][1] = 1.0 / gain;
    map[coordinate::INPUT_BIAS][0] = 1.0 / gain;
    map[coordinate::INPUT_BIAS][1] = -bias_gain / (gain * gain);
    map
}
