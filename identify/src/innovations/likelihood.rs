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
//! No sample is believed to less than the deviation `f` of the record ([`Record::floor`](super::record::Record::floor)): below
//! it `s2 = f^2`, and `|r|^2/f^2` stands for the second `m`.
//!
//! Here `r` is the residual, `X` the `p` filtered columns and `X0` the same columns before the filter, all over the deviation of
//! the outputs: a prior that is flat in another unit would favour more states in one unit and fewer in another. All states are
//! unknown, so any initial covariance gives the same likelihood, and the filter starts from its steady one: its gain is
//! constant from the first block on. Reference: P. de Jong, "The likelihood for a state space model", Biometrika 75
//! (1988); G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973).
//!
//! The response of an unstable process, and what its initial state explains, grow without end; their innovations do not. So the
//! filter gets what the input does within each block, and carries on by its own, which is stable, what the input does later.
//! In `X0`, which only says in which unit the prior is flat, the pole is mirrored.
//!
//! Nonlinear forces of the record add a column each, behind `g`: their coefficients are further linear unknowns.
//!
//! Shapes: `N` states (the last one is the disturbance), `blocks` rows, `D` data columns `y`, `g` and up to two of nonlinear
//! forces, and `N` columns `X0`. The linear unknowns are in the order gain, forces, states.

use std::f64::consts::TAU as TWO_PI;

use onecycle_design::matrix::{Matrix, add, congruent, product, times};

use super::filter::{self, Run, runs};
use super::lifted::{Lifted, row_times, transpose};
use super::normal::Normal;
use super::orthogonal::Orthogonal;
use super::record::Blocks;
use super::response;
use super::system::{Start, System, by_size};
use super::theta::Theta;

/// Likelihood at one point, with the linear unknowns at their best.
#[derive(Clone, Debug)]
pub(super) struct Evaluation {
    pub(super) log_likelihood: f64,
    /// `-2 ln L` of a row, with all linear unknowns at their best instead of integrated out.
    profile: f64,
    /// Residual `r` of each block that has samples, over [`Self::scale`].
    residual: Vec<f64>,
    /// `sum ln S_k + ln|X'X| - ln|X0'X0|`.
    logs: f64,
    /// `m`.
    freedom: f64,
    /// Deviation of the outputs (output unit).
    scale: f64,
    /// Whether the white noise is what no sample is believed beyond.
    is_floored: bool,
    /// Gain in front of the stages (output unit / input unit, per second for each integration).
    pub(super) gain: f64,
    /// Variance of the gain for fixed nonlinear unknowns, over [`Self::variance`].
    pub(super) gain_factor: f64,
    /// State at the first block; the disturbance is the last (output unit, times the gain).
    pub(super) state: Vec<f64>,
    /// Coefficients of the nonlinear forces, and their deviation for fixed nonlinear unknowns (output unit / unit of the
    /// force).
    pub(super) forces: Vec<(f64, f64)>,
    /// Variance of the disturbance at the first block and its covariance with the gain, for fixed nonlinear unknowns, over
    /// [`Self::variance`].
    pub(super) disturbance_factors: (f64, f64),
    /// Variance `s2` of the white noise of a sample (output unit^2).
    pub(super) variance: f64,
    /// Log-likelihood with a prior that is flat in the unit of the output, as the oracles have it.
    #[cfg(test)]
    pub(super) log_likelihood_in_output_units: f64,
    /// `sum ln S_k` and `ln|X'X| - ln|X0'X0|`.
    #[cfg(test)]
    pub(super) determinants: (f64, f64),
}

impl Evaluation {
    /// Number of rows: blocks that have samples.
    pub(super) fn rows(&self) -> usize {
        self.residual.len()
    }

    /// Bayesian information criterion with the linear unknowns at their best and `others` more, of `rows` rows that are as likely as
    /// these: comparable between starts with another number of unknown states.
    pub(super) fn profile_bic(&self, others: usize, rows: f64) -> f64 {
        let linear = self.residual.len() as f64 - self.freedom;
        (linear + others as f64) * rows.ln() + rows * self.profile
    }

