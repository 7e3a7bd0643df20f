//! The process of which a relay test shows period and amplitude, by its exact limit cycle.
//!
//! The relay switches between two levels, `2H` apart. Its output, delayed by `tau`, drives the process: it is high for
//! `t1 = D P` and low for `t2 = (1 - D) P` in each period `P`. A constant input moves the output by a constant, or is cancelled
//! by the load of an integrator, so the mean of the square wave is left out: the levels are `2H(1 - D)` and `-2H D`.
//!
//! With `Phi(t)`, `Gamma(t)` of the process without dead time and gain, and time from a rise of the delayed input,
//!
//! ```text
//! x(P) = Phi(t2) [Phi(t1) x(0) + Gamma(t1) 2H(1 - D)] - Gamma(t2) 2H D = x(0)        the periodic state
//! k (max y - min y) = 2A                                                              determines the slope k
//! k (y(t1 - tau) - y(P - tau)) = 2E                                                   determines tau
//! ```
//!
//! The last line: the relay falls where the output has risen to `E` above the middle, and rises where it has fallen to `E`
//! below, each `tau` before the delayed input does.

use std::f64::consts::PI;

use crate::matrix::times;
use crate::model::Linear;
use crate::model::state_space::StateSpace;
use crate::roots::root;
use crate::rules::Ultimate;

/// Two stages and the disturbance of [`StateSpace`].
const STATES: usize = 3;

/// Slopes below this share of the largest one are rounding errors.
const ROUNDING: f64 = 1e-12;

/// First trial of the time of the turn, in lags.
const SHORT: f64 = 1e-3;

/// A steady oscillation under a relay with hysteresis.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RelayTest {
    /// `H`: half of the distance between the levels of the relay (input unit).
    pub relay: f64,
    /// `A`: half of the peak-to-peak output (output unit).
    pub amplitude: f64,
    /// Period (s).
    pub period_s: f64,
    /// `E`: half of the distance between the thresholds of the relay (output unit), less than `amplitude`.
    pub hysteresis: f64,
    /// `D`: share of the period for which the relay is high, between 0 and 1.
    pub duty: f64,
}

impl RelayTest {
    /// Test with a relay of half-width `relay` (input unit), an output of half the peak-to-peak value `amplitude` (output unit)
    /// and a period of `period_s` (s), without hysteresis, high for half of the time.
    #[must_use]
    pub fn new(relay: f64, amplitude: f64, period_s: f64) -> Self {
        Self {
            relay,
            amplitude,
            period_s,
            hysteresis: 0.0,
            duty: 0.5,
        }
    }

    /// Sets half of the distance between the thresholds (output unit).
    #[must_use]
    pub fn with_hysteresis(self, hysteresis: f64) -> Self {
        Self { hysteresis, ..self }
    }

    /// Sets the share of the period for which the relay is high.
    #[must_use]
    pub fn with_duty(self, duty: f64) -> Self {
        Self { duty, ..self }
    }

    /// `KU = 4H/(pi sqrt(A^2 - E^2))` by the describing function, and the period.
    #[must_use]
    pub fn describing_function(&self) -> Ultimate {
        let (a, e) = (self.amplitude, self.hysteresis);
        Ultimate::new(
            4.0 * self.relay / (PI * (a * a - e * e).sqrt()),
            self.period_s,
        )
    }

    /// `process` with the slope and the dead time with which it oscillates as in the test. `None` if it does so with no dead
    /// time: its lags are too long for the hysteresis.
    pub(super) fn complete(&self, process: &Linear) -> Option<Linear> {
        let cycle = Cycle::new(self, &process.with_gain(1.0));
        let (low, high) = cycle.extremes();
        let slope = 2.0 * self.amplitude / (high - low);
        let thresholds = 2.0 * self.hysteresis / slope;
        let excess =
            |tau_s: f64| cycle.before_the_fall(tau_s) - cycle.before_the_rise(tau_s) - thresholds;
        let longest_s = cycle.lasting_s[0].min(cycle.lasting_s[1]);
        if !(excess(0.0) > 0.0 && excess(longest_s) < 0.0) {
            return None;
        }
        let tau_s = root(excess, 0.0, longest_s, 0.0);
        Some(process.with_gain(slope).with_tau_s(tau_s))
    }
}

