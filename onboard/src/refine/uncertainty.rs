//! Uncertainty of the process: from the noise, and from the error of the model.
//!
//! To first order a disturbance `d` of the fitted rows moves the unknowns by `R^-1 Q^T d` and leaves `d - Q Q^T
//! d` in the residual, where `Q R` is the matrix of the derivatives with respect to all unknowns.
//!
//! White noise gives the usual covariance. A process outside the family errs by a fraction `e` of its response
//! at each harmonic of the oscillation. The unknowns absorb nearly all of that at the large low harmonics, so
//! little of it remains in the residual. `e` is estimated from that remainder by maximum likelihood
//! (`model_error.rs`), and its full effect on the unknowns is added to the covariance. Any other residual that
//! is not white counts by its degrees of freedom.

use core::f64::consts::TAU;
use core::task::Poll;

use libm::{cos, sin, sqrt};

use super::linear_fit::{Bench, Jacobian, LinearFit, Orthonormalisation, PARTS};
use super::model_error::{HARMONICS, ModelError, Wave};
use super::problem::Problem;
use super::tried::TRIED;
use super::{ALL, KNOWN, LINEAR, Walk, coordinate};
use crate::least_squares::{back_substitute, dot};
use crate::window::Window;

/// Bins of a wave per slice: one sine each.
const WAVE_BINS: usize = 32;
/// Lags of the residual's autocorrelation per slice.
const LAGS: usize = 8;
/// Residual beyond which the noise of the samples does not explain it: its mean square over theirs.
const MOST_WHITE: f64 = 2.0;
/// Sum of the squared differences over that of the values: 2 for white noise. The fit follows a random walk with its unknowns
/// and leaves 0.3 to 1.5 of it.
const MOST_ALIKE: f64 = 1.6;
/// Sum of the squared differences of what is to be white over that of itself: 1.5 for a random walk averaged in bins.
/// Below this the residual is smoother, as under a wind whose force is integrated twice.
const LEAST_CURVED: f64 = 1.0;
/// Sum of the squared second differences over that of the noise of the samples: 6 for white noise, of which there must be
/// little, because what it leaves in third differences would hide that those of the residual are smooth.
const MOST_NOISY: f64 = 60.0;
/// Variance of the differences over that of the random walk which the samples' third differences show. An estimator that
/// filters its rate lies above one; white noise under a wind lies below a half, a wind alone above ten.
const WALKS: core::ops::RangeInclusive<f64> = 0.5..=10.0;
/// Squares added to the covariance per slice.
const SQUARES: usize = 5;

/// State of the computation.
pub(super) struct Uncertainty {
    error: ModelError,
    /// Covariance of all unknowns.
    all: [[f64; ALL]; ALL],
    /// Noise of differences of neighbouring bins, where the residual is rather a random walk than white.
    pub(super) walk: Option<Walk>,
    stage: Stage,
}

/// Next step of the computation.
enum Stage {
    /// Derivatives with respect to the shape.
    Derivatives(Jacobian),
    /// Orthonormalisation of the derivatives.
    Basis(Orthonormalisation),
    /// A wave: its index, and the bins computed so far.
    Wave(usize, usize),
    /// Removal of the unknowns' part from the wave.
    Part(usize, Projection),
    /// Error of the model.
    Error,
    /// Colour of the residual.
    Walk,
    /// Redundancy of the residual.
    Redundancy(Redundancy),
    /// Covariance: squares added so far, standard deviation of a row.
    Squares(usize, f64),
}

/// Removal of the basis from a wave: components so far, and sizes before.
#[derive(Clone, Copy)]
struct Projection {
    parts: [f64; ALL],
    done: usize,
    energy: f64,
    output: f64,
}

impl Uncertainty {
    /// All zeros: memory before the first use.
    pub(super) const NONE: Self = Self {
        error: ModelError::NONE,
        all: [[0.0; ALL]; ALL],
        walk: None,
        stage: Stage::Derivatives(Jacobian::BEGIN),
    };

    pub(super) fn begin(&mut self) {
        self.error.begin();
        self.all = [[0.0; ALL]; ALL];
        self.walk = None;
        self.stage = Stage::Derivatives(Jacobian::BEGIN);
    }

