//! Exact time step of the process without its dead time, under an input that is a cubic polynomial over the step.
//!
//! ```text
//! dy/dt = v,   dv/dt = f - v/T_body,   df/dt = (u - f)/T_prop          (K/T_body = 1)
//! u(s) = u0 + u1 s + u2 s^2/2 + u3 s^3/6,   s from 0 to 1 over the step
//! ```
//!
//! | symbol | meaning | unit |
//! |--------|---------|------|
//! | `y` | output | output unit |
//! | `v` | rate | output unit / time |
//! | `f` | force, as an acceleration | output unit / time^2 |
//! | `u` | input | output unit / time^2 |
//!
//! A chain of integrators in front of the process generates the cubic. The matrix exponential of this chain of seven
//! states gives the step. A stiff process (actuator much faster than the step) needs no smaller step. The caller
//! chooses the unit of time; with the simulation step as unit the numbers are well scaled.

/// State `[y, v, f]`. For symbols see the module.
pub(crate) type State = [f64; 3];

/// Number of states of the chain: `y`, `v`, `f`, the input and its three derivatives.
const ORDER: usize = 7;

/// Terms of the Taylor series. For a matrix of norm 1/4 the truncation error is below 1e-18.
const TAYLOR_TERMS: u32 = 12;

type Matrix = [[f64; ORDER]; ORDER];

/// Cubic polynomial over a step: value and three derivatives at the start, with the step as unit of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cubic(pub(crate) [f64; 4]);

/// Value and slope of a function at a node of the time grid. The slope is per step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) value: f64,
    pub(crate) slope: f64,
}

impl Cubic {
    /// Hermite cubic between two nodes.
    pub(crate) fn hermite(start: Node, end: Node) -> Self {
        let rise = end.value - start.value;
        Self([
            start.value,
            start.slope,
            6.0 * rise - 4.0 * start.slope - 2.0 * end.slope,
            -12.0 * rise + 6.0 * (start.slope + end.slope),
        ])
    }

    /// Part of the cubic from the fraction `start` of the step on. Its `length` becomes the new unit of time.
    pub(crate) fn piece(self, start: f64, length: f64) -> Self {
        let Self([u0, u1, u2, u3]) = self;
        let s = start;
        Self([
            u0 + s * (u1 + s / 2.0 * (u2 + s / 3.0 * u3)),
            length * (u1 + s * (u2 + s / 2.0 * u3)),
            length * length * (u2 + s * u3),
            length * length * length * u3,
        ])
    }

    /// Slope at the fraction `s` of the step.
    pub(crate) fn slope_at(self, s: f64) -> f64 {
        self.piece(s, 1.0).0[1]
    }

    /// Value at the fraction `s` of the step.
    pub(crate) fn at(self, s: f64) -> f64 {
        self.piece(s, 0.0).0[0]
    }
}

/// Linear map over a fixed duration `d`: `state(t + d) = from_state state(t) + from_input cubic`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Propagation {
    /// 3 x 3.
    from_state: [[f64; 3]; 3],
    /// 3 x 4.
    from_input: [[f64; 4]; 3],
}

impl Propagation {
    /// Map over `duration` for the poles `-damping` and `-actuator`, all three in the same unit of time.
    pub(crate) fn over(damping: f64, actuator: f64, duration: f64) -> Self {
        let mut chain = [[0.0; ORDER]; ORDER];
        chain[0][1] = duration;
        chain[1][1] = -damping * duration;
        chain[1][2] = duration;
        chain[2][2] = -actuator * duration;
        chain[2][3] = actuator * duration;
        for k in 3..ORDER - 1 {
            chain[k][k + 1] = 1.0;
        }
        let exponential = exponential(&chain);
        let mut step = Self {
            from_state: [[0.0; 3]; 3],
            from_input: [[0.0; 4]; 3],
        };
        for (row, entries) in exponential.iter().take(3).enumerate() {
            step.from_state[row].copy_from_slice(&entries[..3]);
            step.from_input[row].copy_from_slice(&entries[3..]);
        }
        step
    }

