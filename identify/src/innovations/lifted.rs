//! Model of a block of samples: its sum, and the state at its end.
//!
//! ```text
//! x+ = Phi x + w,    s = C x + v,    cov w = Q,   cov(w, v) = S,   var v = R
//! ```
//!
//! `s` is the sum of the samples present in the block, `x` the state at its start. Exact for any pattern of absent
//! samples. The steady covariance of the state's prediction comes from structured doubling of the Riccati equation.
//! Reference: B. D. O. Anderson, J. B. Moore, "Optimal Filtering" (1979), chapters 3 to 6.

use onecycle_design::matrix::{Matrix, add, congruent, identity, inverse, product, times};

/// Matrices of a block. See the [module](self).
#[derive(Clone, Copy, Debug)]
pub(super) struct Lifted<const N: usize> {
    pub(super) phi: Matrix<N>,
    pub(super) c: [f64; N],
    pub(super) q: Matrix<N>,
    pub(super) s: [f64; N],
    /// Zero if no sample is present.
    pub(super) r: f64,
}

/// Matrices of one sample: `x+ = Phi x + w` and `y = C x + v` with `cov w = Q` and `var v = noise`.
pub(super) struct Sample<const N: usize> {
    pub(super) phi: Matrix<N>,
    pub(super) c: [f64; N],
    pub(super) q: Matrix<N>,
    pub(super) noise: f64,
}

impl<const N: usize> Lifted<N> {
    /// Block of the samples of `mask`.
    pub(super) fn of_mask(sample: &Sample<N>, mask: &[bool]) -> Self {
        let mut block = Self {
            phi: identity(),
            c: [0.0; N],
            q: [[0.0; N]; N],
            s: [0.0; N],
            r: 0.0,
        };
        for &present in mask {
            if present {
                let row = row_times(&sample.c, &block.phi);
                let seen = times(&block.q, &sample.c);
                block.r += dot(&sample.c, &seen) + 2.0 * dot(&sample.c, &block.s) + sample.noise;
                for i in 0..N {
                    block.c[i] += row[i];
                    block.s[i] += seen[i];
                }
            }
            block.phi = product(&sample.phi, &block.phi);
            block.q = congruent(&sample.phi, &block.q);
            add(&mut block.q, &sample.q);
            block.s = times(&sample.phi, &block.s);
        }
        block
    }

    /// Block of `count` samples, all present, by doubling.
    pub(super) fn of_full(sample: &Sample<N>, count: usize) -> Self {
        let one = Self::of_mask(sample, &[true]);
        let mut whole: Option<Self> = None;
        let mut power = one;
        let mut left = count;
        while left > 0 {
            if left & 1 == 1 {
                whole = Some(whole.map_or(power, |before| before.then(&power)));
            }
            left >>= 1;
            if left > 0 {
                power = power.then(&power);
            }
        }
        whole.unwrap_or(one)
    }

    /// This block followed by `later`: one block with the sum of both.
    fn then(&self, later: &Self) -> Self {
        let row = row_times(&later.c, &self.phi);
        let seen = times(&self.q, &later.c);
        let carried: [f64; N] = std::array::from_fn(|i| self.s[i] + seen[i]);
        let mut s = times(&later.phi, &carried);
        let mut q = congruent(&later.phi, &self.q);
        add(&mut q, &later.q);
        let mut c = self.c;
        for i in 0..N {
            c[i] += row[i];
            s[i] += later.s[i];
        }
        Self {
            phi: product(&later.phi, &self.phi),
            c,
            q,
            s,
            r: self.r + later.r + dot(&later.c, &seen) + 2.0 * dot(&later.c, &self.s),
        }
    }

