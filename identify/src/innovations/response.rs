//! Response of a process of unit gain, at rest at the first sample, to the recorded input.
//!
//! The dead time is `tau = (m + f) dt` with a whole `m` and `0 <= f < 1`. During one sample the delayed input is that of
//! two samples: a part `f` of the older one, then the newer one. Before the record the input is that of the first
//! sample, or the one under which the process was at rest; then the response is that to the change of the input from
//! there. A negative dead time uses later input.
//!
//! Nonlinear forces are inputs too. They enter behind the actuator lags without a delay, and run straight from sample to
//! sample.

use std::collections::HashMap;

use onecycle_design::matrix::{Matrix, identity, product, times};
use onecycle_design::state_space::{StateSpace, Step};
use onecycle_design::{Linear, Structure};

use super::lifted::{dot, row_times};
use super::record::{BlockKind, Blocks, Hold, Record};
use super::theta::Theta;

/// Values at the samples of a record that act on a process.
#[derive(Clone, Copy)]
struct Source<'a> {
    values: &'a [f64],
    /// Value before the first sample.
    before: f64,
    hold: Hold,
    tau_s: f64,
}

/// Calls `with` with the input of `record`, less the one before the record if the process was at rest under it.
fn with_input<T>(record: &Record, tau_s: f64, with: impl FnOnce(Source<'_>) -> T) -> T {
    let source = Source {
        values: &record.input,
        before: record.input[0],
        hold: record.hold,
        tau_s,
    };
    match record.rest {
        None => with(source),
        Some(rest) => {
            let inputs = record.input.iter();
            let changes: Vec<f64> = inputs.map(|input| input - rest.input).collect();
            with(Source {
                values: &changes,
                before: 0.0,
                ..source
            })
        }
    }
}

/// Response summed over the samples present in each block (output unit / input unit for unit gain).
pub(super) fn sums<const N: usize>(
    model: &StateSpace<N>,
    blocks: &Blocks<'_>,
    tau_s: f64,
) -> Vec<f64> {
    with_input(blocks.record, tau_s, |source| {
        sums_of(model, blocks, source)
    })
}

/// Response of a process to its input of unit gain: as [`sums`], and no states. Of one that grows, what the input does within each
/// block, from a state of zero at its start: the sum over the samples present, and the state at its end. On an even grid.
pub(super) fn of_input<const N: usize>(
    model: &StateSpace<N>,
    blocks: &Blocks<'_>,
    theta: &Theta,
) -> (Vec<f64>, Vec<[f64; N]>) {
    if !theta.grows {
        return (sums(model, blocks, theta.tau_s()), vec![]);
    }
    with_input(blocks.record, theta.tau_s(), |source| {
        let mut walk = Walk::new(model, blocks, source);
        (0..blocks.len())
            .map(|block| walk.over(block, &[0.0; N]))
            .unzip()
    })
}

/// Responses to the nonlinear forces of the record in the order of their coefficients, as [`sums`]. `lag_s`: the actuator lag, whose
/// output over the lag is what the thrust is the square of.
pub(super) fn of_forces<const N: usize>(
    model: &StateSpace<N>,
    blocks: &Blocks<'_>,
    (tau_s, lag_s): (f64, f64),
) -> Vec<Vec<f64>> {
    let record = blocks.record;
    let behind = StateSpace {
        b: model.entry,
        ..*model
    };
    let of_force = |values: &[f64]| {
        let source = Source {
            values,
            before: values[0],
            hold: Hold::Interpolated,
            tau_s: 0.0,
        };
        sums_of(&behind, blocks, source)
    };
    let mut sums = Vec::with_capacity(record.forces.len());
    sums.extend(record.forces.of_rate().map(of_force));
    if let Some(middle) = record.forces.thrust {
        let lag = StateSpace::<2>::new(
            &Linear::new(Structure::Foptd)
                .with_gain(1.0)
                .with_pole_per_s(1.0 / lag_s),
        );
        let lagged = with_input(record, tau_s, |source| outputs(&lag, record, source));
        // The square at rest is a constant, which the disturbance holds.
        let rest = record.rest.map_or(0.0, |rest| rest.input) - middle;
        let squares: Vec<f64> = (lagged.iter())
            .map(|lagged| (rest + lagged / lag_s).powi(2) - rest * rest)
            .collect();
        sums.push(of_force(&squares));
    }
    sums
}

fn sums_of<const N: usize>(
    model: &StateSpace<N>,
    blocks: &Blocks<'_>,
    source: Source<'_>,
) -> Vec<f64> {
    if blocks.record.uneven_s.is_empty() {
        even(model, blocks, source)
    } else {
        blocks.sums_of(&uneven(model, blocks.record, source))
    }
}

/// Response at each sample.
fn outputs<const N: usize>(model: &StateSpace<N>, record: &Record, source: Source<'_>) -> Vec<f64> {
    if !record.uneven_s.is_empty() {
        return uneven(model, record, source);
    }
    let injection = Injection::new(model, record.dt_s, source);
    let mut state = [0.0; N];
    let mut copy = Vec::new();
    let mut outputs = vec![0.0];
    for sample in 1..record.len() {
        let inputs = delayed(source, injection.delay, (sample - 1, 1), &mut copy);
        state = injection.advance(&state, inputs);
        outputs.push(state[model.output]);
    }
    outputs
}

/// State at the end of a sample per unit of the delayed input: of the sample before, of this one, and of the next one.
struct Injection<const N: usize> {
    phi: Matrix<N>,
    inputs: [[f64; N]; 3],
    /// Whole samples of the dead time.
    delay: i64,
}

impl<const N: usize> Injection<N> {
    fn new(model: &StateSpace<N>, dt_s: f64, source: Source<'_>) -> Self {
        let Source { hold, tau_s, .. } = source;
        let whole = (tau_s / dt_s).floor();
        let f = tau_s / dt_s - whole;
        let (older, newer) = (model.step(f * dt_s), model.step((1.0 - f) * dt_s));
        let held = times(&newer.phi, &older.held);
        let ramp = times(&newer.phi, &older.ramp);
        let column = |value: &dyn Fn(usize) -> f64| std::array::from_fn(value);
        let inputs = match hold {
            Hold::Held => [held, newer.held, [0.0; N]],
            Hold::Interpolated => [
                column(&|i| held[i] * f - ramp[i] / dt_s),
                column(&|i| held[i] * (1.0 - f) + (ramp[i] - newer.ramp[i]) / dt_s + newer.held[i]),
                column(&|i| newer.ramp[i] / dt_s),
            ],
        };
        Self {
            phi: product(&newer.phi, &older.phi),
            inputs,
            delay: whole as i64,
        }
    }

    /// Moves the state over one sample. `window` holds the three inputs.
    fn advance(&self, state: &[f64; N], window: &[f64]) -> [f64; N] {
        let mut next = times(&self.phi, state);
        for (column, input) in self.inputs.iter().zip(window) {
            for i in 0..N {
                next[i] += column[i] * input;
            }
        }
        next
    }
}

/// Sum and final state of a block without absent samples as linear functions of the state at its start and of the
/// delayed inputs, from that of the sample before the block on to the one after it.
struct Weights<const N: usize> {
    phi: Matrix<N>,
    output: [f64; N],
    /// Of each input on the final state. The last state, the disturbance, has no input: its place holds the weight on the
    /// sum.
    inputs: Vec<[f64; N]>,
}

impl<const N: usize> Weights<N> {
    fn new(injection: &Injection<N>, output: usize, count: usize) -> Self {
        let mut weights = Self {
            phi: identity(),
            output: [0.0; N],
            inputs: vec![[0.0; N]; count + 2],
        };
        // Backwards: the effect of an input on the state at the end, and on the sum of the samples until then.
        for (ahead, column) in injection.inputs.iter().enumerate() {
            let (mut effect, mut sum) = (*column, 0.0);
            for k in (0..count).rev() {
                let weight = &mut weights.inputs[k + ahead];
                for i in 0..N - 1 {
                    weight[i] += effect[i];
                }
                weight[N - 1] += sum;
                sum += effect[output];
                effect = times(&injection.phi, &effect);
            }
        }
        let mut row = [0.0; N];
        row[output] = 1.0;
        for _ in 0..count {
            for i in 0..N {
                weights.output[i] += row[i];
            }
            row = row_times(&row, &injection.phi);
            weights.phi = product(&injection.phi, &weights.phi);
        }
        weights
    }

    /// Sum of the samples, and the state after them.
    fn advance(&self, state: &[f64; N], inputs: &[f64]) -> (f64, [f64; N]) {
        // Four sums side by side, so that an addition does not wait for the one before.
        let mut sums = [[0.0; N]; 4];
        let (weights, last_weights) = self.inputs.as_chunks::<4>();
        let (inputs, last_inputs) = inputs.as_chunks::<4>();
        for (weights, inputs) in weights.iter().zip(inputs) {
            for part in 0..4 {
                for lane in 0..N {
                    sums[part][lane] += weights[part][lane] * inputs[part];
                }
            }
        }
        for (weight, input) in last_weights.iter().zip(last_inputs) {
            for lane in 0..N {
                sums[0][lane] += weight[lane] * input;
            }
        }
        let total: [f64; N] = std::array::from_fn(|lane| {
            (sums[0][lane] + sums[1][lane]) + (sums[2][lane] + sums[3][lane])
        });
        let mut next = times(&self.phi, state);
        for i in 0..N - 1 {
            next[i] += total[i];
        }
        (dot(&self.output, state) + total[N - 1], next)
    }
}

/// Delayed inputs of `count` samples from `start` on, with one before and one after them. `copy` holds them where they
/// reach beyond the record.
fn delayed<'a>(
    source: Source<'a>,
    delay: i64,
    (start, count): (usize, usize),
    copy: &'a mut Vec<f64>,
) -> &'a [f64] {
    let first = start as i64 - delay - 1;
    let inside = usize::try_from(first).ok();
    if let Some(inputs) = inside.and_then(|first| source.values.get(first..first + count + 2)) {
        return inputs;
    }
    let last = source.values.len() as i64 - 1;
    let window = first..first + count as i64 + 2;
    copy.clear();
    copy.extend(window.map(|k| match usize::try_from(k.min(last)) {
        Ok(sample) => source.values[sample],
        Err(_) => source.before,
    }));
    copy
}

