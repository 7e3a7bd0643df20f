//! The shipped identifier: from a recipe to a pack, and its scores on cycles that it has not seen.
//!
//! ```text
//! IdentifierRecipe -> Manifest -> records -> Trainer -> calibrate -> PackContents -> bytes
//!                                                              |
//!                                                  Scores  <---+   as the board computes
//! ```
//!
//! The output of the network is a Gaussian over the four values of `dataset`: the estimator's own coordinates,
//! in which the posterior of a cycle is nearly Gaussian. Experiments are numbered from zero: first
//! those for training, then those for the choice of the best epoch and the calibration, then those for
//! the score.
//!
//! ```toml
//! network = "density"
//! hidden = [64, 64]      # widths of the hidden layers, each followed by tanh
//! learning = 220000      # experiments for training
//! choosing = 8000        # experiments for the choice of the epoch and the calibration
//! scoring = 8000         # experiments for the score
//! # defaults of other fields: IdentifierRecipe::default()
//!
//! [experiments]          # a recipe as for `onecycle-lab dataset`
//! ```

mod calibration;
mod score;

use std::ops::Range;

use onecycle_onboard::signature::LENGTH;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

pub use self::calibration::{Calibrated, MOST_UNKNOWN, calibrated};
pub use self::score::{Reliability, Scores, scores};
use crate::experiments;
use crate::experiments::{ExperimentError, RecipeError};
use crate::learn::dataset::VALUES;
use crate::learn::dataset::learning::{SCALE, Wanted, batch};
use crate::learn::dataset::shards::ExampleRecord;
use crate::learn::lead_table;
use crate::learn::pack::{LeadTableContents, PackContents, PackContentsError, Precision, layers};
use crate::learn::train::{
    Batch, Gaussian, Layer, Loss, Network, OptimizerMethod, Schedule, Shape, TrainError,
    TrainingSettings,
};
use crate::space::{FieldError, first_out_of_range};

/// Recipe of an identifier. See the [module](self).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdentifierRecipe {
    /// Kind of network; always `density` here.
    pub network: IdentifierKind,
    /// Widths of the hidden layers.
    pub hidden: Vec<usize>,
    /// Number of experiments for training.
    pub learning: u64,
    /// Number of experiments for the choice of the best epoch and the calibration.
    pub choosing: u64,
    /// Number of experiments for the score.
    pub scoring: u64,
    /// Largest number of epochs.
    pub epochs: u64,
    /// Number of epochs without improvement after which training stops.
    pub patience: u64,
    /// Examples per step.
    pub batch: usize,
    /// Highest learning rate.
    pub rate: f64,
    /// Weight of the cost beside the likelihood, see [`Loss::CostAwareGaussian`].
    pub cost_weight: f64,
    /// Cost above which it counts linearly instead of by its square.
    pub cost_scale: f64,
    /// Whether a weight takes one byte on board instead of four.
    pub bytes: bool,
    /// Seed of the first weights and of the order of the examples.
    pub seed: u64,
    /// Recipe of the experiments.
    pub experiments: experiments::Recipe,
}

/// The kind of network, which distinguishes recipes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IdentifierKind {
    /// A density over the values of a process.
    Density,
}

impl Default for IdentifierRecipe {
    fn default() -> Self {
        Self {
            network: IdentifierKind::Density,
            hidden: vec![64, 64],
            learning: 220_000,
            choosing: 8_000,
            scoring: 8_000,
            epochs: 100,
            patience: 30,
            batch: 128,
            rate: 4e-3,
            // Of weights from 0 to 30 and scales from 0.002 to 0.05 these gave the least mean cost, a
            // tenth less than the likelihood alone.
            cost_weight: 1.0,
            cost_scale: 0.01,
            bytes: true,
            seed: 1,
            experiments: experiments::Recipe::default(),
        }
    }
}

/// Largest number of experiments, epochs or cycles that a recipe may ask for: years of work.
const MOST: u64 = 1_000_000_000;

/// Epochs over which the learning rate rises to its highest.
const WARM_UP_EPOCHS: f64 = 0.5;
/// Learning rate of the last epoch over the highest.
const LEAST_RATE: f64 = 0.003;

