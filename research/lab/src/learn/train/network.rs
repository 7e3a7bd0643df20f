//! A network: layers one after another.
//!
//! Learning goes forward and backward through a [`Tape`], which keeps the output of each layer;
//! evaluation keeps nothing. [`Network::folded`] multiplies batch normalisation into the dense layers
//! next to it: for `y = W x + b` and `z = scale y + shift`
//!
//! ```text
//! after a dense layer      W := diag(scale) W,   b := scale b + shift
//! before a dense layer     b := b + W shift,     W := W diag(scale)
//! ```
//!
//! Networks are exchanged with other programs as ONNX ([`onnx`](crate::learn::onnx)).

use rand::Rng;

use super::layer::{Draw, Layer, Memory, PARAMETERS, Passed, RUNNING_VARIANCE, Stage};
use super::matrix::Matrix;
use super::{TrainError, expect_size};
use crate::space::FieldError;
use crate::workers::Workers;

/// Largest number of weights: 4 GB.
const MOST_WEIGHTS: usize = 1 << 30;

/// Largest probability of dropout; beyond, hardly any number is left.
const MOST_DROPPED: f64 = 0.99;

/// Layers one after another. See the [module](super).
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    inputs: usize,
    stages: Vec<Stage>,
}

/// Memory of a forward pass for the backward pass. One tape serves all steps.
#[derive(Clone, Debug, Default)]
pub struct Tape {
    /// The inputs, then the output of each layer.
    values: Vec<Matrix>,
    memories: Vec<Memory>,
    /// Gradient of every parameter, in their order.
    gradients: Vec<Matrix>,
}

impl Tape {
    /// The network's outputs, `batch x out`.
    #[must_use]
    pub fn outputs(&self) -> Option<&Matrix> {
        self.values.last()
    }

    /// Gradients of the parameters, in the order of [`Network::parameters`].
    #[must_use]
    pub fn gradients(&self) -> &[Matrix] {
        &self.gradients
    }
}

/// Draw of dropout: the same for the same step and seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dropped {
    /// Seed of the training.
    pub seed: u64,
    /// Number of the step.
    pub step: u64,
}

impl Network {
    /// A network with this number of inputs, random weights (He et al.: normal, variance `2 / inputs`)
    /// and biases zero.
    ///
    /// # Errors
    /// Names the first size or probability that is out of its range.
    pub fn new(inputs: usize, layers: &[Layer], rng: &mut impl Rng) -> Result<Self, TrainError> {
        let mut network = Self::zeros(inputs, layers)?;
        for stage in &mut network.stages {
            stage.draw(rng);
        }
        Ok(network)
    }

    /// As [`Self::new`], with all weights zero, to be filled by [`Self::with_numbers`].
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn zeros(inputs: usize, layers: &[Layer]) -> Result<Self, TrainError> {
        count_weights(inputs, layers)?;
        let mut width = inputs;
        let stages = (layers.iter())
            .map(|&layer| {
                let stage = Stage::zeros(layer, width);
                width = width_after(layer, width);
                stage
            })
            .collect();
        Ok(Self { inputs, stages })
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        (self.stages.iter()).fold(self.inputs, |width, stage| {
            width_after(stage.layer(), width)
        })
    }

    /// The layers.
    #[must_use]
    pub fn layers(&self) -> Vec<Layer> {
        self.stages.iter().map(Stage::layer).collect()
    }

    /// Number of numbers that are learnt.
    #[must_use]
    pub fn weights(&self) -> usize {
        self.parameters().map(|matrix| matrix.values().len()).sum()
    }

    /// The arrays that are learnt: of each layer in turn its weight, `out x in` or a row, and its bias,
    /// a row.
    pub fn parameters(&self) -> impl Iterator<Item = &Matrix> {
        self.stages.iter().flat_map(Stage::parameters)
    }

    /// As [`Self::parameters`], to change.
    pub(super) fn parameters_mut(&mut self) -> impl Iterator<Item = &mut Matrix> {
        (self.stages.iter_mut())
            .flat_map(|stage| stage.arrays_mut().into_iter().take(PARAMETERS))
            .map(|(_, matrix)| matrix)
    }

