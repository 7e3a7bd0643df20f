//! Relative error `e` of the model's response, from the harmonics in the residual, by maximum likelihood.
//!
//! ```text
//! r ~ N(0, left (left e^2 s^2 + 2 sigma^2 / N + 1e-12 s^2))     cosine and sine of each harmonic
//! ```
//!
//! | symbol  | name          | meaning                                                    | unit        |
//! |---------|---------------|------------------------------------------------------------|-------------|
//! | `e`     | `error`       | relative error of the response, common to all harmonics    | 1           |
//! | `r`     | `residual`    | amplitude of the wave in the residual                      | output unit |
//! | `s`     | `scale`       | amplitude of the wave under a relative error of one        | output unit |
//! | `left`  | `left`        | part of the wave's energy that the fit leaves              | 1           |
//! | `sigma` | `noise_sigma` | noise of a sample                                          | output unit |
//! | `N`     | `samples`     | samples in the window                                      | 1           |
//!
//! An even harmonic that a symmetric relay does not excite is measured against its neighbours: what is found
//! there is distortion.

use libm::{hypot, log, sqrt};

use super::ALL;
use super::problem::Problem;
use super::tried::TRIED;

/// Number of harmonics used; beyond them a relay oscillation has less than 1/1000 of its amplitude.
pub(super) const HARMONICS: usize = 9;
/// A cosine and a sine for each harmonic.
const WAVES: usize = 2 * HARMONICS;
/// Part of a harmonic that the residual must keep for it to be used.
const LEAST_LEFT: f64 = 1e-4;
/// Gain in log likelihood above which a model error is significant (1 % of white noise exceeds it).
const SIGNIFICANT: f64 = 2.7;
/// Rounding error of the fit, for recordings without noise.
const FLOOR: f64 = 1e-12;

/// Cosine or sine over the bins, and its relation to the fit.
#[derive(Clone, Copy)]
pub(super) struct Wave {
    /// Change of the unknowns per unit of the wave.
    pub(super) shift: [f64; ALL],
    /// Part of its energy that the residual keeps.
    pub(super) left: f64,
    /// Its amplitude in the output and in the residual (output unit).
    pub(super) output: f64,
    pub(super) residual: f64,
    /// Root mean square of its amplitude under a relative error of one (output unit).
    pub(super) scale: f64,
    /// Samples that count for its noise.
    pub(super) samples: f64,
}

pub(super) struct ModelError {
    /// Cosine and sine of each harmonic in turn, up to half the sampling rate of the bins.
    waves: [Wave; WAVES],
    count: usize,
    /// Index of the next error to try; the most probable so far with its log likelihood; `None` before zero has
    /// been tried.
    next: usize,
    best: Option<(f64, f64)>,
}

impl Wave {
    const NONE: Self = Self {
        shift: [0.0; ALL],
        left: 0.0,
        output: 0.0,
        residual: 0.0,
        scale: 0.0,
        samples: 0.0,
    };
}

impl ModelError {
    pub(super) const NONE: Self = Self {
        waves: [Wave::NONE; WAVES],
        count: 0,
        next: 0,
        best: None,
    };

    pub(super) fn begin(&mut self) {
        (self.count, self.next, self.best) = (0, 0, None);
    }

    /// Adds the next wave.
    pub(super) fn push(&mut self, wave: Wave) {
        if let Some(place) = self.waves.get_mut(self.count) {
            *place = wave;
            self.count += 1;
        }
    }

    fn waves(&self) -> &[Wave] {
        &self.waves[..self.count]
    }

    pub(super) fn set_scales(&mut self) {
        set_scales(&mut self.waves[..self.count]);
    }

    /// Tries the next error; true when all have been tried.
    pub(super) fn advance<const BINS: usize>(&mut self, problem: &Problem<BINS>) -> bool {
        match (self.best, TRIED.get(self.next)) {
            (None, _) => self.best = Some((self.log_likelihood(0.0, problem) + SIGNIFICANT, 0.0)),
            (Some((highest, _)), Some(&error)) => {
                let likelihood = self.log_likelihood(error, problem);
                if likelihood > highest {
                    self.best = Some((likelihood, error));
                }
                self.next += 1;
            }
            (Some(_), None) => {}
        }
        self.next == TRIED.len()
    }

    /// Number of waves.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Relative error of the response; zero if noise explains the harmonics in the residual.
    pub(super) fn found(&self) -> f64 {
        self.best.map_or(0.0, |(_, error)| error)
    }

    /// Shift of the unknowns by the error found, wave by wave.
    pub(super) fn shift(&self, n: usize) -> Option<[f64; ALL]> {
        let wave = self.waves().get(n)?;
        Some(wave.shift.map(|value| value * self.found() * wave.scale))
    }

    fn log_likelihood<const BINS: usize>(&self, error: f64, problem: &Problem<BINS>) -> f64 {
        let noise = problem.row_sigma() * problem.row_sigma();
        let mut sum = 0.0;
        for wave in self.waves() {
            if wave.left > LEAST_LEFT {
                let size = wave.scale * wave.scale;
                let error_variance = wave.left * error * error * size;
                let variance =
                    wave.left * (error_variance + 2.0 * noise / wave.samples + FLOOR * size);
                sum -= 0.5 * (log(variance) + wave.residual * wave.residual / variance);
            }
        }
        sum
    }
}

/// Sets the scale of each harmonic: its size in the output, or the geometric mean of its neighbours' sizes if
/// that is larger. Half of the energy belongs to the cosine, half to the sine.
fn set_scales(waves: &mut [Wave]) {
    let mut size = [0.0; HARMONICS];
    for (size, pair) in size.iter_mut().zip(waves.chunks_exact(2)) {
        *size = hypot(pair[0].output, pair[1].output);
    }
    for (k, pair) in waves.chunks_exact_mut(2).enumerate() {
        let neighbours = match (k.checked_sub(1).map(|j| size[j]), size.get(k + 1)) {
            (Some(before), Some(behind)) => sqrt(before * behind),
            _ => 0.0,
        };
        for wave in pair {
            wave.scale = size[k].max(neighbours) * core::f64::consts::FRAC_1_SQRT_2;
        }
    }
}
