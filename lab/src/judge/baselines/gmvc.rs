//! PX4's gains: a PID of the rate by generalised minimum variance on the model of [`arx`](super::arx),
//! and a proportional gain of the angle around it.
//!
//! T. Yamamoto, K. Fujii, M. Kaneda, "Design and implementation of a self-tuning PID controller" (1998), in
//! the form and with the numbers that PX4 flies (`mc_autotune_attitude_control`, library `pid_design`).
//!
//! **The law.** With `A = 1 + a1 q + a2 q^2`, `B = b0 + b1 q + b2 q^2`, `q` a delay of one sample and
//! `D = 1 - q`, the law minimises the variance of `P v + lambda D u - F(1) w` two samples ahead, where
//! `w` is the commanded rate. It is two samples because PX4 counts one more than the model has. The
//! prediction splits off by
//!
//! ```text
//! P = D A (1 + e1 q) + q^2 (f0 + f1 q + f2 q^2),      P = 1 + p1 q + p2 q^2
//! e1 = 1 - a1 + p1                      from q
//! f0 = p2 + a1 - a2 + e1 (1 - a1)       from q^2
//! f1 = a2 + e1 (a1 - a2)                from q^3
//! f2 = a2 e1                            from q^4
//! ```
//!
//! and `D u = (F(1) w - F v)/(E B + lambda)`. With the static value of the denominator, `nu = (1 +
//! e1)(b0 + b1 + b2) + lambda`, this is a PID whose proportional and derivative parts act on the
//! measurement. The powers of `q` in `F/nu = k (D + dt/Ti + Td/dt D^2)` give
//!
//! ```text
//! k = -(f1 + 2 f2)/nu,   1/Ti = -(f0 + f1 + f2)/(dt (f1 + 2 f2)),   Td = -dt f2/(f1 + 2 f2)
//! ```
//!
//! PX4 takes a fifth of this integral part, and the proportional part acts on the error.
//!
//! **Reference model.** `P` is `1 + sigma s + mu sigma^2 s^2` in discrete time, `sigma` the rise time.
//! With `rho = dt/sigma`
//!
//! ```text
//! p1 = -2 exp(-rho/(2 mu)) cos(sqrt(4 mu - 1) rho/(2 mu)),   p2 = exp(-rho/mu)
//! ```
//!
//! PX4 uses critical damping, `mu` = 1/4.
//!
//! **The angle.** An error of 60 degrees commands the full torque: `angle_p = 1/(pi/3 k)`, limited to 2
//! to 6.5 1/s.
//!
//! **Units.** Rise time, detuning `lambda` and the rule for the angle are numbers for vehicles:
//! seconds, radians, full torque. On other processes they must be scaled with the process for a fair
//! comparison ([`Design::scaled_to_oscillation`]).

use std::f64::consts::PI;

use super::arx::Model;
use super::{BaselineError, steady_cycles};
use onecycle_design::cascade::Cascade;
use onecycle_identify::{MOST_CYCLES, Signals};

/// Part of the law's integral that PX4 uses.
const INTEGRAL_PART: f64 = 0.2;

/// Design parameters of the law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Design {
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

/// A vehicle for which PX4's numbers are right: the relay test of JSBSim's F450 in roll
/// (`examples/jsbsim_f450_roll_clean.csv`): period (s), amplitude (rad), amplitude of the relay (part
/// of the torque).
const VEHICLE: (f64, f64, f64) = (0.503, 0.172, 0.05);

impl Design {
    /// PX4's own numbers, for a recording in radians and parts of the torque.
    pub const PX4: Self = Self {
        rise_time_s: 0.14,
        damping: 0.25,
        detuning: 0.7,
        stiffness: 3.0 / PI,
        angle_p_range: (2.0, 6.5),
    };

    /// PX4's numbers scaled with the oscillation; equal to them for the vehicle that they are made for.
    ///
    /// # Errors
    /// [`BaselineError::NoOscillation`], [`BaselineError::Uneven`].
    pub fn scaled_to_oscillation(signals: &Signals<'_>) -> Result<Self, BaselineError> {
        let (found, _) = steady_cycles(signals, MOST_CYCLES)?;
        let (period_s, amplitude, relay) = VEHICLE;
        let slower = found.period_s / period_s;
        let stronger = (found.amplitude / found.relay_amplitude) / (amplitude / relay);
        let (least, most) = Self::PX4.angle_p_range;
        Ok(Self {
            rise_time_s: Self::PX4.rise_time_s * slower,
            damping: Self::PX4.damping,
            detuning: Self::PX4.detuning * stronger / slower,
            stiffness: Self::PX4.stiffness / stronger,
            angle_p_range: (least / slower, most / slower),
        })
    }

    /// The gains for a model.
    ///
    /// # Errors
    /// [`BaselineError::NotThisProcess`] if proportional, integral or derivative gain is negative; PX4
    /// does not fly such gains either.
    pub fn cascade(&self, model: &Model) -> Result<Cascade, BaselineError> {
        let [a1, a2, b0, b1, b2] = model.coefficients;
        let (mu, rho) = (self.damping, model.sample_s / self.rise_time_s);
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
        let rate_i = INTEGRAL_PART * (f0 + f1 + f2) / (model.sample_s * proportional);
        let rate_d = (model.sample_s * f2 / proportional).max(0.0);
        if !(rate_p > 0.0 && rate_p.is_finite() && rate_i > 0.0) {
            return Err(BaselineError::NotThisProcess(
                "the gains that follow from it are not positive",
            ));
        }
        let (least, most) = self.angle_p_range;
        Ok(Cascade {
            angle_p: (self.stiffness / rate_p).clamp(least, most),
            rate_p,
            rate_i,
            rate_d,
        })
    }
}
