//! The experiment of the paper's estimation set II: the board's relay, its phase swept in time.

use onecycle_onboard::{Relay, RelayError, RelaySettings};
use onecycle_plant::{Controller, Sensed};

/// A relay whose `beta` moves linearly in time, from one value to another over a duration, and stays
/// there.
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

    /// The paper's sweep, from -0.1 to -0.9 in 20 s, of a relay with these settings but for their
    /// `beta`.
    ///
    /// # Errors
    /// Names the setting that is out of range.
    pub fn paper(settings: RelaySettings) -> Result<Self, RelayError> {
        Self::new(settings, (-0.1, -0.9), Self::PAPER_DURATION_S)
    }

    /// From the first `beta` to the second over `duration_s` of a relay with these settings but for
    /// their `beta`.
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
        // Between two values that the relay has taken there is none that it refuses.
        let _ = self
            .relay
            .set_beta(self.from + part * (self.to - self.from));
        Controller::step(&mut self.relay, dt_s, reference, sensed)
    }
}
