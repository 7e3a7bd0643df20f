//! The closed loop in steps of length `h`.
//!
//! The delayed input of a step is the polynomial through `u` at the 8 nodes one dead time earlier, and the states follow
//! it exactly. A dead time of at least a fifth of the wanted step is a whole number of steps, and its input is known. A
//! shorter one reaches into the present step: then the input at the nodes is a linear function of the state and of the
//! last step, from one matrix inverse.
//!
//! After a step of the reference the output rests for one dead time, and `u = b kp + ki t`. The simulation starts at the
//! end of it. After a step of the load it starts when the load reaches the output.

use super::law::Law;
use super::process::Process;
use super::propagator::{MONOMIALS, NODES, Step, of_node_values, times};
use super::realisation::{Excitation, Realisation};
use crate::matrix::inverse;

/// A dead time shorter than this share of the wanted step reaches into the present step.
const SHORT_DELAY: f64 = 0.2;

/// Most steps per dead time. A finer one needs too much memory.
const MOST_STEPS_PER_DELAY: f64 = 1e5;

/// Values at the nodes of a step.
pub(crate) type Nodes = [f64; NODES];

pub(crate) struct Simulation<const N: usize> {
    /// Length of a step.
    pub h: f64,
    /// Time of the first node after the step of the reference. Zero after a step of the load.
    pub start: f64,
    phi: [[f64; N]; N],
    gamma: [[f64; N]; NODES],
    /// `u` and `y` at the nodes, by columns: of the state, and of the input at the nodes.
    of_state: [[f64; 2 * NODES]; N],
    of_input: [[f64; 2 * NODES]; NODES],
    /// Input at the nodes of the state and of `u` in the last step, by columns. `None` if the delay is whole steps.
    implicit: Option<Box<([Nodes; N], [Nodes; NODES])>>,
    state: [f64; N],
    /// `u` at the nodes of the last steps, one dead time of them.
    history: Vec<Nodes>,
    count: usize,
}

impl<const N: usize> Simulation<N> {
    /// Loop at rest before the step of `excitation`, with steps of at most `longest`. `None` if the loop has no state
    /// space with `N` states, or if the dead time takes too many steps.
    pub(crate) fn new(
        process: &Process,
        law: &Law,
        excitation: Excitation,
        longest: f64,
    ) -> Option<Self> {
        let loop_ = Realisation::<N>::new(process, law, excitation)?;
        let tau = process.tau;
        let is_short = tau <= SHORT_DELAY * longest;
        let per_delay = if is_short {
            1.0
        } else {
            (tau / longest).ceil()
        };
        if !(per_delay <= MOST_STEPS_PER_DELAY && longest > 0.0 && longest.is_finite()) {
            return None;
        }
        let h = if is_short { longest } else { tau / per_delay };
        let step = Step::between_nodes(&loop_.a, &loop_.b, h);
        let (u_state, u_input) = step.rows_at_nodes(&loop_.cu);
        let (y_state, y_input) = step.rows_at_nodes(&loop_.cy);
        let whole = step.whole();
        let mut by_row = [[0.0; NODES]; N];
        for i in 0..N {
            for p in 0..NODES {
                by_row[i][p] = whole.gamma[p][i];
            }
        }
        let gamma_rows = of_node_values(&by_row);
        let (u_input, y_input) = (of_node_values(&u_input), of_node_values(&y_input));
        let mut gamma = [[0.0; N]; NODES];
        let (mut of_state, mut of_input) = ([[0.0; 2 * NODES]; N], [[0.0; 2 * NODES]; NODES]);
        for node in 0..NODES {
            for j in 0..N {
                gamma[node][j] = gamma_rows[j][node];
                of_state[j][node] = u_state[node][j];
                of_state[j][NODES + node] = y_state[node][j];
            }
            for j in 0..NODES {
                of_input[j][node] = u_input[node][j];
                of_input[j][NODES + node] = y_input[node][j];
            }
        }
        let mut state = [0.0; N];
        state[N - 1] = 1.0;
        let mut start = 0.0;
        let mut history = vec![[0.0; NODES]; per_delay as usize];
        if excitation == Excitation::Reference {
            start = tau;
            if let Some(integral) = loop_.integral {
                state[integral] = tau;
            }
            for (i, nodes) in history.iter_mut().enumerate() {
                for (node, u) in nodes.iter_mut().enumerate() {
                    let steps = i as f64 + node as f64 / (NODES - 1) as f64 - per_delay;
                    *u = law.kp * law.b + law.ki * (tau + steps * h);
                }
            }
        }
        let implicit = if is_short {
            Some(Box::new(implicit(tau / h, &u_state, &u_input)?))
        } else {
            None
        };
        Some(Self {
            h,
            start,
            phi: whole.phi,
            gamma,
            of_state,
            of_input,
            implicit,
            state,
            history,
            count: 0,
        })
    }

    /// Takes one step. Returns `u` and `y` at its nodes: `[u; 8]`, then `[y; 8]`.
    #[inline]
    pub(crate) fn step(&mut self) -> [f64; 2 * NODES] {
        let slot = self.count % self.history.len();
        self.count += 1;
        let earlier = self.history[slot];
        let input = match &self.implicit {
            None => earlier,
            Some(matrices) => {
                let mut input = times(&matrices.0, &self.state);
                let last = times(&matrices.1, &earlier);
                for i in 0..NODES {
                    input[i] += last[i];
                }
                input
            }
        };
        let mut out = times(&self.of_state, &self.state);
        let forced = times(&self.of_input, &input);
        for i in 0..2 * NODES {
            out[i] += forced[i];
        }
        self.history[slot].copy_from_slice(&out[..NODES]);
        let free = times(&self.phi, &self.state);
        self.state = times(&self.gamma, &input);
        for i in 0..N {
            self.state[i] += free[i];
        }
        out
    }
}

/// Input at the nodes if the dead time is `delay` steps, below 1: `v(s) = u(s - delay)`, of this step or of the last one.
/// By columns, per state and per `u` in the last step.
fn implicit<const N: usize>(
    delay: f64,
    u_state: &[[f64; N]; NODES],
    u_input: &[[f64; NODES]; NODES],
) -> Option<([Nodes; N], [Nodes; NODES])> {
    let (mut present, mut last) = ([[0.0; NODES]; NODES], [[0.0; NODES]; NODES]);
    for node in 0..NODES {
        let s = node as f64 / (NODES - 1) as f64 - delay;
        let (rows, s) = if s >= 0.0 {
            (&mut present, s)
        } else {
            (&mut last, s + 1.0)
        };
        for i in 0..NODES {
            rows[node][i] = (0..NODES)
                .rev()
                .fold(0.0, |sum, p| sum * s + MONOMIALS[p][i]);
        }
    }
    let mut matrix = [[0.0; NODES]; NODES];
    for i in 0..NODES {
        for j in 0..NODES {
            let product: f64 = (0..NODES).map(|k| present[i][k] * u_input[k][j]).sum();
            matrix[i][j] = f64::from(u8::from(i == j)) - product;
        }
    }
    let inverse = inverse(matrix)?;
    let (mut of_state, mut of_last) = ([[0.0; NODES]; N], [[0.0; NODES]; NODES]);
    for i in 0..NODES {
        for k in 0..NODES {
            for j in 0..NODES {
                of_last[j][i] += inverse[i][k] * last[k][j];
                let weight = inverse[i][k] * present[k][j];
                for state in 0..N {
                    of_state[state][i] += weight * u_state[j][state];
                }
            }
        }
    }
    Some((of_state, of_last))
}
