//! Process model: integrator with two lags and delay (equation 1 of the paper, "SOIPTD").
//!
//! ```text
//!              K e^(-tau s)                        K/T_body e^(-tau s)
//! G(s) = ---------------------------- = ------------------------------------
//!        s (T_prop s + 1)(T_body s + 1)    s (T_prop s + 1)(s + 1/T_body)
//! ```
//!
//! | symbol   | name               | unit                        |
//! |----------|--------------------|-----------------------------|
//! | K        | `k`                | output unit / (input unit s)  |
//! | K/T_body | `k_over_t_body`    | output unit / (input unit s^2)|
//! | T_prop   | `t_prop_s`         | s, lag of the actuator      |
//! | 1/T_body | `inv_t_body_per_s` | 1/s, damping of the body    |
//! | tau      | `tau_s`            | s, dead time                |
//!
//! The form on the right is the one stored. Without damping (`1/T_body = 0`) the process is a double integrator
//! and every formula stays regular, while `K` and `T_body` are infinite.

use core::f64::consts::{FRAC_PI_2, PI};
use core::fmt;

use libm::{asin, atan, exp, hypot, log, sqrt};

/// A process with valid parameters. See the [module](self) for the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Soiptd {
    k_over_t_body: f64,
    t_prop_s: f64,
    inv_t_body_per_s: f64,
    tau_s: f64,
}

/// Invalid process parameter, with its value.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SoiptdError {
    /// The gain is zero or not finite.
    Gain(f64),
    /// `T_prop` is not a positive, finite time.
    TProp(f64),
    /// `T_body` is not a positive time. Infinity is valid and means no damping.
    TBody(f64),
    /// `tau` is negative or not finite.
    Tau(f64),
}

impl fmt::Display for SoiptdError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gain(v) => write!(f, "the gain must be finite and not zero, but is {v}"),
            Self::TProp(v) => write!(f, "T_prop must be a positive time, but is {v} s"),
            Self::TBody(v) => write!(f, "T_body must be a positive time, but is {v} s"),
            Self::Tau(v) => write!(f, "tau must be zero or a positive time, but is {v} s"),
        }
    }
}

impl core::error::Error for SoiptdError {}

impl Soiptd {
    /// A process from the parameters of the paper: velocity gain `k`, times in seconds.
    ///
    /// # Errors
    /// The first parameter that is out of range. For a process without damping use
    /// [`Soiptd::from_acceleration_gain`].
    pub fn new(k: f64, t_prop_s: f64, t_body_s: f64, tau_s: f64) -> Result<Self, SoiptdError> {
        if !(t_body_s.is_finite() && t_body_s > 0.0) {
            return Err(SoiptdError::TBody(t_body_s));
        }
        if !k.is_finite() {
            return Err(SoiptdError::Gain(k));
        }
        Self::from_acceleration_gain(k / t_body_s, t_prop_s, 1.0 / t_body_s, tau_s)
    }

    /// A process from the acceleration gain `K/T_body` and the damping rate `1/T_body`, which may be zero.
    ///
    /// # Errors
    /// The first parameter that is out of range.
    pub fn from_acceleration_gain(
        k_over_t_body: f64,
        t_prop_s: f64,
        inv_t_body_per_s: f64,
        tau_s: f64,
    ) -> Result<Self, SoiptdError> {
        if !(k_over_t_body.is_finite() && k_over_t_body != 0.0) {
            return Err(SoiptdError::Gain(k_over_t_body));
        }
        if !(t_prop_s.is_finite() && t_prop_s > 0.0) {
            return Err(SoiptdError::TProp(t_prop_s));
        }
        if !(inv_t_body_per_s.is_finite() && inv_t_body_per_s >= 0.0) {
            return Err(SoiptdError::TBody(1.0 / inv_t_body_per_s));
        }
        if !(tau_s.is_finite() && tau_s >= 0.0) {
            return Err(SoiptdError::Tau(tau_s));
        }
        Ok(Self {
            k_over_t_body,
            t_prop_s,
            inv_t_body_per_s,
            tau_s,
        })
    }

    /// Acceleration gain `K/T_body`: output unit / (input unit s^2).
    #[must_use]
    pub fn k_over_t_body(&self) -> f64 {
        self.k_over_t_body
    }

    /// `K/(T_body T_prop)` (output unit / (input unit s^3)): third derivative of the output right after a unit
    /// step of the input, from rest. Unlike `K/T_body` it does not change when the two lags are exchanged.
    #[must_use]
    pub fn jerk_gain(&self) -> f64 {
        self.k_over_t_body / self.t_prop_s
    }

