//! Open loop of an integrator with two lags and dead time under a PD: gain and phase crossover.
//!
//! ```text
//!                             D(s) e^(-tau s)
//! L(s) = (Kp + Kd s) G(s)  =  ---------------,   C(s) = s (T_prop s + 1)(s + 1/T_body)
//!                                  C(s)          D(s) = kp + kd s
//! ```
//!
//! The controller gains are multiplied by the acceleration gain `A = K/T_body`:
//!
//! | symbol | name        | unit  |
//! |--------|-------------|-------|
//! | A Kp   | `kp`        | 1/s^2 |
//! | A Kd   | `kd`        | 1/s   |
//! | 1/T_body | `damping` | 1/s   |
//! | T_prop | `lag_s`     | s     |
//! | tau    | `tau_s`     | s     |
//!
//! For `kp > 0` the magnitude falls monotonically from infinity to zero. So there is exactly one gain crossover, and
//! the loop is stable if and only if its unwrapped phase at the gain crossover is above `-pi`.

use num_complex::Complex64;
use onecycle_onboard::{Pd, Soiptd, crossover};

use crate::roots::falling_root;

/// A loop with positive proportional gain. See the [module](self) for symbols and units.
#[derive(Clone, Copy, Debug)]
pub struct OpenLoop {
    /// `A Kp` (1/s^2).
    pub kp: f64,
    /// `A Kd` (1/s).
    pub kd: f64,
    /// `1/T_body` (1/s).
    pub damping: f64,
    /// `T_prop` (s).
    pub lag_s: f64,
    /// `tau` (s).
    pub tau_s: f64,
}

impl OpenLoop {
    /// Open loop of `process` under `pd`.
    ///
    /// `None` if `K Kp` is not positive and finite or `K Kd` is not finite. A loop with `K Kp <= 0` is unstable (a real
    /// closed-loop pole is zero or positive), and its gain crossover may not exist.
    #[must_use]
    pub fn new(process: &Soiptd, pd: Pd) -> Option<Self> {
        let gain = process.k_over_t_body();
        let (kp, kd) = (gain * pd.kp, gain * pd.kd);
        let usable = kp > 0.0 && kp.is_finite() && kd.is_finite();
        usable.then_some(Self {
            kp,
            kd,
            damping: process.inv_t_body_per_s(),
            lag_s: process.t_prop_s(),
            tau_s: process.tau_s(),
        })
    }

    /// Open loop of `process` whose gain crossover is `omega` (rad/s), where the controller adds the phase `lead_rad`.
    #[must_use]
    pub fn crossing_at(process: &Soiptd, omega: f64, lead_rad: f64) -> Self {
        // 1/|G| for A = 1, without the integrator.
        let lags =
            (omega * process.t_prop_s()).hypot(1.0) * process.inv_t_body_per_s().hypot(omega);
        Self {
            kp: lead_rad.cos() * omega * lags,
            kd: lead_rad.sin() * lags,
            damping: process.inv_t_body_per_s(),
            lag_s: process.t_prop_s(),
            tau_s: process.tau_s(),
        }
    }

    /// Gains of the PD that has this open loop with `process`.
    #[must_use]
    pub fn pd(&self, process: &Soiptd) -> Pd {
        let gain = process.k_over_t_body();
        Pd {
            kp: self.kp / gain,
            kd: self.kd / gain,
        }
    }

    /// Gain crossover (rad/s), as on board: see [`onecycle_onboard::crossover`].
    pub fn gain_crossover(&self) -> f64 {
        crossover::gain_crossover(self.kp, self.kd, self.damping, self.lag_s, f64::cbrt)
    }

    /// `pi` plus the unwrapped phase of `L(jw)` (rad) at `omega` (rad/s). At the gain crossover this is the phase
    /// margin.
    #[must_use]
    pub fn phase_above_minus_pi(&self, omega: f64) -> f64 {
        process_phase_above_minus_pi(self.damping, self.lag_s, self.tau_s, omega)
            + self.lead_rad(omega)
    }

    /// Phase that the controller adds at `omega` (rad), between `-pi/2` and `pi/2`.
    #[must_use]
    pub fn lead_rad(&self, omega: f64) -> f64 {
        (self.kd * omega).atan2(self.kp)
    }

    /// Phase crossover (rad/s): frequency at which the unwrapped phase falls through `-pi`. `None` if it never does.
    ///
    /// There is at most one. With `h(w) = atan(w kd/kp) - atan(w T_prop) - w tau` the phase above `-pi` is
    /// `atan(1/(w T_body)) + h(w)`. Starting from zero, `h` may first rise and then falls without end. Where `h` is
    /// positive the sum is positive too; beyond that both terms fall, so the sum crosses zero at most once.
    #[must_use]
    pub fn phase_crossover(&self) -> Option<f64> {
        if self.tau_s > 0.0 {
            falling_root(
                |omega| self.phase_above_minus_pi(omega),
                self.gain_crossover(),
            )
        } else {
            // No dead time: Im L = 0 has this closed-form solution.
            let fall = self.kp * self.lag_s - self.kd * (1.0 + self.damping * self.lag_s);
            let omega = (self.kp * self.damping / fall).sqrt();
            (omega.is_finite() && omega > 0.0).then_some(omega)
        }
    }

    /// Magnitude `|L(jw)|` at `omega` (rad/s).
    #[must_use]
    pub fn magnitude(&self, omega: f64) -> f64 {
        self.kp.hypot(self.kd * omega)
            / (omega * (omega * self.lag_s).hypot(1.0) * self.damping.hypot(omega))
    }

    /// Numerator `D(s) e^(-tau s)` and denominator `C(s)` of the open loop.
    #[must_use]
    pub fn fraction(&self, s: Complex64) -> (Complex64, Complex64) {
        let delayed = (-s * self.tau_s).exp() * (s * self.kd + self.kp);
        (delayed, s * (s * self.lag_s + 1.0) * (s + self.damping))
    }
}

/// `pi` plus the unwrapped phase of the process alone (rad). Falls monotonically with `omega`.
fn process_phase_above_minus_pi(damping: f64, lag_s: f64, tau_s: f64, omega: f64) -> f64 {
    damping.atan2(omega) - (omega * lag_s).atan() - omega * tau_s
}

/// Lead (rad) that the controller must add at the gain crossover `omega` (rad/s) for this phase margin. Rises
/// monotonically with `omega`.
#[must_use]
pub fn lead_for_margin(process: &Soiptd, omega: f64, phase_margin_rad: f64) -> f64 {
    phase_margin_rad
        - process_phase_above_minus_pi(
            process.inv_t_body_per_s(),
            process.t_prop_s(),
            process.tau_s(),
            omega,
        )
}
