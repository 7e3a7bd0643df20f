//! PD law of a simulated loop as a function of the state, in units of the simulation step.

use crate::soiptd_pd::open_loop::OpenLoop;
use crate::soiptd_pd::propagation::{Node, State};

/// PD in units of the simulation step and of the acceleration gain: `u` and `du/dt` from the state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Feedback {
    kp: f64,
    kd: f64,
    /// `1/T_body` times the step.
    pub(crate) damping: f64,
}

impl Feedback {
    /// From values already in units of the step.
    pub(crate) fn new(kp: f64, kd: f64, damping: f64) -> Self {
        Self { kp, kd, damping }
    }

    /// The PD of `open_loop` at a simulation step of `step_s`.
    pub(crate) fn of(open_loop: &OpenLoop, step_s: f64) -> Self {
        let OpenLoop {
            kp, kd, damping, ..
        } = *open_loop;
        Self::new(kp * step_s * step_s, kd * step_s, damping * step_s)
    }

    /// Second derivative of the output.
    pub(crate) fn acceleration(&self, state: &State) -> f64 {
        state[2] - self.damping * state[1]
    }

    /// `u` for a reference of 1.
    pub(crate) fn node(&self, state: &State) -> Node {
        let response = self.response(state);
        Node {
            value: self.kp + response.value,
            ..response
        }
    }

    /// `u` for a reference of 0: linear in the state.
    pub(crate) fn response(&self, state: &State) -> Node {
        Node {
            value: -self.kp * state[0] - self.kd * state[1],
            slope: -self.kp * state[1] - self.kd * self.acceleration(state),
        }
    }
}
