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
