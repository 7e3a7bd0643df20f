//! A relay around a process without noise, simulated with the crate's own transition.

use onecycle_onboard::cycle::CycleDetector;
use onecycle_onboard::transition::State;
use onecycle_onboard::window::Window;
use onecycle_onboard::{Relay, Soiptd, Transition};

pub(crate) type FitWindow = Window<260, 64>;

/// Input from each sample on, and output at it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Run {
    pub(crate) time_s: Vec<f64>,
    pub(crate) input: Vec<f64>,
    pub(crate) output: Vec<f64>,
}

/// Process under held inputs; the recorded input arrives `tau` later.
pub(crate) struct Simulation {
    process: Soiptd,
    state: State,
    now_s: f64,
    arrived: f64,
    under_way: std::collections::VecDeque<(f64, f64)>,
}

impl Simulation {
    pub(crate) fn new(process: &Soiptd) -> Self {
        let under_way = std::collections::VecDeque::new();
        Self {
            process: *process,
            state: State::default(),
            now_s: 0.0,
            arrived: 0.0,
            under_way,
        }
    }

    pub(crate) fn output(&self) -> f64 {
        self.process.k_over_t_body() * self.state.y
    }

    /// Holds the input at `u` until `until_s`.
    pub(crate) fn hold(&mut self, u: f64, until_s: f64) {
        self.under_way
            .push_back((self.now_s + self.process.tau_s(), u));
        while let Some((arrival_s, arriving)) = self.under_way.front().copied() {
            if arrival_s >= until_s {
                break;
            }
            self.forward(arrival_s);
            self.arrived = arriving;
            self.under_way.pop_front();
        }
        self.forward(until_s);
    }

    fn forward(&mut self, to_s: f64) {
        let transition = Transition::over(&self.process, (to_s - self.now_s).max(0.0));
        self.state = transition.apply(&self.state, self.arrived);
        self.now_s = to_s;
    }
}

/// Runs the relay at these instants under a constant input bias.
pub(crate) fn run(
    process: &Soiptd,
    relay: &mut Relay,
    bias: f64,
    times_s: impl IntoIterator<Item = f64>,
) -> Run {
    let mut simulation = Simulation::new(process);
    let mut run = Run::default();
    let mut times_s = times_s.into_iter().peekable();
    while let Some(time_s) = times_s.next() {
        let Some(&next_s) = times_s.peek() else { break };
        let output = simulation.output();
        // For a process of negative gain the relay's output is reversed.
        let sense = process.k_over_t_body().signum();
        let input = sense * f64::from(relay.step((-output) as f32, (next_s - time_s) as f32));
        run.time_s.push(time_s);
        run.input.push(input);
        run.output.push(output);
        simulation.hold(input + bias, next_s);
    }
    run
}

/// Evenly spaced instants.
pub(crate) fn every(sample_s: f64, count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| k as f64 * sample_s)
}

/// A window with the last `cycles` cycles and two periods of input before them, and their period; `keep` says
/// which samples exist.
pub(crate) fn last_cycles(
    run: &Run,
    sample_s: f64,
    cycles: usize,
    mut keep: impl FnMut(usize) -> bool,
) -> (FitWindow, f64) {
    let mut detector = CycleDetector::new();
    let mut found = Vec::new();
    let sense = run.input[0].signum();
    for index in 0..run.time_s.len() {
        let high = sense * run.input[index] > 0.0;
        found.extend(detector.push(run.time_s[index], high, run.output[index]));
    }
    let found = &found[found.len() - cycles..];
    let (first, last) = (found[0], found[cycles - 1]);
    let end_s = last.start_s + last.period_s;
    let period_s = (end_s - first.start_s) / cycles as f64;
    let mut window = Window::new(first.start_s, sample_s);
    let half_s = 0.5 * sample_s;
    for index in 0..run.time_s.len() {
        let time_s = run.time_s[index];
        if time_s < first.start_s - 2.0 * period_s || time_s > end_s - half_s {
            continue;
        }
        window.push_input(time_s, run.input[index]).unwrap();
        if time_s > first.start_s - half_s && keep(index) {
            window.push_output(time_s, run.output[index]);
        }
    }
    (window, period_s)
}
