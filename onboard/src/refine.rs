//! The estimator: from a window of one or more cycles to the process, by variable projection.
//!
//! Given the two lags and the delay, the output is linear in everything else:
//!
//! ```text
//! y(t) = b g(t) + b u0 s(t) + y0 + v0 r(t) + w0 q(t)
//! ```
//!
//! with `b = K/T_body`, `g` the response to the recorded input, `s` to a constant one (the unknown
//! input bias `u0`), and `r`, `q` to the unknown initial rate and acceleration. So a search over three
//! unknowns (Levenberg-Marquardt, box-constrained) with the five linear ones solved inside it:
//! Golub and Pereyra (1973), with Kaufman's (1975) Jacobian.
//!
//! One thing is known beforehand: the acceleration at the beginning of the past cannot exceed what
//! the relay can produce. It stands as a last row of the equations; without it one that has died
//! away before the window begins would be undetermined.
//!
//! The three unknowns are the sum of the two poles (its logarithm), their product over the square
//! of the sum, and the delay: regular where the lags are equal (1/4) and where damping vanishes
//! (0), so the double integrator is an ordinary point of the domain's boundary.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use libm::{atan, atan2, cos, exp, hypot, log, sin, sqrt, tan};

use crate::least_squares::{Columns, Triangle, back_substitute, covariance, dot, solve_symmetric};
use crate::process::Process;
use crate::response::{Drive, Grid, Response};
use crate::transition::State;
use crate::window::Window;

/// Unknowns of the search: `ln(pole sum * period)`, pole ratio, `tau / period`.
type Shape = [f64; 3];

/// The domain, in periods: lags from 1/1000 of a period to one, delays to half a period. Wider
/// than any relay oscillation of this process: its actuator and delay are at most its half period.
const LOWEST: Shape = [0.0, 0.0, 0.0];
const HIGHEST: Shape = [6.9, 0.25, 0.5];

/// Number of linear unknowns: y0, v0, w0, the bias times the gain, the gain.
const LINEAR: usize = 5;
/// All unknowns.
const ALL: usize = LINEAR + 3;

/// Index of each coordinate in [`Refined::covariance`].
pub mod coordinate {
    /// Logarithm of the sum of the two poles.
    pub const LN_POLE_SUM: usize = 0;
    /// Product of the poles over the square of their sum.
    pub const POLE_RATIO: usize = 1;
    /// Delay (s).
    pub const TAU_S: usize = 2;
    /// Logarithm of the size of the acceleration gain `K/T_body`.
    pub const LN_GAIN: usize = 3;
    /// Input bias (input unit).
    pub const INPUT_BIAS: usize = 4;
}

/// A limit of the domain that the best fit lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DomainEdge {
    /// Both lags as slow as the oscillation allows.
    SlowLags,
    /// The actuator's lag too fast to be seen.
    FastLag,
    /// The delay as long as the oscillation allows.
    LongDelay,
}

/// The best process and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// The process of least squares.
    pub process: Process,
    /// Constant input that the recording does not show (input unit).
    pub input_bias: f64,
    /// Covariance over the coordinates of [`coordinate`], for white residuals of
    /// `residual_sigma`; `None` where a coordinate has no influence at all.
    pub covariance: Option<[[f64; 5]; 5]>,
    /// Standard deviation of the residual, for one sample (output unit).
    pub residual_sigma: f64,
    /// How much less the residuals tell than white ones would: multiply the covariance by it.
    pub inflation: f64,
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

/// Least number of bins for eight unknowns and a residual to judge them by.
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
    Estimator::new(window, period_s)?.run()
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
    lag_rad: f64,
}

