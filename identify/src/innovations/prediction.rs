//! What a fit predicts, row by row: simulation, one-step and far predictions, disturbance, rejected rows.

use std::ops::Range;

use onecycle_design::matrix::{Matrix, times};

use super::filter::Gains;
use super::lifted::{Lifted, dot, row_times};
use super::likelihood::Evaluation;
use super::record::Blocks;
use super::response;
use super::system::{System, by_size};
use super::theta::Theta;

/// What a fit predicts, row by row.
pub(super) struct Predictions {
    /// Output of the model from the input and the state at the first block alone, mean over the samples of each block
    /// (output unit). Of an unstable process, which no simulation follows, that of [`Self::predicted`].
    pub(super) simulated: Vec<f64>,
    /// One-block-ahead prediction, mean over the samples of each block (output unit).
    pub(super) predicted: Vec<f64>,
    /// Estimate of the disturbance at each block from the blocks before it, in units of the input.
    pub(super) disturbance: Vec<f64>,
    /// Output from the state before each block, without the input from there on, `ahead` blocks later (output unit). Of an unstable
    /// process with that input.
    pub(super) ahead: Vec<f64>,
    /// Response to the input and the nonlinear forces, mean over the samples of each block (output unit). Of an unstable process
    /// zero: it is part of [`Self::ahead`].
    pub(super) forced: Vec<f64>,
    /// Variance of the error of [`Self::ahead`] plus [`Self::forced`] that the noises cause (output unit^2).
    pub(super) ahead_variance: f64,
    /// Rows whose innovation was rejected: one sample, or a few, off the path that those before and after follow.
    pub(super) rejected: Vec<usize>,
}

/// How [`predict`] filters.
#[derive(Clone, Copy, Default)]
pub(super) struct Filtering {
    /// Number of blocks to predict ahead.
    pub(super) ahead: usize,
    /// Largest innovation, in standard deviations, that is accepted, and the most rows that are rejected in a row.
    pub(super) reject: Option<(f64, usize)>,
}

/// Predictions along the record, for the gain and the initial state of `evaluation`.
pub(super) fn predict(
    blocks: &Blocks<'_>,
    theta: &Theta,
    evaluation: &Evaluation,
    filtering: Filtering,
) -> Option<Predictions> {
    by_size!(theta, predict_sized(blocks, theta, evaluation, filtering))
}

fn predict_sized<const N: usize>(
    blocks: &Blocks<'_>,
    theta: &Theta,
    evaluation: &Evaluation,
    filtering: Filtering,
) -> Option<Predictions> {
    let system = System::<N>::new(theta, blocks.record.dt_s);
    let lifted = system.lifted(blocks);
    let (response, within) = response::of_input(&system.model, blocks, theta);
    let forces = response::of_forces(&system.model, blocks, theta.delay_and_lag_s());
    let mut gains = Gains::new(system.start(blocks, &lifted)?);
    let start: [f64; N] = std::array::from_fn(|i| evaluation.state[i]);
    let (mut free, mut filtered) = (start, start);
    let walks = system.c[N - 1] != 0.0;
    let later = far_row(&system, blocks, filtering.ahead);
    let deviation = evaluation.variance.sqrt();
    let mut found = Predictions::with_capacity(blocks.len());
    let mut pending: Vec<(usize, f64)> = Vec::new();
    for (block, &kind) in blocks.kind_of.iter().enumerate() {
        let model = &lifted[kind as usize];
        let terms = forces.iter().zip(&evaluation.forces);
        let nonlinear: f64 = terms
            .map(|(force, (coefficient, _))| coefficient * force[block])
            .sum();
        let forced = evaluation.gain * response[block] + nonlinear;
        let count = blocks.present(block).max(1) as f64;
        let prediction = forced + dot(&model.c, &filtered);
        found.predicted.push(prediction / count);
        let (simulated, forced, ahead) = if theta.grows {
            let inputs = (&response[..], &within[..]);
            let from = (evaluation.gain, &filtered);
            let ahead = block..block + filtering.ahead;
            let later = later_output(&lifted, blocks, inputs, from, ahead);
            (prediction, 0.0, later)
        } else {
            (
                forced + dot(&model.c, &free),
                forced,
                dot(&later, &filtered),
            )
        };
        found.simulated.push(simulated / count);
        found.forced.push(forced / count);
        found.ahead.push(ahead);
        let disturbance = if walks { 0.0 } else { filtered[N - 1] };
        found.disturbance.push(disturbance / evaluation.gain);
        free = times(&model.phi, &free);
        filtered = times(&model.phi, &filtered);
        if let Some(within) = within.get(block) {
            add(&mut filtered, evaluation.gain, within);
        }
        if model.r <= 0.0 {
            gains.skip(model);
            continue;
        }
        let innovation = blocks.sums[block] * blocks.scale - prediction;
        let (_, variance) = model.gain(gains.covariance());
        let size = innovation.abs() / (deviation * variance.sqrt());
        let is_far =
            (filtering.reject).is_some_and(|(limit, run)| size > limit && pending.len() < run);
        if is_far {
            pending.push((block, innovation));
            gains.skip(model);
            continue;
        }
        // After a jump the path goes on where the rejected rows are; after an outlier it goes on as before.
        let returns = |(_, off): &&(usize, f64)| innovation * off.signum() < 0.5 * off.abs();
        found
            .rejected
            .extend(pending.iter().filter(returns).map(|(row, _)| row));
        pending.clear();
        gains.update(kind, model);
        add(&mut filtered, innovation, &gains.gain);
    }
    let variance = later_variance(&lifted, *gains.covariance(), filtering.ahead);
    found.ahead_variance = variance * evaluation.variance / (blocks.samples as f64).powi(2);
    Some(found)
}

