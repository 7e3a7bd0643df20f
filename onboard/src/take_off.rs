//! The integrator that lifts a vehicle which has no controller yet: the paper's equation 17.
//!
//! ```text
//! u_i(t) = k_i integral (r - y) dt    while y < r and dy/dt < the climb allowed
//! u_i(t) = u_i(t-)                    otherwise
//! ```
//!
//! The paper writes "or" between the two conditions. With it the integral grows all the way up, however
//! fast the climb, and the vehicle shoots over; with "and" it stands still as soon as the vehicle has left the
//! ground, at about what holds it less the relay's amplitude (`docs/decisions/0013-tuner.md`).

/// How the integrator lifts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TakeOffSettings {
    /// Gain of the integrator, `k_i`: input unit / (output unit s).
    pub gain: f32,
    /// Rate of the output above which it waits (output unit / s).
    pub climb: f32,
}

impl TakeOffSettings {
    /// The first setting that is not positive and finite: its name and value.
    pub(crate) fn out_of_range(&self) -> Option<(&'static str, f32)> {
        [
            ("the integrator's gain", self.gain),
            ("the climb allowed", self.climb),
        ]
        .into_iter()
        .find(|&(_, value)| !(value.is_finite() && value > 0.0))
    }
}

/// The integral at the next tick (input unit).
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

    // 0.5 a second for each unit of error: 0.25 + 0.5 * 2 * 0.25 = 0.5, exact in binary.
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
