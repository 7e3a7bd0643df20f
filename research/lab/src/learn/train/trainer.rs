//! Epochs: shuffle, step, validate, keep the best, stop early.
//!
//! An epoch visits every sample once, in batches of equal size and in an order that its number and the
//! seed determine; a remainder smaller than a batch waits for another epoch. After each epoch the
//! validation set is evaluated, and the network with the least validation loss is kept.
//!
//! Between epochs [`Trainer::save`] saves the whole state; a training that was stopped there and
//! resumed gives the same bits as one that was not.

use std::ops::ControlFlow;

use rand::seq::SliceRandom;

use super::data::{Batch, Dataset};
use super::loss::Loss;
use super::matrix::Matrix;
use super::network::{Dropped, Network, Tape};
use super::optimizer::{Optimizer, OptimizerMethod};
use super::schedule::Schedule;
use super::{Purpose, TrainError, expect_size, stream};
use crate::space::FieldError;
use crate::workers::Workers;

/// Settings of a training.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingSettings {
    /// The loss.
    pub loss: Loss,
    /// Method of the optimiser.
    pub method: OptimizerMethod,
    /// The learning rate.
    pub schedule: Schedule,
    /// Samples per step; all of them if there are fewer.
    pub batch: usize,
    /// Largest number of epochs.
    pub epochs: u64,
    /// Number of epochs without a lower validation loss after which training stops; never if left out.
    #[serde(default)]
    pub patience: Option<u64>,
    /// Seed of the shuffling and of dropout.
    pub seed: u64,
}

impl TrainingSettings {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        self.loss.validate()?;
        self.method.validate()?;
        self.schedule.validate()?;
        for (field, value) in [
            ("batch", self.batch as u64),
            ("epochs", self.epochs),
            ("patience", self.patience.unwrap_or(1)),
        ] {
            if value == 0 {
                return Err(FieldError {
                    field,
                    range: "1 or more",
                    value: 0.0,
                });
            }
        }
        Ok(())
    }
}

/// Result of an epoch.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Epoch {
    /// Number of the epoch, from one.
    pub number: u64,
    /// Mean loss of the steps, each evaluated before the step.
    pub training_loss: f64,
    /// Loss over the validation set after the epoch.
    pub validation_loss: f64,
    /// Learning rate of the last step.
    pub rate: f64,
    /// Whether no epoch before had a lower validation loss.
    pub is_best: bool,
}

/// Why training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All epochs are done.
    Finished,
    /// The validation loss has not fallen for the number of epochs in `patience`.
    StoppedEarly,
    /// The caller paused the training.
    Paused,
    /// A loss was not finite; the best network before that is kept.
    Diverged,
}

/// A network in training.
#[derive(Clone, Debug, PartialEq)]
pub struct Trainer {
    pub(super) settings: TrainingSettings,
    pub(super) network: Network,
    pub(super) best: Network,
    pub(super) optimizer: Optimizer,
    pub(super) history: Vec<Epoch>,
}

/// Buffers of a run.
#[derive(Default)]
struct Workshop {
    tape: Tape,
    batch: Batch,
    gradient: Matrix,
}

impl Trainer {
    /// A training before its first epoch.
    ///
    /// # Errors
    /// [`TrainError`]: names the first setting that is out of its range; or the network has another
    /// number of outputs than the loss needs.
    pub fn new(settings: TrainingSettings, network: Network) -> Result<Self, TrainError> {
        settings.validate()?;
        if let Some(outputs) = settings.loss.outputs() {
            expect_size("the number of outputs", outputs, network.outputs())?;
        }
        Ok(Self {
            optimizer: Optimizer::new(settings.method, &network)?,
            best: network.clone(),
            history: Vec::new(),
            network,
            settings,
        })
    }

    /// The current network.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// The network with the least validation loss; before the first epoch, the initial one.
    #[must_use]
    pub fn best(&self) -> &Network {
        &self.best
    }

