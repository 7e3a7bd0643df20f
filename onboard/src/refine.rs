//! The estimator: from a window of one or more cycles to the process, by variable projection.
//!
//! Given the two lags and the delay, the output is linear in everything else:
//!
//! ```text
//! y(t) = b g(t) + b u0 s(t) + y0 + v0 r(t) + w0 q(t) + c d(t)
//! ```
//!
//! with `b` the gain, `g` the response to the recorded input, `s` to a constant one (the unknown
//! input bias `u0`), `r`, `q` to the unknown initial rate and acceleration, and `d` to the even part
//! of the actuator's force (`distortion.rs`). So a search over three unknowns (Levenberg-Marquardt,
//! box-constrained) with the six linear ones solved inside it: Golub and Pereyra (1973), with
//! Kaufman's (1975) Jacobian.
//!
//! Two things are known beforehand and stand as rows of the equations. The acceleration at the
//! beginning of the past cannot exceed what the relay can produce: without that, one that has died
//! away before the window begins would be undetermined. And the even part of the force is small.
//! Where the family of the process is known, so is how likely its shapes are (`prior.rs`): three rows
//! more, and the estimate is the most probable process instead of that of least squares.
//!
//! The three unknowns are the sum of the two poles (its logarithm), their product over the square
//! of the sum, and the delay: regular where the lags are equal (1/4) and where damping vanishes
//! (0), so the double integrator is an ordinary point of the domain's boundary.

mod descent;
mod domain;
mod fundamental;
mod prior;
mod uncertainty;

use libm::{exp, sqrt};

use self::descent::NormalEquations;
pub(crate) use self::domain::shape_of;
pub use self::domain::{DomainEdge, Shape};
use self::domain::{HIGHEST, SHAPE, clamp, domain_edge};
use self::fundamental::Fundamental;
pub use self::prior::ShapePrior;
use crate::distortion;
use crate::least_squares::{Columns, Triangle, back_substitute, dot};
use crate::process::Process;
use crate::response::{Drive, Grid, Response};
use crate::transition::State;
use crate::window::{KNOWN_ROWS, Window};

/// Number of linear unknowns: y0, v0, w0, the distortion, the bias times the gain, the gain.
const LINEAR: usize = 6;
/// Rows for what is known beforehand: of the acceleration, of the distortion, of the shape.
const KNOWN: usize = KNOWN_ROWS;
/// Standard deviation of the distortion known beforehand, as a part of the force: that of a thrust
/// quadratic in the rotor's speed under a relay of a twelfth of hover is 0.02.
const DISTORTION: f64 = 0.02;
/// All unknowns.
const ALL: usize = LINEAR + SHAPE;

/// Index of each coordinate in [`Refined::covariance`].
pub mod coordinate {
    /// Logarithm of the sum of the two poles.
    pub const LN_POLE_SUM: usize = 0;
    /// Product of the poles over the square of their sum.
    pub const POLE_RATIO: usize = 1;
    /// Delay (s).
    pub const TAU_S: usize = 2;
    /// Logarithm of the size of `K/(T_body T_prop)`: unlike `K/T_body`, the same whichever lag comes
    /// first, so regular where they meet.
    pub const LN_JERK_GAIN: usize = 3;
    /// Input bias (input unit).
    pub const INPUT_BIAS: usize = 4;
}

/// The best process and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// The process of least squares.
    pub process: Process,
    /// Constant input that the recording does not show (input unit).
    pub input_bias: f64,
    /// Covariance over the coordinates of [`coordinate`], from the noise and from the error of the
    /// model that the residual betrays; `None` where a coordinate has no influence at all.
    pub covariance: Option<[[f64; 5]; 5]>,
    /// Relative error of the response at the harmonics of the oscillation that the residual betrays;
    /// zero where noise explains it.
    pub response_error: f64,
    /// Standard deviation of the residual, for one sample (output unit).
    pub residual_sigma: f64,
    /// Standard deviation of white noise seen in the samples themselves (output unit).
    pub noise_sigma: f64,
    /// Root mean square of the residual bins (output unit).
    pub residual_rms: f64,
    /// The limit of the domain that the fit lies on, if any.
    pub edge: Option<DomainEdge>,
    /// Steps of the search, over all starts.
    pub steps: u32,
}

/// Why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefineError {
    /// Fewer usable bins than unknowns ask for.
    TooFewBins(usize),
    /// The window's input never changes.
    NoInput,
    /// No start led to a process: the output does not follow the input.
    NoFit,
}

/// Least number of bins for nine unknowns and a residual to judge them by.
const FEWEST_BINS: usize = 16;
/// Starts that are searched to the end, after all were tried once.
const SEARCHED: usize = 3;
/// Limit of the search from one start; it takes about ten steps.
const MOST_STEPS: u32 = 60;
/// The search ends when a step lowers the sum of squares by less than this part.
const CONVERGED: f64 = 1e-9;

