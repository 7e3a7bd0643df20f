//! Likelihood of a record under a process with disturbances: one Kalman filter over all columns.
//!
//! ```text
//! y = kappa g + X0 x0 + e,    e = white noise of a sample + response to the disturbances
//! ```
//!
//! `g` is the response of unit gain to the input, `x0` the unknown state at the first block, the disturbance among it.
//! The filter turns `e` into white innovations of variance `s2 S_k`; applied to `y`, `g` and the columns of `X0` it
//! leaves a linear least-squares problem for `kappa` and `x0`. With flat priors on both, and the best `s2`,
//!
//! ```text
//! ln L = -1/2 (m ln(2 pi s2) + m + sum ln S_k + ln|X'X| - ln|X0'X0|),   s2 = |r|^2 / m,   m = N - p
//! ```
//!
//! where `r` is the residual, `X` the `p` filtered columns and `X0` the same columns before the filter. All states are
//! unknown, so any initial covariance gives the same likelihood, and the filter starts from its steady one: its gain is
//! constant from the first block on. Reference: P. de Jong, "The likelihood for a state space model", Biometrika 75
//! (1988); G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973).
//!
//! Quadratic forces of the record add a column each, beside `g`: their coefficients are further linear unknowns.
//!
//! Shapes: `N` states (the last one is the disturbance), `blocks` rows, `N + 2` columns `y`, `g`, `X0`, and up to two of
//! quadratic forces.

use std::f64::consts::TAU as TWO_PI;

use onecycle_design::state_space::{Matrix, StateSpace, identity, product};

use super::lifted::{Lifted, Sample, row_times};
use super::orthogonal::Orthogonal;
use super::record::Blocks;
use super::response;
use super::theta::{NoiseKind, Theta};

/// Columns of a row of the filter: room for `y`, `g`, the states and quadratic forces, six of these in all, and a multiple
/// of the width of a vector register.
const LANES: usize = 8;
/// Relative change of the covariance below which the filter of a kind of block is steady.
const STEADY: f64 = 1e-9;

/// Likelihood at one point, with the linear unknowns at their best.
#[derive(Clone, Debug)]
pub(super) struct Evaluation {
    pub(super) log_likelihood: f64,
    /// Residual of each block that has samples, scaled so that least squares of it is maximum likelihood, the noise
    /// included.
    pub(super) residual: Vec<f64>,
    /// Scale of the residual: `exp((sum ln S_k + ln|X'X| - ln|X0'X0|) / (2 m))` over the deviation of the outputs.
    pub(super) stretch: f64,
    /// Gain in front of the stages (output unit / input unit, per second for each integration).
    pub(super) gain: f64,
    /// Variance of the gain for fixed nonlinear unknowns, over [`Self::variance`].
    pub(super) gain_factor: f64,
    /// State at the first block; the disturbance is the last (output unit, times the gain).
    pub(super) state: Vec<f64>,
    /// Coefficients of the quadratic forces, and their deviation for fixed nonlinear unknowns (output unit / unit of the
    /// force).
    pub(super) quadratic: Vec<(f64, f64)>,
    /// Variance of the disturbance at the first block and its covariance with the gain, for fixed nonlinear unknowns, over
    /// [`Self::variance`].
    pub(super) disturbance_factors: (f64, f64),
    /// Variance `s2` of the white noise of a sample (output unit^2).
    pub(super) variance: f64,
    /// Innovations of the response to the input, over the standard deviation of an innovation.
    pub(super) input_innovations: Vec<f64>,
    /// `sum ln S_k` and `ln|X'X| - ln|X0'X0|`.
    #[cfg(test)]
    pub(super) determinants: (f64, f64),
}

impl Evaluation {
    /// Sum of squares of the residual.
    pub(super) fn cost(&self) -> f64 {
        self.residual.iter().map(|r| r * r).sum()
    }

    /// Innovations over their standard deviation.
    pub(super) fn innovations(&self) -> Vec<f64> {
        let scale = 1.0 / (self.stretch * self.variance.sqrt());
        self.residual.iter().map(|r| r * scale).collect()
    }
}

