//! Process with delay at steps of any length, with a history of its input.
//!
//! It computes a transition for every stretch between events, so it is slower than
//! [`FixedStepProcess`](crate::FixedStepProcess) and independent of it. It serves jittered samples and tests of
//! the other.

use std::collections::VecDeque;

use onecycle_onboard::Soiptd;
use onecycle_onboard::transition::{State, Transition};

/// Input behind a dead time: which value arrives for how long.
#[derive(Clone, Debug)]
pub(crate) struct DelayedInput {
    tau_s: f64,
    time_s: f64,
    arrived: f64,
    /// Inputs that have not arrived yet: arrival time (s) and value.
    under_way: VecDeque<(f64, f64)>,
}

impl DelayedInput {
    /// Input zero up to time zero, dead time `tau_s`.
    pub(crate) fn new(tau_s: f64) -> Self {
        Self {
            tau_s,
            time_s: 0.0,
            arrived: 0.0,
            under_way: VecDeque::new(),
        }
    }

    /// Holds the input at `u` for `duration_s >= 0`. Calls `propagate` with the duration (s) and the value of each stretch
    /// of constant delayed input.
    pub(crate) fn advance(&mut self, u: f64, duration_s: f64, mut propagate: impl FnMut(f64, f64)) {
        self.under_way.push_back((self.time_s + self.tau_s, u));
        let end_s = self.time_s + duration_s;
        while let Some(&(arrival_s, value)) = self.under_way.front() {
            if arrival_s >= end_s {
                break;
            }
            propagate((arrival_s - self.time_s).max(0.0), self.arrived);
            self.time_s = arrival_s;
            self.arrived = value;
            self.under_way.pop_front();
        }
        propagate((end_s - self.time_s).max(0.0), self.arrived);
        self.time_s = end_s;
    }

    /// Delayed input now.
    pub(crate) fn arrived(&self) -> f64 {
        self.arrived
    }
}

/// A process at rest that advances by any duration with a held input.
#[derive(Clone, Debug)]
pub struct VariableStepProcess {
    process: Soiptd,
    state: State,
    input: DelayedInput,
}

impl VariableStepProcess {
    /// The process at rest at time zero.
    #[must_use]
    pub fn new(process: &Soiptd) -> Self {
        Self {
            process: *process,
            state: State::default(),
            input: DelayedInput::new(process.tau_s()),
        }
    }

    /// Holds the input at `u` for `duration_s >= 0`.
    pub fn advance(&mut self, u: f64, duration_s: f64) {
        let (process, state) = (&self.process, &mut self.state);
        self.input.advance(u, duration_s, |step_s, arrived| {
            *state = Transition::over(process, step_s).apply(state, arrived);
        });
    }

    /// Output now (output unit).
    #[must_use]
    pub fn output(&self) -> f64 {
        self.process.k_over_t_body() * self.state.y
    }

    /// Rate of the output now (output unit / s).
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.process.k_over_t_body() * self.state.v
    }

    /// Adds an offset to the output and to its rate, as a disturbance or an initial condition.
    pub fn displace(&mut self, output: f64, rate: f64) {
        self.state.y += output / self.process.k_over_t_body();
        self.state.v += rate / self.process.k_over_t_body();
    }
}
