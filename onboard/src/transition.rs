//! Exact transition of the process without delay while its input is constant.
//!
//! State for `K/T_body = 1`: output `y`, rate `v`, force `f` (the output of the actuator):
//!
//! ```text
//! dy/dt = v,   dv/dt = f - v/T_body,   df/dt = (u - f)/T_prop
//! ```
//!
//! The matrix exponential over a duration `d` contains the divided differences of `exp` at `0, 0, -d/T_body,
//! -d/T_prop` (Opitz's formula), so nothing is singular where the lags are equal or where damping vanishes. It
//! is computed by scaling and squaring. All entries are sums and products of positive numbers, so each is
//! accurate to a few roundings, however small it is.
//!
//! Reference: N. J. Higham, "Functions of Matrices" (SIAM 2008), chapters 4 and 10.

use libm::{exp, frexp, ldexp};

use crate::process::Soiptd;

/// State of the process with unit acceleration gain, or its response to one of its inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Output (output unit per unit of acceleration gain).
    pub y: f64,
    /// Rate of the output (the unit of `y` per second).
    pub v: f64,
    /// Force: output of the actuator's lag (input unit).
    pub f: f64,
}

/// Transition over a duration `d`: `state(t + d) = matrix * state(t) + column * u`.
///
/// Rows of `matrix | column`. `y`: `1, y_v, y_f | y_u`; `v`: `0, v_v, v_f | v_u`; `f`: `0, 0, f_f | f_u`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    /// Output after a unit rate.
    pub y_v: f64,
    /// Output after a unit force.
    pub y_f: f64,
    /// Output after a unit input.
    pub y_u: f64,
    /// Rate after a unit rate.
    pub v_v: f64,
    /// Rate after a unit force.
    pub v_f: f64,
    /// Rate after a unit input.
    pub v_u: f64,
    /// Force after a unit force.
    pub f_f: f64,
    /// Force after a unit input.
    pub f_u: f64,
}

impl Transition {
    /// Transition over no time.
    pub const IDENTITY: Self = Self {
        y_v: 0.0,
        y_f: 0.0,
        y_u: 0.0,
        v_v: 1.0,
        v_f: 0.0,
        v_u: 0.0,
        f_f: 1.0,
        f_u: 0.0,
    };

    /// All zeros: memory before the first use.
    pub(crate) const ZERO: Self = Self {
        y_v: 0.0,
        y_f: 0.0,
        y_u: 0.0,
        v_v: 0.0,
        v_f: 0.0,
        v_u: 0.0,
        f_f: 0.0,
        f_u: 0.0,
    };

    /// Transition over `duration_s >= 0` of the process. Its gain and delay have no influence.
    #[must_use]
    pub fn over(process: &Soiptd, duration_s: f64) -> Self {
        Self::of_poles(
            process.inv_t_body_per_s(),
            1.0 / process.t_prop_s(),
            duration_s,
        )
    }

    /// Transition over `duration_s` with the poles `-body` and `-prop` (1/s), both not negative.
    #[must_use]
    pub fn of_poles(body: f64, prop: f64, duration_s: f64) -> Self {
        // Scale until the fastest pole moves by at most 1/4, then square.
        let (_, exponent) = frexp(body.max(prop) * duration_s);
        let squarings = (exponent + 2).max(0);
        let mut step = Self::taylor(body, prop, ldexp(duration_s, -squarings));
        for _ in 0..squarings {
            step = step.then(&step);
        }
        step
    }

    /// Taylor series of the chain, shifted by its fastest pole so that no term is negative.
    fn taylor(body: f64, prop: f64, d: f64) -> Self {
        let shift = body.max(prop);
        // Diagonal of the shifted matrix times d, in the order y, v, f, u.
        let (dy, dv, df) = (shift * d, (shift - body) * d, (shift - prop) * d);
        let du = shift * d;
        // Rows of M^n d^n / n!, upper triangular with super-diagonal 1, 1, prop.
        let (mut vv, mut ff) = (1.0, 1.0);
        let (mut yv, mut vf, mut fu) = (0.0, 0.0, 0.0);
        let (mut yf, mut vu, mut yu) = (0.0, 0.0, 0.0);
        let mut yy = 1.0;
        let mut sum = Self::IDENTITY;
        // Terms fall by at least 1/4 / n: after 14 they are below 1e-19 of the sum.
        for n in 1..=14 {
            let inverse = 1.0 / f64::from(n);
            // New entry of a row: old entry times its diagonal, plus the step from its left neighbour.
            (yu, yf, yv, yy) = (
                (yu * du + yf * prop * d) * inverse,
                (yf * df + yv * d) * inverse,
                (yv * dv + yy * d) * inverse,
                yy * dy * inverse,
            );
            (vu, vf, vv) = (
                (vu * du + vf * prop * d) * inverse,
                (vf * df + vv * d) * inverse,
                vv * dv * inverse,
            );
            (fu, ff) = ((fu * du + ff * prop * d) * inverse, ff * df * inverse);
            sum.y_v += yv;
            sum.y_f += yf;
            sum.y_u += yu;
            sum.v_v += vv;
            sum.v_f += vf;
            sum.v_u += vu;
            sum.f_f += ff;
            sum.f_u += fu;
        }
        sum.scaled(exp(-shift * d))
    }

