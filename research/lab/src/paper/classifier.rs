//! The paper's classifier: from one cycle of a relay test to a member of a grid of processes (section
//! III-C; Ayyad, Chehadeh, Awad, Zweiri 2020).
//!
//! ```text
//! ClassifierRecipe -> Classes, the members of a grid
//!        -> Examples: Trials under the relay -> SampledCycle -> Prepared, the network's 4520 inputs
//!                                                            -> Measured, which gives the gain
//!        -> Network 4520-3000-1000-N, a Loss each -> picks by either PickRule -> Score
//! ```
//!
//! Choices that the paper leaves open, or that differ from it because they are better:
//!
//! | question              | the paper                          | here                               |
//! |-----------------------|------------------------------------|------------------------------------|
//! | training examples     | 30 experiments of each class       | random processes and some classes  |
//! | the true class        | the simulated class                | the class of least cost            |
//! | cost of another class | between classes                    | on the true process                |
//! | gain of a class       | from the amplitude                 | from the harmonics                 |
//! | the output, `pv`      | zero-padded                        | zero-padded or stretched: [`Fit`]  |
//! | inputs                | amplitude 1                        | amplitude 1, then standardised for training: [`Standard`] |
//! | noise                 | into the finished cycle            | at the sensor of the relay         |
//! | a hidden layer        | ReLU, batch normalisation, dropout | the same, in this order            |
//! | rate, momentum, batch, epochs, dropout, noise | not given | in the recipe                       |
//!
//! Each choice is a field of the recipe, whose default is the right column; what is in the left one and not in the paper is
//! in its authors' published code.
//!
//! A controller has two numbers and a process, apart from its gain, three. So many classes have nearly
//! the same controller, a wrong class is often as good as the right one, and accuracy says little.

mod classes;
mod examples;
mod experiment;
mod harmonic;
mod input;
mod scoring;
mod standard;

use std::ops::Range;

use onecycle_onboard::SoiptdError;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

pub use classes::{Class, Classes, Gain, Measured, Price, TrueProcess, label};
pub use examples::{Examples, Label, Processes, Reading, coordinates, times_at};
pub use experiment::{NoiseKind, Protocol, RelayKind, Trial, Trials};
pub use harmonic::{Harmonics, Response};
pub use input::{Fit, INPUTS, Prepared, SAMPLES};
pub use scoring::{PickRule, Score, least_expected_cost, most_likely, picks};
pub use standard::{Standard, Standardised};

use self::examples::TIMES;
use crate::experiments::ExperimentError;
use crate::learn::train::{
    Layer, Loss, Network, OptimizerMethod, Schedule, TrainError, TrainingSettings,
};
use crate::space::candidate::Gains;
use crate::space::grid;
use crate::space::grid::{Grid, GridError, Layout};
use crate::space::{FieldError, Space, first_out_of_range};
use crate::workers::Workers;
use onecycle_design::soiptd_pd::optimum::OptimumError;

/// Why there is no classifier.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ClassifierError {
    /// A field is out of its range.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// The grid of classes cannot be computed.
    #[error("{0}")]
    Grid(#[from] GridError),
    /// The times are out of range.
    #[error("{0}")]
    Process(#[from] SoiptdError),
    /// A process has no controller.
    #[error("{0}")]
    Optimum(#[from] OptimumError),
    /// An experiment cannot be run.
    #[error("{0}")]
    Experiment(#[from] ExperimentError),
    /// The relay does not make a class oscillate.
    #[error(
        "T_prop, T_body, tau of {0:?} s do not oscillate under this relay: choose a smaller beta"
    )]
    NoOscillation([f64; 3]),
    /// Network and examples do not fit each other.
    #[error("{0}")]
    Train(#[from] TrainError),
    /// The loss reads something other than classes and their costs.
    #[error(
        "losses: a classifier needs a loss over classes, such as cross_entropy, or a regression of the three times, \
         squared_error with dimension 3"
    )]
    Loss,
}

