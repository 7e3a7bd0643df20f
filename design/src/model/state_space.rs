//! Exact discretisation of a process with a disturbance: state-space matrices, their exponentials and integrals.
//!
//! ```text
//! dx/dt = A x + B u(t - tau) + noise,     y = x[output]
//! ```
//!
//! The states are those of the [stages](super::Stages) in their order, then the disturbance `d`, the last state. `d` is
//! constant unless noise drives it, and enters where the actuator lags end: wind acts on the body, not on the motor. The
//! gain of the process is not part of the matrices: they have unit gain.
//!
//! All matrices of one step of length `h` come from Taylor series on a step `h / 2^n` that is short for the fastest
//! stage, and `n` doublings. Confluent and stiff stages need no special case.

use super::linear::Linear;
use crate::matrix::{Matrix, add, congruent, identity, product, times};

/// Terms of the Taylor series; with a step of norm 0.25 the first one left out is below 1e-17.
const TERMS: usize = 13;
const NORM: f64 = 0.25;
/// Most doublings: a longer step is beyond the range of the parameters.
const MOST_DOUBLINGS: i32 = 60;

/// Continuous-time matrices of a process of unit gain, without its dead time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSpace<const N: usize> {
    /// `A` (1/s).
    pub a: Matrix<N>,
    /// `B`: input column.
    pub b: [f64; N],
    /// Column of the disturbance: where it enters.
    pub entry: [f64; N],
    /// Index of the state that is the output.
    pub output: usize,
}

/// Response over one step of length `h`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<const N: usize> {
    /// `Phi(h)`: state at the end per state at the start.
    pub phi: Matrix<N>,
    /// `Gamma0(h)`: state at the end per unit of input held over the step.
    pub held: [f64; N],
    /// `Gamma1(h)`: state at the end for an input that starts at zero and rises by one unit a second.
    pub ramp: [f64; N],
}

impl<const N: usize> StateSpace<N> {
    /// Matrices of `process`. `N` is at least [`Stages::states`](super::Stages::states) + 1. States beyond those are
    /// constant and have no effect.
    #[must_use]
    pub fn new(process: &Linear) -> Self {
        let stages = process.structure().stages();
        let mut built = Self {
            a: [[0.0; N]; N],
            b: [0.0; N],
            entry: [0.0; N],
            output: 0,
        };
        let mut source = None;
        let mut next = 0;
        for lag_s in process.lags_s() {
            built.add(&mut next, &mut source, 1.0 / lag_s, 1.0 / lag_s);
        }
        let behind_the_lags = next;
        if stages.poles > 0 {
            built.add(&mut next, &mut source, process.pole_per_s(), 1.0);
        }
        if stages.pairs > 0 {
            let [c1, c0] = process.pair();
            let (z, w) = (next, next + 1);
            built.a[z][w] = 1.0;
            built.a[w][z] = -c0;
            built.a[w][w] = -c1;
            built.feed(w, source, 1.0);
            source = Some(z);
            next += 2;
        }
        for _ in 0..stages.integrators {
            built.add(&mut next, &mut source, 0.0, 1.0);
        }
        built.output = next - 1 - usize::from(stages.pairs > 0 && stages.integrators == 0);
        let entry = behind_the_lags + usize::from(stages.pairs > 0);
        built.entry[entry] = 1.0;
        built.a[entry][N - 1] += 1.0;
        built
    }

    /// Adds the stage `gain / (s + pole)` behind `source`, the input if `None`.
    fn add(&mut self, next: &mut usize, source: &mut Option<usize>, pole: f64, gain: f64) {
        self.a[*next][*next] = -pole;
        self.feed(*next, *source, gain);
        *source = Some(*next);
        *next += 1;
    }

    fn feed(&mut self, state: usize, source: Option<usize>, gain: f64) {
        match source {
            Some(source) => self.a[state][source] = gain,
            None => self.b[state] = gain,
        }
    }

    /// Largest absolute row sum of `A` (1/s).
    fn norm(&self) -> f64 {
        let row = |row: &[f64; N]| row.iter().map(|v| v.abs()).sum::<f64>();
        self.a.iter().map(row).fold(0.0, f64::max)
    }

    /// Number of halvings of `h` after which the series converges.
    fn halvings(&self, h_s: f64) -> i32 {
        let ratio = self.norm() * h_s / NORM;
        if ratio > 1.0 {
            (ratio.log2().ceil() as i32).min(MOST_DOUBLINGS)
        } else {
            0
        }
    }

    /// Response over a step of `h_s` seconds.
    #[must_use]
    pub fn step(&self, h_s: f64) -> Step<N> {
        let doublings = self.halvings(h_s);
        let short_s = h_s * 0.5_f64.powi(doublings);
        let mut step = self.short_step(short_s);
        let mut length_s = short_s;
        for _ in 0..doublings {
            step = step.twice(length_s);
            length_s *= 2.0;
        }
        step
    }

    /// Taylor series of the three integrals: `sum (A h)^k / k!`, `h sum (A h)^k / (k+1)! B`,
    /// `h^2 sum (A h)^k / (k+2)! B`.
    fn short_step(&self, h: f64) -> Step<N> {
        let mut phi = identity();
        let mut power = identity();
        let mut column = self.b.map(|b| b * h);
        let mut held = column;
        let mut ramp = column.map(|c| 0.5 * h * c);
        for k in 1..=TERMS {
            let factor = h / k as f64;
            power = scaled(&product(&self.a, &power), factor);
            add(&mut phi, &power);
            // The column is h (A h)^k B / k! here.
            column = times(&self.a, &column).map(|v| v * factor);
            let after = 1.0 / (k + 1) as f64;
            for i in 0..N {
                held[i] += column[i] * after;
                ramp[i] += column[i] * h * after / (k + 2) as f64;
            }
        }
        Step { phi, held, ramp }
    }