/// From block to block of an even grid.
struct Walk<'a, const N: usize> {
    blocks: &'a Blocks<'a>,
    source: Source<'a>,
    output: usize,
    injection: Injection<N>,
    weights: Weights<N>,
    /// Whether a kind of block has all samples.
    full: Vec<bool>,
    copy: Vec<f64>,
}

impl<'a, const N: usize> Walk<'a, N> {
    fn new(model: &StateSpace<N>, blocks: &'a Blocks<'a>, source: Source<'a>) -> Self {
        let injection = Injection::new(model, blocks.record.dt_s, source);
        let is_full = |kind: &BlockKind| kind.mask.iter().all(|present| *present);
        Self {
            blocks,
            source,
            output: model.output,
            weights: Weights::new(&injection, model.output, blocks.samples),
            injection,
            full: blocks.kinds.iter().map(is_full).collect(),
            copy: Vec::new(),
        }
    }

    /// Sum of `count` samples from `start` on, and the state after them.
    fn advance(&mut self, state: &[f64; N], (start, count): (usize, usize)) -> (f64, [f64; N]) {
        let delay = self.injection.delay;
        let inputs = delayed(self.source, delay, (start, count), &mut self.copy);
        match count == self.blocks.samples {
            true => self.weights.advance(state, inputs),
            false => (state[self.output], self.injection.advance(state, inputs)),
        }
    }

