//! What is fitted: the rows of the equations, their weights, and what is known beforehand.

use libm::{exp, sqrt};

use super::domain::{HIGHEST, SHAPE, Shape};
use super::fundamental::Fundamental;
use super::{RefineError, ShapePrior};
use crate::process::Soiptd;
use crate::response::Grid;
use crate::window::{KNOWN_ROWS, Window};

/// Rows for what is known beforehand: of the acceleration, of the distortion, of the shape.
pub(super) const KNOWN: usize = KNOWN_ROWS;
/// Standard deviation of the distortion known beforehand, as a part of the force: that of a thrust
/// quadratic in the rotor's speed under a relay of a twelfth of hover is 0.02.
const DISTORTION: f64 = 0.02;
/// Least number of bins for nine unknowns and a residual to judge them by.
const FEWEST_BINS: usize = 16;

pub(super) struct Problem<const BINS: usize> {
    pub(super) grid: Grid,
    pub(super) period_s: f64,
    /// Per row: square root of the number of samples (0 leaves the row out), mean deviation from
    /// the middle of the bin (s).
    pub(super) weight: [f64; BINS],
    pub(super) offset_s: [f64; BINS],
    pub(super) rows: usize,
    pub(super) used: usize,
    /// Standard deviation of a sample over that of the acceleration known beforehand.
    pub(super) acceleration_row: f64,
    /// Standard deviation of a sample over that of the distortion known beforehand.
    pub(super) distortion_row: f64,
    /// White noise of a sample, and the same but for rounding (output unit).
    pub(super) noise_sigma: f64,
    pub(super) sigma: f64,
    pub(super) prior: Option<ShapePrior>,
    pub(super) fundamental: Fundamental,
}

impl<const BINS: usize> Problem<BINS> {
    /// Of no window yet.
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
    };

    /// The rows of this window; what the oscillation tells is still to be [settled](Self::settle).
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
        // The past is used from where the longest delay no longer reaches behind its first edge.
        let known_from_s = first.time_s + HIGHEST[2] * period_s;
        self.grid = Grid {
            sample_s: window.sample_s(),
            per_bin: window.per_bin(),
            past_bins: ((window.start_s() - known_from_s) / bin_s).max(0.0) as usize,
            start_s: window.start_s(),
        };
        self.period_s = period_s;
        self.prior = prior;
        self.noise_sigma = window.noise_sigma();
        self.rows = window.bins().len() + KNOWN;
        self.used = 0;
        self.weight.fill(0.0);
        self.offset_s.fill(0.0);
        let half_bin_s = 0.5 * (bin_s - window.sample_s());
        for (k, bin) in window.bins().iter().enumerate() {
            // A bin that lacks many of its samples, as the last one may, has another spread in time.
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

    /// What is known of acceleration and distortion, from the oscillation's fundamental.
    pub(super) fn settle(&mut self, fundamental: Fundamental) {
        // A perfect recording leaves rounding of about a millionth.
        self.sigma = self.noise_sigma.max(1e-6 * fundamental.rms);
        self.acceleration_row = if fundamental.acceleration > 0.0 {
            self.sigma / fundamental.acceleration
        } else {
            0.0
        };
        self.distortion_row = self.sigma / DISTORTION;
        self.fundamental = fundamental;
    }

    /// Number of bins.
    pub(super) fn bins(&self) -> usize {
        self.rows - KNOWN
    }

    /// Sum of squares that white noise as seen in the samples would leave, and a quarter more.
    pub(super) fn cost_of_noise(&self) -> f64 {
        1.25 * self.noise_sigma * self.noise_sigma * self.used as f64
    }

    /// The process of a shape and of unit acceleration gain, which there may not be.
    pub(super) fn process(&self, shape: &Shape) -> Option<Soiptd> {
        let [ln_sum, ratio, delay] = *shape;
        let sum_per_s = exp(ln_sum) / self.period_s;
        Soiptd::from_pole_sum(1.0, sum_per_s, ratio, delay * self.period_s).ok()
    }

    /// The weighted outputs, and the prior's rows at a shape.
    pub(super) fn measured<const EDGES: usize>(
        &self,
        window: &Window<BINS, EDGES>,
        shape: &Shape,
        rows: &mut [f64; BINS],
    ) {
        rows.fill(0.0);
        for (k, bin) in window.bins().iter().enumerate() {
            if self.weight[k] > 0.0 {
                rows[k] = bin.output_sum / self.weight[k];
            }
        }
        if let Some(prior) = &self.prior {
            let rows = &mut rows[self.rows - SHAPE..self.rows];
            for (row, deviation) in rows.iter_mut().zip(prior.deviations(shape)) {
                *row = -self.sigma * deviation;
            }
        }
    }
}
