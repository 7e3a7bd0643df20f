//! Process with delay at a fixed step: exact, with a dozen multiplications per step.
//!
//! With `tau = (n + fraction) step` the delayed input over a step is the one of `n` and one steps ago for
//! `fraction * step`, and then the one of `n` steps ago. Hence one transition and two input columns, which are
//! computed once.

use onecycle_onboard::Soiptd;
use onecycle_onboard::transition::{State, Transition};

/// A process at rest that advances in fixed steps with a held input. See the [module](self).
#[derive(Clone, Debug)]
pub struct FixedStepProcess {
    transition: Transition,
    /// Response of the state to the input before the delayed edge, and to the input after it.
    before_edge: State,
    behind_edge: State,
    gain: f64,
    /// The last inputs; the oldest one still needed is at `next`.
    history: Vec<f64>,
    next: usize,
    arrived: f64,
    state: State,
}

impl FixedStepProcess {
    /// The process at rest, with steps of `step_s > 0`.
    #[must_use]
    pub fn new(process: &Soiptd, step_s: f64) -> Self {
        let steps = process.tau_s() / step_s;
        let whole = steps.floor();
        let early = Transition::over(process, (steps - whole) * step_s);
        let late = Transition::over(process, (1.0 - (steps - whole)) * step_s);
        Self {
            transition: Transition::over(process, step_s),
            before_edge: late.apply(&early.step_response(), 0.0),
            behind_edge: late.step_response(),
            gain: process.k_over_t_body(),
            history: vec![0.0; whole as usize + 1],
            next: 0,
            arrived: 0.0,
            state: State::default(),
        }
    }

    /// Advances by one step with the input `u`.
    #[inline]
    pub fn step(&mut self, u: f64) {
        self.history[self.next] = u;
        self.next += 1;
        if self.next == self.history.len() {
            self.next = 0;
        }
        let (before, behind) = (self.arrived, self.history[self.next]);
        self.arrived = behind;
        let free = self.transition.apply(&self.state, 0.0);
        self.state = State {
            y: free.y + self.before_edge.y * before + self.behind_edge.y * behind,
            v: free.v + self.before_edge.v * before + self.behind_edge.v * behind,
            f: free.f + self.before_edge.f * before + self.behind_edge.f * behind,
        };
    }

    /// Output now (output unit).
    #[must_use]
    #[inline]
    pub fn output(&self) -> f64 {
        self.gain * self.state.y
    }

    /// Rate of the output now (output unit / s).
    #[must_use]
    #[inline]
    pub fn rate(&self) -> f64 {
        self.gain * self.state.v
    }

    /// Adds an offset to the output and to its rate, as a disturbance or an initial condition.
    pub fn displace(&mut self, output: f64, rate: f64) {
        self.state.y += output / self.gain;
        self.state.v += rate / self.gain;
    }
}