    /// State at the first block, from rest at the first sample.
    fn at_first(&mut self) -> [f64; N] {
        let samples = self.blocks.samples;
        let mut state = [0.0; N];
        let single = self.blocks.first % samples;
        for sample in 0..single {
            (_, state) = self.advance(&state, (sample, 1));
        }
        for start in (single..self.blocks.first).step_by(samples) {
            (_, state) = self.advance(&state, (start, samples));
        }
        state
    }

    /// Sum over the samples present in a block, and the state after it.
    fn over(&mut self, block: usize, state: &[f64; N]) -> (f64, [f64; N]) {
        let start = self.blocks.range(block).start;
        let kind = self.blocks.kind_of[block] as usize;
        if self.full[kind] {
            return self.advance(state, (start, self.blocks.samples));
        }
        let (mut sum, mut state) = (0.0, *state);
        let blocks = self.blocks;
        for (sample, present) in (start..).zip(&blocks.kinds[kind].mask) {
            if *present {
                sum += state[self.output];
            }
            let inputs = delayed(
                self.source,
                self.injection.delay,
                (sample, 1),
                &mut self.copy,
            );
            state = self.injection.advance(&state, inputs);
        }
        (sum, state)
    }
}

/// Samples on an even grid, block by block.
fn even<const N: usize>(
    model: &StateSpace<N>,
    blocks: &Blocks<'_>,
    source: Source<'_>,
) -> Vec<f64> {
    let mut walk = Walk::new(model, blocks, source);
    let mut state = walk.at_first();
    let mut sums = Vec::with_capacity(blocks.len());
    for block in 0..blocks.len() {
        let (sum, next) = walk.over(block, &state);
        state = next;
        sums.push(sum);
    }
    sums
}