    /// `Q(h)`: covariance at the end of a step of `h_s` seconds of the state that white noise of intensity
    /// `intensity` has driven, `int e^(As) W e^(A's) ds`.
    #[must_use]
    pub fn covariance(&self, intensity: &Matrix<N>, h_s: f64) -> Matrix<N> {
        let doublings = self.halvings(2.0 * h_s);
        let h = h_s * 0.5_f64.powi(doublings);
        let mut term = scaled(intensity, h);
        let mut sum = term;
        for k in 1..=TERMS {
            // W_(k+1) = (A W_k + W_k A') h / (k+1): the derivative of e^(At) W e^(A't).
            let left = product(&self.a, &term);
            let mut next = [[0.0; N]; N];
            for i in 0..N {
                for j in 0..N {
                    next[i][j] = (left[i][j] + left[j][i]) * h / (k + 1) as f64;
                }
            }
            term = next;
            add(&mut sum, &term);
        }
        let mut phi = self.short_step(h).phi;
        for _ in 0..doublings {
            let later = congruent(&phi, &sum);
            add(&mut sum, &later);
            phi = product(&phi, &phi);
        }
        sum
    }
}

impl<const N: usize> Step<N> {
    /// Step of twice the length. `length_s` is the length of this one.
    fn twice(&self, length_s: f64) -> Self {
        let mut held = times(&self.phi, &self.held);
        let mut ramp = times(&self.phi, &self.ramp);
        for i in 0..N {
            ramp[i] += self.ramp[i] + length_s * self.held[i];
            held[i] += self.held[i];
        }
        Self {
            phi: product(&self.phi, &self.phi),
            held,
            ramp,
        }
    }
}

fn scaled<const N: usize>(a: &Matrix<N>, factor: f64) -> Matrix<N> {
    a.map(|row| row.map(|v| v * factor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Structure;

    const H_S: f64 = 0.02;

    fn matrices(t_prop_s: f64, pole_per_s: f64) -> StateSpace<4> {
        StateSpace::new(
            &Linear::new(Structure::Soiptd)
                .with_lags_s([t_prop_s, 1.0])
                .with_pole_per_s(pole_per_s),
        )
    }

    fn close(found: &[f64], expected: &[f64]) {
        for (found, expected) in found.iter().zip(expected) {
            let error = (found - expected).abs();
            assert!(error <= 2e-10 * expected.abs(), "{found} is not {expected}");
        }
    }

    // Numbers of an independent implementation (Python, numpy): distinct, equal, undamped and stiff lags.
    #[test]
    fn steps_of_an_independent_implementation() {
        let cases = [
            (
                0.05,
                0.5,
                [3.2967995396e-01, 3.5039331317e-03, 2.4138340085e-05],
                [3.5160023018e-03, 2.4138340085e-05, 1.2308965131e-07],
                [1.7519665659e-04, 1.9900332502e-02, 1.0, 1.9933499667e-04],
            ),
            (
                0.05,
                20.0,
                [3.2967995396e-01, 3.0775967775e-03, 2.1920276214e-05],
                [3.5160023018e-03, 2.1920276214e-05, 1.1398043485e-07],
                [1.5387983888e-04, 1.6483997698e-02, 1.0, 1.7580011509e-04],
            ),
            (
                0.05,
                0.0,
                [3.2967995396e-01, 3.5160023018e-03, 2.4199884911e-05],
                [3.5160023018e-03, 2.4199884911e-05, 1.2333908779e-07],
                [1.7580011509e-04, 2.0e-2, 1.0, 2.0e-4],
            ),
            (
                0.0004,
                0.5,
                [1.0, 1.9504233348e-02, 1.9153330333e-04],
                [1.96e-2, 1.9153330333e-04, 1.2533933342e-06],
                [7.8016933393e-06, 1.9900332502e-02, 1.0, 1.9933499667e-04],
            ),
        ];
        for (t_prop_s, pole_per_s, held, ramp, row) in cases {
            let step = matrices(t_prop_s, pole_per_s).step(H_S);
            close(&step.held, &held);
            close(&step.ramp, &ramp);
            close(&step.phi[2], &row);
        }
    }

    // The same implementation: noise on the disturbance and beside it, three rows of the covariance.
    #[test]
    fn covariance_of_an_independent_implementation() {
        let mut intensity = [[0.0; 4]; 4];
        intensity[1][1] = 3.2e-1;
        intensity[3][3] = 1.458e1;
        let q = matrices(0.05, 0.5).covariance(&intensity, H_S);
        close(
            &q[1][1..],
            &[6.3750142978e-03, 6.3653381462e-05, 2.9063042515e-03],
        );
        close(&q[2][2..], &[8.4928297980e-07, 1.9391497038e-05]);
        close(&q[3][3..], &[2.916e-1]);
        assert_eq!(q[0], [0.0; 4]);
    }

    // By hand: x'' = -4 x' - 3 x + u has poles 1 and 3, so a unit step gives 1/3 - e^-t/2 + e^-3t/6.
    #[test]
    fn two_real_poles_of_a_second_order_stage_by_hand() {
        let process = Linear::new(Structure::Resonant).with_pair(4.0, 3.0);
        let step = StateSpace::<3>::new(&process).step(0.7);
        let exact = 1.0 / 3.0 - 0.5 * (-0.7_f64).exp() + (-2.1_f64).exp() / 6.0;
        assert!((step.held[0] - exact).abs() < 1e-15);
    }
}
