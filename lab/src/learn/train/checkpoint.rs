//! A training between two epochs, as a file: safetensors.
//!
//! ```text
//! network.0.weight ..    the network as it is          first.0, first.1, ..    velocities or means
//! best.0.weight ..       the one of least loss         second.0, ..            mean squares
//! metadata "onecycle.training/1": JSON of settings, inputs, layers, steps and all epochs
//! ```

use serde::{Deserialize, Serialize};

use super::TrainError;
use super::layer::Layer;
use super::network::{Network, count_weights};
use super::optimizer::Optimizer;
use super::tensor_file::{Tensor, TensorFile, TensorFileError};
use super::trainer::{Epoch, Trainer, TrainingSettings};

/// Key of the metadata; changes with every change that a reader could notice.
const FORMAT: &str = "onecycle.training/1";

/// What is wrong with a file of a training.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CheckpointError {
    /// A tensor, or the file around it.
    #[error("{0}")]
    File(#[from] TensorFileError),
    /// A setting, or a size of the network.
    #[error("{0}")]
    Train(#[from] TrainError),
    /// What is not a tensor.
    #[error("the file is not one of a training: {0}")]
    Metadata(String),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Progress {
    settings: TrainingSettings,
    inputs: usize,
    layers: Vec<Layer>,
    steps: u64,
    history: Vec<Epoch>,
}

impl Trainer {
    /// All there is between two epochs, as the bytes of a safetensors file.
    ///
    /// # Errors
    /// Never with settings and losses that were finite.
    pub fn save(&self) -> Result<Vec<u8>, CheckpointError> {
        let progress = Progress {
            settings: self.settings.clone(),
            inputs: self.network.inputs(),
            layers: self.network.layers(),
            steps: self.optimizer.steps(),
            history: self.history.clone(),
        };
        let progress = serde_json::to_string(&progress)
            .map_err(|error| CheckpointError::Metadata(error.to_string()))?;
        let mut file = TensorFile::default();
        file.metadata.insert(FORMAT.to_owned(), progress);
        for (prefix, network) in [("network", &self.network), ("best", &self.best)] {
            for mut tensor in network.tensors() {
                tensor.name = format!("{prefix}.{}", tensor.name);
                file.tensors.push(tensor);
            }
        }
        for (prefix, moments) in ["first", "second"]
            .into_iter()
            .zip(self.optimizer.moments())
        {
            for (i, matrix) in moments.iter().enumerate() {
                file.tensors.push(Tensor {
                    name: format!("{prefix}.{i}"),
                    shape: vec![matrix.rows(), matrix.columns()],
                    values: matrix.values().to_vec(),
                });
            }
        }
        Ok(file.to_bytes())
    }

    /// The training that [`Self::save`] saved: what it does next has the bits it would have had.
    ///
    /// # Errors
    /// Says what is wrong with the file.
    pub fn resume(bytes: &[u8]) -> Result<Self, CheckpointError> {
        let mut file = TensorFile::from_bytes(bytes)?;
        let progress = (file.metadata.get(FORMAT))
            .ok_or_else(|| CheckpointError::Metadata(format!("it has no {FORMAT}")))?;
        let progress: Progress = serde_json::from_str(progress)
            .map_err(|error| CheckpointError::Metadata(error.to_string()))?;
        let Progress {
            settings,
            inputs,
            layers,
            steps,
            history,
        } = progress;
        // Before memory is asked for: the file must hold the weights it speaks of.
        let weights = count_weights(inputs, &layers).map_err(TrainError::from)?;
        let held: usize = file.tensors.iter().map(|tensor| tensor.values.len()).sum();
        if weights > held {
            let reason = format!("its layers have {weights} numbers, but it holds {held}");
            return Err(CheckpointError::Metadata(reason));
        }
        let numbers = history.iter().map(|epoch| epoch.number);
        if !numbers.eq(1..=history.len() as u64) {
            let reason = "its epochs are not numbered from one".to_owned();
            return Err(CheckpointError::Metadata(reason));
        }
        let mut network = Network::zeros(inputs, &layers)?;
        let mut best = network.clone();
        network.take(&mut file, "network.")?;
        best.take(&mut file, "best.")?;
        let mut optimizer = Optimizer::new(settings.method, &network).map_err(TrainError::from)?;
        take_moments(&mut optimizer, &mut file, steps)?;
        file.expect_nothing_left()?;
        let mut trainer = Self::new(settings, network)?;
        trainer.best = best;
        trainer.optimizer = optimizer;
        trainer.history = history;
        Ok(trainer)
    }
}

fn take_moments(
    optimizer: &mut Optimizer,
    file: &mut TensorFile,
    steps_taken: u64,
) -> Result<(), TensorFileError> {
    let (moments, steps) = optimizer.state_mut();
    *steps = steps_taken;
    for ((prefix, moments), is_variance) in
        (["first", "second"].into_iter().zip(moments)).zip([false, true])
    {
        for (i, matrix) in moments.iter_mut().enumerate() {
            let tensor = file.take(&format!("{prefix}.{i}"))?;
            tensor.expect_shape(&[matrix.rows(), matrix.columns()])?;
            tensor.expect_values(is_variance)?;
            matrix.values_mut().copy_from_slice(&tensor.values);
        }
    }
    Ok(())
}