/// Recipe of a classifier, with its examples.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassifierRecipe {
    /// Kind of network; always `classifier` here.
    pub network: ClassifierKind,
    /// Seed of experiments, first weights, shuffling and dropout; below 2^32.
    pub seed: u64,
    /// Space of the processes; the paper's multirotors if left out.
    #[serde(default = "multirotor")]
    pub space: Space,
    /// `J*` of the grid of classes.
    pub deterioration: f64,
    /// How the gain of a class is found.
    #[serde(default)]
    pub gain: Gain,
    /// How the output is fitted into 2260 numbers.
    #[serde(default)]
    pub fit: Fit,
    /// Every n-th of the 4520 inputs alone is used; `n` divides 2260.
    #[serde(default = "one", skip_serializing_if = "is_default_every")]
    pub every: usize,
    /// Scaling of the inputs.
    #[serde(default, skip_serializing_if = "is_default")]
    pub scaling: Scaling,
    /// The true class of an example.
    #[serde(default, skip_serializing_if = "is_default")]
    pub label: Label,
    /// Cost of a class that is not the true one.
    #[serde(default, skip_serializing_if = "is_default")]
    pub price: Price,
    /// The relay of the experiments.
    #[serde(default, skip_serializing_if = "is_default")]
    pub relay: RelayKind,
    /// Where the noise enters.
    #[serde(default, skip_serializing_if = "is_default")]
    pub noise: NoiseKind,
    /// The network that is kept.
    #[serde(default, skip_serializing_if = "is_default")]
    pub keep: Keep,
    /// Layout of the grid of classes.
    #[serde(default, skip_serializing_if = "is_default")]
    pub layout: Layout,
    /// Neurons of the hidden layers.
    pub hidden: Vec<usize>,
    /// Probability of dropout.
    pub dropout: f64,
    /// Experiments to learn from.
    pub examples: u64,
    /// Every n-th example is of a class instead of a random process; 0 for none.
    pub class_every: u64,
    /// Experiments of every class for verification, as in the paper.
    pub verification: u64,
    /// Largest input bias over the relay's amplitude.
    pub bias: f64,
    /// Largest noise over the amplitude of the oscillation.
    pub sigma: f64,
    /// Whether the relay trims the bias away in the examples to learn from.
    pub protocol: Protocol,
    /// Tests on random processes.
    pub tests: Vec<Test>,
    /// Method of the optimiser.
    pub method: OptimizerMethod,
    /// The learning rate.
    pub schedule: Schedule,
    /// Samples per step.
    pub batch: usize,
    /// Largest number of epochs.
    pub epochs: u64,
    /// Number of epochs without a lower loss on the verification set after which training stops.
    #[serde(default)]
    pub patience: Option<u64>,
    /// The losses to compare, one network each.
    pub losses: Vec<Choice>,
}

/// The kind of network, which distinguishes recipes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClassifierKind {
    /// `network = "classifier"`.
    Classifier,
}

/// Scaling of the inputs of a classifier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scaling {
    /// Less their mean, over their deviation: [`Standard::of`].
    #[default]
    Standard,
    /// Less their mean: [`Standard::centred`].
    Centred,
}

/// The network of a training that is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// That of the least loss on the verification set.
    #[default]
    Best,
    /// The last one.
    Last,
}

fn one() -> usize {
    1
}

fn is_default_every(every: &usize) -> bool {
    *every == one()
}

/// Recipes of before name no such field.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// A loss to learn with.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// The loss.
    pub loss: Loss,
    /// Highest learning rate for this loss, because some losses are steeper than others.
    #[serde(default)]
    pub rate: Option<f64>,
}

/// A set of random processes that no network has learnt from.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Test {
    /// Number of processes.
    pub systems: u64,
    /// Seed of the processes; below 2^32.
    pub seed: u64,
    /// Whether the relay trims the bias away.
    pub protocol: Protocol,
}

fn multirotor() -> Space {
    Space::MULTIROTOR
}

/// Limit of seeds and of numbers of experiments: training, verification and tests then never draw from
/// the same seed.
const SEEDS: u64 = 1 << 32;