/// The linear fit at one shape.
struct LinearFit<const BINS: usize> {
    basis: Columns<LINEAR, BINS>,
    triangle: Triangle<LINEAR>,
    coefficients: [f64; LINEAR],
    residual: [f64; BINS],
    cost: f64,
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
            rows: window.bins().len() + 1,
            used: 0,
            acceleration_row: 0.0,
            lag_rad: 0.0,
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
        estimator.look_at_fundamental();
        Ok(estimator)
    }

    fn run(&self) -> Result<Refined, RefineError> {
        let mut starts = self.starts();
        for start in &mut starts {
            start.1 = self.fit(&start.0).map_or(f64::INFINITY, |fit| fit.cost);
        }
        starts.sort_unstable_by(|a, b| a.1.total_cmp(&b.1));
        let mut steps = 0;
        let mut best: Option<(Shape, LinearFit<BINS>)> = None;
        for (start, _) in starts.iter().take(SEARCHED) {
            if let Some((shape, fit)) = self.search(*start, &mut steps)
                && best.as_ref().is_none_or(|(_, least)| fit.cost < least.cost)
            {
                let is_noise = fit.cost <= self.cost_of_noise();
                best = Some((shape, fit));
                if is_noise {
                    break;
                }
            }
        }
        let (shape, fit) = best.ok_or(RefineError::NoFit)?;
        self.result(&shape, &fit, steps)
    }

    /// Sum of squares that white noise as seen in the samples would leave, and a quarter more.
    fn cost_of_noise(&self) -> f64 {
        let sigma = self.window.noise_sigma();
        1.25 * sigma * sigma * self.used as f64
    }

    /// Starts on the surface of processes that have the phase measured at the fundamental:
    /// damping from none to strong, the remaining lag shared between actuator and delay.
    fn starts(&self) -> [(Shape, f64); 12] {
        let omega = TAU / self.period_s;
        let mut starts = [([0.0; 3], 0.0); 12];
        for (i, damping) in [0.05, 0.5, 2.0, 5.0].into_iter().enumerate() {
            for (j, share) in [0.15, 0.5, 0.85].into_iter().enumerate() {
                let body = damping / self.period_s;
                // What is left for actuator and delay once the body has taken its part.
                let rest = (self.lag_rad - FRAC_PI_2 - atan(omega / body)).clamp(0.1, 1.4);
                let prop = omega / tan(share * rest);
                let sum = prop + body;
                let shape = [
                    log(sum * self.period_s),
                    prop * body / (sum * sum),
                    (1.0 - share) * rest / TAU,
                ];
                starts[3 * i + j] = (clamp(&shape), 0.0);
            }
        }
        starts
    }

    /// Takes the lag of the process and the size of its acceleration from the fundamentals of input and
    /// output.
    fn look_at_fundamental(&mut self) {
        let omega = TAU / self.period_s;
        let start_s = self.window.start_s();
        let (mut y_cos, mut y_sin, mut y_square) = (0.0, 0.0, 0.0);
        for bin in self.window.bins() {
            let mean = bin.output_sum / f64::from(bin.count).max(1.0);
            let angle = omega * bin.time_sum_s / f64::from(bin.count).max(1.0);
            y_cos += mean * cos(angle) * self.window.bin_s();
            y_sin += mean * sin(angle) * self.window.bin_s();
            y_square += bin.output_sum * mean;
        }
        // Integral of u e^(-i w t) over the window, piece by piece.
        let end_s = self.window.bins().len() as f64 * self.window.bin_s();
        let (mut u_cos, mut u_sin, mut u_largest) = (0.0, 0.0, 0.0_f64);
        let edges = self.window.edges();
        for (k, edge) in edges.iter().enumerate() {
            let to = edges
                .get(k + 1)
                .map_or(end_s, |next| next.time_s - start_s)
                .clamp(0.0, end_s);
            let from = (edge.time_s - start_s).clamp(0.0, end_s);
            u_cos += edge.input * (sin(omega * to) - sin(omega * from)) / omega;
            u_sin += edge.input * (cos(omega * from) - cos(omega * to)) / omega;
            u_largest = u_largest.max(edge.input.abs());
        }
        let lag = atan2(y_sin, y_cos) - atan2(u_sin, u_cos);
        let lag = lag - TAU * libm::floor(lag / TAU);
        // Every process lags by a quarter turn and more; less means a negative gain.
        self.lag_rad = if lag < FRAC_PI_2 { lag + PI } else { lag };
        // |G| is less than b / w^2, by less than two; the largest input takes b to the bound.
        let magnitude = hypot(y_cos, y_sin) / hypot(u_cos, u_sin).max(f64::MIN_POSITIVE);
        let acceleration = 2.0 * magnitude * omega * omega * u_largest;
        let samples: u32 = self.window.bins().iter().map(|bin| bin.count).sum();
        let rms = sqrt(y_square / f64::from(samples));
        // A perfect recording leaves rounding of about a millionth.
        let sigma = self.window.noise_sigma().max(1e-6 * rms);
        if acceleration > 0.0 {
            self.acceleration_row = sigma / acceleration;
        }
    }

    fn process(&self, shape: &Shape) -> Option<Process> {
        let [ln_sum, ratio, delay] = *shape;
        let sum_per_s = exp(ln_sum) / self.period_s;
        Process::from_pole_sum(1.0, sum_per_s, ratio, delay * self.period_s).ok()
    }

    /// Weighted means of the model over the bins, and the acceleration in the last row.
    fn model(&self, response: &Response<'_>, of: &[f64; LINEAR], rows: &mut [f64; BINS]) {
        let bins = self.rows - 1;
        let [y, v, w, constant, recorded] = *of;
        // The acceleration, unlike the force, is a state whichever of the lags comes first.
        let f = w + response.process().inv_t_body_per_s() * v;
        let drive = Drive {
            initial: State { y, v, f },
            constant,
            recorded,
        };
        response.means(&drive, &self.offset_s[..bins], &mut rows[..bins]);
        for (mean, weight) in rows.iter_mut().zip(&self.weight) {
            *mean *= weight;
        }
        rows[bins] = self.acceleration_row * w;
    }

    fn fit(&self, shape: &Shape) -> Option<LinearFit<BINS>> {
        let response = Response::new(&self.process(shape)?, self.grid, self.window.edges());
        let mut basis = Columns::zero(self.rows);
        for (index, column) in basis.column.iter_mut().enumerate() {
            let mut unit = [0.0; LINEAR];
            unit[index] = 1.0;
            self.model(&response, &unit, column);
        }
        let triangle = basis.orthonormalise();
        let mut residual = [0.0; BINS];
        for (k, bin) in self.window.bins().iter().enumerate() {
            if self.weight[k] > 0.0 {
                residual[k] = bin.output_sum / self.weight[k];
            }
        }
        let parts = basis.project_out(&mut residual[..self.rows]);
        let cost = dot(&residual[..self.rows], &residual[..self.rows]);
        let coefficients = back_substitute(&triangle, &parts);
        cost.is_finite().then_some(LinearFit {
            basis,
            triangle,
            coefficients,
            residual,
            cost,
        })
    }

    /// Derivatives of the fitted model by the shape, the coefficients held.
    fn jacobian(&self, shape: &Shape, fit: &LinearFit<BINS>) -> Option<Columns<3, BINS>> {
        // Small enough for a truncation error of 1e-6, large enough for rounding of 1e-9.
        const STEP: f64 = 1e-6;
        let mut here = [0.0; BINS];
        let response = Response::new(&self.process(shape)?, self.grid, self.window.edges());
        self.model(&response, &fit.coefficients, &mut here);
        let mut jacobian = Columns::zero(self.rows);
        for (index, column) in jacobian.column.iter_mut().enumerate() {
            let mut moved = *shape;
            let step = if shape[index] + STEP > HIGHEST[index] {
                -STEP
            } else {
                STEP
            };
            moved[index] += step;
            let response = Response::new(&self.process(&moved)?, self.grid, self.window.edges());
            self.model(&response, &fit.coefficients, column);
            for (value, here) in column.iter_mut().zip(&here) {
                *value = (*value - here) / step;
            }
        }
        Some(jacobian)
    }

    /// Levenberg-Marquardt inside the domain; a coordinate at its limit stays there while the
    /// descent points outwards.
    fn search(&self, start: Shape, steps: &mut u32) -> Option<(Shape, LinearFit<BINS>)> {
        let mut shape = start;
        let mut fit = self.fit(&shape)?;
        let mut damping = 1e-2;
        for _ in 0..MOST_STEPS {
            *steps += 1;
            let mut jacobian = self.jacobian(&shape, &fit)?;
            for column in &mut jacobian.column {
                fit.basis.project_out(&mut column[..self.rows]);
            }
            let normal = NormalEquations::new(&jacobian, &fit.residual, &shape);
            let before = fit.cost;
            while damping < 1e12 {
                let candidate = clamp(&normal.step(&shape, damping));
                match self.fit(&candidate) {
                    Some(better) if better.cost < fit.cost => {
                        (shape, fit) = (candidate, better);
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
        Some((shape, fit))
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
            .and_then(|unit| unit.with_gain_scaled(gain).ok())
            .ok_or(RefineError::NoFit)?;
        let freedom = (self.used - ALL) as f64;
        let variance = fit.cost / freedom;
        let mean_weight_2 = self.weight.iter().map(|w| w * w).sum::<f64>() / self.used as f64;
        Ok(Refined {
            process,
            input_bias: bias_gain / gain,
            covariance: self.covariance(shape, fit, variance),
            residual_sigma: sqrt(variance),
            inflation: self.inflation(&fit.residual, variance),
            noise_sigma: self.window.noise_sigma(),
            residual_rms: sqrt(variance / mean_weight_2),
            edge: domain_edge(shape),
            steps,
        })
    }

    /// Covariance of all unknowns but the initial state, in the coordinates of [`coordinate`].
    fn covariance(
        &self,
        shape: &Shape,
        fit: &LinearFit<BINS>,
        variance: f64,
    ) -> Option<[[f64; 5]; 5]> {
        let mut jacobian = self.jacobian(shape, fit)?;
        let mut along = [[0.0; LINEAR]; 3];
        for (column, along) in jacobian.column.iter_mut().zip(&mut along) {
            *along = fit.basis.project_out(&mut column[..self.rows]);
        }
        let inner = jacobian.orthonormalise();
        // The triangle of bias, gain and shape; the initial state is eliminated before them.
        let mut triangle = [[0.0; 5]; 5];
        for i in 0..2 {
            for j in i..2 {
                triangle[i][j] = fit.triangle[LINEAR - 2 + i][LINEAR - 2 + j];
            }
            for j in 0..3 {
                triangle[i][2 + j] = along[j][LINEAR - 2 + i];
            }
        }
        for i in 0..3 {
            for j in i..3 {
                triangle[2 + i][2 + j] = inner[i][j];
            }
        }
        let raw = covariance(&triangle)?;
        // Linear map from (bias gain, gain, shape) to the coordinates.
        let [.., bias_gain, gain] = fit.coefficients;
        let mut map = [[0.0; 5]; 5];
        map[coordinate::LN_POLE_SUM][2] = 1.0;
        map[coordinate::POLE_RATIO][3] = 1.0;
        map[coordinate::TAU_S][4] = self.period_s;
        map[coordinate::LN_GAIN][1] = 1.0 / gain;
        map[coordinate::INPUT_BIAS][0] = 1.0 / gain;
        map[coordinate::INPUT_BIAS][1] = -bias_gain / (gain * gain);
        let mut mapped = [[0.0; 5]; 5];
        for i in 0..5 {
            for j in 0..5 {
                let mut sum = 0.0;
                for (k, row) in raw.iter().enumerate() {
                    sum += map[i][k] * (0..5).map(|l| row[l] * map[j][l]).sum::<f64>();
                }
                mapped[i][j] = variance * sum;
            }
        }
        Some(mapped)
    }

    /// How much less the residual tells than white noise of its size would.
    ///
    /// What the samples' own white noise does not explain is error of the model. It has few
    /// degrees of freedom, some harmonics of the oscillation, the same in every cycle, and errs as
    /// much along the parameters as along each of those: so it counts as that few, the number of
    /// bins over the sum of the squared autocorrelations (a pure harmonic: two).
    fn inflation(&self, residual: &[f64; BINS], variance: f64) -> f64 {
        let noise = self.window.noise_sigma();
        let unexplained = (1.0 - noise * noise / variance).max(0.0);
        let bins = &residual[..self.rows - 1];
        let mut redundancy = 1.0;
        for lag in 1..bins.len() / 2 {
            let pairs = (bins.len() - lag) as f64;
            let correlation = autocorrelation(bins, lag);
            // White noise alone has a mean square of one over the number of pairs.
            redundancy +=
                2.0 * (correlation * correlation - 1.0 / pairs) * pairs / bins.len() as f64;
        }
        1.0 + unexplained * (redundancy.max(1.0) - 1.0)
    }
}

/// Mean product of values `lag` apart over the mean square; zero where there is nothing to compare.
fn autocorrelation(values: &[f64], lag: usize) -> f64 {
    if lag >= values.len() {
        return 0.0;
    }
    let mean_square = dot(values, values) / values.len() as f64;
    let product = dot(&values[..values.len() - lag], &values[lag..]) / (values.len() - lag) as f64;
    if mean_square > 0.0 {
        product / mean_square
    } else {
        0.0
    }
}

/// Gradient and curvature of the sum of squares in the free coordinates.
struct NormalEquations {
    curvature: [[f64; 3]; 3],
    gradient: [f64; 3],
    free: [bool; 3],
}

impl NormalEquations {
    fn new<const BINS: usize>(
        jacobian: &Columns<3, BINS>,
        residual: &[f64; BINS],
        shape: &Shape,
    ) -> Self {
        let rows = jacobian.rows;
        let column = |i: usize| &jacobian.column[i][..rows];
        let mut this = Self {
            curvature: [[0.0; 3]; 3],
            gradient: [0.0; 3],
            free: [true; 3],
        };
        for i in 0..3 {
            this.gradient[i] = dot(column(i), &residual[..rows]);
            let outwards = (shape[i] <= LOWEST[i] && this.gradient[i] < 0.0)
                || (shape[i] >= HIGHEST[i] && this.gradient[i] > 0.0);
            this.free[i] = !outwards;
            for j in 0..3 {
                this.curvature[i][j] = dot(column(i), column(j));
            }
        }
        this
    }

    /// The shape after a damped step (Marquardt's scaling) of the free coordinates.
    fn step(&self, shape: &Shape, damping: f64) -> Shape {
        let mut matrix = self.curvature;
        let mut right = self.gradient;
        for i in 0..3 {
            matrix[i][i] += damping * self.curvature[i][i] + f64::MIN_POSITIVE;
            if !self.free[i] {
                for j in 0..3 {
                    matrix[i][j] = 0.0;
                    matrix[j][i] = 0.0;
                }
                matrix[i][i] = 1.0;
                right[i] = 0.0;
            }
        }
        let step = solve_symmetric(&matrix, &right).unwrap_or([0.0; 3]);
        [shape[0] + step[0], shape[1] + step[1], shape[2] + step[2]]
    }

    fn step_is_negligible(&self, damping: f64) -> bool {
        let moved = self.step(&[0.0; 3], damping);
        moved.iter().all(|step| step.abs() < 1e-12)
    }
}

fn clamp(shape: &Shape) -> Shape {
    let mut inside = *shape;
    for (value, (low, high)) in inside.iter_mut().zip(LOWEST.iter().zip(&HIGHEST)) {
        *value = value.clamp(*low, *high);
    }
    inside
}

fn domain_edge(shape: &Shape) -> Option<DomainEdge> {
    if shape[0] <= LOWEST[0] {
        Some(DomainEdge::SlowLags)
    } else if shape[0] >= HIGHEST[0] {
        Some(DomainEdge::FastLag)
    } else if shape[2] >= HIGHEST[2] {
        Some(DomainEdge::LongDelay)
    } else {
        None
    }
}
