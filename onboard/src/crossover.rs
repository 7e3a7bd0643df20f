//! Gain crossover of the loop of a PD controller and the process, exactly.
//!
//! ```text
//!                         (kp + kd s) e^(-tau s)
//! L(s) = (Kp + Kd s) G(s) = -------------------------------,   |L(j w)| = 1
//!                         s (T_prop s + 1)(s + 1/T_body)
//! ```
//!
//! with the controller's gains multiplied by the acceleration gain `A = K/T_body`:
//!
//! | symbol   | name      | unit  |
//! |----------|-----------|-------|
//! | A Kp     | `kp`      | 1/s^2 |
//! | A Kd     | `kd`      | 1/s   |
//! | 1/T_body | `damping` | 1/s   |
//! | T_prop   | `lag_s`   | s     |
//! | w        | result    | rad/s |
//!
//! `|L|^2 = 1` is a cubic in `x = w^2` with one positive root where `kp > 0`:
//!
//! `T_prop^2 x^3 + (1 + (T_prop/T_body)^2) x^2 - (kd^2 - 1/T_body^2) x - kp^2 = 0`.
//!
//! The crossover is the frequency at which the paper's phase margin (equations 12 and 13) is taken.

use libm::{frexp, ldexp, sqrt};

/// Newton's method takes 4 to 8 steps on average and 11 at most (ten million random loops).
const MAX_NEWTON_STEPS: usize = 60;

/// Frequency (rad/s) at which the magnitude of the loop is one, to a few roundings.
///
/// Newton's method falls onto the root monotonically from any bound above it, because the cubic is convex there.
/// `cube_root_bound` gives the cube root of its argument or a larger number, for that bound: on a board
/// [`power_of_two_cube_root`], because a cube root takes 3 kB of code; elsewhere `f64::cbrt`. The last bit may
/// depend on the choice.
///
/// There is one root for `kp` other than zero. For `kp = 0` the result is zero or NaN if the magnitude stays
/// below one.
#[must_use]
pub fn gain_crossover(
    kp: f64,
    kd: f64,
    damping: f64,
    lag_s: f64,
    cube_root_bound: impl Fn(f64) -> f64,
) -> f64 {
    let c3 = lag_s * lag_s;
    let c2 = 1.0 + (lag_s * damping) * (lag_s * damping);
    let c1 = (kd - damping) * (kd + damping);
    let c0 = kp * kp;
    // Two upper bounds: the root without the cubic term, and a bound of the root without the quadratic term.
    let discriminant = sqrt(c1 * c1 + 4.0 * c2 * c0);
    let without_cubic = if c1 > 0.0 {
        (discriminant + c1) / (2.0 * c2)
    } else {
        2.0 * c0 / (discriminant - c1)
    };
    let without_quadratic = sqrt(c1.max(0.0) / c3) + cube_root_bound(c0 / c3);
    let mut x = without_cubic.min(without_quadratic);
    for _ in 0..MAX_NEWTON_STEPS {
        let value = ((c3 * x + c2) * x - c1) * x - c0;
        let slope = (3.0 * c3 * x + 2.0 * c2) * x - c1;
        let next = x - value / slope;
        if next >= x || next.is_nan() {
            break;
        }
        x = next;
    }
    sqrt(x)
}

/// A power of two that is at least the cube root of `value >= 0` and at most twice as large.
#[must_use]
pub fn power_of_two_cube_root(value: f64) -> f64 {
    let (fraction, exponent) = frexp(value);
    // value < 2^exponent, so the cube root is below 2^(exponent/3), rounded up. Zero and infinity stay.
    if fraction == 0.0 || !fraction.is_finite() {
        return value;
    }
    ldexp(1.0, (exponent + 2).div_euclid(3))
}

#[cfg(test)]
mod tests {
    use libm::{cbrt, fabs};

    use super::*;

    // Without proportional gain and damping |L| = kd / (w sqrt(1 + w^2 T^2)), which is 1 at w = 1/T for kd =
    // sqrt(2)/T. Without derivative gain and damping |L| = kp / (w^2 sqrt(1 + w^2 T^2)): the same for kp =
    // sqrt(2)/T^2. With a damping of 1/T as well |L| = kp / (w (1 + w^2 T^2) / T): the same for kp = 2/T^2.
    #[test]
    fn crossovers_by_hand() {
        for lag_s in [1e-3, 0.2, 50.0] {
            for (kp, kd, damping) in [
                (0.0, sqrt(2.0) / lag_s, 0.0),
                (sqrt(2.0) / lag_s / lag_s, 0.0, 0.0),
                (2.0 / lag_s / lag_s, 0.0, 1.0 / lag_s),
            ] {
                for bound in [cbrt, power_of_two_cube_root] {
                    let relative = gain_crossover(kp, kd, damping, lag_s, bound) * lag_s;
                    assert!(fabs(relative - 1.0) < 1e-14, "{lag_s} {kp} {relative}");
                }
            }
        }
    }

    // A loop with derivative gain only, which the damping keeps below one: kd < 1/T_body.
    #[test]
    fn a_magnitude_below_one_has_no_crossover() {
        let omega = gain_crossover(0.0, 1.0, 2.0, 0.1, cbrt);
        assert!(omega.is_nan() || omega == 0.0, "{omega}");
    }

    // 8 = 0.5 * 2^4, so 2^(4/3) rounded up to a power of two: 4. Just below 8 it is 2.
    #[test]
    fn powers_of_two_by_hand() {
        for (value, expected) in [
            (8.0, 4.0),
            (7.9, 2.0),
            (1.1, 2.0),
            (0.9, 1.0),
            (0.124, 0.5),
            (0.0, 0.0),
            (f64::INFINITY, f64::INFINITY),
        ] {
            assert_eq!(power_of_two_cube_root(value), expected, "{value}");
        }
        for exponent in -300..300 {
            let value = 1.7 * libm::exp2(f64::from(exponent));
            let factor = power_of_two_cube_root(value) / cbrt(value);
            assert!((1.0..=2.0).contains(&factor), "{value} {factor}");
        }
    }
}
