//! Response of the closed loop to a unit step of the reference, by the method of steps.
//!
//! In units of the simulation step `h` and of the acceleration gain (for symbols see [`crate::soiptd_pd::open_loop`]):
//!
//! ```text
//! dy/dt = v,  dv/dt = f - v/T_body,  df/dt = (u(t - tau) - f)/T_prop,  u = kp (1 - y) - kd v
//! ```
//!
//! The state is zero until `t = tau`, where the time grid begins. Until then `u` is `kp`; from then on `u` is once
//! differentiable. Between nodes `u` is replaced by the Hermite cubic through `u` and `du/dt`, and the process follows
//! this cubic exactly. So the only error is that of the cubic, of order `h^4`, and a fast actuator needs no small step
//! for stability.
//!
//! If the dead time is longer than `h`, the step is reduced until the dead time is a whole number of steps. If it is
//! shorter, the delayed input depends on the end of the step being taken; then `u` and `du/dt` at that end follow from
//! a linear equation.
//!
//! Reference: A. Bellen, M. Zennaro, "Numerical Methods for Delay Differential Equations" (Oxford,
//! 2003), sections 1.2 and 3.2.

use std::f64::consts::PI;

use onecycle_onboard::{Pd, Soiptd};

use crate::soiptd_pd::feedback::Feedback;
use crate::soiptd_pd::open_loop::OpenLoop;
use crate::soiptd_pd::propagation::{Cubic, Node, Propagation, State};
use crate::soiptd_pd::step_metrics::{StepMetrics, metrics};

/// Steps per radian of the gain crossover: the error of the cubic is `(1/64)^4 / 384 = 2e-10`.
const STEPS_PER_RADIAN: f64 = 64.0;

/// Steps per actuator lag, the time scale on which `u` changes after each dead time.
const STEPS_PER_LAG: f64 = 8.0;

/// Maximum number of steps per radian of the gain crossover, reached by a very fast actuator.
const MOST_STEPS_PER_RADIAN: f64 = 2048.0;

/// The simulation ends when the error has stayed below this for one period of the gain crossover plus two dead times.
/// The ISE that is cut off is of the order of its square, 1e-10.
const RESIDUE: f64 = 1e-5;

/// Maximum number of steps: about 0.1 s of computation, enough for a phase margin of 0.1 deg.
const MAX_STEPS: usize = 1 << 20;

/// Sample of a step response.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Sample {
    /// Time since the step of the reference (s).
    pub t_s: f64,
    /// Process output (output unit). The reference is 1.
    pub y: f64,
    /// Controller output, before the dead time (input unit).
    pub u: f64,
}

/// Response to a unit step of the reference, until it has settled.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct StepResponse {
    /// Samples: one at `t = 0`, then evenly spaced from the end of the dead time on.
    pub samples: Vec<Sample>,
    /// Overshoot, rise time, settling time and peak input, interpolated between samples.
    pub metrics: StepMetrics,
    /// Integral of the squared error (output unit^2 s) by quadrature of the response: an independent check of
    /// [`ise`](crate::soiptd_pd::cost::ise()).
    pub ise: f64,
}

impl StepResponse {
    /// Process output (output unit) and controller output (input unit) at a time (s), by linear interpolation. The
    /// interpolation error is at most about `(1/64)^2 / 8` = 3e-5 of the step. Before the first sample the values are
    /// those of the first sample, after the last sample those of the last.
    #[must_use]
    pub fn at(&self, t_s: f64) -> (f64, f64) {
        interpolated(&self.samples, t_s)
    }
}

/// `y` and `u` at a time (s), by linear interpolation between samples; constant outside them.
pub(crate) fn interpolated(samples: &[Sample], t_s: f64) -> (f64, f64) {
    let next = samples.partition_point(|sample| sample.t_s <= t_s);
    let (Some(before), Some(after)) = (
        samples.get(next.saturating_sub(1)),
        samples.get(next).or(samples.last()),
    ) else {
        return (0.0, 0.0);
    };
    let length_s = after.t_s - before.t_s;
    let part = if length_s > 0.0 {
        ((t_s - before.t_s) / length_s).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (
        before.y + part * (after.y - before.y),
        before.u + part * (after.u - before.u),
    )
}

/// Why there is no step response.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StepResponseError {
    /// The closed loop is unstable: the response grows without bound.
    #[error("the closed loop is unstable")]
    Unstable,
    /// The loop is stable but needs more than 2^20 simulation steps to settle. It is within about 0.1 deg or 0.1 % of
    /// gain of the stability limit, or has a mode a thousand times slower than its gain crossover.
    #[error("the closed loop takes too long to settle to be simulated")]
    TooSlow,
    /// No method computes the response of this structure.
    #[error("no method computes the step response of this structure")]
    NoMethod,
}

