//! Any linear process with dead time and disturbances: exact, at a fixed step or at steps of any length.
//!
//! ```text
//! x+ = Phi x + (response to the held input that arrives over the step) + w,    cov w = Q
//! y  = gain x[output] + e
//! ```
//!
//! `Phi`, the responses and `Q` are those of the continuous process over the step ([`state_space`]), so neither the step
//! nor the dead time has an error. The states are those of the process, then the gusts, then the random walk at the input;
//! `e` is the random walk of the output. See [`Disturbances`] for the noises.
//!
//! With `tau = (n + fraction) step` the input that arrives is the one of `n` and one steps ago for `fraction * step`, and
//! then the one of `n` steps ago, as in [`FixedStepProcess`](crate::FixedStepProcess).

use onecycle_design::matrix::{Matrix, times};
use onecycle_design::state_space::{StateSpace, Step};
use onecycle_design::{Linear, Structure};

use crate::NoiseSource;
use crate::delay::DelayedInput;
use crate::disturbance::{Disturbances, Root};

#[cfg(doc)]
use onecycle_design::state_space;

/// States of the largest structure, gusts, random walk.
const STATES: usize = 6;
const GUST: usize = STATES - 2;
const WALK: usize = STATES - 1;

// Every structure leaves room for the two disturbances.
const _: () = {
    let mut index = 0;
    while index < Structure::ALL.len() {
        assert!(Structure::ALL[index].stages().states() <= GUST);
        index += 1;
    }
};

/// State of the process and its disturbances, in steps of any length.
#[derive(Clone, Debug)]
struct Motion {
    gain: f64,
    matrices: StateSpace<STATES>,
    /// Intensity of the noise of the states.
    intensity: Matrix<STATES>,
    disturbances: Disturbances,
    state: [f64; STATES],
    /// Random walk of the measured output (output unit).
    output_walk: f64,
}

impl Motion {
    /// At rest; gusts have their stationary distribution from the start.
    fn new(process: &Linear, disturbances: &Disturbances, noise: &mut impl NoiseSource) -> Self {
        let mut matrices = StateSpace::new(process);
        let mut intensity = [[0.0; STATES]; STATES];
        let mut state = [0.0; STATES];
        let sigma = disturbances.gust_sigma;
        if sigma > 0.0 {
            for row in 0..GUST {
                matrices.a[row][GUST] = matrices.a[row][WALK];
            }
            matrices.a[GUST][GUST] = -1.0 / disturbances.gust_correlation_s;
            intensity[GUST][GUST] = 2.0 * sigma * sigma / disturbances.gust_correlation_s;
            state[GUST] = sigma * noise.standard_normal();
        }
        intensity[WALK][WALK] = disturbances.input_walk.powi(2);
        for row in 0..GUST {
            for column in 0..GUST {
                intensity[row][column] =
                    disturbances.input_white.powi(2) * matrices.entry[row] * matrices.entry[column];
            }
        }
        Self {
            gain: process.gain(),
            matrices,
            intensity,
            disturbances: *disturbances,
            state,
            output_walk: 0.0,
        }
    }

    /// Noise of a step of `step_s`.
    fn root(&self, step_s: f64) -> Root<STATES> {
        Root::of(&self.matrices.covariance(&self.intensity, step_s))
    }

    /// Whether noise drives the states.
    fn is_driven(&self) -> bool {
        self.disturbances.input_walk + self.disturbances.input_white + self.disturbances.gust_sigma
            > 0.0
    }

    fn walk_on(&mut self, step_s: f64, noise: &mut impl NoiseSource) {
        if self.disturbances.output_walk > 0.0 {
            self.output_walk +=
                self.disturbances.output_walk * step_s.sqrt() * noise.standard_normal();
        }
    }

    fn output(&self) -> f64 {
        self.gain * self.state[self.matrices.output] + self.output_walk
    }

    fn rate(&self, arrived: f64) -> f64 {
        let row = self.matrices.output;
        let drift: f64 = (0..STATES)
            .map(|k| self.matrices.a[row][k] * self.state[k])
            .sum();
        self.gain * (drift + self.matrices.b[row] * arrived)
    }

    fn displace(&mut self, output: f64) {
        self.state[self.matrices.output] += output / self.gain;
    }
}

