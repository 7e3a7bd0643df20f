//! Campaigns: many random relay experiments on the paper's multirotors, described by a TOML file.
//!
//! Case `n` of a campaign is a process of the domain, an input bias and a noise under the relay of the
//! board. It depends on the campaign's seed and `n` only, not on what else is run.

use onecycle_identify::{MOST_CYCLES, Method};
use onecycle_onboard::process::Soiptd;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::draw::stream;
use super::experiment::{ExperimentError, PREROLL_SAMPLES, RelayExperiment, RelaySetup};
use super::instruments::Instruments;
use super::oscillation::Oscillation;
use super::recipe::{Family, Recipe};
use crate::space::{FieldError, Space, first_out_of_range};

/// A campaign as a file describes it.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Campaign {
    /// What is measured.
    pub measure: Measure,
    /// Number of cases.
    pub cases: u64,
    /// Seed of the first case; case `n` has seed `seed + n`.
    pub seed: u64,
    /// Largest input bias over the relay's amplitude; drawn uniformly from plus to minus this value.
    pub bias: f64,
    /// Noise over the amplitude of the noise-free oscillation: exactly this, or uniform up to it.
    pub sigma: f64,
    /// Whether the noise is drawn uniformly from zero to `sigma`.
    #[serde(default)]
    pub sigma_uniform: bool,
    /// Offset at the start, in amplitudes of the oscillation.
    #[serde(default)]
    pub offset: f64,
    /// Whether the relay trims the bias away.
    pub trim: bool,
    /// Asymmetry that the trim leaves, see
    /// [`RelaySettings::asymmetry`](onecycle_onboard::RelaySettings::asymmetry).
    #[serde(default)]
    pub asymmetry: f32,
    /// Cycles to fit.
    #[serde(default = "one")]
    pub cycles: usize,
    /// Factor on all times of the processes and on the sample period.
    #[serde(default = "unscaled")]
    pub time_scale: f64,
    /// Identification method.
    #[serde(default)]
    pub method: Method,
    /// Parameter of the relay.
    #[serde(default = "distinguishing_beta")]
    pub beta: f64,
    /// Whether the recordings have the errors of [`Instruments`] that intervals allow for: the true process then differs a
    /// little from the simulated one, which the recording shows.
    #[serde(default)]
    pub instruments: bool,
}

/// Most cases of a campaign: a day's work.
pub const MOST_CASES: u64 = 10_000_000;

fn unscaled() -> f64 {
    1.0
}

fn one() -> usize {
    1
}

fn distinguishing_beta() -> f64 {
    Space::MULTIROTOR.beta
}

/// What a campaign measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Whether the relay reaches a steady oscillation.
    Relay,
    /// Errors, intervals and deterioration of the identified process.
    Identification,
    /// Refusals on out-of-family processes: `cases` of each
    /// [kind](crate::experiments::defect::DefectKind), and five times as many of the family. The noise is
    /// uniform from zero.
    Unknown,
    /// Errors, intervals and structures of the likelihood on any recording; the file describes a
    /// [`RecordingCampaign`](super::RecordingCampaign).
    Recording,
    /// Whether wrong data are refused or named; the file describes an [`HonestyCampaign`](super::HonestyCampaign).
    Honesty,
}

/// Sample period of an unscaled experiment (s): the paper's.
pub const SAMPLE_S: f64 = 1e-3;
/// Changes the seed for the errors of the instruments: arbitrary.
const INSTRUMENTS: u64 = 0x1257_0000_0000;
/// Periods in which a perfect oscillation settles, with a few to spare.
const SETTLING_PERIODS: f64 = 15.0;