    /// State at the end of the duration.
    #[inline]
    pub(crate) fn apply(&self, state: &State, input: Cubic) -> State {
        let mut next = [0.0; 3];
        for (row, next) in next.iter_mut().enumerate() {
            let (a, b) = (&self.from_state[row], &self.from_input[row]);
            let free = a[0] * state[0] + a[1] * state[1] + a[2] * state[2];
            let [u0, u1, u2, u3] = input.0;
            *next = free + b[0] * u0 + b[1] * u1 + b[2] * u2 + b[3] * u3;
        }
        next
    }
}

/// Matrix exponential by Taylor series with scaling and squaring.
fn exponential(matrix: &Matrix) -> Matrix {
    let norm = matrix
        .iter()
        .map(|row| row.iter().map(|entry| entry.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let squarings = (norm.log2().ceil() as i32 + 2).max(0);
    let scale = 0.5_f64.powi(squarings);
    let mut scaled = *matrix;
    scaled
        .iter_mut()
        .flatten()
        .for_each(|entry| *entry *= scale);

    // Horner: 1 + M (1 + M/2 (1 + M/3 (...)))
    let mut sum = identity();
    for term in (1..=TAYLOR_TERMS).rev() {
        sum = product(&scaled, &sum);
        sum.iter_mut()
            .flatten()
            .for_each(|entry| *entry /= f64::from(term));
        for (k, row) in sum.iter_mut().enumerate() {
            row[k] += 1.0;
        }
    }
    for _ in 0..squarings {
        sum = product(&sum, &sum);
    }
    sum
}

fn identity() -> Matrix {
    let mut matrix = [[0.0; ORDER]; ORDER];
    for (k, row) in matrix.iter_mut().enumerate() {
        row[k] = 1.0;
    }
    matrix
}

/// Product of upper triangular matrices.
fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut c = [[0.0; ORDER]; ORDER];
    for row in 0..ORDER {
        for column in row..ORDER {
            c[row][column] = (row..=column).map(|k| a[row][k] * b[k][column]).sum();
        }
    }
    c
}

#[cfg(test)]
mod tests {
    use onecycle_onboard::{Soiptd, Transition};

    use super::*;

    // Under a constant input the step equals the closed form of the on-board transition: with and without damping, with
    // equal lags, and with an actuator 1e4 times as fast as the step.
    #[test]
    fn constant_input_matches_the_transition() {
        for (t_prop, damping) in [(0.3, 0.5), (0.3, 1.0 / 0.3), (0.05, 0.0), (1e-4, 2.0)] {
            let process = Soiptd::from_acceleration_gain(1.0, t_prop, damping, 0.0).unwrap();
            let exact = Transition::over(&process, 1.0).step_response();
            let step = Propagation::over(damping, 1.0 / t_prop, 1.0);
            let [y, v, f] = step.apply(&[0.0; 3], Cubic([1.0, 0.0, 0.0, 0.0]));
            for (a, b) in [(y, exact.y), (v, exact.v), (f, exact.f)] {
                assert!((a - b).abs() < 1e-11 * b, "{a} {b}");
            }
        }
    }

    // u = s^3/6 into two integrators (actuator lag 1e-9 of the step, no damping): v = s^4/24 and y = s^5/120 at s = 1,
    // up to the lag of 1e-9.
    #[test]
    fn cubic_input_is_integrated_exactly() {
        let step = Propagation::over(0.0, 1e9, 1.0);
        let [y, v, f] = step.apply(&[0.0; 3], Cubic([0.0, 0.0, 0.0, 1.0]));
        assert!((f - 1.0 / 6.0).abs() < 1e-8, "{f}");
        assert!((v - 1.0 / 24.0).abs() < 1e-8, "{v}");
        assert!((y - 1.0 / 120.0).abs() < 1e-8, "{y}");
    }

    // 2 - s + 3 s^2 - s^3 has the nodes (value, slope) = (2, -1) at 0 and (3, 2) at 1. At 0.3 it is 1.943.
    #[test]
    fn hermite_and_its_pieces_are_the_cubic() {
        let cubic = Cubic::hermite(
            Node {
                value: 2.0,
                slope: -1.0,
            },
            Node {
                value: 3.0,
                slope: 2.0,
            },
        );
        assert!((cubic.at(0.3) - 1.943).abs() < 1e-14, "{}", cubic.at(0.3));
        assert!((cubic.piece(0.2, 0.5).at(0.2) - 1.943).abs() < 1e-14);
    }
}
