//! A trained classifier as a method: from a recording to the class of its last steady cycle, and that class's controller.
//!
//! `onecycle-lab train` writes such a network as ONNX, with a [`Card`] that says how to read it.

use onecycle_identify::Signals;
use onecycle_plant::Trace;

use super::classifier::{
    Class, ClassifierError, ClassifierRecipe, Gain, INPUTS, Measured, PickRule, Prepared,
    most_likely,
};
use crate::experiments::{SAMPLE_S, SampledCycle, last_steady_cycle, signals_of};
use crate::judge::evaluate::Answer;
use crate::learn::onnx::{self, OnnxError};
use crate::learn::train::{Loss, Matrix, Network, TrainError};
use crate::workers::OneThread;
use onecycle_onboard::{Pd, SoiptdError};

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
    #[error("the oscillation is not steady: the last three cycles of the relay have to be alike")]
    NotSteady,
    /// The oscillation is faster or slower than that of every class.
    #[error(
        "its period of {period_s:.3} s is outside that of the classes, {shortest_s:.3} to {longest_s:.3} s: train a network for its \
         space (onecycle-lab train)"
    )]
    Period {
        /// Period of the recording (s).
        period_s: f64,
        /// Shortest period of a class (s).
        shortest_s: f64,
        /// Longest period of a class (s), as long as a bias may make it.
        longest_s: f64,
    },
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

/// What a classifier says of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Pick {
    /// Number of the class.
    pub class: usize,
    /// Process and controller, in the units of the recording.
    pub answer: Answer,
    /// Period of the recording (s).
    pub period_s: f64,
    /// Period of the class under the relay of the network's space, without bias (s).
    pub class_period_s: f64,
}

/// End of a recording that is looked at (s): more than any network's fourteen periods.
const END_S: f64 = 60.0;
/// Factor by which a bias that is not trimmed may lengthen the period.
const LENGTHENED: f64 = 3.0;
/// Factor of the shortest period for noise that switches the relay early.
const SHORTENED: f64 = 0.8;

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

    /// The most likely class of the last steady cycle of a relay of amplitude one, sampled as the network has learnt, at the gain
    /// that the cycle gives it: a process and its controller.
    ///
    /// # Errors
    /// [`NoPick`]: there is no steady cycle, or it has no gain.
    pub fn answer(&self, signals: &Signals<'_>) -> Result<Answer, NoPick> {
        let cycle = last_cycle(signals).ok_or(NoPick::NotSteady)?;
        Ok(self.pick(&cycle, 1.0)?.answer)
    }

    /// As [`Self::answer`], of a relay of any levels at any sample rate, whose period must be one that the classes have.
    ///
    /// # Errors
    /// [`NoPick`]: the recording has no steady cycle, no class has its period, or it tells no gain.
    pub fn answer_to_any(&self, signals: &Signals<'_>) -> Result<Pick, NoPick> {
        let (trace, amplitude) = normalised(signals).ok_or(NoPick::NotSteady)?;
        let cycle = last_cycle(&signals_of(&trace, SAMPLE_S)).ok_or(NoPick::NotSteady)?;
        let pick = self.pick(&cycle, amplitude)?;
        let (shortest_s, longest_s) = range(self.classes.iter().map(|class| class.period_s));
        let (shortest_s, longest_s) = (SHORTENED * shortest_s, LENGTHENED * longest_s);
        let period_s = pick.period_s;
        match (shortest_s..=longest_s).contains(&period_s) {
            true => Ok(pick),
            false => Err(NoPick::Period {
                period_s,
                shortest_s,
                longest_s,
            }),
        }
    }

    /// The class of a cycle whose input is in amplitudes of the relay. `amplitude`: that of the relay (input unit).
    fn pick(&self, cycle: &SampledCycle, amplitude: f64) -> Result<Pick, NoPick> {
        let recipe = &self.card.recipe;
        // Nothing measured matches the gain of an unknown process.
        let gain = match recipe.gain {
            Gain::Matched => Gain::DescribingFunction,
            measurable => measurable,
        };
        let measured = Measured::of(gain, cycle, recipe.space.beta).ok_or(NoPick::NoHarmonics)?;
        let mut inputs = Matrix::zeros(1, self.network.inputs());
        Prepared::of(cycle, recipe.fit).fill(inputs.row_mut(0));
        let outputs = self.network.evaluate(&inputs, &OneThread)?;
        let number = most_likely(outputs.row(0));
        let class = &self.classes[number];
        let gain = class.gain(&measured) / amplitude;
        let Pd { kp, kd } = class.controller(&measured);
        let (kp, kd) = (kp * amplitude, kd * amplitude);
        Ok(Pick {
            class: number,
            answer: Answer {
                process: Some(class.process.with_gain_scaled(gain)?),
                ..Answer::of_gains(Pd { kp, kd })
            },
            period_s: cycle.output.len() as f64 * cycle.sample_s,
            class_period_s: class.period_s,
        })
    }
}

/// The end of a recording at the network's sample rate, from zero, its input between -1 and 1, and the relay's amplitude (input
/// unit). The input is held between two samples, the output runs straight. `None` of a constant input.
fn normalised(signals: &Signals<'_>) -> Option<(Trace, f64)> {
    let time_s = signals.time_s;
    let end_s = *time_s.last()?;
    let first = time_s.partition_point(|at_s| *at_s < end_s - END_S);
    let (time_s, input, output) = (
        &time_s[first..],
        &signals.input[first..],
        &signals.output[first..],
    );
    let (low, high) = range(input.iter().copied());
    let (centre, amplitude) = (0.5 * (high + low), 0.5 * (high - low));
    if amplitude <= 0.0 {
        return None;
    }
    let begin_s = *time_s.first()?;
    let count = ((end_s - begin_s) / SAMPLE_S) as usize;
    let mut trace = Trace::with_capacity(count);
    let mut row = 0;
    for sample in 0..count {
        let at_s = sample as f64 * SAMPLE_S;
        // Stamps are as exact as their last digits.
        while row + 2 < time_s.len() && time_s[row + 1] - begin_s <= at_s + 1e-3 * SAMPLE_S {
            row += 1;
        }
        let [before_s, after_s] = [row, row + 1].map(|row| time_s[row] - begin_s);
        let part = (at_s - before_s) / (after_s - before_s);
        let y = output[row] + part * (output[row + 1] - output[row]);
        trace.push(at_s, (input[row] - centre) / amplitude, y, y);
    }
    Some((trace, amplitude))
}

/// Least and largest value.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (value.min(low), value.max(high))
    })
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
