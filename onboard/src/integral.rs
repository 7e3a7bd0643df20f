//! Integral action beside a PD: removes the offset that payload, wind and trim leave.
//!
//! ```text
//! u = kp (b r - y) + ki int (r - y) dt - kd dy/dt
//!
//! ki = kp w tan(phi),     b = 1 - ki (kd + 1/K) / kp^2
//! ```
//!
//! | symbol | name         | unit                         |
//! |--------|--------------|------------------------------|
//! | kp, kd | [`Pd`]       | the PD stays as it is        |
//! | w      | gain crossover of the PD | rad/s            |
//! | phi    | `phase_rad`  | rad                          |
//! | ki     | `ki`         | input unit / (output unit s) |
//! | K      | velocity gain of the process | output unit / (input unit s) |
//! | b      | `setpoint_weight` | 0 to 1                  |
//!
//! The integral time `kp/ki = 1/(w tan(phi))` is the one at which the factor `1 + 1/(j w Ti)` of a PI controller lags by
//! `phi`. The derivative term leads, so beside it the integral costs less, about `phi cos(psi)^2` with the lead `psi` of
//! the PD, and the crossover falls a little: over the paper's multirotors 5 degrees cost 0.3 degrees of phase margin and
//! 1.2 % of `Ms` at most.
//!
//! Behind two integrations the error of a step must change its sign, so an integral adds overshoot. The weight `b` avoids
//! it: the error of a step under the PD integrates to `(kd + 1/K)/kp` of the step, which would charge the integral by
//! `ki (kd + 1/K)/kp`; the proportional term gives up just that, and the integral ends where it began.

use libm::{cos, sin};

use crate::control::Pd;
use crate::crossover::{gain_crossover, power_of_two_cube_root};
use crate::process::Soiptd;

/// Phase of [`Integral::beside`] that the tuner uses unless told otherwise (rad): 5 degrees. The offset then decays to a
/// tenth within `25/w`, and the ISE of a step grows by 4 to 15 %. At 10 degrees it decays twice as fast and costs up to 34 %
/// (`plant/tests/it/pid.rs`).
pub const USUAL_PHASE_RAD: f32 = 0.087_266_46;

/// Largest phase of [`Integral::beside`] (rad): at 20 degrees the set-point weight is zero.
pub const MOST_PHASE_RAD: f32 = 0.349_065_85;

/// Integral gain and set-point weight beside a PD. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integral {
    /// Integral gain (input unit / (output unit s)).
    pub ki: f64,
    /// Set-point weight, 0 to 1.
    pub setpoint_weight: f64,
}

impl Integral {
    /// No integral.
    pub const NONE: Self = Self {
        ki: 0.0,
        setpoint_weight: 1.0,
    };

    /// The integral beside `pd` on `process`, for a phase of `phase_rad` (rad). [`Integral::NONE`] if the phase is zero
    /// or the loop has no gain crossover.
    #[must_use]
    pub fn beside(pd: Pd, process: &Soiptd, phase_rad: f64) -> Self {
        let (gain, damping) = (process.k_over_t_body(), process.inv_t_body_per_s());
        let omega = gain_crossover(
            gain * pd.kp,
            gain * pd.kd,
            damping,
            process.t_prop_s(),
            power_of_two_cube_root,
        );
        // The tangent, without the code of a third function on the board.
        let ki = pd.kp * omega * sin(phase_rad) / cos(phase_rad);
        let setpoint_weight = 1.0 - ki * (pd.kd + damping / gain) / (pd.kp * pd.kp);
        if ki == 0.0 || !setpoint_weight.is_finite() {
            return Self::NONE;
        }
        Self {
            ki,
            setpoint_weight: setpoint_weight.clamp(0.0, 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use libm::{fabs, sqrt};

    use super::*;

    // Without damping and kd, A kp = sqrt(2)/T^2 crosses over at w = 1/T (see `crossover.rs`). With tan(phi) = 1/8:
    // ki = kp/(8 T). With kd the weight is 1 - ki kd/kp^2.
    #[test]
    fn by_hand() {
        let process = Soiptd::from_acceleration_gain(-2.0, 0.25, 0.0, 0.1).unwrap();
        let pd = Pd {
            kp: -sqrt(2.0) * 8.0,
            kd: 0.0,
        };
        let found = Integral::beside(pd, &process, libm::atan(0.125));
        assert!(fabs(found.ki / (0.5 * pd.kp) - 1.0) < 1e-12, "{found:?}");
        assert_eq!(found.setpoint_weight, 1.0);
        assert_eq!(Integral::beside(pd, &process, 0.0), Integral::NONE);
        let none = Pd {
            kp: 0.0,
            kd: -0.001,
        };
        assert_eq!(Integral::beside(none, &process, 0.1), Integral::NONE);
    }
}