/// Response of the continuous loop to a unit step of the reference, from rest.
///
/// # Errors
/// - [`StepResponseError::Unstable`]: the response grows without bound.
/// - [`StepResponseError::TooSlow`]: the response takes too long to settle.
pub fn step_response(process: &Soiptd, pd: Pd) -> Result<StepResponse, StepResponseError> {
    let open_loop = OpenLoop::new(process, pd).ok_or(StepResponseError::Unstable)?;
    let crossover = open_loop.gain_crossover();
    let phase_margin_rad = open_loop.phase_above_minus_pi(crossover);
    if phase_margin_rad.is_nan() || phase_margin_rad <= 0.0 {
        return Err(StepResponseError::Unstable);
    }
    let grid = Grid::of(&open_loop, crossover, STEPS_PER_RADIAN);
    let states = simulate(&open_loop, crossover, grid)?;

    let feedback = Feedback::of(&open_loop, grid.step_s);
    let input_unit = 1.0 / (process.k_over_t_body() * grid.step_s * grid.step_s);
    let start = (open_loop.tau_s > 0.0).then_some(Sample {
        t_s: 0.0,
        y: 0.0,
        u: pd.kp,
    });
    let nodes = states.iter().enumerate().map(|(n, state)| Sample {
        t_s: open_loop.tau_s + n as f64 * grid.step_s,
        y: state[0],
        u: feedback.node(state).value * input_unit,
    });
    Ok(StepResponse {
        samples: start.into_iter().chain(nodes).collect(),
        metrics: metrics(
            &states,
            &feedback,
            open_loop.tau_s,
            grid.step_s,
            input_unit.abs(),
        ),
        ise: squared_error(&states, &open_loop, grid.step_s),
    })
}

/// Time grid of the simulation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Simulation step (s).
    pub(super) step_s: f64,
    /// Dead time in whole steps. Zero if the dead time is shorter than a step.
    delay_steps: usize,
}

impl Grid {
    pub(super) fn of(open_loop: &OpenLoop, crossover: f64, steps_per_radian: f64) -> Self {
        let radian_s = 1.0 / crossover;
        let step_s = (radian_s / steps_per_radian)
            .min(open_loop.lag_s / STEPS_PER_LAG)
            .max(radian_s / MOST_STEPS_PER_RADIAN);
        if open_loop.tau_s < step_s {
            return Self {
                step_s,
                delay_steps: 0,
            };
        }
        let delay_steps = (open_loop.tau_s / step_s).ceil();
        Self {
            step_s: open_loop.tau_s / delay_steps,
            delay_steps: delay_steps as usize,
        }
    }
}

/// States at the nodes of the grid, the first at `t = tau`, until the loop has settled.
pub(super) fn simulate(
    open_loop: &OpenLoop,
    crossover: f64,
    grid: Grid,
) -> Result<Vec<State>, StepResponseError> {
    let feedback = Feedback::of(open_loop, grid.step_s);
    let quiet_s = 2.0 * PI / crossover + 2.0 * open_loop.tau_s;
    let quiet_steps = (quiet_s / grid.step_s).ceil() as usize;
    let stepper = Stepper::of(open_loop, feedback, grid);

    let rest = [0.0; 3];
    let mut states = vec![rest];
    let mut inputs = vec![feedback.node(&rest)];
    let mut quiet = 0;
    while quiet < quiet_steps {
        let n = states.len() - 1;
        if n == MAX_STEPS {
            return Err(StepResponseError::TooSlow);
        }
        let next = stepper.step(&states[n], &inputs);
        quiet = if (1.0 - next[0]).abs() <= RESIDUE {
            quiet + 1
        } else {
            0
        };
        inputs.push(feedback.node(&next));
        states.push(next);
    }
    Ok(states)
}

/// Method of one simulation step.
enum Stepper {
    /// The dead time is a whole number of steps, so the delayed input is known before the step.
    Whole {
        delay_steps: usize,
        step: Propagation,
    },
    /// The dead time is shorter than a step.
    Part {
        /// Dead time as a fraction of the step.
        fraction: f64,
        /// First part of the step, whose delayed input belongs to the previous step and is known.
        tail: Propagation,
        /// Second part of the step, whose delayed input belongs to this step.
        head: Box<Head>,
    },
}