/// Evaluates the likelihood at `theta`. `None` if the filter does not converge or the columns are degenerate.
pub(super) fn evaluate(
    blocks: &Blocks<'_>,
    theta: &Theta,
    memory: &mut Memory,
) -> Option<Evaluation> {
    match theta.structure.stages().states() + 1 {
        2 => evaluate_sized::<2>(blocks, theta, memory),
        3 => evaluate_sized::<3>(blocks, theta, memory),
        4 => evaluate_sized::<4>(blocks, theta, memory),
        5 => evaluate_sized::<5>(blocks, theta, memory),
        _ => None,
    }
}

/// What the last evaluation computed from the process alone. Steps in the noise find it here.
#[derive(Default)]
pub(super) struct Memory {
    key: Option<(Theta, bool)>,
    /// `g`, summed over the samples present in each block.
    response: Vec<f64>,
    /// The same of each quadratic force.
    quadratic: Vec<Vec<f64>>,
    /// `ln|X0'X0| / 2`.
    log_determinant: f64,
}

impl Memory {
    /// The process of `theta` without its noise, and whether the output walks.
    fn key(theta: &Theta, walks: bool) -> (Theta, bool) {
        let mut process = *theta;
        for kind in NoiseKind::ALL {
            process.set_noise(kind, 0.0);
        }
        (process, walks)
    }
}

/// Matrices of a process under its noises.
pub(super) struct System<const N: usize> {
    pub(super) model: StateSpace<N>,
    /// Output row.
    pub(super) c: [f64; N],
    /// Intensities of the noises over the variance of the white noise of a sample.
    intensity: Matrix<N>,
}

impl<const N: usize> System<N> {
    pub(super) fn new(theta: &Theta, dt_s: f64) -> Self {
        let mut model = StateSpace::<N>::new(&theta.process(1.0));
        let stages = theta.structure.stages();
        let behind = stages.behind_the_lags() as i32;
        let mut c = [0.0; N];
        c[model.output] = 1.0;
        let [w1, w0, wy] = NoiseKind::ALL.map(|kind| theta.noise(kind));
        // Without an integrator the last state is the walk of the output. It takes the place of the disturbance, from
        // which it could hardly be told in the steady state.
        let mut walking = model.output;
        if wy > 0.0 && stages.integrators == 0 {
            walking = N - 1;
            c[N - 1] = 1.0;
            for row in &mut model.a {
                row[N - 1] = 0.0;
            }
        }
        let mut intensity = [[0.0; N]; N];
        if w1 > 0.0 && walking != N - 1 {
            intensity[N - 1][N - 1] = dt_s * w1.powi(2 * behind + 2);
        }
        for i in 0..N {
            for j in 0..N {
                intensity[i][j] += model.entry[i] * model.entry[j] * dt_s * w0.powi(2 * behind);
            }
        }
        if wy > 0.0 {
            intensity[walking][walking] += dt_s * wy * wy;
        }
        Self {
            model,
            c,
            intensity,
        }
    }

    /// Matrices of one sample of `step_s`.
    fn sample(&self, step_s: f64, phi: Matrix<N>) -> Sample<N> {
        Sample {
            phi,
            c: self.c,
            q: self.model.covariance(&self.intensity, step_s),
            noise: 1.0,
        }
    }

    fn is_quiet(&self) -> bool {
        self.intensity.iter().flatten().all(|v| *v == 0.0)
    }

    /// Matrices of each kind of block.
    pub(super) fn lifted(&self, blocks: &Blocks<'_>) -> Vec<Lifted<N>> {
        let mut lifted: Vec<Lifted<N>> = Vec::with_capacity(blocks.kinds.len());
        let mut last: Option<(f64, Sample<N>)> = None;
        for kind in &blocks.kinds {
            let sample = match last.take() {
                Some((step_s, sample)) if step_s == kind.step_s => sample,
                _ => self.sample(kind.step_s, self.model.step(kind.step_s).phi),
            };
            lifted.push(if kind.mask.iter().all(|present| *present) {
                Lifted::of_full(&sample, kind.mask.len())
            } else {
                Lifted::of_mask(&sample, &kind.mask)
            });
            last = Some((kind.step_s, sample));
        }
        lifted
    }