    /// The epochs so far.
    #[must_use]
    pub fn history(&self) -> &[Epoch] {
        &self.history
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &TrainingSettings {
        &self.settings
    }

    /// Trains until the last epoch, until patience ends, or until `progress`, which is called after
    /// every epoch, breaks.
    ///
    /// # Errors
    /// [`TrainError`]: data, loss and network do not fit each other.
    pub fn run(
        &mut self,
        training: &dyn Dataset,
        validation: &dyn Dataset,
        workers: &dyn Workers,
        progress: &mut dyn FnMut(&Epoch) -> ControlFlow<()>,
    ) -> Result<Outcome, TrainError> {
        if training.is_empty() {
            return Err(TrainError::NoSample("learn from"));
        }
        if validation.is_empty() {
            return Err(TrainError::NoSample("validate with"));
        }
        let mut workshop = Workshop::default();
        loop {
            if let Some(outcome) = self.end() {
                return Ok(outcome);
            }
            let Some((training_loss, rate)) = self.epoch(training, workers, &mut workshop)? else {
                return Ok(Outcome::Diverged);
            };
            let validation_loss = self.validate(validation, workers, &mut workshop)?;
            if !validation_loss.is_finite() {
                return Ok(Outcome::Diverged);
            }
            let lowest = (self.history.iter())
                .map(|epoch| epoch.validation_loss)
                .fold(f64::INFINITY, f64::min);
            let epoch = Epoch {
                number: self.history.len() as u64 + 1,
                training_loss,
                validation_loss,
                rate,
                is_best: validation_loss < lowest,
            };
            if epoch.is_best {
                self.best.clone_from(&self.network);
            }
            self.history.push(epoch);
            if progress(&epoch).is_break() {
                return Ok(self.end().unwrap_or(Outcome::Paused));
            }
        }
    }

    /// The outcome, if training has ended.
    fn end(&self) -> Option<Outcome> {
        let epochs = self.history.len() as u64;
        if epochs >= self.settings.epochs {
            return Some(Outcome::Finished);
        }
        let best = self.history.iter().rfind(|epoch| epoch.is_best)?.number;
        let patience = self.settings.patience?;
        (epochs - best >= patience).then_some(Outcome::StoppedEarly)
    }

    /// Mean loss and last rate of the steps of an epoch; `None` if a loss is not finite.
    fn epoch(
        &mut self,
        training: &dyn Dataset,
        workers: &dyn Workers,
        workshop: &mut Workshop,
    ) -> Result<Option<(f64, f64)>, TrainError> {
        let Workshop {
            tape,
            batch,
            gradient,
        } = workshop;
        let epochs_before = self.history.len() as u64;
        let mut order: Vec<usize> = (0..training.len()).collect();
        order.shuffle(&mut stream(
            self.settings.seed,
            Purpose::Shuffling,
            epochs_before,
        ));
        let size = self.settings.batch.min(order.len());
        let steps = order.len() / size;
        let (mut sum, mut rate) = (0.0, 0.0);
        for (i, samples) in order.chunks_exact(size).enumerate() {
            training.fill(samples, batch);
            expect_size("the samples of a batch", size, batch.inputs.rows())?;
            let dropped = Dropped {
                seed: self.settings.seed,
                step: self.optimizer.steps(),
            };
            self.network
                .forward(tape, &batch.inputs, dropped, workers)?;
            let outputs = tape.outputs().unwrap_or(&batch.inputs);
            let loss = self.settings.loss.evaluate(outputs, batch, gradient)?;
            if !loss.is_finite() {
                return Ok(None);
            }
            sum += loss;
            self.network.backward(tape, gradient, workers)?;
            let epochs = epochs_before as f64 + (i as f64 + 0.5) / steps as f64;
            rate = self.settings.schedule.rate_after(epochs);
            self.optimizer
                .step(&mut self.network, tape, rate, workers)?;
        }
        Ok(Some((sum / steps as f64, rate)))
    }

    fn validate(
        &self,
        validation: &dyn Dataset,
        workers: &dyn Workers,
        workshop: &mut Workshop,
    ) -> Result<f64, TrainError> {
        let batch = &mut workshop.batch;
        let order: Vec<usize> = (0..validation.len()).collect();
        let (mut sum, mut total) = (0.0, 0.0);
        for samples in order.chunks(self.settings.batch) {
            validation.fill(samples, batch);
            expect_size("the samples of a batch", samples.len(), batch.inputs.rows())?;
            let outputs = self.network.evaluate(&batch.inputs, workers)?;
            let weight = batch.total_weight()?;
            let gradient = &mut workshop.gradient;
            sum += weight * self.settings.loss.evaluate(&outputs, batch, gradient)?;
            total += weight;
        }
        Ok(sum / total)
    }
}