    /// Upper bound of the number of slices for a number of bins.
    pub(super) fn most_slices(bins: usize) -> usize {
        let of_wave = bins / WAVE_BINS + 1 + ALL / PARTS + 1;
        let squares = (ALL + 2 * HARMONICS) / SQUARES + 2;
        2 * (ALL - LINEAR)
            + 2 * HARMONICS * of_wave
            + 3
            + TRIED.len()
            + 1
            + bins / (2 * LAGS)
            + 1
            + squares
    }

    /// Does one slice of the uncertainty of the fit at the best shape. After the last it returns the covariance
    /// over the coordinates of [`coordinate`] and the relative error of the response; `None` in it if an unknown
    /// has no influence.
    #[inline(never)]
    pub(super) fn advance<const BINS: usize, const EDGES: usize>(
        &mut self,
        problem: &Problem<BINS>,
        window: &Window<BINS, EDGES>,
        fit: &mut LinearFit<BINS>,
        bench: &mut Bench<BINS>,
    ) -> Poll<Option<([[f64; 5]; 5], f64)>> {
        match &mut self.stage {
            Stage::Derivatives(jacobian) => match jacobian.advance(problem, window, fit, bench) {
                Poll::Pending => {}
                Poll::Ready(None) => return Poll::Ready(None),
                Poll::Ready(Some(())) => {
                    self.stage = Stage::Basis(Orthonormalisation::of(LINEAR));
                }
            },
            Stage::Basis(under_way) => {
                if under_way.advance(&mut fit.basis, &mut fit.triangle) {
                    let next = under_way.column + 1;
                    self.stage = if next < ALL {
                        Stage::Basis(Orthonormalisation::of(next))
                    } else if (0..ALL).any(|i| fit.triangle[i][i] == 0.0) {
                        return Poll::Ready(None);
                    } else {
                        set_output(problem, window, fit, bench);
                        Stage::Wave(0, 0)
                    };
                }
            }
            Stage::Wave(n, made) => {
                let step_rad = (*n / 2 + 1) as f64 * (TAU * window.bin_s() / problem.period_s);
                if *n == 2 * HARMONICS || step_rad > 0.25 * TAU {
                    self.error.set_scales();
                    self.stage = Stage::Error;
                } else if make_wave(*n, step_rad, made, problem, &mut bench.rows[0]) {
                    self.stage = Stage::Part(*n, Projection::NONE);
                }
            }
            Stage::Part(n, under_way) => {
                let next = *n + 1;
                let [wave, output, rest] = &mut bench.rows;
                if under_way.advance(problem, fit, wave, output) {
                    self.error.push(under_way.wave(problem, fit, wave, rest));
                    self.stage = Stage::Wave(next, 0);
                }
            }
            Stage::Error => {
                if self.error.advance(problem) {
                    self.stage = Stage::Walk;
                }
            }
            Stage::Walk => {
                self.walk = self.walk(problem, fit, bench);
                let residual = self.residual(problem, fit, bench);
                self.stage = Stage::Redundancy(Redundancy::of(problem, residual));
            }
            Stage::Redundancy(redundancy) => {
                let mut found = *redundancy;
                let variance = found.advance(self.residual(problem, fit, bench));
                self.stage = match variance {
                    None => Stage::Redundancy(found),
                    Some(variance) => Stage::Squares(0, sqrt(variance)),
                };
            }
            Stage::Squares(done, sigma) => {
                let (from, sigma) = (*done, *sigma);
                *done = from + SQUARES;
                if !self.add_squares(from, sigma, fit) {
                    let [.., bias_gain, gain] = fit.coefficients;
                    let map = coordinate_map(bias_gain, gain, problem.period_s);
                    return Poll::Ready(Some((mapped(&self.all, &map), self.error.found())));
                }
            }
        }
        Poll::Pending
    }

