//! Proportional-derivative control with the derivative on the measurement only:
//! `u = kp (r - y) - kd dy/dt`.
//!
//! The form behind the paper's cost (section 3 of its method). It is the cascade that autopilots
//! fly: `u = rate_p (angle_p (r - y) - dy/dt)` with `angle_p = kp / kd` (1/s) and `rate_p = kd`.

/// Gains of the controller. Units: `kp` input unit / output unit, `kd` the same times seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pd {
    /// Proportional gain: input unit / output unit.
    pub kp: f64,
    /// Derivative gain: input unit s / output unit.
    pub kd: f64,
}

impl Pd {
    /// Outer gain of the equivalent cascade, `kp / kd` (1/s): angle P of an autopilot.
    #[must_use]
    pub fn angle_p(&self) -> f64 {
        self.kp / self.kd
    }

    /// Inner gain of the equivalent cascade, `kd`: rate P of an autopilot.
    #[must_use]
    pub fn rate_p(&self) -> f64 {
        self.kd
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // u = 6 (2 - 0.5) - 1.5 * 0.8 = 7.8; as a cascade 1.5 (4 (2 - 0.5) - 0.8), the same.
    #[test]
    fn the_cascade_is_the_controller() {
        let pd = Pd { kp: 6.0, kd: 1.5 };
        let (error, rate) = (1.5, 0.8);
        let cascade = pd.rate_p() * (pd.angle_p() * error - rate);
        assert_eq!((pd.angle_p(), pd.rate_p()), (4.0, 1.5));
        assert!((cascade - 7.8).abs() < 1e-14);
        assert!((pd.kp * error - pd.kd * rate - 7.8).abs() < 1e-14);
    }
}