    /// `Phi` of `count` blocks like this one, and the sum of `X' X` over the rows `X = C Phi^k` of the first state, by
    /// doubling.
    pub(super) fn observed(&self, count: usize) -> (Matrix<N>, Matrix<N>) {
        let mut power = self.phi;
        let mut of_power: Matrix<N> =
            std::array::from_fn(|i| std::array::from_fn(|j| self.c[i] * self.c[j]));
        let mut whole: Option<(Matrix<N>, Matrix<N>)> = None;
        let mut left = count;
        loop {
            if left & 1 == 1 {
                whole = Some(match whole {
                    None => (power, of_power),
                    Some((phi, sum)) => {
                        let mut both = of_power;
                        add(&mut both, &congruent(&transpose(&power), &sum));
                        (product(&phi, &power), both)
                    }
                });
            }
            left >>= 1;
            if left == 0 {
                return whole.unwrap_or((identity(), [[0.0; N]; N]));
            }
            let later = congruent(&transpose(&power), &of_power);
            add(&mut of_power, &later);
            power = product(&power, &power);
        }
    }

    /// Kalman gain and variance of the innovation for the covariance `p` of the predicted state.
    pub(super) fn gain(&self, p: &Matrix<N>) -> ([f64; N], f64) {
        let seen = times(p, &self.c);
        let variance = dot(&self.c, &seen) + self.r;
        let moved = times(&self.phi, &seen);
        let gain = std::array::from_fn(|i| (moved[i] + self.s[i]) / variance);
        (gain, variance)
    }

    /// Covariance of the next predicted state.
    pub(super) fn next_covariance(
        &self,
        p: &Matrix<N>,
        gain: &[f64; N],
        variance: f64,
    ) -> Matrix<N> {
        let mut next = congruent(&self.phi, p);
        for i in 0..N {
            for j in 0..N {
                next[i][j] += self.q[i][j] - gain[i] * gain[j] * variance;
            }
        }
        next
    }

    /// Steady covariance of the predicted state. `None` if the iteration does not converge.
    pub(super) fn steady_covariance(&self) -> Option<Matrix<N>> {
        // Without the correlation of w and v: Phi - S C/R, Q - S S'/R.
        let mut a = [[0.0; N]; N];
        let mut h = self.q;
        let mut g = [[0.0; N]; N];
        for i in 0..N {
            for j in 0..N {
                a[j][i] = self.phi[i][j] - self.s[i] * self.c[j] / self.r;
                h[i][j] -= self.s[i] * self.s[j] / self.r;
                g[i][j] = self.c[i] * self.c[j] / self.r;
            }
        }
        for _ in 0..STEPS {
            let mut w = product(&g, &h);
            add(&mut w, &identity());
            let w = inverse(w)?;
            let aw = product(&a, &w);
            let transposed = transpose(&a);
            let gain = product(&product(&transposed, &product(&h, &w)), &a);
            let smaller = product(&product(&aw, &g), &transposed);
            add(&mut g, &smaller);
            add(&mut h, &gain);
            a = product(&aw, &a);
            symmetrise(&mut g);
            symmetrise(&mut h);
            if largest(&gain) <= 1e-14 * largest(&h) {
                return Some(h);
            }
        }
        None
    }
}

/// Most doublings. The error of the Riccati iteration squares with each, or halves for a disturbance without noise.
const STEPS: usize = 60;

pub(super) fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    (0..N).map(|i| a[i] * b[i]).sum()
}

/// `c' A`.
pub(super) fn row_times<const N: usize>(c: &[f64; N], a: &Matrix<N>) -> [f64; N] {
    std::array::from_fn(|j| (0..N).map(|i| c[i] * a[i][j]).sum())
}

pub(super) fn transpose<const N: usize>(a: &Matrix<N>) -> Matrix<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn symmetrise<const N: usize>(a: &mut Matrix<N>) {
    for i in 0..N {
        for j in 0..i {
            let mean = 0.5 * (a[i][j] + a[j][i]);
            a[i][j] = mean;
            a[j][i] = mean;
        }
    }
}

fn largest<const N: usize>(a: &Matrix<N>) -> f64 {
    a.iter().flatten().fold(0.0, |most, v| most.max(v.abs()))
}