impl Campaign {
    /// One experiment with the paper's relay, without trim, bias and noise; a base to change fields of.
    pub const QUIET: Self = Self {
        measure: Measure::Identification,
        cases: 1,
        seed: 1,
        bias: 0.0,
        sigma: 0.0,
        sigma_uniform: false,
        offset: 0.0,
        trim: false,
        asymmetry: 0.0,
        cycles: 1,
        time_scale: 1.0,
        method: Method::Map,
        beta: Space::MULTIROTOR.beta,
        instruments: false,
    };

    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        first_out_of_range([
            (
                "cases",
                "1 to 10,000,000",
                self.cases as f64,
                (1..=MOST_CASES).contains(&self.cases),
            ),
            (
                "bias",
                "0 to 100",
                self.bias,
                (0.0..=100.0).contains(&self.bias),
            ),
            (
                "sigma",
                "0 to 100",
                self.sigma,
                (0.0..=100.0).contains(&self.sigma),
            ),
            (
                "offset",
                "-1e6 to 1e6",
                self.offset,
                (-1e6..=1e6).contains(&self.offset),
            ),
            (
                "time_scale",
                "1e-3 to 1e6",
                self.time_scale,
                (1e-3..=1e6).contains(&self.time_scale),
            ),
            (
                "beta",
                "-0.95 to 0.95",
                self.beta,
                (-0.95..=0.95).contains(&self.beta),
            ),
            (
                "cycles",
                "1 to 50",
                self.cycles as f64,
                (1..=MOST_CYCLES).contains(&self.cycles),
            ),
        ])
    }

    /// The recipe of the experiments on out-of-family processes ([`Measure::Unknown`]).
    #[must_use]
    pub fn recipe(&self) -> Recipe {
        Recipe {
            families: vec![Family {
                space: Space {
                    beta: self.beta,
                    ..Space::MULTIROTOR
                },
                ..Family::default()
            }],
            seed: self.seed,
            bias: self.bias,
            sigma: self.sigma,
            trim: self.trim,
        }
    }

    /// Experiment of case number `n`.
    ///
    /// # Errors
    /// [`ExperimentError`]: parameters outside their physical range.
    pub fn experiment(&self, n: u64) -> Result<RelayExperiment, ExperimentError> {
        let mut rng = stream(self.seed, n);
        let times_s = Space::MULTIROTOR.random(&mut rng);
        let [t_prop_s, t_body_s, tau_s] = times_s.map(|time_s| time_s * self.time_scale);
        let bias = rng.random_range(-1.0..1.0) * self.bias;
        let part = if self.sigma_uniform {
            rng.random_range(0.0..1.0)
        } else {
            1.0
        };
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)?;
        let mut experiment = self.quiet_experiment(process, self.seed.wrapping_add(n))?;
        experiment.input_bias = bias;
        experiment.noise_sigma = part * self.sigma * experiment.oscillation.amplitude;
        if self.instruments {
            // A stream of its own, so that the rest stays the same.
            let mut rng = stream(self.seed ^ INSTRUMENTS, n);
            experiment.instruments = Instruments::drawn(experiment.sample_s, &mut rng);
        }
        Ok(experiment)
    }

    /// The experiment on a given process, without bias and noise; its noise, once it is turned up, is
    /// that of `seed`. The amplitude of its oscillation is simulated.
    ///
    /// # Errors
    /// [`ExperimentError::NoOscillation`] if the describing function has none.
    pub fn quiet_experiment(
        &self,
        process: Soiptd,
        seed: u64,
    ) -> Result<RelayExperiment, ExperimentError> {
        let mut experiment = self.at_rest(process, seed)?;
        let (settled, _) = experiment.run(SETTLING_PERIODS)?;
        let two_periods = (2.0 * experiment.oscillation.period_s / experiment.sample_s) as usize;
        let amplitude = settled.amplitude_of_last(two_periods);
        experiment.oscillation.amplitude = amplitude;
        experiment.initial_output = self.offset * amplitude;
        Ok(experiment)
    }

    /// As [`Self::quiet_experiment`], from rest and with the amplitude of the describing function.
    pub(super) fn at_rest(
        &self,
        process: Soiptd,
        seed: u64,
    ) -> Result<RelayExperiment, ExperimentError> {
        let oscillation =
            Oscillation::approximate(&process, self.beta).ok_or(ExperimentError::NoOscillation)?;
        let setup = RelaySetup {
            beta: self.beta,
            trim: self.trim,
            sample_s: SAMPLE_S * self.time_scale,
            preroll_s: PREROLL_SAMPLES * SAMPLE_S * self.time_scale,
        };
        // The noise has a stream of its own, so that it does not depend on how many numbers were drawn.
        let noise = Pcg64Mcg::seed_from_u64(!seed);
        let mut experiment = RelayExperiment::new(process, oscillation, setup, noise);
        experiment.relay.asymmetry = self.asymmetry;
        Ok(experiment)
    }
}
