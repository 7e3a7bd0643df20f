//! A static nonlinearity in front of a process, tested in several modes of operation: each test finds the local gain (the
//! paper's introduction: "applying the identification process in multiple operation modes").
//!
//! ```text
//! force = f(u0 + h r),   r = +-1 of the relay,   local gain  f'(u0) h K
//! f(u) = u^p, such as the thrust of a propeller over its speed (p = 2)
//! ```
//!
//! A relay has two levels, so the process sees two forces: a linear process with the gain of the secant between them, and a
//! bias where the secant's middle is not `f(u0)`.

use onecycle_onboard::{Relay, Soiptd};
use onecycle_plant::{Controller, Sensed, Trace};

use crate::experiments::{Campaign, ExperimentError, IDENTIFICATION_PERIODS};

/// A mode of operation: where on the curve the relay works.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mode {
    /// `p`, the power of the curve.
    pub power: f64,
    /// `u0`, the mean input (input unit).
    pub at: f64,
    /// `h`, the amplitude of the relay (input unit), below `u0`.
    pub amplitude: f64,
}

/// The relay in front of the curve, with what it commands.
struct Curved {
    mode: Mode,
    relay: Relay,
    commands: Vec<f64>,
}

impl Controller for Curved {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        let command = Controller::step(&mut self.relay, dt_s, reference, sensed);
        self.commands.push(command);
        self.mode.force(command)
    }
}

impl Mode {
    /// Force for a command in amplitudes of the relay, less the force at rest.
    fn force(&self, command: f64) -> f64 {
        (self.at + self.amplitude * command).powf(self.power) - self.at.powf(self.power)
    }

    /// The linear process around the mode, for commands in amplitudes of the relay.
    ///
    /// # Errors
    /// [`ExperimentError::Process`]: the gain is out of range.
    pub fn local(&self, process: &Soiptd) -> Result<Soiptd, ExperimentError> {
        let slope = self.power * self.at.powf(self.power - 1.0) * self.amplitude;
        Ok(process.with_gain_scaled(slope)?)
    }

    /// A relay test of the process in this mode, trimmed, with noise of this part of its amplitude; inputs are commands.
    ///
    /// # Errors
    /// [`ExperimentError`]: the process does not oscillate under the relay.
    pub fn test(&self, process: &Soiptd, sigma: f64, seed: u64) -> Result<Trace, ExperimentError> {
        let campaign = Campaign {
            trim: true,
            ..Campaign::QUIET
        };
        let mut experiment = campaign.quiet_experiment(*process, seed)?;
        let half_span = 0.5 * (self.force(1.0) - self.force(-1.0));
        experiment.noise_sigma = sigma * half_span * experiment.oscillation.amplitude;
        let mut curved = Curved {
            mode: *self,
            relay: Relay::new(experiment.relay)?,
            commands: Vec::new(),
        };
        let duration_s = IDENTIFICATION_PERIODS * experiment.oscillation.period_s;
        let trace = experiment.simulate(&mut curved, duration_s);
        Ok(Trace {
            input: curved.commands,
            ..trace
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::{SAMPLE_S, signals_of};
    use crate::judge::evaluate::{Contender, Seen};

    // u^2 at 1.5 with a relay of 0.1: the secant of a parabola is its slope in the middle, 0.3, exactly. Without noise the
    // gain is found within 1 %.
    #[test]
    fn the_local_gain_of_a_parabola() {
        let process = Soiptd::new(1.0, 0.05, 0.8, 0.02).unwrap();
        let mode = Mode {
            power: 2.0,
            at: 1.5,
            amplitude: 0.1,
        };
        let local = mode.local(&process).unwrap();
        assert!((local.k_over_t_body() * 0.8 - 0.3).abs() < 1e-12);
        let trace = mode.test(&process, 0.0, 1).unwrap();
        let seen = Seen::of(signals_of(&trace, SAMPLE_S));
        let found = Contender::OneCycle(2)
            .answer(&seen)
            .unwrap()
            .process
            .unwrap();
        let ratio = found.k_over_t_body() / local.k_over_t_body();
        assert!((ratio - 1.0).abs() < 1e-2, "{ratio}");
    }
}