    /// Deviation of the white noise of a sample that the record shows (output unit). Zero if it is only assumed.
    pub(super) fn seen_deviation(&self) -> f64 {
        if self.is_floored {
            0.0
        } else {
            self.variance.sqrt()
        }
    }

    /// Innovations over their standard deviation.
    pub(super) fn innovations(&self) -> Vec<f64> {
        let scale = self.scale / self.variance.sqrt();
        self.residual.iter().map(|r| r * scale).collect()
    }

    /// Residual of which least squares is maximum likelihood near `at`, the noise included, over [`Self::scale`]. With the best
    /// `s2`, `ln L` is `-m/2 ln |r exp(logs/(2 m))|^2` but for a constant. With `s2 = f^2` it is `-(|r|^2/f^2 + logs)/2`, and the
    /// square of a further entry stands for `logs`: its derivative at `at` is that of `f^2 logs`.
    pub(super) fn residual_near(&self, at: &Self) -> Vec<f64> {
        let stretch = |logs: f64| (logs / (2.0 * at.freedom)).exp();
        if !at.is_floored {
            let stretch = stretch(self.logs);
            return self.residual.iter().map(|r| r * stretch).collect();
        }
        let size = at.variance.sqrt() / at.scale * at.freedom.sqrt();
        let last = size * stretch(self.logs - at.logs);
        self.residual.iter().copied().chain([last]).collect()
    }

    /// Variance of the innovations at the scale of [`Self::residual_near`] itself.
    pub(super) fn residual_variance(&self) -> f64 {
        let stretch = match self.is_floored {
            true => 1.0,
            false => (self.logs / (2.0 * self.freedom)).exp(),
        };
        self.variance * (stretch / self.scale).powi(2)
    }
}

/// Evaluates the likelihood at `theta`. `None` if the filter does not converge or the columns are degenerate.
pub(super) fn evaluate(
    blocks: &Blocks<'_>,
    theta: &Theta,
    memory: &mut Memory,
) -> Option<Evaluation> {
    by_size!(theta, evaluate_sized(blocks, theta, memory))
}

/// The response to the input at unit gain and the columns of the initial state, as sums over the blocks that have samples.
pub(super) fn regressors(blocks: &Blocks<'_>, theta: &Theta) -> Option<Vec<Vec<f64>>> {
    by_size!(theta, regressors_sized(blocks, theta))
}

fn regressors_sized<const N: usize>(blocks: &Blocks<'_>, theta: &Theta) -> Option<Vec<Vec<f64>>> {
    let system = System::<N>::new(theta, blocks.record.dt_s);
    let lifted = system.lifted(blocks);
    let start = system.start_of(blocks, theta);
    let response = response::sums(&system.model, blocks, theta.tau_s());
    Some(columns(&lifted, blocks, &[response], &start))
}

/// Innovations of the response to the input at unit gain, over their standard deviation, less what the unknown initial state
/// explains of them: what tells the gain. `None` if the filter does not converge.
pub(super) fn input_innovations(blocks: &Blocks<'_>, theta: &Theta) -> Option<Vec<f64>> {
    by_size!(theta, input_innovations_sized(blocks, theta))
}

fn input_innovations_sized<const N: usize>(blocks: &Blocks<'_>, theta: &Theta) -> Option<Vec<f64>> {
    let system = System::<N>::new(theta, blocks.record.dt_s);
    let lifted = system.lifted(blocks);
    let start = system.start_of(blocks, theta);
    let (response, within) = response::of_input(&system.model, blocks, theta);
    let (runs, _) = runs(system.start(blocks, &lifted)?, &lifted, blocks);
    let mut workspace = vec![];
    let rows = filter::of_data::<N, 1>(&runs, [&response], &within, &mut workspace);
    let filtered: Vec<f64> = rows.iter().map(|row| row[0]).collect();
    let of_start = filter::of_start(&runs, &start.basis, start.count);
    let columns = start_columns(&of_start, start.count, filtered.len());
    Some(Orthogonal::independent(&columns).solve(&filtered).0)
}

