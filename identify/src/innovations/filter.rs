//! One Kalman filter over all columns of the likelihood.
//!
//! ```text
//! e = (z - C x) / sqrt(S),      x+ = (Phi - K C) x + K z
//! ```
//!
//! The gain `K` and the variance `S` do not depend on the data: they come first, as runs of blocks with the same gain.
//! Then the filter runs over the data columns (`y` and the responses to the input), from a state of zero, and over the
//! columns of an unknown initial state, which have no data: the filter forgets the initial state, and their rows end
//! where nothing of it is left.

use onecycle_design::matrix::Matrix;

use super::lifted::Lifted;
use super::normal::Normal;
use super::record::Blocks;

/// Relative change of the covariance below which the filter of a kind of block is steady.
const STEADY: f64 = 1e-9;
/// Part of the length of a column below which its next row does not count.
const FORGOTTEN: f64 = 1e-12;
/// Rows between two looks whether the initial state is forgotten.
const LOOK: usize = 16;

/// Blocks in a row with the same gain.
pub(super) struct Run<const N: usize> {
    blocks: usize,
    /// Without samples there is no innovation, and the gain is zero.
    has_samples: bool,
    /// `Phi - K C`.
    closed: Matrix<N>,
    gain: [f64; N],
    /// `C / sqrt(S)`.
    row: [f64; N],
    /// `1 / sqrt(S)`.
    inverse_deviation: f64,
}

impl<const N: usize> Run<N> {
    fn new(model: &Lifted<N>, gains: &Gains<N>) -> Self {
        let mut closed = model.phi;
        for i in 0..N {
            for j in 0..N {
                closed[i][j] -= gains.gain[i] * model.c[j];
            }
        }
        Self {
            blocks: 1,
            has_samples: true,
            closed,
            gain: gains.gain,
            row: model.c.map(|c| c * gains.inverse_deviation),
            inverse_deviation: gains.inverse_deviation,
        }
    }

    /// States of all columns at the end of a block with the data `z`.
    #[inline]
    fn moved<const D: usize>(&self, states: &[[f64; D]; N], z: &[f64; D]) -> [[f64; D]; N] {
        let mut next = [[0.0; D]; N];
        for i in 0..N {
            for lane in 0..D {
                next[i][lane] = self.gain[i] * z[lane];
            }
            for k in 0..N {
                for lane in 0..D {
                    next[i][lane] += self.closed[i][k] * states[k][lane];
                }
            }
        }
        next
    }

    fn without_samples(model: &Lifted<N>) -> Self {
        Self {
            blocks: 1,
            has_samples: false,
            closed: model.phi,
            gain: [0.0; N],
            row: [0.0; N],
            inverse_deviation: 0.0,
        }
    }
}

/// Runs of a filter that starts from the covariance `start`, and `sum ln S_k`.
pub(super) fn runs<const N: usize>(
    start: Matrix<N>,
    lifted: &[Lifted<N>],
    blocks: &Blocks<'_>,
) -> (Vec<Run<N>>, f64) {
    let mut gains = Gains::new(start);
    let mut runs: Vec<Run<N>> = Vec::new();
    let mut log_variances = 0.0;
    for &kind in &blocks.kind_of {
        let model = &lifted[kind as usize];
        if model.r <= 0.0 {
            gains.skip(model);
            runs.push(Run::without_samples(model));
            continue;
        }
        match runs.last_mut() {
            Some(run) if gains.is_steady(kind) => run.blocks += 1,
            _ => {
                gains.update(kind, model);
                runs.push(Run::new(model, &gains));
            }
        }
        log_variances += gains.log_variance;
    }
    (runs, log_variances)
}

/// Innovations of `D` data columns over their standard deviations, a row for each block that has samples.
/// `workspace` holds the rows.
///
/// The last column may be what the input does within each block only, with the state `within` that it leaves behind: the
/// filter then carries on what it does later. Empty, if the column is the whole response.
pub(super) fn of_data<'a, const N: usize, const D: usize>(
    runs: &[Run<N>],
    columns: [&[f64]; D],
    within: &[[f64; N]],
    workspace: &'a mut Vec<f64>,
) -> &'a [[f64; D]] {
    let left = |state: &mut [[f64; D]; N], block: usize| {
        if let Some(within) = within.get(block) {
            for i in 0..N {
                state[i][D - 1] -= within[i];
            }
        }
    };
    let with_samples = runs.iter().filter(|run| run.has_samples);
    let count: usize = with_samples.map(|run| run.blocks).sum();
    workspace.resize(count * D, 0.0);
    let (rows, _) = workspace.as_chunks_mut::<D>();
    let mut rest = &mut rows[..];
    let mut state = [[0.0; D]; N];
    let mut first = 0;
    for run in runs {
        let data = columns.map(|column| &column[first..first + run.blocks]);
        let begin = first;
        first += run.blocks;
        if !run.has_samples {
            state = run.moved(&state, &[0.0; D]);
            left(&mut state, begin);
            continue;
        }
        let (own, after) = rest.split_at_mut(run.blocks);
        rest = after;
        for (block, row) in own.iter_mut().enumerate() {
            let z: [f64; D] = std::array::from_fn(|lane| data[lane][block]);
            let mut innovation = z.map(|z| z * run.inverse_deviation);
            for i in 0..N {
                for lane in 0..D {
                    innovation[lane] -= run.row[i] * state[i][lane];
                }
            }
            state = run.moved(&state, &z);
            left(&mut state, begin + block);
            *row = innovation;
        }
    }
    rows
}

