//! Relays of other relay tests, for methods that need an excitation of their own.

use onecycle_onboard::{Relay, RelayError, RelaySettings};
use onecycle_plant::{Controller, Sensed};

use super::experiment::ExperimentError;

/// The board's relay with a `beta` that moves linearly from one value to another and then stays there:
/// the experiment of the paper's estimation set II.
#[derive(Clone, Debug)]
pub struct SweptRelay {
    relay: Relay,
    from: f32,
    to: f32,
    duration_s: f64,
    elapsed_s: f64,
}

impl SweptRelay {
    /// Duration of the paper's sweep (s).
    pub const PAPER_DURATION_S: f64 = 20.0;

    /// The paper's sweep, from -0.1 to -0.9 in 20 s; `beta` of the settings is not used.
    ///
    /// # Errors
    /// Names the setting that is out of range.
    pub fn paper(settings: RelaySettings) -> Result<Self, RelayError> {
        Self::new(settings, (-0.1, -0.9), Self::PAPER_DURATION_S)
    }

    /// A sweep from the first `beta` to the second in `duration_s`; `beta` of the settings is not used.
    ///
    /// # Errors
    /// Names the setting that is out of range.
    pub fn new(
        settings: RelaySettings,
        (from, to): (f32, f32),
        duration_s: f64,
    ) -> Result<Self, RelayError> {
        let mut relay = Relay::new(RelaySettings {
            beta: from,
            ..settings
        })?;
        relay.set_beta(to)?;
        relay.set_beta(from)?;
        if !(duration_s.is_finite() && duration_s >= 0.0) {
            return Err(RelayError::Setting("the sweep", duration_s as f32));
        }
        Ok(Self {
            relay,
            from,
            to,
            duration_s,
            elapsed_s: 0.0,
        })
    }
}

impl Controller for SweptRelay {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        let part = if self.elapsed_s < self.duration_s {
            (self.elapsed_s / self.duration_s) as f32
        } else {
            1.0
        };
        self.elapsed_s += dt_s;
        // The relay accepts every value between two that it has accepted.
        let _ = self
            .relay
            .set_beta(self.from + part * (self.to - self.from));
        Controller::step(&mut self.relay, dt_s, reference, sensed)
    }
}

/// The rule of the modified relay alone, with amplitude one and without any protection, as in the published code of the paper's
/// authors: `u = sign(e + beta e0)`, `e0` the error of largest magnitude since its filtered derivative has last changed its
/// sign. Noise changes that sign at every sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlainRelay {
    beta: f64,
    lag_s: f64,
    last_error: f64,
    slope: f64,
    peak: f64,
    is_high: bool,
}

impl PlainRelay {
    /// Lag of the derivative's filter over the time in which the oscillation turns by one radian.
    pub const LAG: f64 = 0.2;

    /// A relay of this `beta`, -1 to 1, and this lag of the derivative (s).
    #[must_use]
    pub fn new(beta: f64, lag_s: f64) -> Self {
        Self {
            beta,
            lag_s,
            last_error: 0.0,
            slope: 0.0,
            peak: 0.0,
            is_high: true,
        }
    }
}

impl Controller for PlainRelay {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        let error = reference - sensed.output;
        let was_rising = self.slope > 0.0;
        let share = -(-dt_s / self.lag_s).exp_m1();
        self.slope += share * ((error - self.last_error) / dt_s - self.slope);
        self.last_error = error;
        if (self.slope > 0.0) != was_rising {
            self.peak = 0.0;
        }
        if error.abs() > self.peak.abs() {
            self.peak = error;
        }
        let switch = error + self.beta * self.peak;
        if switch != 0.0 {
            self.is_high = switch > 0.0;
        }
        if self.is_high { 1.0 } else { -1.0 }
    }
}

/// A relay with two unequal levels and a hysteresis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricRelay {
    high: f64,
    low: f64,
    hysteresis: f64,
    is_high: bool,
}

impl AsymmetricRelay {
    /// A relay that starts high. `high` is positive, `low` negative (input unit). The output switches when
    /// the error passes the hysteresis (output unit), which should lie above the noise.
    ///
    /// # Errors
    /// [`ExperimentError::Setting`] for a level on the wrong side or a negative hysteresis.
    pub fn new(high: f64, low: f64, hysteresis: f64) -> Result<Self, ExperimentError> {
        if !(high.is_finite() && high > 0.0) {
            return Err(ExperimentError::Setting("the high level", high));
        }
        if !(low.is_finite() && low < 0.0) {
            return Err(ExperimentError::Setting("the low level", low));
        }
        if !(hysteresis.is_finite() && hysteresis >= 0.0) {
            return Err(ExperimentError::Setting("the hysteresis", hysteresis));
        }
        Ok(Self {
            high,
            low,
            hysteresis,
            is_high: true,
        })
    }
}

impl Controller for AsymmetricRelay {
    fn step(&mut self, _dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        let error = reference - sensed.output;
        if error > self.hysteresis {
            self.is_high = true;
        } else if error < -self.hysteresis {
            self.is_high = false;
        }
        if self.is_high { self.high } else { self.low }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // By hand for beta = -0.5, with a derivative that is hardly filtered: from the largest error on, the error counts that is
    // largest since it falls (1.5): low below 0.75, and high again above half of the least (-2). A turn within an excursion
    // makes it count from there: after 1.0 rises to 1.2, low below 0.6.
    #[test]
    fn the_rule_by_hand() {
        let mut relay = PlainRelay::new(-0.5, 1e-9);
        let errors = [
            (1.0, 1.0),
            (2.0, 1.0),
            (1.5, 1.0),
            (0.8, 1.0),
            (0.7, -1.0),
            (-1.0, -1.0),
            (-2.5, -1.0),
            (-2.0, -1.0),
            (-1.1, -1.0),
            (-0.9, 1.0),
            (1.4, 1.0),
            (1.0, 1.0),
            (1.2, 1.0),
            (0.7, 1.0),
            (0.3, -1.0),
        ];
        for (error, expected) in errors {
            let sensed = Sensed {
                output: -error,
                rate: 0.0,
            };
            assert_eq!(relay.step(1e-3, 0.0, sensed), expected, "{error}");
        }
    }
}