/// Columns of the initial state, zero after the end of `of_start`.
fn start_columns<const N: usize>(
    of_start: &[[f64; N]],
    count: usize,
    rows: usize,
) -> Vec<Vec<f64>> {
    let column = |i: usize| {
        let mut column: Vec<f64> = of_start.iter().map(|row| row[i]).collect();
        column.resize(rows, 0.0);
        column
    };
    (0..count).map(column).collect()
}

/// What the last evaluation computed from the process alone, which steps in the noise find here, and its rows.
#[derive(Default)]
pub(super) struct Memory {
    key: Option<(Theta, bool)>,
    /// `g`, then the response to each nonlinear force, summed over the samples present in each block.
    responses: Vec<Vec<f64>>,
    /// Of an unstable process, whose `g` is only what the input does within each block: the states that it leaves behind, one after
    /// the other.
    within: Vec<f64>,
    /// `ln|X0'X0| / 2`.
    log_determinant: f64,
    /// Innovations of the data columns over their standard deviations, row by row.
    rows: Vec<f64>,
}

impl Memory {
    /// The process of `theta` without its noise, and whether the output walks.
    fn key(theta: &Theta, walks: bool) -> (Theta, bool) {
        (theta.without_noises(), walks)
    }
}

fn evaluate_sized<const N: usize>(
    blocks: &Blocks<'_>,
    theta: &Theta,
    memory: &mut Memory,
) -> Option<Evaluation> {
    let system = System::<N>::new(theta, blocks.record.dt_s);
    let lifted = system.lifted(blocks);
    let start = system.start_of(blocks, theta);
    remember(&system, &lifted, blocks, (theta, &start), memory)?;
    let filter = runs(system.start(blocks, &lifted)?, &lifted, blocks);
    match memory.responses.len() {
        1 => filtered::<N, 2>(blocks, &filter, &start, memory),
        2 => filtered::<N, 3>(blocks, &filter, &start, memory),
        3 => filtered::<N, 4>(blocks, &filter, &start, memory),
        _ => None,
    }
}

/// Likelihood of the responses in `memory` under a filter.
fn filtered<const N: usize, const D: usize>(
    blocks: &Blocks<'_>,
    (runs, log_variances): &(Vec<Run<N>>, f64),
    start: &Start<N>,
    memory: &mut Memory,
) -> Option<Evaluation> {
    let columns = std::array::from_fn(|column| match column.checked_sub(1) {
        None => &blocks.sums[..],
        Some(response) => &memory.responses[response][..],
    });
    let (within, _) = memory.within.as_chunks::<N>();
    let rows = filter::of_data::<N, D>(runs, columns, within, &mut memory.rows);
    let responses = D - 1;
    let count = rows.len();
    let freedom = count as f64 - (responses + start.count) as f64;
    if freedom < 1.0 {
        return None;
    }
    let of_start = filter::of_start(runs, &start.basis, start.count);
    let fit = least_squares(rows, &of_start, start)?;
    let sum: f64 = fit.residual.iter().map(|r| r * r).sum();
    let scale = blocks.scale;
    let floor = (blocks.record.floor / scale).powi(2);
    let is_floored = sum < floor * freedom;
    // `s2` for this many degrees of freedom, and `|r|^2/s2`.
    let of = |freedom: f64| match sum < floor * freedom {
        true => (floor, sum / floor),
        false => (sum / freedom, freedom),
    };
    let (variance, square) = of(freedom);
    let log_x = 2.0 * (fit.log_determinant - memory.log_determinant);
    let logs = log_variances + log_x;
    let likelihood = -0.5 * (freedom * (TWO_PI * variance).ln() + square + logs);
    let log_likelihood = likelihood - count as f64 * scale.ln();
    // With all linear unknowns at their best instead of integrated out.
    let all = count as f64;
    let (of_all, square) = of(all);
    let profile = (TWO_PI * of_all).ln() + (square + log_variances) / all;
    if !log_likelihood.is_finite() {
        return None;
    }
    let squared = variance * scale * scale;
    Some(Evaluation {
        log_likelihood,
        profile,
        residual: fit.residual,
        logs,
        freedom,
        scale,
        is_floored,
        gain: fit.coefficients[0] * scale,
        gain_factor: fit.covariance[0][0],
        state: (start.basis.iter())
            .map(|row| scale * inner(&row[..start.count], &fit.coefficients[responses..]))
            .collect(),
        forces: (1..responses)
            .map(|i| {
                (
                    fit.coefficients[i] * scale,
                    (fit.factors[i] * squared).sqrt(),
                )
            })
            .collect(),
        disturbance_factors: (fit.covariance[1][1], fit.covariance[0][1]),
        variance: squared,
        #[cfg(test)]
        log_likelihood_in_output_units: likelihood - freedom * scale.ln(),
        #[cfg(test)]
        determinants: (*log_variances, log_x),
    })
}

