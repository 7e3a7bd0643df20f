//! Integral of the squared error (ISE) of a unit step, in closed form.
//!
//! The controller differentiates the measurement only, `u = Kp (r - y) - Kd dy/dt`. The error of a unit step is
//!
//! ```text
//!               1 + Kd s G                               Kp G
//! E(s) = ------------------------- ,      s E(s) = 1 - -------
//!        s (1 + (Kp + Kd s) G)                          1 + L
//!
//! J = int_0^inf e^2 dt = 1/pi int_0^inf |E(jw)|^2 dw        (output unit^2 s, Parseval)
//! ```
//!
//! With `L = D(s) e^(-tau s) / C(s)` (symbols: [`open_loop`](crate::soiptd_pd::open_loop)) the integrand splits into
//! `X(s) + X(-s)`. Right of the imaginary axis `X` is analytic except at the zeros of `P(s) = C(s) C(-s) - D(s) D(-s)`,
//! a cubic in `q = s^2` that does not contain the dead time, and except for a pole at zero. Closing the contour gives a
//! residue at zero and one at each root `q_k`, with `s_k = sqrt(q_k)` and the gains `kp`, `kd` multiplied by
//! `K/T_body`:
//!
//! ```text
//!      kd        kp^2      1 - L(s_k)
//! J = ---- + sum ------------------- .  ------------ ,   P(q) = -T_prop^2 (q - q_1)(q - q_2)(q - q_3)
//!      kp     k  2 s_k q_k dP/dq(q_k)   1 + L(s_k)
//! ```
//!
//! The root `q_1 = -wc^2` belongs to the gain crossover `wc`, where the last fraction is `j cot(PM/2)`. So the
//! resonance at a small phase margin `PM` is exact. The other two roots lie in the right half plane. Their terms form a
//! divided difference, which is regular where the two roots coincide.
//!
//! References: the cost is the paper's equation 9 (Ayyad, Chehadeh, Awad, Zweiri 2020) over infinite time, not
//! averaged. The contour is that of K. Walton, H. Gorecki, "On the evaluation of cost functionals, with particular
//! emphasis on time-delay systems", IMA J. Math. Control Inf. 1 (1984).

use std::f64::consts::PI;

use num_complex::Complex64;
use onecycle_onboard::{Pd, Soiptd};

use crate::soiptd_pd::open_loop::OpenLoop;

/// If half the distance of two roots is below this fraction of their mean, a contour integral replaces the divided
/// difference, which would lose a factor of 1/0.03, 1.5 digits, or more.
const CONFLUENT_FRACTION: f64 = 0.03;

/// Radius of that contour as a fraction of the mean of the roots: ten times their half distance, and 0.3 of the
/// distance to the branch point at zero, which makes the error of 24 nodes 0.3^24 = 3e-13.
const CONTOUR_FRACTION: f64 = 0.3;

/// Half of the 24 nodes of the contour. The other half are the complex conjugates.
const CONTOUR_NODE_PAIRS: u32 = 12;

/// ISE of a unit step of the reference (output unit^2 s), exact to rounding.
///
/// `None` if the closed loop is unstable: its phase margin is not positive, or `Kp` is zero or has the wrong sign. `Kd`
/// may have either sign.
#[must_use]
pub fn ise(process: &Soiptd, pd: Pd) -> Option<f64> {
    let open_loop = OpenLoop::new(process, pd)?;
    let omega = open_loop.gain_crossover();
    ise_at_crossover(&open_loop, omega, open_loop.phase_above_minus_pi(omega))
}

/// ISE (output unit^2 s) of a loop whose gain crossover `omega` (rad/s) and phase margin (rad) are known. `None` if the
/// loop is unstable.
#[must_use]
pub fn ise_at_crossover(open_loop: &OpenLoop, omega: f64, phase_margin_rad: f64) -> Option<f64> {
    let OpenLoop {
        kp,
        kd,
        damping,
        lag_s,
        ..
    } = *open_loop;
    if !(phase_margin_rad > 0.0 && phase_margin_rad < PI) {
        return None;
    }
    let crossover_sq = omega * omega;
    let lag_sq = lag_s * lag_s;
    // T_prop^2 (q_2 + q_3), by Vieta from the quadratic term of P and q_1.
    let pair_sum = 1.0 + lag_sq * (damping * damping + crossover_sq);
    // -dP/dq at q_1 = T_prop^2 (q_1 - q_2)(q_1 - q_3): a sum of positive terms, no cancellation.
    let slope =
        lag_sq * crossover_sq * crossover_sq + pair_sum * crossover_sq + kp * kp / crossover_sq;
    let resonance = kp * kp / (2.0 * omega * crossover_sq * slope * (0.5 * phase_margin_rad).tan());

    let mean = 0.5 * pair_sum / lag_sq;
    let product = kp * kp / (lag_sq * crossover_sq);
    let rest = Rest {
        open_loop,
        crossover_sq,
        scale: -0.5 * kp * kp / lag_sq,
    };
    let cost = kd / kp + resonance + rest.divided_difference(mean, product);
    cost.is_finite().then_some(cost)
}

/// Contribution of the roots `q_2` and `q_3`: the divided difference `g[q_2, q_3]` of
/// `g(q) = -kp^2 / (2 T_prop^2 q^(3/2) (q - q_1)) (1 - L)/(1 + L)`.
struct Rest<'a> {
    open_loop: &'a OpenLoop,
    /// `-q_1` (1/s^2).
    crossover_sq: f64,
    /// `-kp^2 / (2 T_prop^2)`.
    scale: f64,
}

impl Rest<'_> {
    /// `g[q_2, q_3]` from the mean of the roots and their product.
    fn divided_difference(&self, mean: f64, product: f64) -> f64 {
        let half_distance_sq = mean * mean - product;
        let half_distance = half_distance_sq.abs().sqrt();
        if half_distance < CONFLUENT_FRACTION * mean {
            self.divided_difference_by_contour(mean, half_distance_sq)
        } else if half_distance_sq > 0.0 {
            let large = mean + half_distance;
            let small = product / large;
            (self.at_real(large) - self.at_real(small)) / (large - small)
        } else {
            self.at(Complex64::new(mean, half_distance)).im / half_distance
        }
    }

    /// Cauchy integral of `g(q) / ((q - q_2)(q - q_3))` around both roots, by the trapezoidal rule.
    fn divided_difference_by_contour(&self, mean: f64, half_distance_sq: f64) -> f64 {
        let sum: f64 = (0..CONTOUR_NODE_PAIRS)
            .map(|k| {
                let angle = PI * (f64::from(k) + 0.5) / f64::from(CONTOUR_NODE_PAIRS);
                let offset = Complex64::from_polar(CONTOUR_FRACTION * mean, angle);
                (self.at(offset + mean) * offset / (offset * offset - half_distance_sq)).re
            })
            .sum();
        sum / f64::from(CONTOUR_NODE_PAIRS)
    }

    fn at(&self, q: Complex64) -> Complex64 {
        let s = q.sqrt();
        let (d, c) = self.open_loop.fraction(s);
        (c - d) / (c + d) * self.scale / (s * q * (q + self.crossover_sq))
    }

    fn at_real(&self, q: f64) -> f64 {
        let OpenLoop {
            kp,
            kd,
            damping,
            lag_s,
            tau_s,
        } = *self.open_loop;
        let s = q.sqrt();
        let d = (-s * tau_s).exp() * (kp + kd * s);
        let c = s * (s * lag_s + 1.0) * (s + damping);
        (c - d) / (c + d) * self.scale / (s * q * (q + self.crossover_sq))
    }
}
