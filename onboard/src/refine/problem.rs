//! Least-squares problem: rows, weights, prior knowledge.

use libm::{exp, sqrt};

use super::domain::{HIGHEST, SHAPE, Shape};
use super::fundamental::Fundamental;
use super::{RefineError, ShapePrior, Walk};
use crate::least_squares::dot;
use crate::process::Soiptd;
use crate::response::Grid;
use crate::window::{KNOWN_ROWS, Window};

/// Rows of prior knowledge: acceleration, distortion, shape.
pub(super) const KNOWN: usize = KNOWN_ROWS;
/// Prior standard deviation of the distortion as a part of the force. For a thrust quadratic in the rotor speed
/// and a relay of a twelfth of hover it is 0.02.
const DISTORTION: f64 = 0.02;
/// Minimum number of bins: nine unknowns and a residual to judge them by.
const FEWEST_BINS: usize = 16;
/// Weight of the first bin among differences.
const LEVEL: f64 = 1e-3;

pub(super) struct Problem<const BINS: usize> {
    pub(super) grid: Grid,
    pub(super) period_s: f64,
    /// Per row: square root of the number of samples (0 excludes the row), and mean deviation from the middle of
    /// the bin (s).
    pub(super) weight: [f64; BINS],
    pub(super) offset_s: [f64; BINS],
    pub(super) rows: usize,
    pub(super) used: usize,
    /// Standard deviation of a sample over the prior one of the acceleration.
    pub(super) acceleration_row: f64,
    /// Standard deviation of a sample over the prior one of the distortion.
    pub(super) distortion_row: f64,
    /// White noise of a sample, and the same with a lower limit for rounding (output unit).
    pub(super) noise_sigma: f64,
    pub(super) sigma: f64,
    pub(super) prior: Option<ShapePrior>,
    pub(super) fundamental: Fundamental,
    /// Noise of the rows, if they are differences of neighbouring bins.
    pub(super) walk: Option<Walk>,
}

impl<const BINS: usize> Problem<BINS> {
    /// All zeros: memory before the first use.
    pub(super) const NONE: Self = Self {
        grid: Grid::NONE,
        period_s: 0.0,
        weight: [0.0; BINS],
        offset_s: [0.0; BINS],
        rows: 0,
        used: 0,
        acceleration_row: 0.0,
        distortion_row: 0.0,
        noise_sigma: 0.0,
        sigma: 0.0,
        prior: None,
        fundamental: Fundamental::NONE,
        walk: None,
    };

    /// Sets the rows of this window. [`settle`](Self::settle) sets what depends on the oscillation.
    pub(super) fn set<const EDGES: usize>(
        &mut self,
        window: &Window<BINS, EDGES>,
        period_s: f64,
        prior: Option<ShapePrior>,
    ) -> Result<(), RefineError> {
        let [first, _, ..] = window.edges() else {
            return Err(RefineError::NoInput);
        };
        let bin_s = window.bin_s();
        // The past is used from where the longest delay no longer reaches before its first edge.
        let known_from_s = first.time_s + HIGHEST[2] * period_s;
        self.grid = Grid {
            sample_s: window.sample_s(),
            per_bin: window.per_bin(),
            past_bins: ((window.start_s() - known_from_s) / bin_s).max(0.0) as usize,
            start_s: window.start_s(),
        };
        self.period_s = period_s;
        self.prior = prior;
        self.walk = None;
        self.noise_sigma = window.noise_sigma();
        self.rows = window.bins().len() + KNOWN;
        self.used = 0;
        self.weight.fill(0.0);
        self.offset_s.fill(0.0);
        let half_bin_s = 0.5 * (bin_s - window.sample_s());
        for (k, bin) in window.bins().iter().enumerate() {
            // A bin without some of its samples, such as the last one, has another spread in time.
            let is_last = k + 1 == window.bins().len();
            if bin.count == window.per_bin() || (!is_last && 8 * bin.count >= 7 * window.per_bin())
            {
                let count = f64::from(bin.count);
                self.weight[k] = sqrt(count);
                self.offset_s[k] = bin.time_sum_s / count - (k as f64 * bin_s + half_bin_s);
                self.used += 1;
            }
        }
        if self.used < FEWEST_BINS {
            return Err(RefineError::TooFewBins(self.used));
        }
        Ok(())
    }

    /// Sets the prior of acceleration and distortion from the fundamental of the oscillation.
    pub(super) fn settle(&mut self, fundamental: Fundamental) {
        self.fundamental = fundamental;
        self.settle_prior();
    }

    /// Goes on with differences of neighbouring bins, which have this noise.
    pub(super) fn difference(&mut self, walk: Walk) {
        self.walk = Some(walk);
        self.settle_prior();
    }

