//! Trials: relay experiments on random processes of a space, sampled at 1 kHz, and the last steady cycle
//! of each.
//!
//! Trial `n` of a seed does not depend on what else is run.

use std::f64::consts::TAU;

use onecycle_onboard::Soiptd;
use rand_pcg::Pcg64Mcg;

use super::ClassifierError;
use crate::experiments::draw::{bias_and_noise, stream};
use crate::experiments::experiment::PREROLL_SAMPLES;
use crate::experiments::{
    Oscillation, PlainRelay, RelayExperiment, RelaySetup, SAMPLE_S, SampledCycle,
    last_steady_cycle, last_whole_cycle,
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

/// The relay of the trials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RelayKind {
    /// The board's, until its oscillation is steady; the last steady cycle.
    #[default]
    Protected,
    /// The rule alone ([`PlainRelay`]), for 10 s to learn from and 20 s to test: the authors' published code. The last whole
    /// cycle, steady or not.
    Plain,
}

/// Where the noise enters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseKind {
    /// At the sensor, before the relay; normal, of standard deviation `sigma`.
    #[default]
    Inside,
    /// Into the finished cycle ([`Prepared::disturb`](super::Prepared::disturb)), uniform, up to `2 sigma`: the authors'
    /// published code. The relay and the gain see none.
    Afterwards,
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
    /// The relay.
    pub relay: RelayKind,
    /// Where the noise enters.
    pub noise: NoiseKind,
    /// Duration of an experiment with the plain relay (s).
    pub duration_s: f64,
}

/// Largest noise over the amplitude, and its random stream.
type Afterwards = Option<(f64, Pcg64Mcg)>;

/// A trial that came to a steady oscillation.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The process, with a velocity gain of one.
    pub process: Soiptd,
    /// The last steady cycle.
    pub cycle: SampledCycle,
    /// Noise for [`Prepared::disturb`](super::Prepared::disturb), and its random stream.
    pub noise_afterwards: Afterwards,
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
        let Some((experiment, noise_afterwards)) = self.experiment(n, times_s)? else {
            return Ok(None);
        };
        let process = experiment.process;
        let trial = |cycle| Trial {
            process,
            cycle,
            noise_afterwards,
        };
        if self.relay == RelayKind::Plain {
            let lag_s = PlainRelay::LAG * experiment.oscillation.period_s / TAU;
            let mut relay = PlainRelay::new(self.space.beta, lag_s);
            let trace = experiment.simulate(&mut relay, self.duration_s);
            return Ok(last_whole_cycle(&trace, SAMPLE_S).map(trial));
        }
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
                return Ok(Some(trial(cycle)));
            }
        }
        Ok(None)
    }

    /// The experiment of a trial, and its noise afterwards; `None` if the relay does not make the process oscillate.
    fn experiment(
        &self,
        n: u64,
        times_s: Option<[f64; 3]>,
    ) -> Result<Option<(RelayExperiment, Afterwards)>, ClassifierError> {
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
        let (inside, afterwards) = match self.noise {
            NoiseKind::Inside => (sigma, None),
            NoiseKind::Afterwards => (0.0, Some((sigma, rng.clone()))),
        };
        let mut experiment = RelayExperiment::new(process, oscillation, setup, rng);
        experiment.input_bias = bias;
        experiment.noise_sigma = inside * oscillation.amplitude;
        Ok(Some((experiment, afterwards)))
    }
}
