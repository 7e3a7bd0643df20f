//! A kind of data: its experiment and its fault.

use onecycle_design::Structure;
use onecycle_onboard::{Relay, RelaySettings};
use onecycle_plant::Controller;
use serde::Deserialize;

use super::HonestyError;
use super::fault::Fault;
use crate::experiments::defect::DefectKind;
use crate::experiments::recording::{
    DisturbanceLevel, Excitation, ProcessRange, Signal, Span, distinguishing_beta,
};
use crate::experiments::relays::AsymmetricRelay;

/// A kind of data. What is `None` is that of the campaign.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kind {
    /// Name in the table.
    pub name: String,
    /// Whether the data are right.
    #[serde(default)]
    pub control: bool,
    /// Fault of the recording or its plant.
    pub fault: Option<Fault>,
    /// Strength of the fault, in its unit.
    pub strength: Option<Span>,
    /// Defect of the process, of random strength. Needs an integrator with two lags.
    pub defect: Option<DefectKind>,
    /// Kinds of the remarks that name the trouble.
    #[serde(default)]
    pub named_by: Vec<String>,
    /// The experiment.
    #[serde(default)]
    pub test: Test,
    /// Processes.
    pub process: Option<ProcessRange>,
    /// Noise.
    pub noise: Option<Span>,
    /// Largest bias.
    pub bias: Option<f64>,
    /// Length of the test.
    pub periods: Option<f64>,
    /// Samples in a period.
    pub samples_per_period: Option<Span>,
    /// Disturbances; not beside a defect.
    #[serde(default)]
    pub wind: DisturbanceLevel,
}

/// An experiment, in the units `T`, `a` and `h`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Test {
    /// The test signal.
    pub signal: Signal,
    /// Parameter of the relay.
    pub beta: f64,
    /// Amplitude of a relay in the second half of the test.
    pub second_amplitude: Option<f64>,
    /// Asymmetry of the relay, which then trims the bias away.
    pub asymmetry: Option<f32>,
    /// Hysteresis in `a`, of a relay with two fixed levels in place of the board's.
    pub hysteresis: Option<f64>,
    /// Lower level of that relay, below zero.
    pub low: f64,
    /// Lowest and highest frequency of a chirp or a multisine, in `1/T`.
    pub band: Option<[f64; 2]>,
    /// Length of a pulse, in `T`.
    pub pulse: Option<f64>,
}

impl Default for Test {
    fn default() -> Self {
        Self {
            signal: Signal::Relay,
            beta: distinguishing_beta(),
            second_amplitude: None,
            asymmetry: None,
            hysteresis: None,
            low: -1.0,
            band: None,
            pulse: None,
        }
    }
}

impl Kind {
    /// Whether the simulation of a process with a defect has what this kind asks for.
    pub(super) fn allows_defect(&self, process: &ProcessRange) -> bool {
        process.structure == Structure::Soiptd
            && self.wind.named().next().is_none()
            && self.fault != Some(Fault::Jitter)
    }
}

impl Test {
    /// The test signal for a period of the oscillation (s).
    pub(super) fn excitation(&self, period_s: f64) -> Excitation {
        Excitation {
            signal: self.signal,
            amplitude: 1.0,
            band_hz: self.band.map(|band| band.map(|edge| edge / period_s)),
            pulse_s: self.pulse.map(|pulse| pulse * period_s),
            beta: self.beta,
        }
    }

    /// What makes the input, for an amplitude (output unit) and a noise (in amplitudes).
    pub(super) fn controller(
        &self,
        kind: &Kind,
        duration_s: f64,
        period_s: f64,
        (amplitude, noise): (f64, f64),
    ) -> Result<Box<dyn Controller>, HonestyError> {
        let of_recording = |error| HonestyError::Part {
            kind: kind.name.clone(),
            error,
        };
        if let Some(hysteresis) = self.hysteresis {
            let relay = AsymmetricRelay::new(1.0, self.low, hysteresis * amplitude);
            let relay = relay.map_err(|error| HonestyError::Relay {
                kind: kind.name.clone(),
                error,
            })?;
            return Ok(Box::new(relay));
        }
        let noise_sigma = noise * amplitude;
        if let (Signal::Relay, Some(asymmetry)) = (self.signal, self.asymmetry) {
            let relay = Relay::new(RelaySettings {
                noise_sigma: noise_sigma as f32,
                trim_gain: RelaySettings::TRIM_GAIN,
                asymmetry,
                ..RelaySettings::new(1.0, self.beta as f32)
            });
            return Ok(Box::new(relay.map_err(|error| of_recording(error.into()))?));
        }
        (self.excitation(period_s))
            .controller(None, duration_s, noise_sigma)
            .map_err(of_recording)
    }
}
