//! The error of the model that the residual betrays: a part of its response at every harmonic, by maximum
//! likelihood of what the residual keeps of it. An even harmonic that a symmetric relay does not excite is
//! measured against its neighbours: what is found there is distortion.

use libm::{hypot, log, sqrt};

use super::ALL;
use super::problem::Problem;
use super::tried::TRIED;
use crate::least_squares::dot;

/// Harmonics that are looked at; beyond them a relay oscillation has less than 1/1000 of its
/// amplitude.
pub(super) const HARMONICS: usize = 9;
/// A cosine and a sine of each.
const WAVES: usize = 2 * HARMONICS;
/// Part of a harmonic that must be left in the residual for it to tell anything.
const LEAST_LEFT: f64 = 1e-4;
/// Gain in log likelihood that makes an error of the model more than chance (1 % of white noises).
const SIGNIFICANT: f64 = 2.7;
/// Rounding of the fit itself, for recordings without any noise.
const FLOOR: f64 = 1e-12;

/// A cosine or sine over the bins, as far as the fit is concerned.
#[derive(Clone, Copy)]
pub(super) struct Wave {
    /// Change of the unknowns per unit of the wave.
    pub(super) shift: [f64; ALL],
    /// Part of its energy that the residual keeps.
    pub(super) left: f64,
    /// Its amplitude in the output and in the residual (output unit).
    pub(super) output: f64,
    pub(super) residual: f64,
    /// Root mean square of the amplitudes that an error of one would give it (output unit).
    pub(super) scale: f64,
}

pub(super) struct ModelError {
    /// Cosine and sine of each harmonic in turn, up to half the bins' rate.
    waves: [Wave; WAVES],
    count: usize,
    /// The next to try, and the most likely so far behind its log likelihood; `None` before zero is tried.
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

    /// Tries the next error; true where all are.
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

    /// Relative error of the response that the harmonics left in the residual speak for; zero where
    /// noise explains them.
    pub(super) fn found(&self) -> f64 {
        self.best.map_or(0.0, |(_, error)| error)
    }

    /// What the error found moves the unknowns by, wave by wave.
    pub(super) fn shift(&self, n: usize) -> Option<[f64; ALL]> {
        let wave = self.waves().get(n)?;
        Some(wave.shift.map(|value| value * self.found() * wave.scale))
    }

    fn log_likelihood<const BINS: usize>(&self, error: f64, problem: &Problem<BINS>) -> f64 {
        let weight = &problem.weight[..problem.bins()];
        let samples = dot(weight, weight);
        let noise = problem.noise_sigma * problem.noise_sigma;
        let mut sum = 0.0;
        for wave in self.waves() {
            if wave.left > LEAST_LEFT {
                let size = wave.scale * wave.scale;
                let error_variance = wave.left * error * error * size;
                let variance = wave.left * (error_variance + 2.0 * noise / samples + FLOOR * size);
                sum -= 0.5 * (log(variance) + wave.residual * wave.residual / variance);
            }
        }
        sum
    }
}

/// The scale of a harmonic is its size in the output, or the geometric mean of its neighbours'
/// sizes where that is larger; half of the energy for the cosine and half for the sine.
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
