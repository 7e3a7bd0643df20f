//! A trained classifier as a method: from a recording to the class of its last steady cycle, and that class's controller.
//!
//! `onecycle-lab train` writes such a network as ONNX, with a [`Card`] that says how to read it.

use onecycle_identify::Signals;
use onecycle_plant::Trace;

use super::classifier::{
    Class, ClassifierError, ClassifierRecipe, Gain, INPUTS, Measured, PickRule, Prepared,
    most_likely,
};
use crate::experiments::{SampledCycle, last_steady_cycle};
use crate::judge::evaluate::Answer;
use crate::learn::onnx::{self, OnnxError};
use crate::learn::train::{Loss, Matrix, Network, TrainError};
use crate::workers::OneThread;
use onecycle_onboard::SoiptdError;

/// Key of the card in the metadata of a model, and its version.
pub const FORMAT: &str = "onecycle.classifier/1";

/// Metadata of a trained classifier.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Card {
    /// The recipe that it was trained by.
    pub recipe: ClassifierRecipe,
    /// The loss of this network.
    pub loss: Loss,
    /// The rule that picks better with it.
    pub rule: PickRule,
    /// `T_prop`, `T_body`, `tau` of every class (s).
    pub classes_s: Vec<[f64; 3]>,
}

/// Why a file is no classifier of the paper.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PaperNetworkError {
    /// The file is not ONNX, or has layers that are not read.
    #[error("{0}")]
    Onnx(#[from] OnnxError),
    /// The model carries no card, or one of another version.
    #[error("it was not written by onecycle-lab train with network = \"classifier\" ({0})")]
    Card(String),
    /// The network does not fit its card.
    #[error(
        "it has {inputs} inputs and {outputs} outputs; {classes} classes need {expected} and {classes}"
    )]
    Size {
        /// Inputs of the network.
        inputs: usize,
        /// Outputs of the network.
        outputs: usize,
        /// Inputs of the card.
        expected: usize,
        /// Classes of the card.
        classes: usize,
    },
    /// A class has no controller.
    #[error("{0}")]
    Class(#[from] ClassifierError),
}

/// Why there is no answer to a recording.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoPick {
    /// The recording ends before the oscillation is steady.
    #[error("the oscillation is not steady")]
    NotSteady,
    /// The cycle has no harmonics: a signal is constant.
    #[error("the cycle has no harmonics")]
    NoHarmonics,
    /// The network cannot be evaluated.
    #[error("{0}")]
    Network(#[from] TrainError),
    /// The gain is out of range.
    #[error("{0}")]
    Process(#[from] SoiptdError),
}

/// A trained classifier. See the [module](self).
#[derive(Clone, Debug)]
pub struct PaperNetwork {
    /// How it was trained.
    pub card: Card,
    network: Network,
    classes: Vec<Class>,
}

impl PaperNetwork {
    /// Reads an ONNX file of `onecycle-lab train`.
    ///
    /// # Errors
    /// [`PaperNetworkError`]: the file is no such network.
    pub fn read(bytes: &[u8]) -> Result<Self, PaperNetworkError> {
        let model = onnx::import(bytes)?;
        let card = model.metadata.get(FORMAT);
        let card =
            card.ok_or_else(|| PaperNetworkError::Card(format!("no {FORMAT} in its metadata")))?;
        let card: Card = serde_json::from_str(card)
            .map_err(|error| PaperNetworkError::Card(error.to_string()))?;
        let (network, classes) = (model.network, card.classes_s.len());
        let (inputs, outputs) = (network.inputs(), network.outputs());
        let expected = INPUTS / card.recipe.every.max(1);
        if (inputs, outputs) != (expected, classes) || model.normalisation.is_some() {
            return Err(PaperNetworkError::Size {
                inputs,
                outputs,
                expected,
                classes,
            });
        }
        let space = &card.recipe.space;
        let class = |&times_s: &[f64; 3]| Class::new(times_s, space.phase_margin_rad(), space.beta);
        let classes = card.classes_s.iter().map(class).collect::<Result<_, _>>()?;
        Ok(Self {
            card,
            network,
            classes,
        })
    }

    /// The most likely class of the last steady cycle, at the gain that the cycle gives it: a process and its controller.
    ///
    /// # Errors
    /// [`NoPick`]: there is no steady cycle, or it has no gain.
    pub fn answer(&self, signals: &Signals<'_>) -> Result<Answer, NoPick> {
        let cycle = last_cycle(signals).ok_or(NoPick::NotSteady)?;
        let recipe = &self.card.recipe;
        // Nothing measured matches the gain of an unknown process.
        let gain = match recipe.gain {
            Gain::Matched => Gain::DescribingFunction,
            measurable => measurable,
        };
        let measured = Measured::of(gain, &cycle, recipe.space.beta).ok_or(NoPick::NoHarmonics)?;
        let mut inputs = Matrix::zeros(1, self.network.inputs());
        Prepared::of(&cycle, recipe.fit).fill(inputs.row_mut(0));
        let outputs = self.network.evaluate(&inputs, &OneThread)?;
        let class = &self.classes[most_likely(outputs.row(0))];
        let process = class.process.with_gain_scaled(class.gain(&measured))?;
        Ok(Answer {
            process: Some(process),
            ..Answer::of_gains(class.controller(&measured))
        })
    }
}

/// The samples of the last steady cycle of a relay of amplitude one.
fn last_cycle(signals: &Signals<'_>) -> Option<SampledCycle> {
    let mut trace = Trace::with_capacity(signals.time_s.len());
    let rows = signals.time_s.iter().zip(signals.input).zip(signals.output);
    for ((&time_s, &input), &output) in rows {
        trace.push(time_s, input, output, output);
    }
    let cycle = last_steady_cycle(&trace)?;
    SampledCycle::of(&trace, &cycle, signals.sample_period_s)
}
