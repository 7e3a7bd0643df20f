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

/// Durations of an experiment in periods of the noise-free oscillation: the second one is used if the
/// first was too short to become steady.
const PERIODS: [f64; 2] = [14.0, 60.0];
/// The same durations for a bias that is not trimmed: cycles are up to three times as long and
/// deviations decay more slowly.
const UNTRIMMED_PERIODS: [f64; 2] = [50.0, 150.0];

/// Longest period of a steady cycle with trim, in periods of the noise-free oscillation. While the trim
/// still moves, three cycles of five periods can be alike. Of 32,000 random experiments no settled one
/// was longer than 1.13.
const LONGEST_TRIMMED: f64 = 1.5;

/// Whether the relay trims the bias away.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// The bias is trimmed away: cycles are symmetric.
    Trimmed,
    /// The bias is left in, as in the paper.
    Untrimmed,
    /// Trimmed and untrimmed in turn.
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

/// Settings of the trials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trials {
    /// Space of the processes, and the relay.
    pub space: Space,
    /// Seed of the first trial; trial `n` has seed `seed + n`.
    pub seed: u64,
    /// Largest input bias over the relay's amplitude; drawn uniformly from plus to minus this value.
    pub bias: f64,
    /// Largest noise of a sample over the amplitude of the noise-free oscillation; drawn uniformly from
    /// zero.
    pub sigma: f64,
    /// Whether the relay trims the bias away.
    pub protocol: Protocol,
}

/// A trial that came to a steady oscillation.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The process, with a velocity gain of one.
    pub process: Soiptd,
    /// The last steady cycle.
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