/// Why there is no identifier.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IdentifierError {
    /// A field of the recipe.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// A field of its experiments.
    #[error("experiments: {0}")]
    Experiments(#[from] RecipeError),
    /// The families differ in a value that a pack has once.
    #[error("all families of one identifier must have the same {0}")]
    Families(&'static str),
    /// Training is not possible.
    #[error("{0}")]
    Train(#[from] TrainError),
    /// A pack cannot hold the network.
    #[error("{0}")]
    Pack(#[from] PackContentsError),
    /// There is no table for the phase margin.
    #[error("{0}")]
    Table(#[from] lead_table::LeadTableError),
    /// An experiment cannot be made.
    #[error("{0}")]
    Experiment(#[from] ExperimentError),
    /// The shapes of the family have no spread.
    #[error("all processes of the family have the same shape: widen its space")]
    OneShape,
}

impl IdentifierRecipe {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), IdentifierError> {
        let wrong = self.hidden.iter().find(|&width| !(1..=128).contains(width));
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let some = |field, value: u64| {
            let is_some = (1..=MOST).contains(&value);
            (field, "1 to 1000000000", value as f64, is_some)
        };
        first_out_of_range([
            (
                "hidden",
                "1 to 5 widths of 1 to 128",
                *wrong.unwrap_or(&self.hidden.len()) as f64,
                wrong.is_none() && (1..=5).contains(&self.hidden.len()),
            ),
            some("learning", self.learning),
            some("choosing", self.choosing),
            some("scoring", self.scoring),
            some("epochs", self.epochs),
            some("patience", self.patience),
            some("batch", self.batch as u64),
            ("rate", "positive", self.rate, positive(self.rate)),
            (
                "cost_weight",
                "zero or positive",
                self.cost_weight,
                self.cost_weight.is_finite() && self.cost_weight >= 0.0,
            ),
            (
                "cost_scale",
                "positive",
                self.cost_scale,
                positive(self.cost_scale),
            ),
        ])?;
        self.experiments.validate()?;
        let [first, others @ ..] = self.experiments.families.as_slice() else {
            return Ok(());
        };
        for other in others {
            if other.space.beta != first.space.beta {
                return Err(IdentifierError::Families("beta"));
            }
            if other.space.phase_margin_deg != first.space.phase_margin_deg {
                return Err(IdentifierError::Families("phase_margin_deg"));
            }
        }
        Ok(())
    }

    /// Number of all experiments.
    #[must_use]
    pub fn experiments(&self) -> u64 {
        self.learning + self.choosing + self.scoring
    }

    /// Numbers of the experiments to learn from, to choose with, and to score.
    #[must_use]
    pub fn numbers(&self) -> [Range<u64>; 3] {
        let chosen = self.learning + self.choosing;
        [
            0..self.learning,
            self.learning..chosen,
            chosen..self.experiments(),
        ]
    }

    /// The network before training.
    ///
    /// # Errors
    /// [`TrainError`]: a width is out of its range.
    pub fn network(&self) -> Result<Network, TrainError> {
        let hidden = self.hidden.iter();
        let mut layers: Vec<Layer> = hidden
            .flat_map(|&outputs| [Layer::Dense { outputs }, Layer::Tanh])
            .collect();
        layers.push(Layer::Dense {
            outputs: Gaussian::outputs(VALUES),
        });
        Network::new(LENGTH, &layers, &mut Pcg64Mcg::seed_from_u64(self.seed))
    }

    /// Settings of the training.
    #[must_use]
    pub fn settings(&self) -> TrainingSettings {
        TrainingSettings {
            loss: Loss::CostAwareGaussian {
                dimension: VALUES,
                weight: self.cost_weight,
                scale: self.cost_scale,
            },
            method: OptimizerMethod::ADAM,
            schedule: Schedule {
                rate: self.rate,
                warm_up: WARM_UP_EPOCHS,
                shape: Shape::Cosine {
                    epochs: self.epochs as f64,
                    least: LEAST_RATE,
                },
            },
            batch: self.batch,
            epochs: self.epochs,
            patience: Some(self.patience),
            seed: self.seed,
        }
    }

    /// The pack of a trained network, calibrated, without scores yet.
    ///
    /// # Errors
    /// [`IdentifierError`]: a pack cannot hold the network, or has no table for the phase margin.
    pub fn pack(
        &self,
        network: &Network,
        learnt: &[ExampleRecord],
        calibrated: &Calibrated,
    ) -> Result<PackContents, IdentifierError> {
        let precision = if self.bytes {
            Precision::Bytes
        } else {
            Precision::Floats
        };
        let margin_rad = self.experiments.families[0].space.phase_margin_rad();
        Ok(PackContents {
            layers: layers(network, precision)?,
            lead_table: LeadTableContents::for_phase_margin(margin_rad, 0.0)?,
            self_tests: learnt
                .iter()
                .take(SELF_TESTS)
                .map(|record| record.example.signature.values)
                .collect(),
            ..calibrated.contents(self, learnt)?
        })
    }
}

/// Number of cycles that a pack contains for its self-test.
const SELF_TESTS: usize = 2;

/// The batch of these records.
#[must_use]
pub fn rows(records: &[ExampleRecord]) -> Batch {
    batch(records, Wanted::ValuesAndSlopes)
}

/// Scales of the outputs, as a pack stores them.
fn output_scales() -> [f32; VALUES] {
    SCALE.map(|scale| scale as f32)
}