/// A linear process that advances in fixed steps with a held input. See the [module](self).
#[derive(Clone, Debug)]
pub struct FixedStepLinear {
    motion: Motion,
    step_s: f64,
    phi: Matrix<STATES>,
    /// Response of the state to the input before the delayed edge, and to the input after it.
    before_edge: [f64; STATES],
    behind_edge: [f64; STATES],
    root: Option<Root<STATES>>,
    /// The last inputs; the oldest one still needed is at `next`.
    history: Vec<f64>,
    next: usize,
    arrived: f64,
}

impl FixedStepLinear {
    /// The process at rest, with steps of `step_s > 0` (s). Gusts have their stationary distribution from the start and
    /// take one number from `noise`.
    #[must_use]
    pub fn new(
        process: &Linear,
        disturbances: &Disturbances,
        step_s: f64,
        noise: &mut impl NoiseSource,
    ) -> Self {
        let motion = Motion::new(process, disturbances, noise);
        let steps = process.tau_s() / step_s;
        let whole = steps.floor();
        let early = motion.matrices.step((steps - whole) * step_s);
        let late = motion.matrices.step((1.0 - (steps - whole)) * step_s);
        Self {
            step_s,
            phi: motion.matrices.step(step_s).phi,
            before_edge: times(&late.phi, &early.held),
            behind_edge: late.held,
            root: motion.is_driven().then(|| motion.root(step_s)),
            history: vec![0.0; whole as usize + 1],
            next: 0,
            arrived: 0.0,
            motion,
        }
    }

    /// Advances by one step with the input `u`. Takes numbers from `noise` only for the disturbances that there are.
    #[inline]
    pub fn step(&mut self, u: f64, noise: &mut impl NoiseSource) {
        self.history[self.next] = u;
        self.next += 1;
        if self.next == self.history.len() {
            self.next = 0;
        }
        let (before, behind) = (self.arrived, self.history[self.next]);
        self.arrived = behind;
        let mut state = times(&self.phi, &self.motion.state);
        for i in 0..STATES {
            state[i] += self.before_edge[i] * before + self.behind_edge[i] * behind;
        }
        if let Some(root) = &self.root {
            root.add_to(&mut state, noise);
        }
        self.motion.state = state;
        self.motion.walk_on(self.step_s, noise);
    }

    /// Output now (output unit), its random walk included.
    #[must_use]
    #[inline]
    pub fn output(&self) -> f64 {
        self.motion.output()
    }

    /// Rate of the output just before the next input arrives (output unit / s), without white noise and without the
    /// random walk of the output.
    #[must_use]
    #[inline]
    pub fn rate(&self) -> f64 {
        self.motion.rate(self.arrived)
    }

    /// Adds an offset to the output, as an initial condition. Without an integrator it decays.
    pub fn displace(&mut self, output: f64) {
        self.motion.displace(output);
    }
}

/// A linear process that advances by any duration with a held input: slower than [`FixedStepLinear`], which computes its
/// matrices once.
#[derive(Clone, Debug)]
pub struct VariableStepLinear {
    motion: Motion,
    input: DelayedInput,
}

impl VariableStepLinear {
    /// The process at rest at time zero. Gusts as in [`FixedStepLinear::new`].
    #[must_use]
    pub fn new(
        process: &Linear,
        disturbances: &Disturbances,
        noise: &mut impl NoiseSource,
    ) -> Self {
        Self {
            motion: Motion::new(process, disturbances, noise),
            input: DelayedInput::new(process.tau_s()),
        }
    }

    /// Holds the input at `u` for `duration_s >= 0`.
    pub fn advance(&mut self, u: f64, duration_s: f64, noise: &mut impl NoiseSource) {
        let motion = &mut self.motion;
        self.input.advance(u, duration_s, |step_s, arrived| {
            let Step { phi, held, .. } = motion.matrices.step(step_s);
            let mut state = times(&phi, &motion.state);
            for i in 0..STATES {
                state[i] += held[i] * arrived;
            }
            if motion.is_driven() {
                motion.root(step_s).add_to(&mut state, noise);
            }
            motion.state = state;
            motion.walk_on(step_s, noise);
        });
    }

    /// Output now (output unit), its random walk included.
    #[must_use]
    pub fn output(&self) -> f64 {
        self.motion.output()
    }

    /// Rate of the output, as [`FixedStepLinear::rate`].
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.motion.rate(self.input.arrived())
    }

    /// Adds an offset to the output, as an initial condition. Without an integrator it decays.
    pub fn displace(&mut self, output: f64) {
        self.motion.displace(output);
    }
}
