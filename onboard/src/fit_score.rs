//! Misfit statistic of a cycle: how well the process read from it explains it. The basis of "unknown".
//!
//! For a cycle of a process of the family, in units of the period `T` and of its amplitude, with `s = j 2 pi n`,
//! `S = (p1 + p2) T`, `r = p1 p2 / (p1 + p2)^2` and duty `d`:
//!
//! ```text
//!          e^(-s tau/T)     2 (1 - e^(-s d))      1
//! y_n =  ---------------- . ---------------- . -------,    Q = s^2 + s S + r S^2,    A = a / (K/(T_body T_prop) T^3)
//!             s Q                  s              A
//!
//! x_k = 32/pi sin(pi k/32) sum_m y_n / n,    n = k + 32 m      means over 32 parts, k = 1..15
//! ```
//!
//! | symbol       | meaning                                            | unit |
//! |--------------|----------------------------------------------------|------|
//! | `p1`, `p2`   | poles `1/T_prop`, `1/T_body`                       | 1/s  |
//! | `a`          | amplitude of the cycle                             | output unit |
//! | `y_n`, `x_k` | harmonics of the output, and of its means over parts | 1  |
//!
//! The input bias is in harmonic zero only and has no influence. The remainder of the measured `x_k` is compared
//! with everything that a cycle of the family may leave:
//!
//! - noise, equal for all harmonics: a part is the mean of `N/32` samples;
//! - uncertainty of the process: the posterior of its values, through the derivatives of `x_k`;
//! - a difference between the states at the end and at the start of the cycle, because noise moves the switches:
//!   jumps of force, rate and output, with the responses `1/(s Q)`, `1/Q`, `s/Q`;
//! - a floor for the errors of a window of samples and of the network.
//!
//! ```text
//! statistic = min over values v and jumps c of   |x - x(v, c)|^2 / variance + |v|^2 + |c|^2
//! ```
//!
//! `v` and `c` are counted in standard deviations. `x` is linear in `c` but not in `v`: the minimum is found
//! with the derivatives at the process read, then with those at that minimum. If everything were Gaussian and
//! linear and the floor zero, the statistic would be chi-squared with 30 degrees of freedom, because each of
//! these contributions only adds to the covariance.

mod fit;
mod response;

use core::f64::consts::PI;

use self::fit::Explained;
use self::response::PeriodicResponse;
use crate::complex::Complex;
use crate::pack::VALUES;
use crate::signature::PARTS;

/// Number of harmonics of the parts: those below the alternating one.
pub(crate) const HARMONICS: usize = PARTS / 2 - 1;

/// Real parts of the harmonics, then imaginary parts.
pub(crate) const ROWS: usize = 2 * HARMONICS;

/// Number of jumps between the end of a cycle and its start.
pub(crate) const JUMPS: usize = 3;

/// Number of columns that may explain the remainder.
const COLUMNS: usize = VALUES + JUMPS;

pub(crate) type Rows = [f64; ROWS];

/// Harmonics of the measured parts per slice.
const SUMMED: usize = 8;

/// Uncertainty of the process read, and deviation of a cycle from the periodic response.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Doubt {
    /// Upper triangular root of the values' covariance.
    pub(crate) root: [[f64; VALUES]; VALUES],
    /// Standard deviation of the jumps.
    pub(crate) jump: f64,
    /// Standard deviation of noise and floor together, per row.
    pub(crate) sigma: f64,
}

/// A cycle and the process read from it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScoredCycle {
    /// Mean outputs over the parts, divided by the amplitude.
    pub(crate) parts: [f64; PARTS],
    /// Values of the process: `ln S, r, tau/T, ln A`.
    pub(crate) mean: [f64; VALUES],
    pub(crate) doubt: Doubt,
    pub(crate) duty: f64,
    /// Number of samples in the period.
    pub(crate) samples: f64,
}

/// The statistic of the [module](self), computed in slices.
#[derive(Clone, Debug)]
pub(crate) struct Statistic {
    cycle: ScoredCycle,
    observed: Rows,
    response: PeriodicResponse,
    /// Where the response is evaluated: deviations of the values from their mean, in columns of the root.
    deviations: [f64; VALUES],
    explained: Explained,
    /// Sum of squares left by the first pass, and whether the second pass is in progress.
    first: f64,
    is_second: bool,
    stage: Stage,
}

/// Next step.
#[derive(Clone, Copy, Debug)]
enum Stage {
    /// Harmonics of the measured parts: number already summed.
    Observed(usize),
    /// Harmonics of the process.
    Response,
    /// The equations.
    Equations,
    /// Their least-squares solution.
    Explained,
}