    fn scaled(self, factor: f64) -> Self {
        Self {
            y_v: self.y_v * factor,
            y_f: self.y_f * factor,
            y_u: self.y_u * factor,
            v_v: self.v_v * factor,
            v_f: self.v_f * factor,
            v_u: self.v_u * factor,
            f_f: self.f_f * factor,
            f_u: self.f_u * factor,
        }
    }

    /// This duration followed by that of `next`, with the same input throughout.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let end = |y: f64, v: f64, f: f64, u: f64| next.apply(&State { y, v, f }, u);
        let from_v = end(self.y_v, self.v_v, 0.0, 0.0);
        let from_f = end(self.y_f, self.v_f, self.f_f, 0.0);
        let from_u = end(self.y_u, self.v_u, self.f_u, 1.0);
        Self {
            y_v: from_v.y,
            v_v: from_v.v,
            y_f: from_f.y,
            v_f: from_f.v,
            f_f: from_f.f,
            y_u: from_u.y,
            v_u: from_u.v,
            f_u: from_u.f,
        }
    }

    /// State after the duration under the constant input `u`.
    #[must_use]
    #[inline]
    pub fn apply(&self, state: &State, u: f64) -> State {
        State {
            y: state.y + self.y_v * state.v + self.y_f * state.f + self.y_u * u,
            v: self.v_v * state.v + self.v_f * state.f + self.v_u * u,
            f: self.f_f * state.f + self.f_u * u,
        }
    }

    /// Step response: state after the duration from rest under a unit input.
    #[must_use]
    pub fn step_response(&self) -> State {
        State {
            y: self.y_u,
            v: self.v_u,
            f: self.f_u,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(a: f64, b: f64, tolerance: f64, what: &str) {
        assert!(
            (a - b).abs() <= tolerance * b.abs().max(1e-300),
            "{what}: {a} against {b}"
        );
    }

    // Partial fractions, valid away from equal lags: with a = 1/T_body, p = 1/T_prop and E(q) = (1 - e^(-q d))/q
    // the step response of the rate is E(a) - (e^(-a d) - e^(-p d))/(p - a).
    #[test]
    fn agrees_with_partial_fractions() {
        for (a, p, d) in [
            (0.5, 66.7, 1e-3),
            (2.0, 10.0, 0.3),
            (5.0, 3.3, 2.0),
            (0.1, 0.7, 40.0),
        ] {
            let t = Transition::of_poles(a, p, d);
            let e = |q: f64| -libm::expm1(-q * d) / q;
            let (ea, ep) = (exp(-a * d), exp(-p * d));
            let v_f = (ea - ep) / (p - a);
            let y_f = (e(a) - e(p)) / (p - a);
            assert_close(t.v_v, ea, 1e-13, "v_v");
            assert_close(t.f_f, ep, 1e-13, "f_f");
            assert_close(t.y_v, e(a), 1e-13, "y_v");
            assert_close(t.v_f, v_f, 1e-12, "v_f");
            assert_close(t.y_f, y_f, 1e-10, "y_f");
            assert_close(t.f_u, p * e(p), 1e-13, "f_u");
            assert_close(t.v_u, e(a) - v_f, 1e-10, "v_u");
        }
    }

    // Double integrator with lag by hand: with x = d/T, f_u = 1 - e^-x, v_u = T (x - 1 + e^-x) and y_u = T^2
    // (x^2/2 - x + 1 - e^-x). For x = 1: 1 - 1/e, 1/e, 1/2 - 1/e.
    #[test]
    fn double_integrator_by_hand() {
        let t = Transition::of_poles(0.0, 10.0, 0.1);
        let e = exp(-1.0);
        assert_close(t.f_u, 1.0 - e, 1e-15, "f_u");
        assert_close(t.v_u, 0.1 * e, 1e-14, "v_u");
        assert_close(t.y_u, 0.01 * (0.5 - e), 1e-14, "y_u");
        assert_close(t.y_v, 0.1, 1e-15, "y_v");
    }

    // Equal lags by hand: for p = 1 and d = 1, v_f = d e^-d = 1/e, y_f = 1 - 2/e, v_u = 1 - 2/e, y_u = 3/e - 1.
    #[test]
    fn equal_lags_by_hand() {
        let t = Transition::of_poles(1.0, 1.0, 1.0);
        let e = exp(-1.0);
        assert_close(t.v_f, e, 1e-15, "v_f");
        assert_close(t.y_f, 1.0 - 2.0 * e, 1e-14, "y_f");
        assert_close(t.v_u, 1.0 - 2.0 * e, 1e-14, "v_u");
        assert_close(t.y_u, 3.0 * e - 1.0, 1e-14, "y_u");
    }

    #[test]
    fn nothing_jumps_where_the_lags_meet() {
        // The response is smooth in the pole, so the value where the lags meet is the mean of its neighbours to
        // second order, 1e-12 here.
        let at = |p: f64| Transition::of_poles(4.0, p, 0.7).y_u;
        assert_close(
            at(4.0),
            0.5 * (at(4.0 - 1e-6) + at(4.0 + 1e-6)),
            1e-12,
            "y_u",
        );
    }

    #[test]
    fn two_halves_make_a_whole() {
        let half = Transition::of_poles(0.3, 20.0, 0.011);
        let whole = Transition::of_poles(0.3, 20.0, 0.022);
        let twice = half.then(&half);
        assert_close(twice.y_u, whole.y_u, 1e-14, "y_u");
        assert_close(twice.v_f, whole.v_f, 1e-14, "v_f");
        assert_eq!(Transition::of_poles(0.3, 20.0, 0.0), Transition::IDENTITY);
    }
}