/// Fit of `y` by the responses and the columns of the initial state.
struct LeastSquares {
    residual: Vec<f64>,
    coefficients: Vec<f64>,
    /// `ln|X'X| / 2`.
    log_determinant: f64,
    /// Of gain and disturbance, for residuals of unit variance.
    covariance: [[f64; 2]; 2],
    /// Variance of the coefficient of each response, for residuals of unit variance.
    factors: Vec<f64>,
}

/// `None` if the columns are degenerate. `data`: `y` and the responses; `start`: columns of the initial state, zero after
/// their end.
fn least_squares<const N: usize, const D: usize>(
    data: &[[f64; D]],
    of_start: &[[f64; N]],
    start: &Start<N>,
) -> Option<LeastSquares> {
    let (normal, right) = filter::products(data, of_start, start.count);
    let Some(root) = normal.root() else {
        return by_orthogonal_columns(data, of_start, start);
    };
    let coefficients = root.solve(&right);
    let responses = D - 1;
    let mut residual: Vec<f64> = data
        .iter()
        .map(|row| {
            let explained = (0..responses).map(|i| coefficients[i] * row[1 + i]);
            row[0] - explained.sum::<f64>()
        })
        .collect();
    for (residual, row) in residual.iter_mut().zip(of_start) {
        for i in 0..start.count {
            *residual -= coefficients[responses + i] * row[i];
        }
    }
    Some(LeastSquares {
        residual,
        coefficients: coefficients[..responses + start.count].to_vec(),
        log_determinant: root.log_determinant(),
        covariance: start.with_disturbance(responses, |i, j| root.covariance(&[i, j])[0][1]),
        factors: (0..responses)
            .map(|i| root.covariance(&[i])[0][0])
            .collect(),
    })
}

/// The same for columns that the normal equations do not tell apart.
fn by_orthogonal_columns<const N: usize, const D: usize>(
    data: &[[f64; D]],
    of_start: &[[f64; N]],
    start: &Start<N>,
) -> Option<LeastSquares> {
    let responses = D - 1;
    let of_data = |lane: usize| data.iter().map(|row| row[lane]).collect::<Vec<f64>>();
    let mut columns: Vec<Vec<f64>> = (1..D).map(of_data).collect();
    columns.extend(start_columns(of_start, start.count, data.len()));
    let columns = Orthogonal::new(&columns)?;
    let (residual, coefficients) = columns.solve(&of_data(0));
    Some(LeastSquares {
        residual,
        coefficients,
        log_determinant: columns.log_determinant(),
        covariance: start.with_disturbance(responses, |i, j| columns.covariance(&[i, j])[0][1]),
        factors: (0..responses)
            .map(|i| columns.covariance(&[i])[0][0])
            .collect(),
    })
}

