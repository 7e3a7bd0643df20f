//! PX4's gains: a PID of the rate by generalised minimum variance, and a proportional gain of the angle around it.
//!
//! T. Yamamoto, K. Fujii, M. Kaneda, "Design and implementation of a self-tuning PID controller" (1998), in the form and with
//! the numbers that PX4 flies (`mc_autotune_attitude_control`, library `pid_design`).
//!
//! The model is that of PX4's identification, from the input `u` to the rate `v`, with a dead time of one sample:
//!
//! ```text
//! v(k) = -a1 v(k-1) - a2 v(k-2) + b0 u(k-1) + b1 u(k-2) + b2 u(k-3)
//! ```
//!
//! **The law.** With `A = 1 + a1 q + a2 q^2`, `B = b0 + b1 q + b2 q^2`, `q` a delay of one sample and `D = 1 - q`, the law
//! minimises the variance of `P v + lambda D u - F(1) w` two samples ahead, where `w` is the commanded rate. It is two
//! samples because PX4 counts one more than the model has. The prediction splits off by
//!
//! ```text
//! P = D A (1 + e1 q) + q^2 (f0 + f1 q + f2 q^2),      P = 1 + p1 q + p2 q^2
//! e1 = 1 - a1 + p1                      from q
//! f0 = p2 + a1 - a2 + e1 (1 - a1)       from q^2
//! f1 = a2 + e1 (a1 - a2)                from q^3
//! f2 = a2 e1                            from q^4
//! ```
//!
//! and `D u = (F(1) w - F v)/(E B + lambda)`. With the static value of the denominator, `nu = (1 + e1)(b0 + b1 + b2) +
//! lambda`, this is a PID whose proportional and derivative parts act on the measurement. The powers of `q` in `F/nu = k (D +
//! dt/Ti + Td/dt D^2)` give
//!
//! ```text
//! k = -(f1 + 2 f2)/nu,   1/Ti = -(f0 + f1 + f2)/(dt (f1 + 2 f2)),   Td = -dt f2/(f1 + 2 f2)
//! ```
//!
//! PX4 takes a fifth of this integral part, and the proportional part acts on the error.
//!
//! **Reference model.** `P` is `1 + sigma s + mu sigma^2 s^2` in discrete time, `sigma` the rise time. With `rho = dt/sigma`
//!
//! ```text
//! p1 = -2 exp(-rho/(2 mu)) cos(sqrt(4 mu - 1) rho/(2 mu)),   p2 = exp(-rho/mu)
//! ```
//!
//! PX4 uses critical damping, `mu` = 1/4.
//!
//! **The angle.** An error of 60 degrees commands the full torque: `angle_p = 1/(pi/3 k)`, limited to 2 to 6.5 1/s.
//!
//! **Units.** Rise time, detuning `lambda` and the rule for the angle are numbers for vehicles: seconds, radians, full torque.
//! On other processes they must be scaled with the process for a fair comparison ([`Gmvc::scaled_to`]).

use std::f64::consts::PI;

use crate::cascade::Cascade;

/// Part of the law's integral that PX4 uses.
const INTEGRAL_PART: f64 = 0.2;

/// A vehicle for which PX4's numbers are right: the relay test of JSBSim's F450 in roll
/// (`examples/jsbsim_f450_roll_clean.csv`): period (s), and amplitude (0.172 rad) per amplitude of the relay (0.05 of the
/// torque).
const VEHICLE: (f64, f64) = (0.503, 0.172 / 0.05);

/// Design parameters of the law.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Gmvc {
    /// Rise time (s).
    pub rise_time_s: f64,
    /// `mu`: 1/4 is critical damping, 0.51 nearly Butterworth.
    pub damping: f64,
    /// Detuning `lambda` (rate unit / input unit): a larger value gives a lower gain.
    pub detuning: f64,
    /// Target of the gain from angle to input (input unit / output unit).
    pub stiffness: f64,
    /// Least and greatest gain of the angle (1/s).
    pub angle_p_range: (f64, f64),
}

impl Gmvc {
    /// PX4's own numbers, for a recording in radians and parts of the torque.
    pub const PX4: Self = Self {
        rise_time_s: 0.14,
        damping: 0.25,
        detuning: 0.7,
        stiffness: 3.0 / PI,
        angle_p_range: (2.0, 6.5),
    };