/// Fits the process to the window of an oscillation with the given period.
///
/// # Errors
/// A [`RefineError`] where the window does not hold what a fit needs.
pub fn refine<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    period_s: f64,
) -> Result<Refined, RefineError> {
    refine_with(window, period_s, &Beforehand::default())
}

/// What is known before the fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beforehand<'a> {
    /// Shapes to start from, beside those that the oscillation itself suggests.
    pub starts: &'a [Shape],
    /// How likely shapes are.
    pub prior: Option<ShapePrior>,
}

/// As [`refine`], with what is known beforehand.
///
/// # Errors
/// As [`refine`].
pub fn refine_with<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    period_s: f64,
    beforehand: &Beforehand<'_>,
) -> Result<Refined, RefineError> {
    let mut estimator = Estimator::new(window, period_s)?;
    estimator.prior = beforehand.prior;
    estimator.run(beforehand.starts)
}

/// What the best linear fit at a given process leaves of each bin (output unit): measured less
/// fitted; zero in a bin that is not fitted. Returns the number of bins.
///
/// # Errors
/// As [`refine`].
pub fn residuals<const BINS: usize, const EDGES: usize>(
    window: &Window<BINS, EDGES>,
    period_s: f64,
    process: &Process,
    residuals: &mut [f64; BINS],
) -> Result<usize, RefineError> {
    let estimator = Estimator::new(window, period_s)?;
    let mut fit = LinearFit::room();
    estimator
        .fit(&shape_of(process, period_s), &mut fit)
        .ok_or(RefineError::NoFit)?;
    *residuals = fit.residual;
    for (residual, weight) in residuals.iter_mut().zip(&estimator.weight) {
        *residual = if *weight > 0.0 {
            *residual / weight
        } else {
            0.0
        };
    }
    Ok(window.bins().len())
}

struct Estimator<'a, const BINS: usize, const EDGES: usize> {
    window: &'a Window<BINS, EDGES>,
    grid: Grid,
    period_s: f64,
    /// Per row: square root of the number of samples (0 leaves the row out), mean deviation from
    /// the middle of the bin (s).
    weight: [f64; BINS],
    offset_s: [f64; BINS],
    rows: usize,
    used: usize,
    /// Standard deviation of a sample over that of the acceleration known beforehand.
    acceleration_row: f64,
    /// Standard deviation of a sample over that of the distortion known beforehand.
    distortion_row: f64,
    /// Standard deviation of a sample (output unit), and what is known of the shape.
    sigma: f64,
    prior: Option<ShapePrior>,
    fundamental: Fundamental,
}

/// The linear fit at one shape.
struct LinearFit<const BINS: usize> {
    basis: Columns<LINEAR, BINS>,
    triangle: Triangle<LINEAR>,
    coefficients: [f64; LINEAR],
    residual: [f64; BINS],
    cost: f64,
}

impl<const BINS: usize> LinearFit<BINS> {
    /// Room for one: a fit is most of the memory that the estimator takes, so it is made where it stays.
    fn room() -> Self {
        Self {
            basis: Columns::zero(0),
            triangle: [[0.0; LINEAR]; LINEAR],
            coefficients: [0.0; LINEAR],
            residual: [0.0; BINS],
            cost: f64::INFINITY,
        }
    }
}

impl<'a, const BINS: usize, const EDGES: usize> Estimator<'a, BINS, EDGES> {
    fn new(window: &'a Window<BINS, EDGES>, period_s: f64) -> Result<Self, RefineError> {
        let [first, later @ ..] = window.edges() else {
            return Err(RefineError::NoInput);
        };
        if later.is_empty() {
            return Err(RefineError::NoInput);
        }
        let bin_s = window.bin_s();
        // The past is used from where the longest delay no longer reaches behind its first edge.
        let known_from_s = first.time_s + HIGHEST[2] * period_s;
        let past_bins = ((window.start_s() - known_from_s) / bin_s).max(0.0) as usize;
        let mut estimator = Self {
            window,
            grid: Grid {
                sample_s: window.sample_s(),
                per_bin: window.per_bin(),
                past_bins,
                start_s: window.start_s(),
            },
            period_s,
            weight: [0.0; BINS],
            offset_s: [0.0; BINS],
            rows: window.bins().len() + KNOWN,
            used: 0,
            acceleration_row: 0.0,
            distortion_row: 0.0,
            sigma: 0.0,
            prior: None,
            fundamental: Fundamental::of(window, period_s),
        };
        let half_bin_s = 0.5 * (bin_s - window.sample_s());
        for (k, bin) in window.bins().iter().enumerate() {
            // A bin that lacks many of its samples, as the last one may, has another spread in time.
            let is_last = k + 1 == window.bins().len();
            if bin.count == window.per_bin() || (!is_last && 8 * bin.count >= 7 * window.per_bin())
            {
                let count = f64::from(bin.count);
                estimator.weight[k] = sqrt(count);
                estimator.offset_s[k] = bin.time_sum_s / count - (k as f64 * bin_s + half_bin_s);
                estimator.used += 1;
            }
        }
        if estimator.used < FEWEST_BINS {
            return Err(RefineError::TooFewBins(estimator.used));
        }
        // A perfect recording leaves rounding of about a millionth.
        estimator.sigma = window.noise_sigma().max(1e-6 * estimator.fundamental.rms);
        if estimator.fundamental.acceleration > 0.0 {
            estimator.acceleration_row = estimator.sigma / estimator.fundamental.acceleration;
        }
        estimator.distortion_row = estimator.sigma / DISTORTION;
        Ok(estimator)
    }