    /// Velocity gain `K`: output unit / (input unit s); `None` without damping.
    #[must_use]
    pub fn k(&self) -> Option<f64> {
        self.t_body_s()
            .map(|t_body_s| self.k_over_t_body * t_body_s)
    }

    /// Lag of the actuator (s).
    #[must_use]
    pub fn t_prop_s(&self) -> f64 {
        self.t_prop_s
    }

    /// Damping rate of the body, `1/T_body` (1/s); zero for a double integrator.
    #[must_use]
    pub fn inv_t_body_per_s(&self) -> f64 {
        self.inv_t_body_per_s
    }

    /// Time constant of the body (s); `None` without damping.
    #[must_use]
    pub fn t_body_s(&self) -> Option<f64> {
        // Not divided to infinity and then refused: firmware may trap a division by zero.
        (self.inv_t_body_per_s >= f64::MIN_POSITIVE).then(|| 1.0 / self.inv_t_body_per_s)
    }

    /// Dead time (s).
    #[must_use]
    pub fn tau_s(&self) -> f64 {
        self.tau_s
    }

    /// The same process with its acceleration gain multiplied by `factor`.
    ///
    /// # Errors
    /// [`SoiptdError::Gain`] if the product is zero or not finite.
    pub fn with_gain_scaled(&self, factor: f64) -> Result<Self, SoiptdError> {
        Self::from_acceleration_gain(
            self.k_over_t_body * factor,
            self.t_prop_s,
            self.inv_t_body_per_s,
            self.tau_s,
        )
    }

    /// The same process with `delay_s` added to its dead time (s).
    ///
    /// # Errors
    /// [`SoiptdError`] if the sum is negative or not finite.
    pub fn delayed(&self, delay_s: f64) -> Result<Self, SoiptdError> {
        Self::from_acceleration_gain(
            self.k_over_t_body,
            self.t_prop_s,
            self.inv_t_body_per_s,
            self.tau_s + delay_s,
        )
    }

    /// Magnitude `|G(jw)|`.
    #[must_use]
    pub fn magnitude(&self, omega_rad_per_s: f64) -> f64 {
        let w = omega_rad_per_s;
        self.k_over_t_body.abs()
            / (w * hypot(1.0, w * self.t_prop_s) * hypot(self.inv_t_body_per_s, w))
    }

    /// Unwrapped phase of `G(jw)` for a positive gain (rad). It falls monotonically with `w`, from `-pi/2`, or
    /// from `-pi` without damping.
    #[must_use]
    pub fn phase_rad(&self, omega_rad_per_s: f64) -> f64 {
        let w = omega_rad_per_s;
        let body = if self.inv_t_body_per_s > 0.0 {
            atan(w / self.inv_t_body_per_s)
        } else {
            FRAC_PI_2
        };
        -FRAC_PI_2 - body - atan(w * self.t_prop_s) - w * self.tau_s
    }