/// Part of a step whose delayed input depends on the state at the end of the same step.
struct Head {
    feedback: Feedback,
    /// Length of the part as a fraction of the step.
    length: f64,
    propagation: Propagation,
    /// Inverse of `I - M`, where `M` maps `(u, du/dt)` assumed at the end of the step to the values that the PD then
    /// returns.
    closure: [[f64; 2]; 2],
}

impl Stepper {
    fn of(open_loop: &OpenLoop, feedback: Feedback, grid: Grid) -> Self {
        let actuator = grid.step_s / open_loop.lag_s;
        let over = |duration| Propagation::over(feedback.damping, actuator, duration);
        if grid.delay_steps > 0 {
            return Self::Whole {
                delay_steps: grid.delay_steps,
                step: over(1.0),
            };
        }
        let fraction = open_loop.tau_s / grid.step_s;
        let length = 1.0 - fraction;
        let head = Box::new(Head::of(feedback, length, over(length)));
        Self::Part {
            fraction,
            tail: over(fraction),
            head,
        }
    }

    /// State one step after `state`. `inputs` holds `u` at all nodes up to that of `state`.
    fn step(&self, state: &State, inputs: &[Node]) -> State {
        // Before the grid begins the input is constant.
        let newest = inputs.len() - 1;
        let cell = |steps_ago: usize| match newest.checked_sub(steps_ago) {
            Some(n) => Cubic::hermite(inputs[n], inputs[n + 1]),
            None => Cubic([inputs[0].value, 0.0, 0.0, 0.0]),
        };
        match self {
            Self::Whole { delay_steps, step } => step.apply(state, cell(*delay_steps)),
            Self::Part {
                fraction,
                tail,
                head,
            } => {
                let between = tail.apply(state, cell(1).piece(1.0 - fraction, *fraction));
                head.finish(&between, inputs[newest])
            }
        }
    }
}

impl Head {
    fn of(feedback: Feedback, length: f64, propagation: Propagation) -> Self {
        let zero = Node {
            value: 0.0,
            slope: 0.0,
        };
        let mut head = Self {
            feedback,
            length,
            propagation,
            closure: [[0.0; 2]; 2],
        };
        let by_value = feedback.response(&head.end(&[0.0; 3], zero, Node { value: 1.0, ..zero }));
        let by_slope = feedback.response(&head.end(&[0.0; 3], zero, Node { slope: 1.0, ..zero }));
        let (a, b) = (1.0 - by_value.value, -by_slope.value);
        let (c, d) = (-by_value.slope, 1.0 - by_slope.slope);
        let determinant = a * d - b * c;
        head.closure = [
            [d / determinant, -b / determinant],
            [-c / determinant, a / determinant],
        ];
        head
    }

    /// State at the end of the step if the input goes from `start` to `end` over the step.
    fn end(&self, state: &State, start: Node, end: Node) -> State {
        self.propagation
            .apply(state, Cubic::hermite(start, end).piece(0.0, self.length))
    }

    /// State at the end of the step, where the input is the output of the PD at that state.
    fn finish(&self, state: &State, start: Node) -> State {
        let assumed = Node {
            value: 0.0,
            slope: 0.0,
        };
        let follows = self.feedback.node(&self.end(state, start, assumed));
        let [[a, b], [c, d]] = self.closure;
        let closed = Node {
            value: a * follows.value + b * follows.slope,
            slope: c * follows.value + d * follows.slope,
        };
        self.end(state, start, closed)
    }
}

/// Integral of the squared error (output unit^2 s): the dead time, during which the error is 1, plus the trapezoidal
/// rule with the Euler-Maclaurin end corrections.
///
/// In units of the step the corrections are the differences of `-g'/12 + g'''/720` between both ends, with
/// `g = (1 - y)^2`. At the end only `g' = -2 (1 - y) v` is significant. At the start `g'` is zero and `g''' = -2 y'''`,
/// where `y''' = df/dt = kp / T_prop`.
fn squared_error(states: &[State], open_loop: &OpenLoop, step_s: f64) -> f64 {
    let square = |state: &State| (1.0 - state[0]).powi(2);
    let end = states.last().copied().unwrap_or_default();
    let sum: f64 = states.iter().skip(1).map(square).sum();
    let end_slope = -2.0 * (1.0 - end[0]) * end[1];
    let start_jerk = open_loop.kp * step_s.powi(3) / open_loop.lag_s;
    let steps = 0.5 + sum - 0.5 * square(&end) - end_slope / 12.0 + start_jerk / 360.0;
    open_loop.tau_s + step_s * steps
}