    /// Residual that counts as noise: without the harmonics that are explained as model error.
    fn residual<'a, const BINS: usize>(
        &self,
        problem: &Problem<BINS>,
        fit: &'a LinearFit<BINS>,
        bench: &'a Bench<BINS>,
    ) -> &'a [f64] {
        let [_, _, rest] = &bench.rows;
        let rows = if self.error.found() > 0.0 {
            rest
        } else {
            &fit.residual
        };
        &rows[..problem.bins()]
    }

    /// Noise of the differences of neighbouring bins, where the residual of the fit is rather a random walk than white: then its
    /// differences are the smaller ones, and the likelihood of the fit to differences is larger. `None` where the noise of the
    /// samples explains the residual.
    fn walk<const BINS: usize>(
        &self,
        problem: &Problem<BINS>,
        fit: &LinearFit<BINS>,
        bench: &Bench<BINS>,
    ) -> Option<Walk> {
        let noise = problem.row_sigma() * problem.row_sigma();
        // Sums of the squares of the values, their differences, the differences of these, and once more.
        let (mut squares, mut noises) = ([0.0; 4], 0.0);
        let mut last = [f64::NAN; 4];
        let rows = self.residual(problem, fit, bench).iter();
        for (row, weight) in rows
            .zip(&problem.weight)
            .filter(|(_, weight)| **weight > 0.0)
        {
            noises += noise / (weight * weight);
            let mut value = row / weight;
            for (sum, last) in squares.iter_mut().zip(&mut last) {
                // Not a number as long as there is no difference yet.
                if value.is_finite() {
                    *sum += value * value;
                }
                value -= core::mem::replace(last, value);
            }
        }
        let waves = if self.error.found() > 0.0 {
            self.error.count()
        } else {
            0
        };
        let freedom = problem.used.checked_sub(ALL + waves + 1)?.max(1) as f64;
        let [values, once, twice, thrice] = squares;
        let variance = once / freedom;
        if values < MOST_WHITE * noises {
            return None;
        }
        let is_walk = once < MOST_ALIKE * values
            && twice > LEAST_CURVED * once
            && WALKS.contains(&(variance / problem.walk_variance()));
        if is_walk {
            return Some(Walk {
                differences: 1,
                sigma: sqrt(variance),
            });
        }
        let is_smooth_walk =
            once < values && thrice > LEAST_CURVED * twice && twice > MOST_NOISY * noises;
        is_smooth_walk.then(|| Walk {
            differences: 2,
            sigma: sqrt(twice / freedom),
        })
    }

    /// Adds the squares of the unknowns' shifts from number `from` on: those by noise of `sigma` along each
    /// basis vector, then those by the error of each wave. False when there are none left.
    fn add_squares<const BINS: usize>(
        &mut self,
        from: usize,
        sigma: f64,
        fit: &LinearFit<BINS>,
    ) -> bool {
        for n in from..from + SQUARES {
            let shift = match n.checked_sub(ALL) {
                None => {
                    let mut unit = [0.0; ALL];
                    unit[n] = sigma;
                    Some(back_substitute(&fit.triangle, &unit))
                }
                Some(wave) => self.error.shift(wave),
            };
            match shift {
                Some(shift) => add_square(&mut self.all, &shift),
                None => return n > from,
            }
        }
        true
    }
}

impl Projection {
    const NONE: Self = Self {
        parts: [0.0; ALL],
        done: 0,
        energy: 0.0,
        output: 0.0,
    };

    /// Removes the next components from a wave; true when all are removed.
    fn advance<const BINS: usize>(
        &mut self,
        problem: &Problem<BINS>,
        fit: &LinearFit<BINS>,
        wave: &mut [f64; BINS],
        output: &[f64; BINS],
    ) -> bool {
        let bins = problem.bins();
        if self.done == 0 {
            self.energy = dot(&wave[..bins], &wave[..bins]);
            self.output = dot(&wave[..bins], &output[..bins]) / self.energy;
            wave[bins..].fill(0.0);
        }
        let from = self.done;
        self.done = ALL.min(from + PARTS);
        for i in from..self.done {
            self.parts[i] = fit.basis.remove_from(i, &mut wave[..bins + KNOWN]);
        }
        self.done == ALL
    }

    /// Relation of the fit to a wave from which all components have been removed. The part that the residual has
    /// of it is removed from `rest`.
    fn wave<const BINS: usize>(
        &self,
        problem: &Problem<BINS>,
        fit: &LinearFit<BINS>,
        wave: &[f64; BINS],
        rest: &mut [f64; BINS],
    ) -> Wave {
        let bins = problem.bins();
        let kept = dot(&wave[..bins], &wave[..bins]);
        let residual = dot(&wave[..bins], &fit.residual[..bins]);
        let again = dot(&wave[..bins], &rest[..bins]) / kept.max(f64::MIN_POSITIVE);
        for (value, wave) in rest[..bins].iter_mut().zip(wave) {
            *value -= again * wave;
        }
        Wave {
            shift: back_substitute(&fit.triangle, &self.parts),
            left: kept / self.energy,
            output: self.output,
            residual: residual / self.energy,
            scale: 0.0,
            samples: problem.samples(self.energy),
        }
    }
}