    fn settle_prior(&mut self) {
        // A perfect recording has rounding errors of about a millionth.
        self.sigma = self.row_sigma().max(1e-6 * self.fundamental.rms);
        self.acceleration_row = if self.fundamental.acceleration > 0.0 {
            self.sigma / self.fundamental.acceleration
        } else {
            0.0
        };
        self.distortion_row = self.sigma / DISTORTION;
    }

    /// Rows from the means of the bins: weighted, or their weighted differences.
    pub(super) fn weigh(&self, means: &mut [f64]) {
        if let Some(walk) = self.walk {
            self.take_differences(means, walk.differences);
        } else {
            for (mean, weight) in means.iter_mut().zip(&self.weight) {
                *mean *= weight;
            }
        }
    }

    /// Differences of neighbouring bins, or the differences of these, per square root of their distance. The first bins only
    /// set the level and the slope, which a random walk leaves open.
    fn take_differences(&self, means: &mut [f64], differences: u8) {
        for taken in 0..differences {
            let mut last: Option<(usize, f64)> = None;
            let mut open = taken;
            for (k, (row, weight)) in means.iter_mut().zip(&self.weight).enumerate() {
                if *weight == 0.0 {
                    *row = 0.0;
                    continue;
                }
                // What is open already stays as it is.
                if open > 0 {
                    open -= 1;
                    continue;
                }
                let value = *row;
                *row = match last {
                    None => LEVEL * value,
                    Some((before, last)) => (value - last) / sqrt((k - before) as f64),
                };
                last = Some((k, value));
            }
        }
    }

    /// Samples that count for the noise of a row of waves with this energy: the variance of a wave's amplitude is twice that
    /// of the noise over this number.
    pub(super) fn samples(&self, energy: f64) -> f64 {
        if self.walk.is_some() {
            return 2.0 * energy;
        }
        let weight = &self.weight[..self.bins()];
        dot(weight, weight)
    }

    /// Mean of the squared weights of the rows in use.
    pub(super) fn mean_weight_2(&self) -> f64 {
        if self.walk.is_some() {
            return 1.0;
        }
        self.weight.iter().map(|w| w * w).sum::<f64>() / self.used as f64
    }

    /// Number of bins.
    pub(super) fn bins(&self) -> usize {
        self.rows - KNOWN
    }

    /// Sum of squares that white noise of the samples' size would leave, plus a quarter.
    pub(super) fn cost_of_noise(&self) -> f64 {
        1.25 * self.row_sigma() * self.row_sigma() * self.used as f64
    }

    /// Standard deviation of the noise of a row (output unit).
    pub(super) fn row_sigma(&self) -> f64 {
        self.walk.map_or(self.noise_sigma, |walk| walk.sigma)
    }

    /// Variance of a difference of neighbouring bins if the noise of the samples is all a random walk: `q^2 (2 n^2 + 1) / (3 n)`
    /// with `n` samples in a bin and steps of variance `q^2`, whose third differences look like white noise of `0.3 q^2`.
    pub(super) fn walk_variance(&self) -> f64 {
        let n = f64::from(self.grid.per_bin);
        let step = self.noise_sigma * self.noise_sigma / 0.3;
        step * (2.0 * n * n + 1.0) / (3.0 * n)
    }

    /// Process of a shape with unit acceleration gain, if there is one.
    pub(super) fn process(&self, shape: &Shape) -> Option<Soiptd> {
        let [ln_sum, ratio, delay] = *shape;
        let sum_per_s = exp(ln_sum) / self.period_s;
        Soiptd::from_pole_sum(1.0, sum_per_s, ratio, delay * self.period_s).ok()
    }

    /// Weighted outputs; zero in rows that are not in use.
    pub(super) fn outputs<const EDGES: usize>(
        &self,
        window: &Window<BINS, EDGES>,
        rows: &mut [f64; BINS],
    ) {
        rows.fill(0.0);
        for (k, bin) in window.bins().iter().enumerate() {
            if self.weight[k] > 0.0 {
                rows[k] = bin.output_sum / self.weight[k];
            }
        }
        if let Some(walk) = self.walk {
            for (row, weight) in rows.iter_mut().zip(&self.weight) {
                if *weight > 0.0 {
                    *row /= weight;
                }
            }
            self.take_differences(&mut rows[..self.rows - KNOWN], walk.differences);
        }
    }

    /// Weighted outputs, and the rows of the prior at a shape.
    pub(super) fn measured<const EDGES: usize>(
        &self,
        window: &Window<BINS, EDGES>,
        shape: &Shape,
        rows: &mut [f64; BINS],
    ) {
        self.outputs(window, rows);
        if let Some(prior) = &self.prior {
            let rows = &mut rows[self.rows - SHAPE..self.rows];
            for (row, deviation) in rows.iter_mut().zip(prior.deviations(shape)) {
                *row = -self.sigma * deviation;
            }
        }
    }
}