    /// Covariance that the filter starts from: the steady one of the first kind of block without absent samples.
    pub(super) fn start(&self, blocks: &Blocks<'_>, lifted: &[Lifted<N>]) -> Option<Matrix<N>> {
        if self.is_quiet() {
            return Some([[0.0; N]; N]);
        }
        let is_full = |kind: usize| blocks.kinds[kind].mask.iter().all(|present| *present);
        let full = (0..lifted.len()).find(|&kind| is_full(kind) && lifted[kind].r > 0.0);
        let any = || (0..lifted.len()).find(|&kind| lifted[kind].r > 0.0);
        lifted[full.or_else(any)?].steady_covariance()
    }
}

fn evaluate_sized<const N: usize>(
    blocks: &Blocks<'_>,
    theta: &Theta,
    memory: &mut Memory,
) -> Option<Evaluation> {
    let system = System::<N>::new(theta, blocks.record.dt_s);
    let lifted = system.lifted(blocks);
    remember(&system, &lifted, blocks, theta, memory)?;
    let filtered = filter(&system, &lifted, blocks, memory)?;
    let columns = Orthogonal::new(&filtered.columns[1..])?;
    let count = filtered.columns[0].len();
    let freedom = count as f64 - (filtered.columns.len() - 1) as f64;
    if freedom < 1.0 {
        return None;
    }
    let (residual, coefficients) = columns.solve(&filtered.columns[0]);
    let sum: f64 = residual.iter().map(|r| r * r).sum();
    let variance = sum / freedom;
    let log_x = 2.0 * (columns.log_determinant() - memory.log_determinant);
    let logs = filtered.log_variances + log_x;
    let scale = blocks.scale;
    let likelihood = -0.5 * (freedom * (TWO_PI * variance).ln() + freedom + logs);
    let log_likelihood = likelihood - freedom * scale.ln();
    if !log_likelihood.is_finite() {
        return None;
    }
    let stretch = (0.5 * logs / freedom).exp();
    let inverse = columns.covariance(&[0, N]);
    let squared = variance * scale * scale;
    let per_deviation = coefficients[0] / variance.sqrt();
    let input_innovations = filtered.columns[1]
        .iter()
        .map(|g| g * per_deviation)
        .collect();
    Some(Evaluation {
        log_likelihood,
        residual: residual.iter().map(|r| r * stretch).collect(),
        stretch: stretch / scale,
        gain: coefficients[0] * scale,
        gain_factor: inverse[0][0],
        state: coefficients[1..=N].iter().map(|x| x * scale).collect(),
        quadratic: (N + 1..coefficients.len())
            .map(|column| {
                let [[factor]] = columns.covariance(&[column]);
                (coefficients[column] * scale, (factor * squared).sqrt())
            })
            .collect(),
        disturbance_factors: (inverse[1][1], inverse[0][1]),
        variance: squared,
        input_innovations,
        #[cfg(test)]
        determinants: (filtered.log_variances, log_x),
    })
}

/// Response and determinant of the columns before the filter, computed unless `memory` has them.
fn remember<const N: usize>(
    system: &System<N>,
    lifted: &[Lifted<N>],
    blocks: &Blocks<'_>,
    theta: &Theta,
    memory: &mut Memory,
) -> Option<()> {
    let walks = system.c[N - 1] != 0.0;
    let key = Memory::key(theta, walks);
    if memory.key == Some(key) {
        return Some(());
    }
    memory.key = None;
    memory.response = response::sums(&system.model, blocks, theta.tau_s());
    memory.quadratic = response::of_quadratic(&system.model, blocks, theta.delay_and_lag_s());
    let has_samples = |block: &usize| lifted[blocks.kind_of[*block] as usize].r > 0.0;
    let mut columns = vec![Vec::with_capacity(blocks.len()); N + 1];
    let of_samples = |sums: &[f64]| -> Vec<f64> {
        let blocks = (0..blocks.len()).filter(has_samples);
        blocks.map(|block| sums[block]).collect()
    };
    columns[0] = of_samples(&memory.response);
    let mut state = identity::<N>();
    for &kind in &blocks.kind_of {
        let block = &lifted[kind as usize];
        if block.r > 0.0 {
            for (column, value) in columns[1..].iter_mut().zip(row_times(&block.c, &state)) {
                column.push(value);
            }
        }
        state = product(&block.phi, &state);
    }
    columns.extend(memory.quadratic.iter().map(|sums| of_samples(sums)));
    memory.log_determinant = Orthogonal::new(&columns)?.log_determinant();
    memory.key = Some(key);
    Some(())
}

