//! Random draws of relay experiments from a [`Recipe`], with or without a defect.
//!
//! The four sources of experiments differ in what they draw, and in which order, for historical reasons;
//! an order never changes, so that a seed keeps its bits:
//!
//! | source                 | order of draws                                                       | noise           |
//! |------------------------|----------------------------------------------------------------------|-----------------|
//! | recipe                 | family, times, bias, noise, samples per period                        | same stream     |
//! | recipe, with a defect  | the same, then the defect                                             | same stream     |
//! | campaign, benchmark    | times, bias, noise if it is uniform; bounds of bias and noise excluded | stream `!seed`  |
//! | trials of the paper    | times, bias, noise                                                    | same stream     |

use onecycle_onboard::Soiptd;
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::defect::{Defect, DefectKind};
use super::experiment::{
    ExperimentError, PREROLL_SAMPLES, RelayExperiment, RelaySetup, Simulation,
};
use super::oscillation::Oscillation;
use super::recipe::{Family, Recipe};

/// Longest pre-roll of an experiment without a defect, in periods. A bias drives the process away
/// meanwhile, and a process without damping so far that it does not come back in time. A relay that
/// measures for so short a time is told the noise.
const PREROLL_PERIODS: f64 = 0.1;

/// The random stream of experiment `n` of a seed.
#[must_use]
pub fn stream(seed: u64, n: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed.wrapping_add(n))
}

/// An input bias, uniform between plus and minus `most_bias`, then a noise, uniform from zero to
/// `most_noise`; bounds included.
pub fn bias_and_noise(most_bias: f64, most_noise: f64, rng: &mut impl Rng) -> (f64, f64) {
    let bias = most_bias * rng.random_range(-1.0..=1.0);
    let noise = most_noise * rng.random_range(0.0..=1.0);
    (bias, noise)
}

/// An experiment of a recipe and how it was drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// The experiment.
    pub experiment: RelayExperiment,
    /// Number of the family in the recipe, from zero.
    pub family: usize,
    /// Noise of a sample over the amplitude of the noise-free oscillation.
    pub sigma: f64,
    /// Samples in a period of the noise-free oscillation.
    pub samples_per_period: f64,
}

/// What a recipe draws first, whatever becomes of it.
struct Draws {
    rng: Pcg64Mcg,
    number: usize,
    family: Family,
    process: Soiptd,
    bias: f64,
    sigma: f64,
    samples_per_period: f64,
}

impl Draws {
    fn of(recipe: &Recipe, n: u64) -> Result<Self, ExperimentError> {
        recipe.validate()?;
        let mut rng = stream(recipe.seed, n);
        let number = recipe.family(&mut rng);
        let family = recipe.families[number];
        let process = family.process(&mut rng)?;
        let (bias, sigma) = bias_and_noise(recipe.bias, recipe.sigma, &mut rng);
        let samples_per_period = family.samples(&mut rng);
        Ok(Self {
            rng,
            number,
            family,
            process,
            bias,
            sigma,
            samples_per_period,
        })
    }

    /// The experiment with this oscillation; the noise continues the stream of the draws.
    fn experiment(self, oscillation: Oscillation, setup: RelaySetup) -> RelayExperiment {
        let mut experiment = RelayExperiment::new(self.process, oscillation, setup, self.rng);
        experiment.input_bias = self.bias;
        experiment.noise_sigma = self.sigma * oscillation.amplitude;
        experiment
    }
}

impl Recipe {
    /// Experiment number `n`: the same whatever else is drawn. `None` if the relay does not make the
    /// process oscillate.
    ///
    /// # Errors
    /// [`ExperimentError`]: a field of the recipe is out of its range.
    pub fn experiment(&self, n: u64) -> Result<Option<Drawn>, ExperimentError> {
        let draws = Draws::of(self, n)?;
        let beta = draws.family.space.beta;
        let Some(oscillation) = Oscillation::exact(&draws.process, beta) else {
            return Ok(None);
        };
        let (family, sigma) = (draws.number, draws.sigma);
        let samples_per_period = draws.samples_per_period;
        let sample_s = oscillation.period_s / samples_per_period;
        let longest_s = PREROLL_PERIODS * oscillation.period_s;
        let setup = RelaySetup {
            beta,
            trim: self.trim,
            sample_s,
            preroll_s: (PREROLL_SAMPLES * sample_s).min(longest_s),
        };
        let mut experiment = draws.experiment(oscillation, setup);
        experiment.relay.noise_sigma = experiment.noise_sigma as f32;
        Ok(Some(Drawn {
            experiment,
            family,
            sigma,
            samples_per_period,
        }))
    }

    /// Experiment number `n` with a random defect of this kind, simulated numerically; process, bias and
    /// noise do not depend on the kind. `None` if the relay does not make the process oscillate.
    ///
    /// # Errors
    /// [`ExperimentError`]: a field of the recipe is out of its range.
    pub fn experiment_with_defect(
        &self,
        kind: DefectKind,
        n: u64,
    ) -> Result<Option<RelayExperiment>, ExperimentError> {
        let mut draws = Draws::of(self, n)?;
        let (process, beta) = (draws.process, draws.family.space.beta);
        let Some(mut oscillation) = Oscillation::exact(&process, beta) else {
            return Ok(None);
        };
        if kind == DefectKind::RateSensor {
            let Some(of_rate) = Oscillation::of_rate(&process, beta) else {
                return Ok(None);
            };
            oscillation = of_rate;
        }
        let defect = Defect::draw(kind, &process, oscillation, &mut draws.rng);
        let sample_s = oscillation.period_s / draws.samples_per_period;
        let is_undriven = defect.is_undriven();
        let setup = RelaySetup {
            beta,
            trim: self.trim,
            sample_s,
            // An output that moves by itself gives the relay no quiet to measure the noise in.
            preroll_s: if is_undriven {
                0.0
            } else {
                PREROLL_SAMPLES * sample_s
            },
        };
        let mut experiment = draws.experiment(oscillation, setup);
        experiment.simulation = Simulation::Numerical(defect);
        if is_undriven {
            experiment.relay.noise_sigma = experiment.noise_sigma as f32;
        }
        Ok(Some(experiment))
    }
}
