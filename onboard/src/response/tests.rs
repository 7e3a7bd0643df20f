//! Means over bins against single outputs.

extern crate std;

use std::vec;
use std::vec::Vec;

use super::*;

const SAMPLE_S: f64 = 0.01;

/// Outputs at single samples: every stretch between an instant and an arriving edge has its own transition.
fn outputs(
    process: &Soiptd,
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

fn processes(tau_s: f64) -> [Soiptd; 4] {
    let new = |prop, damping| Soiptd::from_acceleration_gain(1.0, prop, damping, tau_s).unwrap();
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
    // On an instant (0.30), between two instants, two in one sample, and after the end of the window.
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

/// All means, and how many calls they took.
fn means(
    process: &Soiptd,
    grid: &Grid,
    edges: &[Edge],
    drive: &Drive,
    offset_s: &[f64],
) -> (Vec<f64>, usize) {
    let mut response = Response::NONE;
    response.set(process, grid);
    let mut means = vec![1.0; offset_s.len()];
    let mut course = Course::new(edges, drive);
    for calls in 1.. {
        let before = course;
        let is_complete = response.follow((edges, drive), offset_s, &mut means, &mut course);
        if is_complete {
            return (means, calls);
        }
        // A bin that the last call had begun is not work of this call.
        let done = before.index + usize::from(before.open.is_some());
        let (bins, edges) = (course.index.saturating_sub(done), course.edge - before.edge);
        assert!(
            bins + EDGE_BINS * edges <= SLICE_BINS,
            "{bins} bins, {edges} edges"
        );
        assert!(bins + edges > 0 || course.open.is_some());
    }
    unreachable!()
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
            let (means, _) = means(&process, &grid, &edges, &drive, &vec![0.0; bins]);
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
            // No delay, part of a sample, whole samples, more than a small bin.
            for tau_s in [0.0, 0.0037, 0.02, 0.1173] {
                check(per_bin, past_bins, tau_s);
            }
        }
    }
}

// Samples d late on average add exactly d times the mean slope of their bin: its last output minus its first,
// over its duration.
#[test]
fn late_samples_are_followed_to_first_order() {
    let process = processes(0.0173)[0];
    let edges = edges();
    let grid = Grid {
        sample_s: SAMPLE_S,
        per_bin: 4,
        past_bins: 8,
        start_s: 0.0,
    };
    let means = |offset_s: f64| means(&process, &grid, &edges, &DRIVES[0], &[offset_s; 24]).0;
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
    let (means, _) = means(&process, &grid, &[], &DRIVES[0], &[0.0; 5]);
    assert_eq!(means, [0.0; 5]);
}

// 300 bins without edges: 5.4 times 56, six calls. With five edges, each worth 40 bins: 16 bins are left beside
// an edge, so at most one edge per call; at least six calls, at most 1 + 300/56 + 2 * 5.
#[test]
fn a_call_follows_no_more_than_it_may() {
    let grid = Grid {
        sample_s: SAMPLE_S,
        per_bin: 1,
        past_bins: 50,
        start_s: 0.0,
    };
    let process = processes(0.0)[0];
    let calls = |drive| means(&process, &grid, &edges(), drive, &[0.0; 250]).1;
    assert_eq!(calls(&DRIVES[1]), 6);
    let recorded = calls(&DRIVES[0]);
    assert!((6..=16).contains(&recorded), "{recorded}");
}
