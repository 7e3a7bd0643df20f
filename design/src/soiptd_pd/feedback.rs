//! The PD of a simulated loop, as a function of its state.

use crate::soiptd_pd::open_loop::OpenLoop;
use crate::soiptd_pd::propagation::{Node, State};

/// The controller in units of the step: `u` and `du/dt` from the state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Feedback {
    kp: f64,
    kd: f64,
    pub(crate) damping: f64,
}

impl Feedback {
    /// With everything in units of the step already.
    pub(crate) fn new(kp: f64, kd: f64, damping: f64) -> Self {
        Self { kp, kd, damping }
    }

    pub(crate) fn of(open_loop: &OpenLoop, step_s: f64) -> Self {
        let OpenLoop {
            kp, kd, damping, ..
        } = *open_loop;
        Self::new(kp * step_s * step_s, kd * step_s, damping * step_s)
    }

    /// Rate of change of the rate.
    pub(crate) fn acceleration(&self, state: &State) -> f64 {
        state[2] - self.damping * state[1]
    }

    /// `u` with the reference at 1.
    pub(crate) fn node(&self, state: &State) -> Node {
        let response = self.response(state);
        Node {
            value: self.kp + response.value,
            ..response
        }
    }

    /// `u` with the reference at 0: linear in the state.
    pub(crate) fn response(&self, state: &State) -> Node {
        Node {
            value: -self.kp * state[0] - self.kd * state[1],
            slope: -self.kp * state[1] - self.kd * self.acceleration(state),
        }
    }
}
