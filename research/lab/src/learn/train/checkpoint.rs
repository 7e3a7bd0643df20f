//! A training between two epochs, as the bytes of a file.
//!
//! ```text
//! line 1    JSON: format "onecycle.training/2", settings, inputs, layers, steps, all epochs
//! bytes     f32, little endian: numbers of the network as it is, of the best network, first moments,
//!           second moments (Adam alone), each array row by row
//! ```

use serde::{Deserialize, Serialize};

use super::TrainError;
use super::layer::Layer;
use super::network::{Network, check_values, count_weights};
use super::optimizer::Optimizer;
use super::trainer::{Epoch, Trainer, TrainingSettings};

/// Changes with every change that a reader could notice.
const FORMAT: &str = "onecycle.training/2";

/// What is wrong with a file of a training.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CheckpointError {
    /// A setting, a size of the network, or a number that no network can hold.
    #[error("{0}")]
    Train(#[from] TrainError),
    /// The file is cut off, or is something else.
    #[error("the file is not a saved training: {0}")]
    Malformed(String),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    format: String,
    settings: TrainingSettings,
    inputs: usize,
    layers: Vec<Layer>,
    steps: u64,
    history: Vec<Epoch>,
}

impl Trainer {
    /// The state between two epochs as bytes.
    ///
    /// # Errors
    /// [`CheckpointError::Malformed`]; never with settings and losses that were finite.
    pub fn save(&self) -> Result<Vec<u8>, CheckpointError> {
        let head = Head {
            format: FORMAT.to_owned(),
            settings: self.settings.clone(),
            inputs: self.network.inputs(),
            layers: self.network.layers(),
            steps: self.optimizer.steps(),
            history: self.history.clone(),
        };
        let mut bytes = serde_json::to_vec(&head)
            .map_err(|error| CheckpointError::Malformed(error.to_string()))?;
        bytes.push(b'\n');
        let networks = [&self.network, &self.best].map(Network::numbers);
        let moments = self.optimizer.moments().into_iter().flatten();
        let moments = moments.flat_map(|matrix| matrix.values());
        for number in networks.iter().flatten().chain(moments) {
            bytes.extend(number.to_le_bytes());
        }
        Ok(bytes)
    }

    /// The training that [`Self::save`] saved; it continues with the same bits as without the pause.
    ///
    /// # Errors
    /// Says what is wrong with the bytes.
    pub fn resume(bytes: &[u8]) -> Result<Self, CheckpointError> {
        let malformed = |reason: &str| CheckpointError::Malformed(reason.to_owned());
        let end = bytes.iter().position(|&byte| byte == b'\n');
        let end = end.ok_or_else(|| malformed("its first line does not end"))?;
        let head: Head = serde_json::from_slice(&bytes[..end])
            .map_err(|error| CheckpointError::Malformed(error.to_string()))?;
        if head.format != FORMAT {
            return Err(malformed("it has another format"));
        }
        let numbers = head.history.iter().map(|epoch| epoch.number);
        if !numbers.eq(1..=head.history.len() as u64) {
            return Err(malformed("its epochs are not numbered from one"));
        }
        let (numbers, cut_off) = bytes[end + 1..].as_chunks();
        // Before memory is asked for: the file must hold the weights that its first line promises.
        let weights = count_weights(head.inputs, &head.layers).map_err(TrainError::from)?;
        if !cut_off.is_empty() || weights > numbers.len() {
            let held = numbers.len();
            let reason = format!("its layers have {weights} numbers, but it holds {held}");
            return Err(CheckpointError::Malformed(reason));
        }
        let numbers: Vec<f32> = numbers.iter().copied().map(f32::from_le_bytes).collect();
        let mut rest = &numbers[..];
        let mut next = |length: usize| -> Result<&[f32], CheckpointError> {
            let (first, after) =
                (rest.split_at_checked(length)).ok_or_else(|| malformed("it is cut off"))?;
            rest = after;
            Ok(first)
        };
        let zeros = Network::zeros(head.inputs, &head.layers)?;
        let network = zeros.clone().with_numbers(next(weights)?)?;
        let best = zeros.with_numbers(next(weights)?)?;
        let mut optimizer =
            Optimizer::new(head.settings.method, &network).map_err(TrainError::from)?;
        let (moments, steps) = optimizer.state_mut();
        *steps = head.steps;
        for (moments, is_square) in moments.into_iter().zip([false, true]) {
            for matrix in moments {
                let values = next(matrix.values().len())?;
                check_values(values, is_square).map_err(|value| {
                    malformed(&format!("a moment of the optimizer is {value:?}"))
                })?;
                matrix.values_mut().copy_from_slice(values);
            }
        }
        if !rest.is_empty() {
            return Err(malformed("bytes follow its last number"));
        }
        let mut trainer = Self::new(head.settings, network)?;
        trainer.best = best;
        trainer.optimizer = optimizer;
        trainer.history = head.history;
        Ok(trainer)
    }
}
