//! PD control with the derivative on the measurement only.
//!
//! ```text
//! u = offset + kp (r - y) - kd dy/dt
//! ```
//!
//! | symbol | name         | unit                    |
//! |--------|--------------|-------------------------|
//! | u      | returned     | input unit              |
//! | r, y   | `reference`, `value` | output unit     |
//! | dy/dt  | `rate`       | output unit / s         |
//! | kp     | `kp`         | input unit / output unit|
//! | kd     | `kd`         | input unit s / output unit |
//! | offset | `offset`     | input unit              |
//!
//! It is the controller of the paper's cost (section 3 of its method), and the cascade of autopilots: `u =
//! rate_p (angle_p (r - y) - dy/dt)` with `angle_p = kp / kd` (1/s) and `rate_p = kd`.

/// Gains of the controller.
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

/// Measurement at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Output of the process (output unit).
    pub value: f32,
    /// Rate of the output (output unit / s), if a sensor such as a gyroscope measures it.
    pub rate: Option<f32>,
    /// Age of both (s).
    pub age_s: f32,
}

impl Measurement {
    /// A fresh value without a measured rate; the rate is computed from differences.
    #[must_use]
    pub fn of(value: f32) -> Self {
        Self {
            value,
            rate: None,
            age_s: 0.0,
        }
    }

    /// The same measurement with the rate from its own sensor.
    #[must_use]
    pub fn with_rate(self, rate: f32) -> Self {
        Self {
            rate: Some(rate),
            ..self
        }
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.value.is_finite() && self.rate.is_none_or(f32::is_finite) && self.age_s.is_finite()
    }
}

/// Rate of the output: measured, or the filtered difference of the values.
#[derive(Clone, Copy, Debug, Default)]
pub struct RateEstimate {
    last_value: Option<f32>,
    rate: f32,
}

impl RateEstimate {
    /// Rate (output unit / s) at the next tick, `dt_s > 0` after the last. `lag_s` is the time constant of the
    /// filter for a rate that is not measured.
    #[inline]
    pub fn step(&mut self, measurement: &Measurement, dt_s: f32, lag_s: f32) -> f32 {
        let last = self.last_value.replace(measurement.value);
        self.rate = match (measurement.rate, last) {
            (Some(rate), _) => rate,
            (None, None) => 0.0,
            (None, Some(last)) => {
                let difference = (measurement.value - last) / dt_s;
                self.rate + dt_s / (dt_s + lag_s) * (difference - self.rate)
            }
        };
        self.rate
    }

    /// The rate at the last tick (output unit / s).
    #[must_use]
    pub fn rate(&self) -> f32 {
        self.rate
    }
}

/// The control law as it runs at every tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PdLaw {
    /// Proportional gain: input unit / output unit.
    pub kp: f32,
    /// Derivative gain: input unit s / output unit.
    pub kd: f32,
    /// Input that holds the process at rest (input unit).
    pub offset: f32,
}

impl PdLaw {
    /// No gains and no offset: zero output.
    pub const ZERO: Self = Self {
        kp: 0.0,
        kd: 0.0,
        offset: 0.0,
    };

    /// The law with these gains and this offset.
    #[must_use]
    pub fn new(pd: Pd, offset: f32) -> Self {
        Self {
            kp: pd.kp as f32,
            kd: pd.kd as f32,
            offset,
        }
    }

    /// Input at a tick (input unit), not limited.
    #[inline]
    #[must_use]
    pub fn output(&self, reference: f32, value: f32, rate: f32) -> f32 {
        self.offset + self.kp * (reference - value) - self.kd * rate
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.kp.is_finite() && self.kd.is_finite() && self.offset.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // 1.25 + 6 (2 - 0.5) - 1.5 * 0.5 = 9.5, exact in binary.
    #[test]
    fn the_law_at_a_tick() {
        let law = PdLaw::new(Pd { kp: 6.0, kd: 1.5 }, 1.25);
        assert_eq!(law.output(2.0, 0.5, 0.5), 9.5);
        assert_eq!(PdLaw::ZERO.output(2.0, 0.5, 0.5), 0.0);
    }

    // Differences of a ramp of 2 per second at 1/64 s, filtered with a lag of 3/64 s: the step response of the
    // lag, 2 (1 - (3/4)^n) after n of them. A measured rate is used as it is.
    #[test]
    fn rates_from_differences_and_from_a_sensor() {
        let (dt_s, lag_s) = (1.0 / 64.0, 3.0 / 64.0);
        let mut estimate = RateEstimate::default();
        assert_eq!(estimate.step(&Measurement::of(5.0), dt_s, lag_s), 0.0);
        for n in 1..=8 {
            let value = 5.0 + 2.0 * n as f32 / 64.0;
            let rate = estimate.step(&Measurement::of(value), dt_s, lag_s);
            let expected = 2.0 * (1.0 - libm::powf(0.75, n as f32));
            assert!((rate - expected).abs() < 1e-5, "{n} {rate} {expected}");
        }
        let measured = Measurement::of(0.0).with_rate(-3.5);
        assert_eq!(estimate.step(&measured, dt_s, lag_s), -3.5);
        assert_eq!(estimate.rate(), -3.5);
    }

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