impl Statistic {
    /// All zeros: memory before the first use.
    pub(crate) const NONE: Self = Self {
        cycle: ScoredCycle {
            parts: [0.0; PARTS],
            mean: [0.0; VALUES],
            doubt: Doubt {
                root: [[0.0; VALUES]; VALUES],
                jump: 0.0,
                sigma: 0.0,
            },
            duty: 0.0,
            samples: 0.0,
        },
        observed: [0.0; ROWS],
        response: PeriodicResponse::NONE,
        deviations: [0.0; VALUES],
        explained: Explained::NONE,
        first: 0.0,
        is_second: false,
        stage: Stage::Observed(0),
    };

    /// Begins the statistic of a cycle.
    pub(crate) fn begin(&mut self, cycle: ScoredCycle) {
        self.cycle = cycle;
        self.deviations = [0.0; VALUES];
        self.is_second = false;
        self.stage = Stage::Observed(0);
    }

    /// Does one slice; returns the statistic after the last.
    pub(crate) fn advance(&mut self) -> Option<f64> {
        let cycle = &self.cycle;
        match self.stage {
            Stage::Observed(done) => {
                let end = HARMONICS.min(done + SUMMED);
                add_harmonics(&cycle.parts, done + 1..=end, &mut self.observed);
                self.stage = Stage::Observed(end);
                if end == HARMONICS {
                    self.response.begin(&cycle.mean, cycle.duty);
                    self.stage = Stage::Response;
                }
            }
            Stage::Response => {
                if self.response.advance(cycle.samples) {
                    self.stage = Stage::Equations;
                }
            }
            Stage::Equations => {
                let left =
                    (self.response).equations(&self.observed, &self.deviations, &cycle.doubt);
                self.explained.begin(left);
                self.stage = Stage::Explained;
            }
            Stage::Explained => {
                let left = self.explained.advance(&self.response.columns)?;
                return self.judge(left);
            }
        }
        None
    }

    /// After the pass at the process read, starts the pass at the minimum; after that one returns the statistic.
    fn judge(&mut self, left: f64) -> Option<f64> {
        if !self.is_second {
            (self.first, self.is_second) = (left, true);
            let (mean, root) = (&self.cycle.mean, &self.cycle.doubt.root);
            let (there, deviations) = nearest(mean, &self.explained.values(), root);
            self.deviations = deviations;
            self.response.begin(&there, self.cycle.duty);
            self.stage = Stage::Response;
            return None;
        }
        // With a large uncertainty the minimum may lie where a response overflows.
        let found = [left, self.first].into_iter().find(|one| one.is_finite());
        Some(found.map_or(f64::INFINITY, |statistic| statistic.max(0.0)))
    }
}

/// Adds these harmonics of the means over equal parts.
fn add_harmonics(
    parts: &[f64; PARTS],
    harmonics: core::ops::RangeInclusive<usize>,
    rows: &mut Rows,
) {
    // Rotations by half a part.
    let mut turns = [Complex::ONE; 2 * PARTS];
    let step = Complex::turn(-PI / PARTS as f64);
    for index in 1..turns.len() {
        turns[index] = turns[index - 1] * step;
    }
    for harmonic in harmonics {
        let sum = (parts.iter().enumerate()).fold(Complex::default(), |sum, (part, mean)| {
            sum + turns[harmonic * (2 * part + 1) % turns.len()].scaled(*mean)
        });
        put(rows, harmonic, sum.scaled(1.0 / PARTS as f64));
    }
}

fn put(rows: &mut Rows, harmonic: usize, value: Complex) {
    rows[harmonic - 1] = value.re;
    rows[HARMONICS + harmonic - 1] = value.im;
}

/// Process at these deviations from the mean, or the nearest valid one, and its deviations.
fn nearest(
    mean: &[f64; VALUES],
    deviations: &[f64; VALUES],
    root: &[[f64; VALUES]; VALUES],
) -> ([f64; VALUES], [f64; VALUES]) {
    let moved = |row: usize, deviations: &[f64; VALUES]| -> f64 {
        (row..VALUES).map(|k| root[row][k] * deviations[k]).sum()
    };
    let mut there: [f64; VALUES] = core::array::from_fn(|k| mean[k] + moved(k, deviations));
    let [_, pole_ratio, delay, _] = &mut there;
    *pole_ratio = pole_ratio.clamp(0.0, MOST_POLE_RATIO);
    *delay = delay.max(0.0);
    let mut own = [0.0; VALUES];
    for k in (0..VALUES).rev() {
        own[k] = (there[k] - mean[k] - moved(k, &own)) / root[k][k];
    }
    (there, own)
}

/// Pole ratio of equal lags.
pub(crate) const MOST_POLE_RATIO: f64 = 0.25;

#[cfg(test)]
mod tests;