/// Samples at any times: from edge to edge of the delayed input and from sample to sample.
fn uneven<const N: usize>(model: &StateSpace<N>, record: &Record, source: Source<'_>) -> Vec<f64> {
    let tau_s = source.tau_s;
    let times_s = &record.uneven_s;
    let mut steps = Steps::new(model);
    let mut state = [0.0; N];
    let mut outputs = vec![0.0];
    let mut now_s = times_s[0];
    // Sample whose input acts; that of the first sample acts before the record too.
    let mut acting = times_s.partition_point(|at| at + tau_s <= now_s);
    for &end_s in &times_s[1..] {
        while now_s < end_s {
            let edge_s = times_s.get(acting).map_or(f64::INFINITY, |at| at + tau_s);
            let until_s = end_s.min(edge_s);
            let (value, slope) = value_at(record, source, acting, now_s - tau_s);
            if until_s > now_s {
                let step = steps.of(until_s - now_s);
                let mut next = times(&step.phi, &state);
                for i in 0..N {
                    next[i] += step.held[i] * value + step.ramp[i] * slope;
                }
                state = next;
            }
            now_s = until_s;
            acting += usize::from(edge_s <= now_s);
        }
        outputs.push(state[model.output]);
    }
    outputs
}

/// Value of a source and its slope at a time, where `acting` samples have passed.
fn value_at(record: &Record, source: Source<'_>, acting: usize, time_s: f64) -> (f64, f64) {
    let Some(sample) = acting.checked_sub(1) else {
        return (source.before, 0.0);
    };
    let value = source.values[sample];
    match (source.hold, source.values.get(sample + 1)) {
        (Hold::Interpolated, Some(next)) => {
            let (start_s, end_s) = (record.uneven_s[sample], record.uneven_s[sample + 1]);
            let slope = (next - value) / (end_s - start_s);
            (value + slope * (time_s - start_s), slope)
        }
        _ => (value, 0.0),
    }
}

/// Matrices of the lengths of step that have occurred, to the nanosecond.
struct Steps<'a, const N: usize> {
    model: &'a StateSpace<N>,
    known: HashMap<i64, Step<N>>,
}

impl<'a, const N: usize> Steps<'a, N> {
    fn new(model: &'a StateSpace<N>) -> Self {
        let known = HashMap::new();
        Self { model, known }
    }

    fn of(&mut self, length_s: f64) -> &Step<N> {
        let key = (length_s * 1e9).round() as i64;
        let step = self.known.entry(key);
        step.or_insert_with(|| self.model.step(length_s))
    }
}