    fn run(&self, given: &[Shape]) -> Result<Refined, RefineError> {
        let suggested = self.fundamental.starts();
        let mut fits = [LinearFit::room(), LinearFit::room()];
        let mut starts = [([0.0; SHAPE], f64::INFINITY); SEARCHED];
        for start in given.iter().chain(&suggested) {
            let start = clamp(start);
            let cost = self.fit(&start, &mut fits[0]).unwrap_or(f64::INFINITY);
            if let Some(place) = starts.iter().position(|&(_, other)| cost < other) {
                starts[place..].rotate_right(1);
                starts[place] = (start, cost);
            }
        }
        let mut steps = 0;
        let mut best: Option<(Shape, f64)> = None;
        for (start, _) in starts.iter().filter(|(_, cost)| cost.is_finite()) {
            if let Some((shape, cost)) = self.search(*start, &mut fits, &mut steps)
                && best.is_none_or(|(_, least)| cost < least)
            {
                best = Some((shape, cost));
                if cost <= self.cost_of_noise() {
                    break;
                }
            }
        }
        let (shape, _) = best.ok_or(RefineError::NoFit)?;
        // Made again rather than kept, for want of room.
        let [fit, _] = &mut fits;
        self.fit(&shape, fit).ok_or(RefineError::NoFit)?;
        self.result(&shape, fit, steps)
    }

    /// Sum of squares that white noise as seen in the samples would leave, and a quarter more.
    fn cost_of_noise(&self) -> f64 {
        let sigma = self.window.noise_sigma();
        1.25 * sigma * sigma * self.used as f64
    }

    fn process(&self, shape: &Shape) -> Option<Process> {
        let [ln_sum, ratio, delay] = *shape;
        let sum_per_s = exp(ln_sum) / self.period_s;
        Process::from_pole_sum(1.0, sum_per_s, ratio, delay * self.period_s).ok()
    }

    /// Weighted means of the model over the bins, and the acceleration in the last row.
    fn model(&self, response: &Response<'_>, of: &[f64; LINEAR], rows: &mut [f64; BINS]) {
        let bins = self.rows - KNOWN;
        let [y, v, w, distortion, constant, recorded] = *of;
        let process = response.process();
        // The acceleration, unlike the force, is a state whichever of the lags comes first, as
        // K/(T_body T_prop), unlike K/T_body, is a gain.
        let f = w + process.inv_t_body_per_s() * v;
        let unit = process.t_prop_s();
        let drive = Drive {
            initial: State { y, v, f },
            constant: unit * constant,
            recorded: unit * recorded,
        };
        response.means(&drive, &self.offset_s[..bins], &mut rows[..bins]);
        if distortion != 0.0 {
            let mut even = [0.0; BINS];
            distortion::means(process, &self.grid, self.window.edges(), &mut even[..bins]);
            let scale = distortion * self.fundamental.relay_acceleration;
            for (row, even) in rows.iter_mut().zip(&even) {
                *row += scale * even;
            }
        }
        for (mean, weight) in rows.iter_mut().zip(&self.weight) {
            *mean *= weight;
        }
        rows[bins] = self.acceleration_row * w;
        rows[bins + 1] = self.distortion_row * distortion;
    }

    /// The model at a shape, whose process there may not be.
    #[inline(never)]
    fn model_at(&self, shape: &Shape, of: &[f64; LINEAR], rows: &mut [f64; BINS]) -> Option<()> {
        let response = Response::new(&self.process(shape)?, self.grid, self.window.edges());
        self.model(&response, of, rows);
        Some(())
    }