/// Innovations of all columns.
struct Filtered {
    /// `y`, `g`, one column a state, quadratic forces; a row for each block that has samples.
    columns: Vec<Vec<f64>>,
    /// `sum ln S_k`.
    log_variances: f64,
}

/// Runs the filter over the columns.
fn filter<const N: usize>(
    system: &System<N>,
    lifted: &[Lifted<N>],
    blocks: &Blocks<'_>,
    memory: &Memory,
) -> Option<Filtered> {
    let mut gains = Gains::new(system.start(blocks, lifted)?);
    let forces = &memory.quadratic;
    let count = N + 2 + forces.len();
    if count > LANES {
        return None;
    }
    let mut columns = vec![Vec::with_capacity(blocks.len()); count];
    let mut log_variances = 0.0;
    // Row i holds state i of the predictions of all columns. A column of an initial state is the filter of zero data
    // that starts from minus the unit state.
    let mut states = [[0.0; LANES]; N];
    for i in 0..N {
        states[i][2 + i] = -1.0;
    }
    for (block, &kind) in blocks.kind_of.iter().enumerate() {
        let model = &lifted[kind as usize];
        if model.r <= 0.0 {
            states = moved(&model.phi, &states);
            gains.skip(model);
            continue;
        }
        gains.update(kind, model);
        log_variances += gains.log_variance;
        let mut innovation = [0.0; LANES];
        innovation[0] = blocks.sums[block];
        innovation[1] = memory.response[block];
        for (lane, force) in innovation[N + 2..].iter_mut().zip(forces) {
            *lane = force[block];
        }
        for i in 0..N {
            for lane in 0..LANES {
                innovation[lane] -= model.c[i] * states[i][lane];
            }
        }
        states = moved(&model.phi, &states);
        for i in 0..N {
            for lane in 0..LANES {
                states[i][lane] += gains.gain[i] * innovation[lane];
            }
        }
        for (column, value) in columns.iter_mut().zip(innovation) {
            column.push(value * gains.inverse_deviation);
        }
    }
    Some(Filtered {
        columns,
        log_variances,
    })
}

/// `Phi X` for the states of all lanes.
fn moved<const N: usize>(phi: &Matrix<N>, states: &[[f64; LANES]; N]) -> [[f64; LANES]; N] {
    let mut next = [[0.0; LANES]; N];
    for i in 0..N {
        for k in 0..N {
            for lane in 0..LANES {
                next[i][lane] += phi[i][k] * states[k][lane];
            }
        }
    }
    next
}

/// Gain of the filter, which is constant while blocks of one kind follow each other.
pub(super) struct Gains<const N: usize> {
    covariance: Matrix<N>,
    steady_kind: Option<u32>,
    last_kind: Option<u32>,
    pub(super) gain: [f64; N],
    pub(super) log_variance: f64,
    pub(super) inverse_deviation: f64,
}

impl<const N: usize> Gains<N> {
    /// Covariance of the predicted state.
    pub(super) fn covariance(&self) -> &Matrix<N> {
        &self.covariance
    }

    pub(super) fn new(covariance: Matrix<N>) -> Self {
        Self {
            covariance,
            steady_kind: None,
            last_kind: None,
            gain: [0.0; N],
            log_variance: 0.0,
            inverse_deviation: 1.0,
        }
    }

    /// Gain for the next block, of this kind.
    pub(super) fn update(&mut self, kind: u32, model: &Lifted<N>) {
        if self.steady_kind == Some(kind) {
            return;
        }
        let (gain, variance) = model.gain(&self.covariance);
        let next = model.next_covariance(&self.covariance, &gain, variance);
        let is_close = |i: usize| {
            let (old, new) = (self.covariance[i][i], next[i][i]);
            (new - old).abs() <= STEADY * old.abs()
        };
        let is_steady = self.last_kind == Some(kind) && (0..N).all(is_close);
        self.steady_kind = is_steady.then_some(kind);
        self.last_kind = Some(kind);
        self.covariance = next;
        self.gain = gain;
        self.log_variance = variance.ln();
        self.inverse_deviation = 1.0 / variance.sqrt();
    }

    /// A block without samples.
    pub(super) fn skip(&mut self, model: &Lifted<N>) {
        self.covariance = model.next_covariance(&self.covariance, &[0.0; N], 0.0);
        self.steady_kind = None;
        self.last_kind = None;
    }
}