    /// PX4's numbers scaled with an oscillation in a relay test: its period (s), and its amplitude per amplitude of the relay
    /// (output unit / input unit). Equal to them for the vehicle that they are made for.
    #[must_use]
    pub fn scaled_to(period_s: f64, amplitude_ratio: f64) -> Self {
        let slower = period_s / VEHICLE.0;
        let stronger = amplitude_ratio / VEHICLE.1;
        let (least, most) = Self::PX4.angle_p_range;
        Self {
            rise_time_s: Self::PX4.rise_time_s * slower,
            damping: Self::PX4.damping,
            detuning: Self::PX4.detuning * stronger / slower,
            stiffness: Self::PX4.stiffness / stronger,
            angle_p_range: (least / slower, most / slower),
        }
    }

    /// The gains for a model with the coefficients `a1`, `a2`, `b0`, `b1`, `b2` at a sample period (s). `None` if
    /// proportional or integral gain is not positive; PX4 does not fly such gains either.
    #[must_use]
    pub fn cascade(&self, coefficients: &[f64; 5], sample_s: f64) -> Option<Cascade> {
        let [a1, a2, b0, b1, b2] = *coefficients;
        let (mu, rho) = (self.damping, sample_s / self.rise_time_s);
        let turn_rad = (4.0 * mu - 1.0).max(0.0).sqrt() * rho / (2.0 * mu);
        let p1 = -2.0 * (-rho / (2.0 * mu)).exp() * turn_rad.cos();
        let p2 = (-rho / mu).exp();
        let e1 = 1.0 - a1 + p1;
        let f0 = p2 + a1 - a2 + e1 * (1.0 - a1);
        let f1 = a2 + e1 * (a1 - a2);
        let f2 = a2 * e1;
        let nu = (1.0 + e1) * (b0 + b1 + b2) + self.detuning;
        let proportional = -(f1 + 2.0 * f2);
        let rate_p = proportional / nu;
        let rate_i = INTEGRAL_PART * (f0 + f1 + f2) / (sample_s * proportional);
        let (least, most) = self.angle_p_range;
        (rate_p > 0.0 && rate_p.is_finite() && rate_i > 0.0).then(|| Cascade {
            angle_p: (self.stiffness / rate_p).clamp(least, most),
            rate_p,
            rate_i,
            rate_d: (sample_s * f2 / proportional).max(0.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Poles 0.9 and 0.9, and a rise time with exp(-2 rho) = 0.8: p = -1.6, 0.64, so e1 = 1.2, f0 = 1.39, f1 = -2.322, f2 =
    // 0.972; f0 + f1 + f2 = P(1) = 0.04. With sum b = 0.15 and lambda = 0.17, nu is 0.5: k = 0.378/0.5, 1/Ti = 0.04/(0.01
    // 0.378)/5, Td = 0.01 0.972/0.378; the angle gain is 3/0.756, limited to 2 .. 6.5 1/s.
    #[test]
    fn the_law_by_hand() {
        for (stiffness, angle_p) in [(3.0, 3.0 / 0.756), (0.1, 2.0), (90.0, 6.5)] {
            let design = Gmvc {
                rise_time_s: 0.01 / (-0.5 * 0.8_f64.ln()),
                detuning: 0.17,
                stiffness,
                ..Gmvc::PX4
            };
            let found = design
                .cascade(&[-1.8, 0.81, 0.1, 0.07, -0.02], 0.01)
                .unwrap();
            let expected = [angle_p, 0.756, 0.04 / (5.0 * 0.01 * 0.378), 0.00972 / 0.378];
            let gains = [found.angle_p, found.rate_p, found.rate_i, found.rate_d];
            for (a, b) in gains.iter().zip(expected) {
                assert!((a / b - 1.0).abs() < 1e-12, "{found:?} {expected:?}");
            }
        }
    }

    // Expected values of PX4's own test of its law (pid_design_test.cpp), to the stated digits: k 0.129, 1/Ti 11.911/5 1/s, Td
    // 0.0463 s, at a rise time of 0.1 s, nearly Butterworth, detuning 0.5.
    #[test]
    fn the_law_is_px4s() {
        let design = Gmvc {
            rise_time_s: 0.1,
            damping: 0.51,
            detuning: 0.5,
            ..Gmvc::PX4
        };
        let found = design
            .cascade(&[-1.814, 0.822, 0.0098, -0.162, 0.147], 0.004)
            .unwrap();
        assert!((found.rate_p - 0.129).abs() < 1e-3, "{found:?}");
        assert!((found.rate_i - 11.911 / 5.0).abs() < 1e-3, "{found:?}");
        assert!((found.rate_d - 0.0463).abs() < 1e-4, "{found:?}");
    }

    // Models without poles or with a coefficient that is no number.
    #[test]
    fn wrong_models_are_refused() {
        for coefficients in [[0.0, 0.0, -5.0, 0.0, 0.0], [-1.8, 0.81, f64::NAN, 0.0, 0.0]] {
            assert_eq!(Gmvc::PX4.cascade(&coefficients, 0.01), None);
        }
    }
}