    /// The outputs, `batch x out`, for inputs `batch x in`, without dropout and with running
    /// statistics. A sample has the same bits in any batch of two or more; alone it agrees to rounding.
    ///
    /// # Errors
    /// [`TrainError::Size`]: the number of inputs is not the network's.
    pub fn evaluate(&self, inputs: &Matrix, workers: &dyn Workers) -> Result<Matrix, TrainError> {
        expect_size("the number of inputs", self.inputs, inputs.columns())?;
        let mut values = None;
        for stage in &self.stages {
            values = Some(match (values, stage) {
                (None, Stage::Dense { weight, bias }) => {
                    super::layer::dense_evaluated(weight, bias, inputs, workers)?
                }
                (None, _) => stage.evaluate(inputs.clone(), workers)?,
                (Some(values), _) => stage.evaluate(values, workers)?,
            });
        }
        Ok(values.unwrap_or_else(|| inputs.clone()))
    }

    /// The forward pass of a step: with dropout and the statistics of the batch, which also update the
    /// running statistics. The outputs, `batch x out`, are on the tape.
    ///
    /// # Errors
    /// [`TrainError`]: the number of inputs is not the network's, or a single sample is to be
    /// normalised.
    pub fn forward(
        &mut self,
        tape: &mut Tape,
        inputs: &Matrix,
        dropped: Dropped,
        workers: &dyn Workers,
    ) -> Result<(), TrainError> {
        expect_size("the number of inputs", self.inputs, inputs.columns())?;
        let layers = self.stages.len();
        tape.values.resize_with(layers + 1, Matrix::default);
        tape.memories.resize_with(layers, Memory::default);
        tape.values[0].copy_from(inputs);
        for (i, stage) in self.stages.iter_mut().enumerate() {
            let (before, after) = tape.values.split_at_mut(i + 1);
            let draw = Draw {
                seed: dropped.seed,
                number: (dropped.step.wrapping_mul(layers as u64)).wrapping_add(i as u64),
            };
            let out = (&mut after[0], &mut tape.memories[i]);
            stage.learn(&before[i], out, draw, workers)?;
        }
        Ok(())
    }

    /// The backward pass after [`Self::forward`]: from the gradient with respect to the outputs,
    /// `batch x out`, to [`Tape::gradients`].
    ///
    /// # Errors
    /// [`TrainError::Size`]: the gradient does not have the shape of the tape's outputs.
    pub fn backward(
        &self,
        tape: &mut Tape,
        gradient: &Matrix,
        workers: &dyn Workers,
    ) -> Result<(), TrainError> {
        expect_size(
            "the layers on the tape",
            self.stages.len(),
            tape.memories.len(),
        )?;
        let Some(outputs) = tape.outputs() else {
            return Err(TrainError::NoSample("go back from"));
        };
        expect_size("the rows of the gradient", outputs.rows(), gradient.rows())?;
        let (expected, found) = (outputs.columns(), gradient.columns());
        expect_size("the columns of the gradient", expected, found)?;
        let parameters = self.parameters().count();
        tape.gradients.resize_with(parameters, Matrix::default);
        for (gradient, parameter) in tape.gradients.iter_mut().zip(self.parameters()) {
            gradient.reshape(parameter.rows(), parameter.columns());
        }
        let mut rest = &mut tape.gradients[..];
        let mut gradient = gradient.clone();
        for (i, stage) in self.stages.iter().enumerate().rev() {
            let (earlier, own) = rest.split_at_mut(rest.len() - stage.parameters().len());
            rest = earlier;
            let passed = Passed {
                input: &tape.values[i],
                output: &tape.values[i + 1],
                memory: &tape.memories[i],
            };
            gradient = stage.backward(&passed, gradient, own, i == 0, workers);
        }
        Ok(())
    }

    /// The same function for evaluation, without dropout, and without batch normalisation wherever a
    /// dense layer is before or after it.
    #[must_use]
    pub fn folded(&self) -> Self {
        let mut stages: Vec<Stage> = Vec::new();
        // The batch normalisation that waits for the next dense layer.
        let mut waiting: Option<Stage> = None;
        let kept = (self.stages.iter()).filter(|stage| !matches!(stage, Stage::Dropout { .. }));
        for stage in kept.cloned() {
            match (stage, waiting.take()) {
                (Stage::Dense { weight, bias }, Some(Stage::BatchNorm(norm))) => {
                    let columns: Vec<_> = norm.scale_and_shift().collect();
                    stages.push(folded_before(weight, bias, &columns));
                }
                (Stage::BatchNorm(norm), held) => {
                    stages.extend(held);
                    if let Some(Stage::Dense { weight, bias }) = stages.last_mut() {
                        for (i, (scale, shift)) in norm.scale_and_shift().enumerate() {
                            for value in weight.row_mut(i) {
                                *value = (scale * f64::from(*value)) as f32;
                            }
                            let bias = &mut bias.values_mut()[i];
                            *bias = (scale * f64::from(*bias) + shift) as f32;
                        }
                    } else {
                        waiting = Some(Stage::BatchNorm(norm));
                    }
                }
                (stage, held) => {
                    stages.extend(held);
                    stages.push(stage);
                }
            }
        }
        stages.extend(waiting);
        Self {
            inputs: self.inputs,
            stages,
        }
    }

