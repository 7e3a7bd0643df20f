//! Recipes: which processes are drawn, how often, and under which bias and noise.
//!
//! ```toml
//! seed = 1        # seed of the first example; default 1
//! bias = 0.5      # largest bias, over the relay's amplitude
//! sigma = 0.03    # largest noise, over the amplitude of the oscillation
//! trim = true     # whether the relay follows the bias
//!
//! [[families]]
//! samples_per_period = [89, 2306]
//! space = { t_prop_s = [0.015, 0.3], t_body_s = [0.2, 2.0], tau_s = [0.0005, 0.1] }
//!
//! [[families]]    # one table for each kind of process
//! weight = 0.5    # drawn half as often as a family of weight 1
//! draw = "logarithmic"
//! samples_per_period = [40, 2500]
//! space = { t_prop_s = [0.005, 0.12], t_body_s = [20, 2000], tau_s = [0.008, 0.05] }
//! ```
//!
//! Fields that are left out have the paper's values; an empty file is a valid recipe.

use onecycle_onboard::{Soiptd, SoiptdError};
use rand::{Rng, RngExt};

use crate::space::{FieldError, Range, Space, first_out_of_range, two_times};

/// How the times of a process are drawn from the box of its space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Draw {
    /// Uniform.
    #[default]
    Uniform,
    /// Uniform in their logarithms, for times that span several powers of ten.
    Logarithmic,
}

/// A family of processes.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Family {
    /// Space that the processes are drawn from, with the relay and the phase margin of the controllers.
    pub space: Space,
    /// Distribution of the times.
    pub draw: Draw,
    /// Relative frequency among the families.
    pub weight: f64,
    /// Samples in a period of the noise-free oscillation, uniform in logarithms.
    #[serde(deserialize_with = "two_times")]
    pub samples_per_period: Range,
}

impl Default for Family {
    /// The paper's multirotors at 1 kHz, whose periods are 89 to 2306 samples.
    fn default() -> Self {
        Self {
            space: Space::MULTIROTOR,
            draw: Draw::Uniform,
            weight: 1.0,
            samples_per_period: (89.0, 2306.0),
        }
    }
}

impl Family {
    /// Multirotors as published simulators have them: nearly double integrators behind a fast motor,
    /// with 40 samples a period and more. A body time constant of 2000 s is practically no damping.
    pub const NEAR_DOUBLE_INTEGRATORS: Self = Self {
        space: Space {
            t_prop_s: (0.005, 0.12),
            t_body_s: (20.0, 2000.0),
            tau_s: (0.008, 0.05),
            ..Space::MULTIROTOR
        },
        draw: Draw::Logarithmic,
        weight: 1.0,
        samples_per_period: (40.0, 2500.0),
    };

    fn validate(&self) -> Result<(), FieldError> {
        self.space.validate()?;
        let (least, most) = self.samples_per_period;
        let least_tau_s = self.space.tau_s.0;
        first_out_of_range([
            (
                "weight",
                "positive and at most 1e6",
                self.weight,
                self.weight > 0.0 && self.weight <= 1e6,
            ),
            (
                "samples_per_period",
                "two numbers from 40 to 1e6, the lower first",
                least,
                (40.0..=1e6).contains(&least) && (least..=1e6).contains(&most),
            ),
            (
                "tau_s",
                "positive if the draw is logarithmic (the logarithm of zero is not finite)",
                least_tau_s,
                self.draw == Draw::Uniform || least_tau_s > 0.0,
            ),
        ])
    }

    /// A random process with a velocity gain of one.
    pub(crate) fn process(&self, rng: &mut impl Rng) -> Result<Soiptd, SoiptdError> {
        let [t_prop_s, t_body_s, tau_s] = match self.draw {
            Draw::Uniform => self.space.random(rng),
            Draw::Logarithmic => self.space.ranges_s().map(|range| between(range, rng)),
        };
        Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)
    }

    /// Samples per period of a random experiment.
    pub(crate) fn samples(&self, rng: &mut impl Rng) -> f64 {
        between(self.samples_per_period, rng)
    }
}

/// Uniform in logarithms.
fn between((low, high): Range, rng: &mut impl Rng) -> f64 {
    low * (high / low).powf(rng.random_range(0.0..=1.0))
}

/// How experiments are drawn. See the [module](self).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Recipe {
    /// Seed of the first experiment; experiment `n` has seed `seed + n`.
    pub seed: u64,
    /// Input bias, uniform between plus and minus this part of the relay's amplitude.
    pub bias: f64,
    /// Noise of a sample, uniform up to this part of the amplitude of the noise-free oscillation.
    pub sigma: f64,
    /// Whether the relay trims the bias away.
    pub trim: bool,
    /// Families of processes, usually one. The last field, because a TOML file has its tables at the
    /// end.
    pub families: Vec<Family>,
}

impl Default for Recipe {
    /// The paper's multirotors alone.
    fn default() -> Self {
        Self {
            seed: 1,
            bias: 0.5,
            sigma: 0.03,
            trim: true,
            families: vec![Family::default()],
        }
    }
}

/// What is wrong with a recipe.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RecipeError {
    /// A field of the recipe itself.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// A field of a family.
    #[error("family {number}: {reason}")]
    Family {
        /// Number of the family, from one.
        number: usize,
        /// The field and its value.
        reason: FieldError,
    },
}

impl RecipeError {
    /// The field that is out of its range.
    #[must_use]
    pub fn field(&self) -> FieldError {
        match *self {
            Self::Field(reason) | Self::Family { reason, .. } => reason,
        }
    }
}

impl Recipe {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range, and its family.
    pub fn validate(&self) -> Result<(), RecipeError> {
        let families = self.families.len();
        first_out_of_range([
            (
                "bias",
                "0 to 0.9",
                self.bias,
                (0.0..=0.9).contains(&self.bias),
            ),
            (
                "sigma",
                "0 to 1",
                self.sigma,
                (0.0..=1.0).contains(&self.sigma),
            ),
            ("families", "one or more", families as f64, families > 0),
        ])?;
        for (index, family) in self.families.iter().enumerate() {
            let number = index + 1;
            (family.validate()).map_err(|reason| RecipeError::Family { number, reason })?;
        }
        Ok(())
    }

    /// The number of a random family, by their weights.
    pub(crate) fn family(&self, rng: &mut impl Rng) -> usize {
        let total: f64 = self.families.iter().map(|family| family.weight).sum();
        let mut left = total * rng.random_range(0.0..1.0);
        let is_it = |family: &Family| {
            left -= family.weight;
            left < 0.0
        };
        // Rounding may leave a remainder after the last family.
        (self.families.iter().position(is_it)).unwrap_or(self.families.len().saturating_sub(1))
    }
}
