//! The loop cut open: controller times process, all that stability and cost depend on.
//!
//! ```text
//!                             D(s) e^(-tau s)
//! L(s) = (Kp + Kd s) G(s)  =  ---------------,   C(s) = s (T_prop s + 1)(s + 1/T_body)
//!                                  C(s)          D(s) = kp + kd s
//! ```
//!
//! with the gains of the controller multiplied by the acceleration gain `A = K/T_body`:
//!
//! | symbol | name        | unit  |
//! |--------|-------------|-------|
//! | A Kp   | `kp`        | 1/s^2 |
//! | A Kd   | `kd`        | 1/s   |
//! | 1/T_body | `damping` | 1/s   |
//! | T_prop | `lag_s`     | s     |
//! | tau    | `tau_s`     | s     |
//!
//! With `kp > 0` the magnitude falls monotonically, from infinity to zero, so there is exactly one
//! gain crossover, and the loop is stable exactly when its unwrapped phase there is above `-pi`.

use num_complex::Complex64;
use onecycle_onboard::{Pd, Soiptd};

use crate::roots::falling_root;

/// Steps that Newton's method is allowed; it takes about six.
const MAX_NEWTON_STEPS: usize = 60;

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
    /// `None` where `Kp K` is not positive: that loop is unstable whatever the rest (its closed
    /// loop has a real pole at or right of zero), and its crossover need not exist.
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

    /// The loop whose gain crossover is `omega` and whose controller leads there by `lead_rad`.
    pub fn crossing_at(process: &Soiptd, omega: f64, lead_rad: f64) -> Self {
        // 1/|G| for A = 1, but for the integrator.
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

    /// Gains of the controller that closes this loop around `process`.
    pub fn pd(&self, process: &Soiptd) -> Pd {
        let gain = process.k_over_t_body();
        Pd {
            kp: self.kp / gain,
            kd: self.kd / gain,
        }
    }

    /// Gain crossover (rad/s): `|D|^2 = |C|^2` is a cubic in `x = w^2` with one positive root,
    ///
    /// `T_prop^2 x^3 + (1 + (T_prop/T_body)^2) x^2 - (kd^2 - 1/T_body^2) x - kp^2 = 0`.
    ///
    /// Newton's method falls onto it monotonically from any bound above, for the cubic is convex.
    pub fn gain_crossover(&self) -> f64 {
        let c3 = self.lag_s * self.lag_s;
        let c2 = 1.0 + (self.lag_s * self.damping).powi(2);
        let c1 = (self.kd - self.damping) * (self.kd + self.damping);
        let c0 = self.kp * self.kp;
        // Two bounds: the root without the cubic term, and that without the quadratic one.
        let discriminant = (c1 * c1 + 4.0 * c2 * c0).sqrt();
        let without_cubic = if c1 > 0.0 {
            (discriminant + c1) / (2.0 * c2)
        } else {
            2.0 * c0 / (discriminant - c1)
        };
        let without_quadratic = (c1.max(0.0) / c3).sqrt() + (c0 / c3).cbrt();
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
        x.sqrt()
    }

    /// `pi` plus the unwrapped phase of `L(jw)` (rad): the phase margin where `w` is the crossover.
    pub fn phase_above_minus_pi(&self, omega: f64) -> f64 {
        process_phase_above_minus_pi(self.damping, self.lag_s, self.tau_s, omega)
            + self.lead_rad(omega)
    }

    /// Phase that the controller adds at `omega` (rad), between `-pi/2` and `pi/2`.
    pub fn lead_rad(&self, omega: f64) -> f64 {
        (self.kd * omega).atan2(self.kp)
    }

    /// Frequency (rad/s) where the phase passes `-pi`, at most once and downwards; `None` where it
    /// never does.
    ///
    /// Once only: with `h(w) = atan(w kd/kp) - atan(w T_prop) - w tau` the phase above `-pi` is
    /// `atan(1/(w T_body)) + h(w)`. `h` rises from zero, if at all, and then falls for good, and
    /// where it is positive so is the sum; from there on both terms fall.
    pub fn phase_crossover(&self) -> Option<f64> {
        if self.tau_s > 0.0 {
            falling_root(
                |omega| self.phase_above_minus_pi(omega),
                self.gain_crossover(),
            )
        } else {
            // Im L = 0, solved by hand.
            let fall = self.kp * self.lag_s - self.kd * (1.0 + self.damping * self.lag_s);
            let omega = (self.kp * self.damping / fall).sqrt();
            (omega.is_finite() && omega > 0.0).then_some(omega)
        }
    }

    /// Magnitude `|L(jw)|`.
    pub fn magnitude(&self, omega: f64) -> f64 {
        self.kp.hypot(self.kd * omega)
            / (omega * (omega * self.lag_s).hypot(1.0) * self.damping.hypot(omega))
    }

    /// Numerator `D(s) e^(-tau s)` and denominator `C(s)`.
    pub fn fraction(&self, s: Complex64) -> (Complex64, Complex64) {
        let delayed = (-s * self.tau_s).exp() * (s * self.kd + self.kp);
        (delayed, s * (s * self.lag_s + 1.0) * (s + self.damping))
    }
}

/// `pi` plus the unwrapped phase of the process alone (rad); falls monotonically with `omega`.
fn process_phase_above_minus_pi(damping: f64, lag_s: f64, tau_s: f64, omega: f64) -> f64 {
    damping.atan2(omega) - (omega * lag_s).atan() - omega * tau_s
}

/// Lead that gives the loop of `process` the phase margin at the gain crossover `omega` (rad);
/// rises monotonically with `omega`.
pub fn lead_for_margin(process: &Soiptd, omega: f64, phase_margin_rad: f64) -> f64 {
    phase_margin_rad
        - process_phase_above_minus_pi(
            process.inv_t_body_per_s(),
            process.t_prop_s(),
            process.tau_s(),
            omega,
        )
}