    /// Frequency (rad/s) at which the phase of `G` is `phase_rad`; `None` if there is no such frequency.
    #[must_use]
    pub fn frequency_at_phase(&self, phase_rad: f64) -> Option<f64> {
        // The fastest time of the process gives an upper bound of the frequency, the slowest a lower bound.
        let sum_s = self.t_prop_s + self.tau_s;
        let (mut low, mut high) = (
            log(1e-9 * (self.inv_t_body_per_s + 1.0 / sum_s)),
            log(1e9 / sum_s),
        );
        if self.phase_rad(exp(low)) < phase_rad || self.phase_rad(exp(high)) > phase_rad {
            return None;
        }
        // Bisection in the logarithm of the frequency: 64 halvings of 50 nepers end below one rounding.
        for _ in 0..64 {
            let middle = 0.5 * (low + high);
            if self.phase_rad(exp(middle)) > phase_rad {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(exp(0.5 * (low + high)))
    }

    /// Describing-function estimate of the relay oscillation (equations 6 and 7 of the paper): frequency (rad/s)
    /// at which `arg G = -pi + asin(beta)`, and amplitude `4 h / pi |G|`.
    ///
    /// The error is 5 to 30 %. Use the estimate for durations and starting values only. `None` if the condition
    /// has no solution, for example for a double integrator with `beta >= 0`.
    #[must_use]
    pub fn describing_function_oscillation(
        &self,
        relay_amplitude: f64,
        beta: f64,
    ) -> Option<(f64, f64)> {
        let omega = self.frequency_at_phase(-PI + asin(beta))?;
        Some((omega, 4.0 * relay_amplitude / PI * self.magnitude(omega)))
    }

    /// The two poles besides the integrator as `(sum, product / sum^2)`, in 1/s and without unit, 0 to 1/4.
    ///
    /// `G` depends on the two lags only through these values. They are regular where the lags are equal (1/4)
    /// and where damping vanishes (0). See [`Soiptd::from_pole_sum`].
    #[must_use]
    pub fn pole_sum(&self) -> (f64, f64) {
        let prop = 1.0 / self.t_prop_s;
        let sum = prop + self.inv_t_body_per_s;
        (sum, prop * self.inv_t_body_per_s / (sum * sum))
    }

    /// A process from the coordinates of [`Soiptd::pole_sum`]. The faster pole becomes the lag of the actuator.
    ///
    /// # Errors
    /// The first parameter that is out of range.
    pub fn from_pole_sum(
        k_over_t_body: f64,
        pole_sum_per_s: f64,
        pole_ratio: f64,
        tau_s: f64,
    ) -> Result<Self, SoiptdError> {
        let spread = sqrt((1.0 - 4.0 * pole_ratio).max(0.0));
        let fast = 0.5 * pole_sum_per_s * (1.0 + spread);
        // The slow pole from Vieta's product: the difference would lose its digits as the pole vanishes.
        let slow = pole_ratio * pole_sum_per_s * pole_sum_per_s / fast;
        Self::from_acceleration_gain(k_over_t_body, 1.0 / fast, slow, tau_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, tolerance: f64) -> bool {
        (a - b).abs() <= tolerance * b.abs()
    }

    // Section 2 of the method, describing-function column of the table: h = 1, K = 1, beta = -0.73.
    #[test]
    fn describing_function_matches_the_table() {
        for (t_prop, t_body, tau, period, amplitude) in [
            (0.3, 2.0, 0.1, 2.2055, 0.05873),
            (0.3, 2.0, 0.0005, 1.4117, 0.01915),
            (0.015, 0.2, 0.1, 0.5777, 0.04827),
            (0.015, 0.2, 0.0005, 0.0833, 0.00074),
            (0.0321, 1.6886, 0.0237, 0.3919, 0.00261),
        ] {
            let process = Soiptd::new(1.0, t_prop, t_body, tau).unwrap();
            let (omega, a0) = process.describing_function_oscillation(1.0, -0.73).unwrap();
            assert!(
                (2.0 * PI / omega - period).abs() < 6e-5,
                "period {}",
                2.0 * PI / omega
            );
            assert!((a0 - amplitude).abs() < 6e-6, "amplitude {a0}");
        }
    }

    #[test]
    fn double_integrator_has_no_oscillation_without_lead() {
        let process = Soiptd::from_acceleration_gain(1.0, 0.05, 0.0, 0.03).unwrap();
        assert!(process.describing_function_oscillation(1.0, 0.0).is_none());
        assert!(
            process
                .describing_function_oscillation(1.0, -0.73)
                .is_some()
        );
        assert_eq!((process.k(), process.t_body_s()), (None, None));
    }

    #[test]
    fn pole_sum_is_a_round_trip() {
        for (t_prop, inv_t_body) in [
            (0.05, 0.0),
            (0.05, 1e-9),
            (0.2, 5.0),
            (0.1, 10.0),
            (0.015, 0.5),
        ] {
            let process = Soiptd::from_acceleration_gain(3.0, t_prop, inv_t_body, 0.02).unwrap();
            let (sum, ratio) = process.pole_sum();
            let back = Soiptd::from_pole_sum(3.0, sum, ratio, 0.02).unwrap();
            // At equal poles the square root loses half of the digits.
            assert!(close(back.t_prop_s(), t_prop, 1e-7));
            assert!((back.inv_t_body_per_s() - inv_t_body).abs() <= 1e-7 * inv_t_body);
        }
    }

    #[test]
    fn errors_name_the_parameter() {
        assert_eq!(Soiptd::new(0.0, 0.1, 1.0, 0.0), Err(SoiptdError::Gain(0.0)));
        assert_eq!(
            Soiptd::new(1.0, -0.1, 1.0, 0.0),
            Err(SoiptdError::TProp(-0.1))
        );
        assert_eq!(
            Soiptd::new(1.0, 0.1, 0.0, 0.0),
            Err(SoiptdError::TBody(0.0))
        );
        assert_eq!(
            Soiptd::new(1.0, 0.1, 1.0, -1.0),
            Err(SoiptdError::Tau(-1.0))
        );
        assert!(matches!(
            Soiptd::new(f64::NAN, 0.1, 1.0, 0.0),
            Err(SoiptdError::Gain(_))
        ));
    }
}
