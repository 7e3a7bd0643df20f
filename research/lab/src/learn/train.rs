//! Training of small networks: layers, losses that know the cost of a mistake, optimisers.
//!
//! ```text
//! Dataset -> Batch -> Network -> Loss -> backward -> Optimizer       steps of an epoch
//!                        |                  |
//!                        +- Trainer: shuffles, validates, keeps the best, stops, resumes
//! ```
//!
//! | question                                          | answer                                 |
//! |---------------------------------------------------|----------------------------------------|
//! | which network?                                    | [`Network`], a sequence of [`Layer`]s  |
//! | what does it learn: a class, a cost, a density?   | [`Loss`]                               |
//! | how?                                              | [`OptimizerMethod`], [`Schedule`], [`TrainingSettings`] |
//! | from what?                                        | [`Dataset`], which fills a [`Batch`]   |
//! | how are networks exchanged with PyTorch?          | [`onnx`](crate::learn::onnx)           |
//! | on how many threads?                              | [`Workers`](crate::workers::Workers) of the caller |
//!
//! Rows are samples: inputs `batch x in`, weights of a dense layer `out x in`, outputs `batch x out`.
//! Conventions and names are those of PyTorch, so that numbers can be compared. The same seed gives the
//! same bits on any number of threads and through any interruption.
//!
//! ```
//! use onecycle_lab::learn::train::{Layer, Matrix, Network};
//! use onecycle_lab::workers::OneThread;
//! use rand::SeedableRng;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let layers = [Layer::Dense { outputs: 8 }, Layer::Tanh, Layer::Dense { outputs: 2 }];
//! let network = Network::new(3, &layers, &mut rand_pcg::Pcg64Mcg::seed_from_u64(1))?;
//! let outputs = network.evaluate(&Matrix::zeros(5, 3), &OneThread)?;
//! assert_eq!((outputs.rows(), outputs.columns()), (5, 2));
//! assert_eq!(network.weights(), 8 * 3 + 8 + 2 * 8 + 2);
//! # Ok(())
//! # }
//! ```

mod batch_norm;
mod checkpoint;
mod data;
mod density;
mod layer;
mod loss;
mod matrix;
mod network;
mod optimizer;
mod schedule;
mod softmax;
mod trainer;

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

pub use checkpoint::CheckpointError;
pub use data::{Batch, Dataset};
pub use density::Gaussian;
pub use layer::Layer;
pub use loss::Loss;
pub use matrix::Matrix;
pub use network::{Dropped, Network, Tape};
pub use optimizer::{Optimizer, OptimizerMethod};
pub use schedule::{Schedule, Shape};
pub use trainer::{Epoch, Outcome, Trainer, TrainingSettings};

use crate::space::FieldError;

/// Why training is not possible.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TrainError {
    /// A setting is out of its range.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// Two sizes that must be equal differ.
    #[error("{what} must be {expected}, but is {found}")]
    Size {
        /// Name of the size.
        what: &'static str,
        /// The size that it must have.
        expected: usize,
        /// The size that it has.
        found: usize,
    },
    /// A class that the network has no output for.
    #[error("there is no class {class}: the network has {classes} outputs")]
    Class {
        /// The class.
        class: usize,
        /// Number of outputs.
        classes: usize,
    },
    /// The weights of the samples have no mean.
    #[error(
        "the weights of the samples must be finite and not negative, and their sum must be positive"
    )]
    SampleWeights,
    /// Batch normalisation of a single sample.
    #[error("training with batch normalisation needs batches of at least two samples")]
    OneSample,
    /// A number that no network can hold.
    #[error("layer {layer} of the network: {array} must not hold {value:?}")]
    Value {
        /// Number of the layer, from 0.
        layer: usize,
        /// Name of the array.
        array: &'static str,
        /// The number.
        value: f32,
    },
    /// There are no samples.
    #[error("there are no samples to {0}")]
    NoSample(&'static str),
}

/// Refuses a size other than the expected one.
fn expect_size(what: &'static str, expected: usize, found: usize) -> Result<(), TrainError> {
    if expected == found {
        return Ok(());
    }
    Err(TrainError::Size {
        what,
        expected,
        found,
    })
}

/// Purpose of a stream of random numbers; the streams of one seed are independent.
#[derive(Clone, Copy)]
enum Purpose {
    Shuffling,
    Dropout,
}

/// Stream `number` of a seed for a purpose.
fn stream(seed: u64, purpose: Purpose, number: u64) -> Pcg64Mcg {
    let mut keys = Pcg64Mcg::seed_from_u64(seed);
    let [shuffling, dropout] = [keys.next_u64(), keys.next_u64()];
    let key = match purpose {
        Purpose::Shuffling => shuffling,
        Purpose::Dropout => dropout,
    };
    Pcg64Mcg::seed_from_u64(key.wrapping_add(number))
}
