//! Take-off: integrator that lifts a vehicle without a controller (equation 17 of the paper).
//!
//! ```text
//! u_i(t) = k_i integral (r - y) dt    while y < r and dy/dt < climb
//! u_i(t) = u_i(t-)                    otherwise
//! ```
//!
//! | symbol | name    | unit                        |
//! |--------|---------|-----------------------------|
//! | u_i    | returned| input unit                  |
//! | k_i    | `gain`  | input unit / (output unit s)|
//! | climb  | `climb` | output unit / s             |
//! | r, y   | `error` is `r - y` | output unit      |
//!
//! The paper writes "or" between the two conditions. Then the integral would grow during the whole climb, and
//! the vehicle would overshoot. With "and" it stops when the vehicle has left the ground, close to the thrust of
//! hover minus the amplitude of the relay (`docs/decisions/0013-tuner.md`).

/// Settings of the take-off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TakeOffSettings {
    /// Gain of the integrator, `k_i`: input unit / (output unit s).
    pub gain: f32,
    /// Rate of the output above which the integrator holds (output unit / s).
    pub climb: f32,
}

impl TakeOffSettings {
    /// The first setting that is not positive and finite: name and value.
    pub(crate) fn out_of_range(&self) -> Option<(&'static str, f32)> {
        [
            ("the integrator's gain", self.gain),
            ("the climb allowed", self.climb),
        ]
        .into_iter()
        .find(|&(_, value)| !(value.is_finite() && value > 0.0))
    }
}

/// Integral at the next tick (input unit).
#[inline]
pub(crate) fn lift(
    settings: &TakeOffSettings,
    integral: f32,
    error: f32,
    rate: f32,
    dt_s: f32,
) -> f32 {
    if error > 0.0 && rate < settings.climb {
        integral + settings.gain * error * dt_s
    } else {
        integral
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // 0.5 per second and unit of error: 0.25 + 0.5 * 2 * 0.25 = 0.5, exact in binary.
    #[test]
    fn it_lifts_below_the_reference_and_waits_while_climbing() {
        let settings = TakeOffSettings {
            gain: 0.5,
            climb: 1.0,
        };
        assert_eq!(lift(&settings, 0.25, 2.0, 0.5, 0.25), 0.5);
        assert_eq!(lift(&settings, 0.25, 2.0, 1.0, 0.25), 0.25);
        assert_eq!(lift(&settings, 0.25, -2.0, 0.0, 0.25), 0.25);
    }
}
