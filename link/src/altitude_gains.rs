//! Gains of PX4's altitude: a P of the height around a PI of the climb rate.
//!
//! ```text
//! a = P (A (r - y) - v) + I integral (A (r - y) - v) dt
//! u = a / g * hover
//! ```
//!
//! | symbol | parameter | unit |
//! |---|---|---|
//! | A | `MPC_Z_P` | 1/s |
//! | P | `MPC_Z_VEL_P_ACC` | 1/s |
//! | I | `MPC_Z_VEL_I_ACC` | 1/s^2 |
//! | y, v, r | height, climb rate, reference | m, m/s, m |
//! | a | acceleration | m/s^2 |
//! | u | thrust, a part of the full one; `hover` is that of the hover | 1 |
//!
//! The derivative `MPC_Z_VEL_D_ACC` is 0. As a PID of the height it has `kd = P / s`, `kp = (P A + I) / s` and
//! `ki = I A / s` with the acceleration per thrust `s = g / hover`. Source: PX4 documentation, "Controller Diagrams".

use crate::gains::LoopGains;

/// Standard gravity (m/s^2).
const GRAVITY: f64 = 9.80665;

/// Largest values of the parameters, in their order. Source: PX4 parameter reference.
const MOST: [f64; 4] = [1.5, 15.0, 3.0, 2.0];

/// Gains of PX4's altitude as its parameters have them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct AltitudeCascade {
    /// `MPC_Z_P`, `MPC_Z_VEL_P_ACC`, `MPC_Z_VEL_I_ACC`, `MPC_Z_VEL_D_ACC`.
    pub values: [f64; 4],
}

impl AltitudeCascade {
    /// Names of the parameters.
    pub const NAMES: [&str; 4] = [
        "MPC_Z_P",
        "MPC_Z_VEL_P_ACC",
        "MPC_Z_VEL_I_ACC",
        "MPC_Z_VEL_D_ACC",
    ];

    /// Gains with these values.
    pub fn new(values: [f64; 4]) -> Self {
        Self { values }
    }

    /// The gains of a PID of the height (thrust per m, m s and m/s) at a thrust of the hover, none above its parameter's
    /// maximum: with less gain the loop is slower and has more margin. The cascade has no complex zeros: an integral that would
    /// need them is lowered to the largest one without, so the margins must be computed of the result. `None`: without
    /// proportional or derivative gain there is no cascade.
    pub fn of_pid(pid: LoopGains, hover: f64) -> Option<Self> {
        let scale = GRAVITY / hover;
        let [kp, ki, kd] = [pid.proportional, pid.integral, pid.derivative].map(|k| scale * k);
        // kp = R + ki kd / R with R = P A, and I = kp - R: the smaller root is the integral's.
        let root = (kp * kp - 4.0 * ki * kd).max(0.0);
        if !(kd > 0.0 && kp > 0.0 && scale.is_finite() && ki.is_finite()) {
            return None;
        }
        let integral = 0.5 * (kp - root.sqrt());
        let mut values = [(kp - integral) / kd, kd, integral, 0.0];
        for (value, most) in values.iter_mut().zip(MOST) {
            *value = value.min(most);
        }
        Some(Self { values })
    }

    /// The PID of the height that these gains are, without their derivative.
    pub fn pid(&self, hover: f64) -> LoopGains {
        let [outer, inner, integral, _] = self.values;
        let per_thrust = hover / GRAVITY;
        LoopGains::new(
            per_thrust * (inner * outer + integral),
            per_thrust * integral * outer,
            per_thrust * inner,
        )
    }

    /// A share of the way, 0 to 1, to other gains, with the digits that a file shows: of a ratio for gains that rise, of a
    /// difference for those that fall.
    #[must_use]
    pub fn toward(&self, other: Self, share: f64) -> Self {
        let between = |(from, to): (f64, f64)| match from > 0.0 && to > from {
            true => from * (to / from).powf(share),
            false => from + share * (to - from),
        };
        let round = |value: f64| match value {
            0.0 => 0.0,
            value => {
                let unit = 10_f64.powf(3.0 - value.abs().log10().floor());
                (value * unit).round() / unit
            }
        };
        let pairs = [0, 1, 2, 3].map(|at| (self.values[at], other.values[at]));
        Self {
            values: pairs.map(|pair| round(between(pair))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // By hand: A 1, P 4, I 1 at a hover of 0.5 (s = 19.61): kp = 5 / s, ki = 1 / s, kd = 4 / s. The roots of R + 4 / R = 5 are
    // 4 and 1; the larger one is P A.
    #[test]
    fn by_hand() {
        let cascade = AltitudeCascade::new([1.0, 4.0, 1.0, 0.0]);
        let pid = cascade.pid(0.5);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(pid.proportional * 19.6133, 5.0);
        close(pid.integral * 19.6133, 1.0);
        close(pid.derivative * 19.6133, 4.0);
        let back = AltitudeCascade::of_pid(pid, 0.5).unwrap();
        for (own, value) in back.values.iter().zip(cascade.values) {
            close(*own, value);
        }
    }

    // Double root: kp^2 = 4 ki kd at ki = 1 / 4, where I = kp / 2 and P = kp / (2 kd).
    #[test]
    fn an_integral_that_does_not_fit_is_lowered() {
        let of = |ki| AltitudeCascade::of_pid(LoopGains::new(0.1, ki, 0.1), 0.5).unwrap();
        let back = of(1.0).pid(0.5);
        assert!((back.integral - 0.025).abs() < 1e-12, "{back:?}");
        assert!((back.proportional - 0.1).abs() < 1e-12, "{back:?}");
        assert_eq!(of(1.0), of(0.025));
    }

    #[test]
    fn limits_and_no_form() {
        let fast = AltitudeCascade::of_pid(LoopGains::new(20.0, 0.0, 4.0), 0.5).unwrap();
        assert_eq!(fast.values, [1.5, 15.0, 0.0, 0.0]);
        // No derivative; no proportional gain; not a number.
        for (kp, ki, kd) in [
            (1.0, 0.0, 0.0),
            (0.0, 1.0, 1.0),
            (f64::NAN, 0.0, 1.0),
            (1.0, f64::NAN, 1.0),
        ] {
            assert_eq!(
                AltitudeCascade::of_pid(LoopGains::new(kp, ki, kd), 0.5),
                None
            );
        }
    }

    // Half of the way up from 1 to 4 is 2, down from 4 to 1 it is 2.5; to four digits.
    #[test]
    fn half_of_the_way() {
        let from = AltitudeCascade::new([1.0, 4.0, 0.0, 1.0]);
        let to = AltitudeCascade::new([4.0, 1.0, 1.0, 0.12344]);
        assert_eq!(from.toward(to, 0.5).values, [2.0, 2.5, 0.5, 0.5617]);
    }
}