/// Response and determinant of the columns before the filter, computed unless `memory` has them.
fn remember<const N: usize>(
    system: &System<N>,
    lifted: &[Lifted<N>],
    blocks: &Blocks<'_>,
    (theta, start): (&Theta, &Start<N>),
    memory: &mut Memory,
) -> Option<()> {
    let walks = system.c[N - 1] != 0.0;
    let key = Memory::key(theta, walks);
    if memory.key == Some(key) {
        return Some(());
    }
    memory.key = None;
    memory.within.clear();
    if theta.grows {
        let mirrored = theta.mirrored();
        let of_mirrored = System::<N>::new(&mirrored, blocks.record.dt_s);
        let lifted = of_mirrored.lifted(blocks);
        remember(&of_mirrored, &lifted, blocks, (&mirrored, start), memory)?;
        let (sums, states) = response::of_input(&system.model, blocks, theta);
        memory.responses = vec![sums];
        memory.within = states.concat();
        memory.key = Some(key);
        return Some(());
    }
    memory.responses = vec![response::sums(&system.model, blocks, theta.tau_s())];
    let forces = response::of_forces(&system.model, blocks, theta.delay_and_lag_s());
    memory.responses.extend(forces);
    memory.log_determinant = match products(lifted, blocks, &memory.responses, start).root() {
        Some(root) => root.log_determinant(),
        None => {
            Orthogonal::new(&columns(lifted, blocks, &memory.responses, start))?.log_determinant()
        }
    };
    memory.key = Some(key);
    Some(())
}

/// Products of the columns before the filter. The responses are zero in blocks without samples.
fn products<const N: usize>(
    lifted: &[Lifted<N>],
    blocks: &Blocks<'_>,
    responses: &[Vec<f64>],
    start: &Start<N>,
) -> Normal {
    let count = responses.len();
    let mut normal = Normal::new(count + start.count);
    for (i, response) in responses.iter().enumerate() {
        for (j, other) in responses[..=i].iter().enumerate() {
            normal.products[i][j] = inner(response, other);
        }
        let with_start = with_start(lifted, blocks, response);
        for k in 0..start.count {
            let column = (0..N).map(|i| start.basis[i][k] * with_start[i]);
            normal.products[count + k][i] = column.sum();
        }
    }
    let of_start = congruent(&transpose(&start.basis), &of_start(lifted, blocks));
    for (row, of_start) in normal.products[count..].iter_mut().zip(of_start) {
        row[count..count + N].copy_from_slice(&of_start);
    }
    normal
}

/// Products of the columns of the initial state, from the last block backwards: the products of a block's row are those
/// of `C`, and the state at its start has to `Phi` the state at its end.
fn of_start<const N: usize>(lifted: &[Lifted<N>], blocks: &Blocks<'_>) -> Matrix<N> {
    let mut products = [[0.0; N]; N];
    for run in blocks.kind_of.chunk_by(|a, b| a == b).rev() {
        let (phi, own) = lifted[run[0] as usize].observed(run.len());
        products = congruent(&transpose(&phi), &products);
        add(&mut products, &own);
    }
    products
}

/// Products of a response with the columns of the initial state, backwards too.
fn with_start<const N: usize>(
    lifted: &[Lifted<N>],
    blocks: &Blocks<'_>,
    response: &[f64],
) -> [f64; N] {
    let mut products = [0.0; N];
    let mut end = blocks.len();
    for run in blocks.kind_of.chunk_by(|a, b| a == b).rev() {
        let block = &lifted[run[0] as usize];
        let turned = transpose(&block.phi);
        for g in response[end - run.len()..end].iter().rev() {
            products = times(&turned, &products);
            if block.r > 0.0 {
                for i in 0..N {
                    products[i] += block.c[i] * g;
                }
            }
        }
        end -= run.len();
    }
    products
}

/// Columns before the filter: the responses, and those of the initial state. A row for each block that has samples.
fn columns<const N: usize>(
    lifted: &[Lifted<N>],
    blocks: &Blocks<'_>,
    responses: &[Vec<f64>],
    start: &Start<N>,
) -> Vec<Vec<f64>> {
    let mut of_start = vec![Vec::with_capacity(blocks.len()); start.count];
    let mut of_responses = vec![Vec::with_capacity(blocks.len()); responses.len()];
    let mut state = start.basis;
    for (row, &kind) in blocks.kind_of.iter().enumerate() {
        let block = &lifted[kind as usize];
        if block.r > 0.0 {
            for (column, response) in of_responses.iter_mut().zip(responses) {
                column.push(response[row]);
            }
            for (column, value) in of_start.iter_mut().zip(row_times(&block.c, &state)) {
                column.push(value);
            }
        }
        state = product(&block.phi, &state);
    }
    of_responses.extend(of_start);
    of_responses
}

fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
