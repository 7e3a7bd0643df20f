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
