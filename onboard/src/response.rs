//! Exact response of the delayed process, averaged over the bins of a window.
//!
//! ```text
//! mean of bin k = 1/m sum of y(t_i) over the m instants t_i of the bin
//! ```
//!
//! for the process with unit acceleration gain (`K/T_body = 1`), so `y` is in input unit s^2; times are in
//! seconds. A stretch of `m` samples has a transition and the sum of the outputs at its instants. One
//! multiplication doubles both, so a bin of any size takes a few multiplications. An edge of the input within a
//! bin adds the step response that begins there. A response is computed some bins per slice, so that each slice
//! fits into a control tick.

use crate::process::Soiptd;
use crate::transition::{State, Transition};
use crate::window::{Edge, MOST_PER_BIN};

/// Number of doublings of one sample that give the largest bin.
const DOUBLINGS: usize = MOST_PER_BIN.ilog2() as usize + 1;

/// Stretch of `samples` steps: its transition, and the sum of the outputs at the beginning of each step.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    samples: f64,
    transition: Transition,
    /// Sum of the outputs after a unit rate, after a unit force, and under a unit input.
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

    const ZERO: Self = Self {
        samples: 0.0,
        transition: Transition::ZERO,
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

/// Grid of bins. Times are relative to the first instant of the window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub(crate) sample_s: f64,
    pub(crate) per_bin: u32,
    /// Number of bins of the past before the first bin of the window.
    pub(crate) past_bins: usize,
    /// Absolute time of the first instant of the window (s).
    pub(crate) start_s: f64,
}

impl Grid {
    /// No bins.
    pub(crate) const NONE: Self = Self {
        sample_s: 0.0,
        per_bin: 0,
        past_bins: 0,
        start_s: 0.0,
    };
}

/// What drives the process: initial state at the beginning of the past, a constant input from then on, and a
/// multiple of the recorded input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Drive {
    pub(crate) initial: State,
    pub(crate) constant: f64,
    pub(crate) recorded: f64,
}

impl Drive {
    /// Nothing: at rest without input.
    pub(crate) const NONE: Self = Self {
        initial: State {
            y: 0.0,
            v: 0.0,
            f: 0.0,
        },
        constant: 0.0,
        recorded: 0.0,
    };
}

/// Bins per slice. An edge of the input, whose step response costs as much as [`EDGE_BINS`] bins, counts as that
/// many. See the table in `refine`.
pub(crate) const SLICE_BINS: usize = 56;
/// Cost of an edge in bins: 1,200 operations against 32.
const EDGE_BINS: usize = 40;

/// Progress of a response.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Course {
    /// Next bin, from the beginning of the past, and next edge.
    index: usize,
    edge: usize,
    /// Recorded input and total input before that edge.
    recorded: f64,
    level: f64,
    state: State,
    /// Sum over the bin and state at its end, if the slice ended within the bin.
    open: Option<(f64, State)>,
}

impl Course {
    /// All zeros: memory before the first use.
    pub(crate) const NONE: Self = Self {
        index: 0,
        edge: 0,
        recorded: 0.0,
        level: 0.0,
        state: Drive::NONE.initial,
        open: None,
    };

    /// Progress at the beginning of the past.
    pub(crate) fn new(edges: &[Edge], drive: &Drive) -> Self {
        let recorded = edges.first().map_or(0.0, |first| first.input);
        Self {
            index: 0,
            edge: 0,
            recorded,
            level: drive.constant + drive.recorded * recorded,
            state: drive.initial,
            open: None,
        }
    }
}

/// Process with unit acceleration gain on a grid of bins.
#[derive(Clone, Debug)]
pub(crate) struct Response {
    body_per_s: f64,
    prop_per_s: f64,
    tau_s: f64,
    grid: Grid,
    /// Stretches of 1, 2, 4 ... samples, as many as a bin needs.
    doublings: [Stretch; DOUBLINGS],
    bin: Stretch,
}

impl Response {
    /// All zeros, which takes no space in the program: memory before the first use.
    pub(crate) const NONE: Self = Self {
        body_per_s: 0.0,
        prop_per_s: 0.0,
        tau_s: 0.0,
        grid: Grid::NONE,
        doublings: [Stretch::ZERO; DOUBLINGS],
        bin: Stretch::ZERO,
    };

    /// Sets another process or grid in place, because the value takes two kilobytes.
    pub(crate) fn set(&mut self, process: &Soiptd, grid: &Grid) {
        self.body_per_s = process.inv_t_body_per_s();
        self.prop_per_s = 1.0 / process.t_prop_s();
        self.tau_s = process.tau_s();
        self.grid = *grid;
        self.doublings[0] = Stretch::one(self.over(grid.sample_s));
        let needed = (32 - grid.per_bin.leading_zeros()) as usize;
        for k in 1..needed.min(DOUBLINGS) {
            self.doublings[k] = self.doublings[k - 1].then(&self.doublings[k - 1]);
        }
        self.bin = self.stretch(grid.per_bin);
    }

    fn over(&self, duration_s: f64) -> Transition {
        Transition::of_poles(self.body_per_s, self.prop_per_s, duration_s)
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

    /// Computes the mean outputs over the next [`SLICE_BINS`] bins of the window, where the samples of bin `k`
    /// are `offset_s[k]` late on average. True when all bins are complete.
    pub(crate) fn follow(
        &self,
        (edges, drive): (&[Edge], &Drive),
        offset_s: &[f64],
        means: &mut [f64],
        course: &mut Course,
    ) -> bool {
        let per_bin = f64::from(self.grid.per_bin);
        let bin_s = per_bin * self.grid.sample_s;
        let past = self.grid.past_bins;
        let begin_s = self.grid.start_s - past as f64 * bin_s;
        let later = match edges {
            [_, later @ ..] if drive.recorded != 0.0 => later,
            _ => &[],
        };
        let mut at = *course;
        let mut left = SLICE_BINS;
        while at.index < past + means.len() {
            let start_s = begin_s + at.index as f64 * bin_s;
            let (mut sum, mut next) = match at.open.take() {
                Some(open) => open,
                None if left == 0 => {
                    *course = at;
                    return false;
                }
                None => {
                    left -= 1;
                    let sum = self.bin.sum(&at.state, at.level);
                    (sum, self.bin.transition.apply(&at.state, at.level))
                }
            };
            while let Some(edge) = later.get(at.edge) {
                let after_s = edge.time_s + self.tau_s - start_s;
                if after_s >= bin_s {
                    break;
                }
                if left < EDGE_BINS {
                    at.open = Some((sum, next));
                    *course = at;
                    return false;
                }
                left -= EDGE_BINS;
                let step = drive.recorded * (edge.input - at.recorded);
                self.add_edge(after_s.max(0.0), step, &mut sum, &mut next);
                at.recorded = edge.input;
                at.level += step;
                at.edge += 1;
            }
            if let Some(k) = at.index.checked_sub(past) {
                let rate = (next.y - at.state.y) / bin_s;
                means[k] = sum / per_bin + rate * offset_s[k];
            }
            at.state = next;
            at.index += 1;
        }
        true
    }

    /// Adds the response to a step of the input `after_s` after the first instant of a bin.
    fn add_edge(&self, after_s: f64, step: f64, sum: &mut f64, next: &mut State) {
        let waits = libm::ceil(after_s / self.grid.sample_s);
        let samples = self.grid.per_bin.saturating_sub(waits as u32);
        let stretch = self.stretch(samples);
        let until_sample_s = (waits * self.grid.sample_s - after_s).max(0.0);
        let unit = self.over(until_sample_s).step_response();
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

#[cfg(test)]
mod tests;