/// Computes the next bins of wave `n`, cosine or sine, with a phase step of `step_rad` per bin; true when all
/// bins are `made`.
fn make_wave<const BINS: usize>(
    n: usize,
    step_rad: f64,
    made: &mut usize,
    problem: &Problem<BINS>,
    wave: &mut [f64; BINS],
) -> bool {
    let bins = problem.bins();
    let end = bins.min(*made + WAVE_BINS);
    for k in *made..end {
        let angle = step_rad * k as f64;
        wave[k] = if n.is_multiple_of(2) {
            cos(angle)
        } else {
            sin(angle)
        };
    }
    *made = end;
    if end == bins {
        problem.weigh(&mut wave[..bins]);
    }
    end == bins
}

/// Sets the fitted output, and the residual from which the waves will be removed.
fn set_output<const BINS: usize, const EDGES: usize>(
    problem: &Problem<BINS>,
    window: &Window<BINS, EDGES>,
    fit: &LinearFit<BINS>,
    bench: &mut Bench<BINS>,
) {
    let [_, output, rest] = &mut bench.rows;
    problem.outputs(window, output);
    for (output, residual) in output[..problem.bins()].iter_mut().zip(&fit.residual) {
        *output -= residual;
    }
    *rest = fit.residual;
}

/// Redundancy of a residual: by how much its variance must be increased because it is not white. It is the
/// number of bins over the degrees of freedom, where the degrees of freedom are the number of bins over the sum
/// of squared autocorrelations (a pure harmonic has two). It applies only to the part that white noise does not
/// explain.
#[derive(Clone, Copy)]
struct Redundancy {
    variance: f64,
    /// Part of the variance that white noise does not explain.
    unexplained: f64,
    sum: f64,
    lag: usize,
}

impl Redundancy {
    fn of<const BINS: usize>(problem: &Problem<BINS>, residual: &[f64]) -> Self {
        // The noise of differences is known from the residual alone.
        let noise = match problem.walk {
            Some(_) => 0.0,
            None => problem.noise_sigma * problem.noise_sigma,
        };
        let variance = dot(residual, residual) / (residual.len() - ALL) as f64;
        Self {
            variance,
            unexplained: (1.0 - noise / variance).max(0.0),
            sum: 1.0,
            lag: 1,
        }
    }

    /// Adds the next lags; after the last it returns the variance times the redundancy.
    fn advance(&mut self, residual: &[f64]) -> Option<f64> {
        let bins = residual.len();
        let mean_square = dot(residual, residual) / bins as f64;
        let end = (bins / 2).min(self.lag + LAGS);
        while self.lag < end {
            let pairs = (bins - self.lag) as f64;
            let correlation = autocorrelation(residual, self.lag, mean_square);
            // White noise alone has a mean square of one over the number of pairs.
            self.sum += 2.0 * (correlation * correlation - 1.0 / pairs) * pairs / bins as f64;
            self.lag += 1;
        }
        let redundancy = 1.0 + self.unexplained * (self.sum.max(1.0) - 1.0);
        (end == bins / 2).then_some(self.variance * redundancy)
    }
}

/// Mean product of values `lag` apart over the mean square.
fn autocorrelation(values: &[f64], lag: usize, mean_square: f64) -> f64 {
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

/// Covariance of `map` times the unknowns after the initial state.
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

/// Derivatives of the coordinates of [`coordinate`] with respect to (bias times gain, gain, shape).
fn coordinate_map(bias_gain: f64, gain: f64, period_s: f64) -> [[f64; 5]; 5] {
    let mut map = [[0.0; 5]; 5];
    map[coordinate::LN_POLE_SUM][2] = 1.0;
    map[coordinate::POLE_RATIO][3] = 1.0;
    map[coordinate::TAU_S][4] = period_s;
    map[coordinate::LN_JERK_GAIN][1] = 1.0 / gain;
    map[coordinate::INPUT_BIAS][0] = 1.0 / gain;
    map[coordinate::INPUT_BIAS][1] = -bias_gain / (gain * gain);
    map
}
