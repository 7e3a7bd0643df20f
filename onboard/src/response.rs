//! Responses of the delayed process averaged over the bins of a window, exactly.
//!
//! A stretch of `m` samples has a transition and the sum of the outputs at its instants; both
//! double in one multiplication, so a bin of any size costs a handful of them. An edge of the
//! input inside a bin adds the step response that starts there.

use crate::process::Process;
use crate::transition::{State, Transition};
use crate::window::Edge;

/// Bins of up to `2^20` samples.
const DOUBLINGS: usize = 21;

/// `samples` steps: the transition over them and the sum of the outputs at their beginnings.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    samples: f64,
    transition: Transition,
    /// Sum of outputs after a unit rate, a unit force, under a unit input.
    sum_v: f64,
    sum_f: f64,
    sum_u: f64,
}

impl Stretch {
    const NONE: Self = Self {
        samples: 0.0,
        transition: Transition::IDENTITY,
        sum_v: 0.0,
        sum_f: 0.0,
        sum_u: 0.0,
    };

    fn one(transition: Transition) -> Self {
        Self {
            samples: 1.0,
            transition,
            ..Self::NONE
        }
    }

    /// Sum of the outputs over the stretch, from a state and under a constant input.
    fn sum(&self, from: &State, u: f64) -> f64 {
        self.samples * from.y + self.sum_v * from.v + self.sum_f * from.f + self.sum_u * u
    }

    fn then(&self, next: &Self) -> Self {
        let t = &self.transition;
        Self {
            samples: self.samples + next.samples,
            transition: t.then(&next.transition),
            sum_v: self.sum_v
                + next.sum(
                    &State {
                        y: t.y_v,
                        v: t.v_v,
                        f: 0.0,
                    },
                    0.0,
                ),
            sum_f: self.sum_f
                + next.sum(
                    &State {
                        y: t.y_f,
                        v: t.v_f,
                        f: t.f_f,
                    },
                    0.0,
                ),
            sum_u: self.sum_u
                + next.sum(
                    &State {
                        y: t.y_u,
                        v: t.v_u,
                        f: t.f_u,
                    },
                    1.0,
                ),
        }
    }
}

/// The bins: times relative to the first instant of the window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub(crate) sample_s: f64,
    pub(crate) per_bin: u32,
    /// Bins of the past that lie before the first one of the window.
    pub(crate) past_bins: usize,
    /// Absolute time of the first instant of the window (s).
    pub(crate) start_s: f64,
}

/// What drives the process: its state at the beginning of the past, a constant input from then
/// on, and a multiple of the recorded input.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Drive {
    pub(crate) initial: State,
    pub(crate) constant: f64,
    pub(crate) recorded: f64,
}

/// The process of unit acceleration gain on a grid of bins.
pub(crate) struct Response<'a> {
    process: Process,
    grid: Grid,
    edges: &'a [Edge],
    /// Stretches of 1, 2, 4 ... samples, as many as a bin needs.
    doublings: [Stretch; DOUBLINGS],
    bin: Stretch,
}

impl<'a> Response<'a> {
    pub(crate) fn new(process: &Process, grid: Grid, edges: &'a [Edge]) -> Self {
        let mut doublings = [Stretch::NONE; DOUBLINGS];
        doublings[0] = Stretch::one(Transition::over(process, grid.sample_s));
        let needed = (32 - grid.per_bin.leading_zeros()) as usize;
        for k in 1..needed.min(DOUBLINGS) {
            doublings[k] = doublings[k - 1].then(&doublings[k - 1]);
        }
        let mut response = Self {
            process: *process,
            grid,
            edges,
            doublings,
            bin: Stretch::NONE,
        };
        response.bin = response.stretch(grid.per_bin);
        response
    }

    pub(crate) fn process(&self) -> &Process {
        &self.process
    }

    fn stretch(&self, samples: u32) -> Stretch {
        let mut stretch = Stretch::NONE;
        for (k, doubling) in self.doublings.iter().enumerate() {
            if samples >> k & 1 == 1 {
                stretch = stretch.then(doubling);
            }
        }
        stretch
    }

    /// Mean outputs over the bins of the window, the samples of bin `k` being `offset_s[k]` late
    /// on average.
    pub(crate) fn means(&self, drive: &Drive, offset_s: &[f64], means: &mut [f64]) {
        let bin_s = f64::from(self.grid.per_bin) * self.grid.sample_s;
        let past = self.grid.past_bins;
        let begin_s = self.grid.start_s - past as f64 * bin_s;
        let (first, later) = match self.edges {
            [] => (0.0, [].as_slice()),
            [first, later @ ..] => (first.input, later),
        };
        let mut edges = if drive.recorded == 0.0 {
            [].iter()
        } else {
            later.iter()
        }
        .peekable();
        let mut recorded = first;
        let mut level = drive.constant + drive.recorded * recorded;
        let mut state = drive.initial;
        for index in 0..past + means.len() {
            let mut sum = self.bin.sum(&state, level);
            let mut next = self.bin.transition.apply(&state, level);
            let start_s = begin_s + index as f64 * bin_s;
            while let Some(edge) = edges.peek() {
                let after_s = edge.time_s + self.process.tau_s() - start_s;
                if after_s >= bin_s {
                    break;
                }
                let step = drive.recorded * (edge.input - recorded);
                self.add_edge(after_s.max(0.0), step, &mut sum, &mut next);
                recorded = edge.input;
                level += step;
                edges.next();
            }
            if let Some(k) = index.checked_sub(past) {
                let rate = (next.y - state.y) / bin_s;
                means[k] = sum / f64::from(self.grid.per_bin) + rate * offset_s[k];
            }
            state = next;
        }
    }

    /// Adds the response to a step of the input `after_s` behind the first instant of a bin.
    fn add_edge(&self, after_s: f64, step: f64, sum: &mut f64, next: &mut State) {
        let waits = libm::ceil(after_s / self.grid.sample_s);
        let samples = self.grid.per_bin.saturating_sub(waits as u32);
        let stretch = self.stretch(samples);
        let until_sample_s = (waits * self.grid.sample_s - after_s).max(0.0);
        let unit = Transition::over(&self.process, until_sample_s).step_response();
        let from = State {
            y: step * unit.y,
            v: step * unit.v,
            f: step * unit.f,
        };
        *sum += stretch.sum(&from, step);
        let end = stretch.transition.apply(&from, step);
        *next = State {
            y: next.y + end.y,
            v: next.v + end.v,
            f: next.f + end.f,
        };
    }
}
