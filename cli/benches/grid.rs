//! A grid of 10 % of the paper's space, at one and at two threads, and what it is made of:
//! `cargo bench -p onecycle --bench grid`.

use std::hint::black_box;
use std::time::{Duration, Instant};

use onecycle_lab::space::Space;
use onecycle_lab::space::candidate::{Candidate, Gains};
use onecycle_lab::space::grid::{Grid, GridSettings, Layout, check};
use onecycle_lab::workers::Workers;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

struct Threads(ThreadPool);

impl Workers for Threads {
    fn count(&self) -> usize {
        self.0.current_num_threads()
    }

    fn each(&self, parts: usize, part: &(dyn Fn(usize) + Sync)) {
        self.0.install(|| (0..parts).into_par_iter().for_each(part));
    }
}

/// The paper's hover process and one that is mostly dead time, made alike in time scale.
const HOVER_S: [f64; 3] = [0.0321, 1.6886, 0.0237];
const DELAYED_S: [f64; 3] = [0.015, 0.8, 0.04];

const CALLS: u32 = 20_000;
const RUNS: usize = 3;

fn main() {
    let candidate = |times_s| {
        Candidate::new(&Space::MULTIROTOR, Gains::SameAmplitude, times_s).expect("a process")
    };
    let (one, other) = (candidate(HOVER_S), candidate(DELAYED_S));
    each("J_ij", || one.cost_on(black_box(&other)));
    each("J_(ij)", || one.distance(black_box(&other)));
    each("candidate", || candidate(black_box(HOVER_S)).optimum.ise);
    let mut grids = Vec::new();
    for threads in [1, 2] {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let threads = Threads(pool.expect("threads start"));
        let of = threads.0.current_num_threads();
        for layout in [Layout::Rays, Layout::Fewest] {
            let settings = GridSettings {
                layout,
                ..GridSettings::default()
            };
            let name = format!("{layout:?}, {of} thread(s)");
            let grid = whole(&name, || {
                Grid::build(&settings, &threads).expect("the space has a grid")
            });
            whole(&format!("10,000 checked, {name}"), || {
                check(&grid, 10_000, 1, &threads).expect("processes are processes")
            });
            grids.push(grid);
        }
    }
    assert!(grids[0] == grids[2] && grids[1] == grids[3], "same bits");
}

/// Time of one call.
fn each(name: &str, mut call: impl FnMut() -> f64) {
    let time = |_| {
        let begin = Instant::now();
        for _ in 0..CALLS {
            black_box(call());
        }
        begin.elapsed() / CALLS
    };
    report(name, (0..RUNS).map(time).collect());
}

/// Time of the whole.
fn whole<T>(name: &str, make: impl Fn() -> T) -> T {
    let mut times = Vec::new();
    loop {
        let begin = Instant::now();
        let made = make();
        times.push(begin.elapsed());
        if times.len() == RUNS {
            report(name, times);
            return made;
        }
    }
}

#[expect(clippy::print_stdout, reason = "a bench reports")]
fn report(name: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    println!(
        "{name:<34} median {:.3?}, least {:.3?}",
        times[times.len() / 2],
        times[0]
    );
}