    /// The linear fit at a shape, into `fit`; `None` where there is no such process or no finite fit.
    #[inline(never)]
    fn fit(&self, shape: &Shape, fit: &mut LinearFit<BINS>) -> Option<f64> {
        let response = Response::new(&self.process(shape)?, self.grid, self.window.edges());
        fit.basis.rows = self.rows;
        for (index, column) in fit.basis.column.iter_mut().enumerate() {
            let mut unit = [0.0; LINEAR];
            unit[index] = 1.0;
            column.fill(0.0);
            self.model(&response, &unit, column);
        }
        fit.triangle = fit.basis.orthonormalise();
        let residual = &mut fit.residual;
        residual.fill(0.0);
        for (k, bin) in self.window.bins().iter().enumerate() {
            if self.weight[k] > 0.0 {
                residual[k] = bin.output_sum / self.weight[k];
            }
        }
        if let Some(prior) = &self.prior {
            let rows = &mut residual[self.rows - SHAPE..self.rows];
            for (row, deviation) in rows.iter_mut().zip(prior.deviations(shape)) {
                *row = -self.sigma * deviation;
            }
        }
        let parts = fit.basis.project_out(&mut residual[..self.rows]);
        fit.cost = dot(&residual[..self.rows], &residual[..self.rows]);
        fit.coefficients = back_substitute(&fit.triangle, &parts);
        fit.cost.is_finite().then_some(fit.cost)
    }

    /// Derivatives of the fitted model by the shape, the coefficients held, into `jacobian`.
    #[inline(never)]
    fn jacobian(
        &self,
        shape: &Shape,
        coefficients: &[f64; LINEAR],
        jacobian: &mut [[f64; BINS]],
    ) -> Option<()> {
        // Small enough for a truncation error of 1e-6, large enough for rounding of 1e-9.
        const STEP: f64 = 1e-6;
        let mut here = [0.0; BINS];
        self.model_at(shape, coefficients, &mut here)?;
        for (index, column) in jacobian.iter_mut().enumerate() {
            let mut moved = *shape;
            let step = if shape[index] + STEP > HIGHEST[index] {
                -STEP
            } else {
                STEP
            };
            moved[index] += step;
            column.fill(0.0);
            self.model_at(&moved, coefficients, column)?;
            for (value, here) in column.iter_mut().zip(&here) {
                *value = (*value - here) / step;
            }
        }
        if let Some(prior) = &self.prior {
            prior.add_to(jacobian, self.rows - SHAPE, self.sigma);
        }
        Some(())
    }

    /// Levenberg-Marquardt inside the domain; a coordinate at its limit stays there while the
    /// descent points outwards.
    #[inline(never)]
    fn search(
        &self,
        start: Shape,
        [fit, candidate]: &mut [LinearFit<BINS>; 2],
        steps: &mut u32,
    ) -> Option<(Shape, f64)> {
        let mut shape = start;
        self.fit(&shape, fit)?;
        let mut damping = 1e-2;
        let mut jacobian = Columns::zero(self.rows);
        for _ in 0..MOST_STEPS {
            *steps += 1;
            self.jacobian(&shape, &fit.coefficients, &mut jacobian.column)?;
            for column in &mut jacobian.column {
                fit.basis.project_out(&mut column[..self.rows]);
            }
            let normal = NormalEquations::new(&jacobian, &fit.residual, &shape);
            let before = fit.cost;
            while damping < 1e12 {
                let tried = clamp(&normal.step(&shape, damping));
                match self.fit(&tried, candidate) {
                    Some(cost) if cost < fit.cost => {
                        shape = tried;
                        core::mem::swap(fit, candidate);
                        damping *= 0.1;
                        break;
                    }
                    _ => damping *= 8.0,
                }
                if normal.step_is_negligible(damping) {
                    break;
                }
            }
            if before - fit.cost <= CONVERGED * before {
                break;
            }
        }
        Some((shape, fit.cost))
    }

    fn result(
        &self,
        shape: &Shape,
        fit: &LinearFit<BINS>,
        steps: u32,
    ) -> Result<Refined, RefineError> {
        let [.., bias_gain, gain] = fit.coefficients;
        let process = self
            .process(shape)
            .and_then(|unit| unit.with_gain_scaled(gain * unit.t_prop_s()).ok())
            .ok_or(RefineError::NoFit)?;
        let freedom = (self.used - ALL) as f64;
        let variance = fit.cost / freedom;
        let mean_weight_2 = self.weight.iter().map(|w| w * w).sum::<f64>() / self.used as f64;
        let uncertainty = self.covariance(shape, fit);
        Ok(Refined {
            process,
            input_bias: bias_gain / gain,
            covariance: uncertainty.map(|(covariance, _)| covariance),
            response_error: uncertainty.map_or(0.0, |(_, error)| error),
            residual_sigma: sqrt(variance),
            noise_sigma: self.window.noise_sigma(),
            residual_rms: sqrt(variance / mean_weight_2),
            edge: domain_edge(shape),
            steps,
        })
    }
}