/// Durations of an experiment with the plain relay (s), to learn from and to test: those of the authors' published code.
const PLAIN_S: [f64; 2] = [10.0, 20.0];

/// Largest number of experiments in memory: some 10 GB.
const MOST_EXAMPLES: u64 = 1_000_000;

/// Largest number of neurons in a layer, for which the first one takes 2 GB.
const MOST_NEURONS: u64 = 100_000;

/// Purpose of experiments.
#[derive(Clone, Copy)]
enum Purpose {
    Training,
    Verification,
    Test,
}

impl ClassifierRecipe {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), ClassifierError> {
        let below = |field, value: u64, range, most: u64| {
            (field, range, value as f64, (0..=most).contains(&value))
        };
        let few = |field, value: u64, range, most: u64| {
            (field, range, value as f64, (1..=most).contains(&value))
        };
        first_out_of_range([
            below("seed", self.seed, "0 to 4294967295", SEEDS - 1),
            few("examples", self.examples, "1 to 1,000,000", MOST_EXAMPLES),
            below(
                "class_every",
                self.class_every,
                "0 to 1,000,000",
                MOST_EXAMPLES,
            ),
            few("verification", self.verification, "1 to 1000", 1000),
            (
                "every",
                "a divisor of 2260",
                self.every as f64,
                self.every > 0 && SAMPLES.is_multiple_of(self.every),
            ),
            few("losses", self.losses.len() as u64, "1 to 100 of them", 100),
            (
                "dropout",
                "0 to 0.9",
                self.dropout,
                (0.0..=0.9).contains(&self.dropout),
            ),
        ])?;
        for &neurons in &self.hidden {
            first_out_of_range([few("hidden", neurons as u64, "1 to 100,000", MOST_NEURONS)])?;
        }
        for test in &self.tests {
            first_out_of_range([
                few(
                    "tests.systems",
                    test.systems,
                    "1 to 1,000,000",
                    MOST_EXAMPLES,
                ),
                below("tests.seed", test.seed, "0 to 4294967295", SEEDS - 1),
            ])?;
        }
        self.grid().validate()?;
        self.trials(Purpose::Training, 0, self.protocol)
            .validate()?;
        for (number, choice) in self.losses.iter().enumerate() {
            match choice.loss {
                Loss::SquaredError { dimension: TIMES } => {}
                loss if loss.outputs().is_some() => return Err(ClassifierError::Loss),
                _ => {}
            }
            self.settings(number).validate()?;
        }
        Ok(())
    }

    fn grid(&self) -> grid::GridSettings {
        grid::GridSettings {
            space: self.space,
            deterioration: self.deterioration,
            layout: self.layout,
            gains: match self.layout {
                Layout::Lattice => Gains::SameMagnitude,
                Layout::Rays | Layout::Fewest => Gains::SameAmplitude,
            },
            ..grid::GridSettings::default()
        }
    }

    fn trials(&self, purpose: Purpose, seed: u64, protocol: Protocol) -> Trials {
        Trials {
            space: self.space,
            seed: (purpose as u64) * 2 * SEEDS + seed,
            bias: self.bias,
            sigma: self.sigma,
            protocol,
            relay: self.relay,
            noise: self.noise,
            duration_s: match purpose {
                Purpose::Training | Purpose::Verification => PLAIN_S[0],
                Purpose::Test => PLAIN_S[1],
            },
        }
    }

    /// Scaling of the inputs, from the examples to learn from.
    #[must_use]
    pub fn scaled(&self, training: &Examples) -> Standard {
        self.scaled_rows(training.inputs(), training.rows())
    }

    /// The same from the rows of this many inputs.
    pub fn scaled_rows(
        &self,
        inputs: usize,
        rows: impl Iterator<Item = impl AsRef<[f32]>>,
    ) -> Standard {
        match self.scaling {
            Scaling::Standard => Standard::of(inputs, rows),
            Scaling::Centred => Standard::centred(inputs, rows),
        }
    }

    /// The classes: a grid of the space.
    ///
    /// # Errors
    /// [`ClassifierError`]: the grid cannot be computed.
    pub fn classes(&self, workers: &dyn Workers) -> Result<Classes, ClassifierError> {
        Classes::priced(&Grid::build(&self.grid(), workers)?, self.price)
    }

    /// The sets, by name, with their numbers of experiments: to learn from; to choose the best epoch with, as many of every
    /// class; and the tests.
    #[must_use]
    pub fn sets(&self, classes: &Classes) -> Vec<(String, u64)> {
        let tests = (1..).zip(&self.tests);
        let tests = tests.map(|(number, test): (u32, _)| (format!("test_{number}"), test.systems));
        let verification = self.verification * classes.len() as u64;
        let first = [("training", self.examples), ("verification", verification)];
        (first.into_iter())
            .map(|(name, size)| (name.to_owned(), size))
            .chain(tests)
            .collect()
    }

    /// Examples of a set, by its place in [`sets`](Self::sets): those of the experiments of these numbers. Panics if there is no
    /// such set.
    ///
    /// # Errors
    /// [`ClassifierError`]: a process has no controller.
    pub fn part(
        &self,
        set: usize,
        numbers: Range<u64>,
        classes: &Classes,
        workers: &dyn Workers,
    ) -> Result<Examples, ClassifierError> {
        let (purpose, seed, protocol) = match set {
            0 => (Purpose::Training, self.seed, self.protocol),
            1 => (Purpose::Verification, self.seed, self.protocol),
            _ => {
                let test = &self.tests[set - 2];
                (Purpose::Test, test.seed, test.protocol)
            }
        };
        let processes = match (purpose, self.class_every) {
            (Purpose::Verification, _) => Processes::Classes,
            (Purpose::Test, _) | (Purpose::Training, 0) => Processes::Random,
            (Purpose::Training, every) => Processes::RandomAndClasses { every },
        };
        let reading = Reading {
            gain: self.gain,
            fit: self.fit,
            label: self.label,
        };
        let trials = self.trials(purpose, seed, protocol);
        let of = (&trials, numbers);
        let examples = Examples::make(of, processes, (classes, reading), workers)?;
        Ok(examples.thinned(self.every))
    }

    /// All sets, in the order of [`sets`](Self::sets).
    ///
    /// # Errors
    /// [`ClassifierError`]: a process has no controller.
    pub fn all_sets(
        &self,
        classes: &Classes,
        workers: &dyn Workers,
    ) -> Result<Vec<Examples>, ClassifierError> {
        (self.sets(classes).iter().enumerate())
            .map(|(set, (_, size))| self.part(set, 0..*size, classes, workers))
            .collect()
    }

    /// Number of inputs of the network.
    #[must_use]
    pub fn inputs(&self) -> usize {
        INPUTS / self.every.max(1)
    }

    fn layers(&self, outputs: usize) -> Vec<Layer> {
        let hidden = (self.hidden.iter()).flat_map(|&outputs| {
            let probability = self.dropout;
            [
                Layer::Dense { outputs },
                Layer::Relu,
                Layer::BatchNorm,
                Layer::Dropout { probability },
            ]
        });
        hidden.chain([Layer::Dense { outputs }]).collect()
    }

    /// The network before training with loss `number`, the same for every loss over classes; panics if there is no such
    /// loss.
    ///
    /// # Errors
    /// Names the first size or probability that is out of its range.
    pub fn network(&self, number: usize, classes: usize) -> Result<Network, ClassifierError> {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed);
        let outputs = self.losses[number].loss.outputs().unwrap_or(classes);
        Ok(Network::new(
            self.inputs(),
            &self.layers(outputs),
            &mut rng,
        )?)
    }

    /// Settings of the training with loss `number`; panics if there is none.
    #[must_use]
    pub fn settings(&self, number: usize) -> TrainingSettings {
        let choice = &self.losses[number];
        let mut schedule = self.schedule;
        schedule.rate = choice.rate.unwrap_or(schedule.rate);
        TrainingSettings {
            loss: choice.loss,
            method: self.method,
            schedule,
            batch: self.batch,
            epochs: self.epochs,
            patience: self.patience,
            seed: self.seed,
        }
    }
}
