//! Trials: relay experiments on random processes of a space, sampled at 1 kHz, and the last steady cycle
//! of each.
//!
//! Trial `n` of a seed does not depend on what else is run.

use onecycle_onboard::Soiptd;

use super::ClassifierError;
use crate::experiments::draw::{bias_and_noise, stream};
use crate::experiments::experiment::PREROLL_SAMPLES;
use crate::experiments::{
    Oscillation, RelayExperiment, RelaySetup, SAMPLE_S, SampledCycle, last_steady_cycle,
};
use crate::space::{FieldError, Space, first_out_of_range};

/// Periods of the noise-free oscillation that an experiment lasts, and that it lasts where it was not
/// steady by then.
const PERIODS: [f64; 2] = [14.0, 60.0];
/// The same under a bias that is not trimmed: cycles are up to three times as long, and what is left of
/// a deviation after one is more.
const UNTRIMMED_PERIODS: [f64; 2] = [50.0, 150.0];

/// A cycle of a relay that follows the bias is steady only up to this many periods of the noise-free
/// oscillation: on the way there, while the trim still moves, three cycles of five periods can be alike. Of 32,000
/// random experiments none that had settled was longer than 1.13.
const LONGEST_TRIMMED: f64 = 1.5;

/// Whether the relay follows the bias.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// It does: cycles are symmetric.
    Trimmed,
    /// It does not, as in the paper: the bias is in the cycle.
    Untrimmed,
    /// The one and the other in turn.
    Both,
}

impl Protocol {
    /// Whether trial `n` is trimmed.
    fn is_trimmed(self, n: u64) -> bool {
        match self {
            Self::Trimmed => true,
            Self::Untrimmed => false,
            Self::Both => n.is_multiple_of(2),
        }
    }
}

/// How trials are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trials {
    /// Where processes come from, and the relay.
    pub space: Space,
    /// Seed of the first; the others follow.
    pub seed: u64,
    /// Input bias, uniform between plus and minus this part of the relay's amplitude.
    pub bias: f64,
    /// Noise of a sample, uniform up to this part of the amplitude of the noise-free oscillation.
    pub sigma: f64,
    /// Whether the relay follows the bias.
    pub protocol: Protocol,
}

/// A trial that came to a steady oscillation.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The process, its velocity gain one.
    pub process: Soiptd,
    /// Its last steady cycle.
    pub cycle: SampledCycle,
}

impl Trials {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        self.space.validate()?;
        let share = |field, value: f64, most: f64, range| {
            (field, range, value, (0.0..=most).contains(&value))
        };
        first_out_of_range([
            share("bias", self.bias, 0.9, "0 to 0.9"),
            share("sigma", self.sigma, 1.0, "0 to 1"),
        ])
    }

    /// Trial number `n`, of a process with these times (s) or of a random one; `None` if the oscillation
    /// does not become steady.
    ///
    /// # Errors
    /// [`ClassifierError`]: the times are outside their physical range.
    pub fn trial(
        &self,
        n: u64,
        times_s: Option<[f64; 3]>,
    ) -> Result<Option<Trial>, ClassifierError> {
        let Some(experiment) = self.experiment(n, times_s)? else {
            return Ok(None);
        };
        let (lengths, longest_s) = if self.protocol.is_trimmed(n) {
            (PERIODS, LONGEST_TRIMMED * experiment.oscillation.period_s)
        } else {
            (UNTRIMMED_PERIODS, f64::INFINITY)
        };
        for periods in lengths {
            let (trace, _) = experiment.run(periods)?;
            let settled = last_steady_cycle(&trace).filter(|cycle| cycle.period_s < longest_s);
            let cycle = settled.and_then(|cycle| SampledCycle::of(&trace, &cycle, SAMPLE_S));
            if let Some(cycle) = cycle {
                let process = experiment.process;
                return Ok(Some(Trial { process, cycle }));
            }
        }
        Ok(None)
    }

    /// The experiment of a trial; `None` if the relay does not make the process oscillate.
    fn experiment(
        &self,
        n: u64,
        times_s: Option<[f64; 3]>,
    ) -> Result<Option<RelayExperiment>, ClassifierError> {
        let mut rng = stream(self.seed, n);
        let random = self.space.random(&mut rng);
        let (bias, sigma) = bias_and_noise(self.bias, self.sigma, &mut rng);
        let [t_prop_s, t_body_s, tau_s] = times_s.unwrap_or(random);
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)?;
        let Some(oscillation) = Oscillation::exact(&process, self.space.beta) else {
            return Ok(None);
        };
        let setup = RelaySetup {
            beta: self.space.beta,
            trim: self.protocol.is_trimmed(n),
            sample_s: SAMPLE_S,
            preroll_s: PREROLL_SAMPLES * SAMPLE_S,
        };
        let mut experiment = RelayExperiment::new(process, oscillation, setup, rng);
        experiment.input_bias = bias;
        experiment.noise_sigma = sigma * oscillation.amplitude;
        Ok(Some(experiment))
    }
}