/// Data that a filter turns into `white` innovations, from an initial state of zero: one for each block that has samples.
pub(super) fn coloured<const N: usize>(
    runs: &[Run<N>],
    mut white: impl FnMut() -> f64,
) -> Vec<f64> {
    let mut data = Vec::new();
    let mut state = [[0.0; 1]; N];
    for run in runs {
        for _ in 0..run.blocks {
            if !run.has_samples {
                state = run.moved(&state, &[0.0]);
                continue;
            }
            let predicted: f64 = (0..N).map(|i| run.row[i] * state[i][0]).sum();
            let z = (white() + predicted) / run.inverse_deviation;
            state = run.moved(&state, &[z]);
            data.push(z);
        }
    }
    data
}

/// Innovations of the first `count` columns of the initial state, which are those of `basis`, until they are forgotten.
pub(super) fn of_start<const N: usize>(
    runs: &[Run<N>],
    basis: &Matrix<N>,
    count: usize,
) -> Vec<[f64; N]> {
    let mut rows = Vec::new();
    let mut state = *basis;
    let mut squares = [0.0; N];
    let mut looked = 0;
    for run in runs {
        let mut left = run.blocks;
        while left > 0 {
            let part = left.min(LOOK);
            left -= part;
            if !run.has_samples {
                state = run.moved(&state, &[0.0; N]);
                continue;
            }
            rows.extend((0..part).map(|_| {
                let mut row = [0.0; N];
                for i in 0..N {
                    for lane in 0..N {
                        row[lane] += run.row[i] * state[i][lane];
                    }
                }
                for lane in 0..N {
                    squares[lane] += row[lane] * row[lane];
                }
                state = run.moved(&state, &[0.0; N]);
                row
            }));
            if rows.len() >= looked + LOOK {
                looked = rows.len();
                if is_forgotten(run, &state, &squares[..count]) {
                    return rows;
                }
            }
        }
    }
    rows
}

/// Whether the next row is negligible in every column.
fn is_forgotten<const N: usize>(run: &Run<N>, state: &Matrix<N>, squares: &[f64]) -> bool {
    (0..squares.len()).all(|lane| {
        let size: f64 = (0..N).map(|i| (run.row[i] * state[i][lane]).abs()).sum();
        size < FORGOTTEN * squares[lane].sqrt()
    })
}

/// Products of the regressors: the data columns but the first, then the first `count` of the initial state; and their
/// products with the first data column.
pub(super) fn products<const N: usize, const D: usize>(
    data: &[[f64; D]],
    start: &[[f64; N]],
    count: usize,
) -> (Normal, [f64; super::normal::MOST]) {
    let mut of_data = [[0.0; D]; D];
    for row in data {
        for i in 0..D {
            for j in 0..=i {
                of_data[i][j] += row[i] * row[j];
            }
        }
    }
    let mut mixed = [[0.0; D]; N];
    let mut of_start = [[0.0; N]; N];
    for (data, row) in data.iter().zip(start) {
        for i in 0..N {
            for j in 0..D {
                mixed[i][j] += row[i] * data[j];
            }
            for j in 0..=i {
                of_start[i][j] += row[i] * row[j];
            }
        }
    }
    let responses = D - 1;
    let mut normal = Normal::new(responses + count);
    let mut right = [0.0; super::normal::MOST];
    for i in 0..responses {
        right[i] = of_data[i + 1][0];
        normal.products[i][..=i].copy_from_slice(&of_data[i + 1][1..i + 2]);
    }
    for i in 0..count {
        let row = &mut normal.products[responses + i];
        right[responses + i] = mixed[i][0];
        row[..responses].copy_from_slice(&mixed[i][1..]);
        row[responses..=responses + i].copy_from_slice(&of_start[i][..=i]);
    }
    (normal, right)
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

    /// Whether the gain for the next block, of this kind, is that of the last one.
    fn is_steady(&self, kind: u32) -> bool {
        self.steady_kind == Some(kind)
    }

    /// Gain for the next block, of this kind.
    pub(super) fn update(&mut self, kind: u32, model: &Lifted<N>) {
        if self.is_steady(kind) {
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