/// Variance of a full block over that of the noise, `ahead` blocks after the state of this covariance. Zero without a full block.
fn later_variance<const N: usize>(
    lifted: &[Lifted<N>],
    mut covariance: Matrix<N>,
    ahead: usize,
) -> f64 {
    let Some(full) = lifted.iter().find(|block| block.r > 0.0) else {
        return 0.0;
    };
    for _ in 0..ahead {
        covariance = full.next_covariance(&covariance, &[0.0; N], 0.0);
    }
    full.gain(&covariance).1
}

fn add<const N: usize>(state: &mut [f64; N], factor: f64, direction: &[f64; N]) {
    for i in 0..N {
        state[i] += factor * direction[i];
    }
}

/// Mean output of the block at the end of `ahead`, from the state before its first block and the input in between: `inputs` are the sums
/// and the states that the input of unit gain leaves within each block. Zero beyond the record.
fn later_output<const N: usize>(
    lifted: &[Lifted<N>],
    blocks: &Blocks<'_>,
    (sums, within): (&[f64], &[[f64; N]]),
    (gain, state): (f64, &[f64; N]),
    ahead: Range<usize>,
) -> f64 {
    let last = ahead.end;
    let Some(kind) = blocks.kind_of.get(last) else {
        return 0.0;
    };
    let mut state = *state;
    for block in ahead {
        state = times(&lifted[blocks.kind_of[block] as usize].phi, &state);
        add(&mut state, gain, &within[block]);
    }
    let sum = gain * sums[last] + dot(&lifted[*kind as usize].c, &state);
    sum / blocks.present(last).max(1) as f64
}

impl Predictions {
    fn with_capacity(rows: usize) -> Self {
        let column = || Vec::with_capacity(rows);
        Self {
            simulated: column(),
            predicted: column(),
            disturbance: column(),
            ahead: column(),
            forced: column(),
            ahead_variance: 0.0,
            rejected: vec![],
        }
    }
}

/// Row that gives the mean output of the block `ahead` blocks later from the state now, without input.
fn far_row<const N: usize>(system: &System<N>, blocks: &Blocks<'_>, ahead: usize) -> [f64; N] {
    let phi = system.model.step(blocks.record.dt_s).phi;
    let mut row = system.c;
    for _ in 0..ahead * blocks.samples {
        row = row_times(&row, &phi);
    }
    let mut sum = [0.0; N];
    for _ in 0..blocks.samples {
        for i in 0..N {
            sum[i] += row[i] / blocks.samples as f64;
        }
        row = row_times(&row, &phi);
    }
    sum
}