/// Periodic response of a process of unit slope without dead time.
struct Cycle {
    space: StateSpace<STATES>,
    /// Levels of the input: high, low.
    levels: [f64; 2],
    /// For how long the input has these levels (s).
    lasting_s: [f64; 2],
    /// States where the input rises and where it falls.
    starts: [[f64; STATES]; 2],
}

impl Cycle {
    fn new(test: &RelayTest, process: &Linear) -> Self {
        let space = StateSpace::new(process);
        let levels = [
            2.0 * test.relay * (1.0 - test.duty),
            -2.0 * test.relay * test.duty,
        ];
        let lasting_s = [test.duty * test.period_s, (1.0 - test.duty) * test.period_s];
        let mut cycle = Self {
            space,
            levels,
            lasting_s,
            starts: [[0.0; STATES]; 2],
        };
        // The state after a period is M x + g, and M is triangular: a stage depends on those before it.
        let driven = cycle.after_a_period(&[0.0; STATES]);
        let mut rise = [0.0; STATES];
        for stage in 0..=space.output {
            let mut unit = [0.0; STATES];
            unit[stage] = 1.0;
            let kept = cycle.after_a_period(&unit)[stage] - driven[stage];
            let reached = cycle.after_a_period(&rise)[stage];
            // The output of an integrator has no level of its own.
            rise[stage] = if kept < 1.0 {
                reached / (1.0 - kept)
            } else {
                0.0
            };
        }
        cycle.starts = [rise, cycle.at(0, &rise, cycle.lasting_s[0])];
        cycle
    }

    fn after_a_period(&self, rise: &[f64; STATES]) -> [f64; STATES] {
        let fall = self.at(0, rise, self.lasting_s[0]);
        self.at(1, &fall, self.lasting_s[1])
    }

    /// State `time_s` after the input has taken level `level` at the state `start`.
    fn at(&self, level: usize, start: &[f64; STATES], time_s: f64) -> [f64; STATES] {
        let step = self.space.step(time_s);
        let mut state = times(&step.phi, start);
        for (state, held) in state.iter_mut().zip(&step.held) {
            *state += held * self.levels[level];
        }
        state
    }

    fn output(&self, level: usize, time_s: f64) -> f64 {
        self.at(level, &self.starts[level], time_s)[self.space.output]
    }

    /// Output `tau_s` before the delayed input falls, at most the time for which it is high.
    fn before_the_fall(&self, tau_s: f64) -> f64 {
        self.output(0, self.lasting_s[0] - tau_s)
    }

    fn before_the_rise(&self, tau_s: f64) -> f64 {
        self.output(1, self.lasting_s[1] - tau_s)
    }

    /// Least and largest output. Behind a lag the output goes on after the input has switched, and turns once.
    fn extremes(&self) -> (f64, f64) {
        let extreme = |level: usize| self.output(level, self.turn_s(level));
        (extreme(0), extreme(1))
    }

    /// Time (s) from a switch of the input to the turn of the output.
    fn turn_s(&self, level: usize) -> f64 {
        let onward = -self.levels[level].signum();
        let slope = |time_s: f64| {
            let state = self.at(level, &self.starts[level], time_s);
            onward * times(&self.space.a, &state)[self.space.output]
        };
        // The slope of a process of unit slope is of the size of its input. A first-order one turns at once, and so does one
        // that has come to rest.
        if self.space.output == 0 || slope(0.0) <= ROUNDING * self.levels[level].abs() {
            return 0.0;
        }
        // The search begins at the time scale of the lag, because a short one leaves no slope behind the turn.
        let mut end_s = SHORT / self.space.a[0][0].abs();
        while slope(end_s) > 0.0 && end_s < self.lasting_s[level] {
            end_s *= 2.0;
        }
        root(slope, 0.0, end_s.min(self.lasting_s[level]), 0.0)
    }
}