    /// Every array with its name: of each layer in turn weight and bias, then running mean and running
    /// variance. The names are those of PyTorch in a `Sequential`: `0.weight`, `0.bias`, `1.running_mean`.
    pub fn arrays(&self) -> impl Iterator<Item = (String, &Matrix)> {
        (self.stages.iter().enumerate()).flat_map(|(i, stage)| {
            let arrays = stage.arrays().into_iter();
            arrays.map(move |(name, matrix)| (format!("{i}.{name}"), matrix))
        })
    }

    /// All numbers of [`Self::arrays`], one array after the other, row by row.
    #[must_use]
    pub fn numbers(&self) -> Vec<f32> {
        (self.arrays())
            .flat_map(|(_, matrix)| matrix.values().iter().copied())
            .collect()
    }

    /// The same layers with other numbers, in the order of [`Self::numbers`].
    ///
    /// # Errors
    /// Another count of numbers; a number that is not finite, or a negative variance.
    pub fn with_numbers(mut self, numbers: &[f32]) -> Result<Self, TrainError> {
        let expected = self.arrays().map(|(_, matrix)| matrix.values().len()).sum();
        expect_size("the count of numbers", expected, numbers.len())?;
        let mut rest = numbers;
        for (layer, stage) in self.stages.iter_mut().enumerate() {
            for (array, matrix) in stage.arrays_mut() {
                let (values, after) = rest.split_at(matrix.values().len());
                rest = after;
                check_values(values, array == RUNNING_VARIANCE).map_err(|value| {
                    TrainError::Value {
                        layer,
                        array,
                        value,
                    }
                })?;
                matrix.values_mut().copy_from_slice(values);
            }
        }
        Ok(self)
    }
}

/// The first number that no network can hold: not finite, or negative for a variance.
pub(super) fn check_values(values: &[f32], is_variance: bool) -> Result<(), f32> {
    let is_wrong = |value: &&f32| !value.is_finite() || is_variance && **value < 0.0;
    match values.iter().find(is_wrong) {
        None => Ok(()),
        Some(&value) => Err(value),
    }
}

fn width_after(layer: Layer, width: usize) -> usize {
    match layer {
        Layer::Dense { outputs } => outputs,
        _ => width,
    }
}

/// Number of numbers of such a network, with running statistics; names the first size or probability
/// that is out of its range.
pub(super) fn count_weights(inputs: usize, layers: &[Layer]) -> Result<usize, FieldError> {
    let size = |field, value: usize| FieldError {
        field,
        range: "1 or more, with less than 2^30 weights in all",
        value: value as f64,
    };
    if inputs == 0 {
        return Err(size("inputs", inputs));
    }
    let mut width = inputs;
    let mut weights = 0_usize;
    for &layer in layers {
        match layer {
            Layer::Dense { outputs } => {
                let more = width.saturating_add(1).saturating_mul(outputs);
                weights = weights.saturating_add(more);
                if outputs == 0 || weights > MOST_WEIGHTS {
                    return Err(size("outputs", outputs));
                }
            }
            Layer::BatchNorm => {
                weights = weights.saturating_add(width.saturating_mul(4));
                if weights > MOST_WEIGHTS {
                    return Err(size("inputs", width));
                }
            }
            Layer::Dropout { probability } if !(0.0..=MOST_DROPPED).contains(&probability) => {
                return Err(FieldError {
                    field: "probability",
                    range: "0 to 0.99",
                    value: probability,
                });
            }
            _ => {}
        }
        width = width_after(layer, width);
    }
    Ok(weights)
}

/// A dense layer with the batch normalisation before it folded into it.
fn folded_before(mut weight: Matrix, mut bias: Matrix, columns: &[(f64, f64)]) -> Stage {
    for (i, bias) in bias.values_mut().iter_mut().enumerate() {
        let mut sum = f64::from(*bias);
        for (value, (scale, shift)) in weight.row_mut(i).iter_mut().zip(columns) {
            sum += f64::from(*value) * shift;
            *value = (scale * f64::from(*value)) as f32;
        }
        *bias = sum as f32;
    }
    Stage::Dense { weight, bias }
}
