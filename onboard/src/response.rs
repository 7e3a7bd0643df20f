//! Responses of the delayed process averaged over the bins of a window, exactly.
//!
//! A stretch of `m` samples has a transition and the sum of the outputs at its instants; both
//! double in one multiplication, so a bin of any size costs a handful of them. An edge of the
//! input inside a bin adds the step response that starts there.

use crate::process::Process;
use crate::transition::{State, Transition};
use crate::window::{Edge, MOST_PER_BIN};

/// Doublings of one sample that make the largest bin.
const DOUBLINGS: usize = MOST_PER_BIN.ilog2() as usize + 1;

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

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec;
    use std::vec::Vec;

    use super::*;

    const SAMPLE_S: f64 = 0.01;

    /// Outputs at the samples one by one: every stretch between an instant and an arriving edge has a
    /// transition of its own.
    fn outputs(
        process: &Process,
        drive: &Drive,
        edges: &[Edge],
        begin_s: f64,
        count: usize,
    ) -> Vec<f64> {
        let mut outputs = Vec::new();
        let mut state = drive.initial;
        let mut now_s = begin_s;
        let mut recorded = edges.first().map_or(0.0, |first| first.input);
        let mut later = edges.iter().skip(1).peekable();
        for sample in 0..count {
            let until_s = begin_s + sample as f64 * SAMPLE_S;
            let mut forward = |to_s: f64, recorded: f64, state: &mut State| {
                let level = drive.constant + drive.recorded * recorded;
                *state = Transition::over(process, (to_s - now_s).max(0.0)).apply(state, level);
                now_s = now_s.max(to_s);
            };
            while let Some(edge) = later.next_if(|edge| edge.time_s + process.tau_s() < until_s) {
                forward(edge.time_s + process.tau_s(), recorded, &mut state);
                recorded = edge.input;
            }
            forward(until_s, recorded, &mut state);
            outputs.push(state.y);
        }
        outputs
    }

    fn processes(tau_s: f64) -> [Process; 4] {
        let new =
            |prop, damping| Process::from_acceleration_gain(1.0, prop, damping, tau_s).unwrap();
        [
            new(0.032, 0.6),
            new(0.2, 5.0),
            new(0.05, 0.0),
            new(0.001, 0.1),
        ]
    }

    const DRIVES: [Drive; 3] = [
        Drive {
            initial: State {
                y: 0.0,
                v: 0.0,
                f: 0.0,
            },
            constant: 0.0,
            recorded: 1.0,
        },
        Drive {
            initial: State {
                y: 0.3,
                v: -0.5,
                f: 0.8,
            },
            constant: 0.0,
            recorded: 0.0,
        },
        Drive {
            initial: State {
                y: 0.3,
                v: -0.5,
                f: 0.8,
            },
            constant: -0.4,
            recorded: 1.7,
        },
    ];

    fn edges() -> Vec<Edge> {
        // On an instant (0.30), between two, two in one sample, and later than the window's end.
        [
            (-3.0, 1.0),
            (0.0553, -1.0),
            (0.30, 0.5),
            (0.4711, -1.0),
            (0.4737, 1.0),
            (0.9871, -1.0),
        ]
        .map(|(time_s, input)| Edge { time_s, input })
        .to_vec()
    }

    fn check(per_bin: u32, past_bins: usize, tau_s: f64) {
        let bins = 128_usize.div_ceil(per_bin as usize);
        let grid = Grid {
            sample_s: SAMPLE_S,
            per_bin,
            past_bins,
            start_s: 0.0,
        };
        let begin_s = -((past_bins * per_bin as usize) as f64) * SAMPLE_S;
        let edges = edges();
        for process in processes(tau_s) {
            for drive in DRIVES {
                let response = Response::new(&process, grid, &edges);
                let mut means = vec![0.0; bins];
                response.means(&drive, &vec![0.0; bins], &mut means);
                let count = (past_bins + bins) * per_bin as usize;
                let outputs = outputs(&process, &drive, &edges, begin_s, count);
                let scale = outputs.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
                let window = outputs.chunks(per_bin as usize).skip(past_bins);
                for (index, (mean, samples)) in means.iter().zip(window).enumerate() {
                    let expected = samples.iter().sum::<f64>() / samples.len() as f64;
                    assert!(
                        (mean - expected).abs() <= 1e-12 * scale,
                        "{process:?} {drive:?} bin {index} of {per_bin}: {mean} against {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn bins_are_means_of_their_samples() {
        for per_bin in [1, 3, 64] {
            for past_bins in [0, 2] {
                // None, part of a sample, whole samples, more than a small bin.
                for tau_s in [0.0, 0.0037, 0.02, 0.1173] {
                    check(per_bin, past_bins, tau_s);
                }
            }
        }
    }

    // Samples late by d on average: d times the mean slope of their bin, its last output less its
    // first over its duration, is added; exactly that.
    #[test]
    fn late_samples_are_followed_to_first_order() {
        let process = processes(0.0173)[0];
        let edges = edges();
        let means = |offset_s: f64| {
            let grid = Grid {
                sample_s: SAMPLE_S,
                per_bin: 4,
                past_bins: 8,
                start_s: 0.0,
            };
            let mut means = [0.0; 24];
            Response::new(&process, grid, &edges).means(&DRIVES[0], &[offset_s; 24], &mut means);
            means
        };
        let outputs = outputs(&process, &DRIVES[0], &edges, -32.0 * SAMPLE_S, 32 + 97);
        let late_s = 0.2 * SAMPLE_S;
        for (bin, (late, even)) in means(late_s).iter().zip(means(0.0)).enumerate() {
            let slope = (outputs[32 + 4 * bin + 4] - outputs[32 + 4 * bin]) / (4.0 * SAMPLE_S);
            assert!((late - even - slope * late_s).abs() < 1e-15, "bin {bin}");
        }
    }

    #[test]
    fn no_edges_no_input() {
        let grid = Grid {
            sample_s: SAMPLE_S,
            per_bin: 3,
            past_bins: 0,
            start_s: 0.0,
        };
        let process = processes(0.01)[0];
        let mut means = [1.0; 5];
        Response::new(&process, grid, &[]).means(&DRIVES[0], &[0.0; 5], &mut means);
        assert_eq!(means, [0.0; 5]);
    }
}
