//! Layers: names, numbers, forward and backward pass.
//!
//! | layer       | output                                             | tensors                |
//! |-------------|----------------------------------------------------|------------------------|
//! | dense       | `x weight^T + bias`                                | `out x in`, `out`      |
//! | ReLU        | `max(x, 0)`, derivative zero at zero               |                        |
//! | tanh        | `tanh x`                                           |                        |
//! | batch norm  | see its own file                                   | four of `out`          |
//! | dropout     | learning: zero with `p`, else `x / (1 - p)`        |                        |
//! |             | evaluating: `x`                                    |                        |
//!
//! References: K. He, X. Zhang, S. Ren, J. Sun, "Delving deep into rectifiers: surpassing
//! human-level performance on ImageNet classification", ICCV (2015), for the initial weights;
//! N. Srivastava et al., "Dropout: a simple way to prevent neural networks from overfitting",
//! J. Machine Learning Research 15 (2014).

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use super::batch_norm::BatchNorm;
use super::matrix::Matrix;
use super::{Purpose, TrainError, expect_size, stream};
use crate::workers::Workers;

/// A layer as a recipe names it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Layer {
    /// Every output is a weighted sum of all inputs plus a bias.
    Dense {
        /// Number of outputs.
        outputs: usize,
    },
    /// Replaces negative numbers by zero.
    Relu,
    /// Hyperbolic tangent.
    Tanh,
    /// Scales every column to mean zero and variance one, then scales and shifts it.
    BatchNorm,
    /// Replaces random numbers by zero while learning.
    Dropout {
        /// Probability that a number is replaced, 0 to 0.99.
        probability: f64,
    },
}

/// Number of arrays of a layer that are learnt, which come first: weight and bias.
pub(super) const PARAMETERS: usize = 2;

/// Name of the array that holds variances.
pub(super) const RUNNING_VARIANCE: &str = "running_var";

/// A layer with its numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Stage {
    Dense { weight: Matrix, bias: Matrix },
    Relu,
    Tanh,
    BatchNorm(BatchNorm),
    Dropout { probability: f64 },
}

/// Memory of a layer between forward and backward pass.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    /// `x^` of batch normalisation, factors of dropout.
    pub(super) matrix: Matrix,
    /// `1 / sqrt(var + eps)` of batch normalisation.
    pub(super) row: Vec<f64>,
}

/// A layer's part of a forward pass.
pub(super) struct Passed<'a> {
    pub(super) input: &'a Matrix,
    pub(super) output: &'a Matrix,
    pub(super) memory: &'a Memory,
}

/// Draw of a dropout layer: the same for the same seed, step and layer.
#[derive(Clone, Copy)]
pub(super) struct Draw {
    pub(super) seed: u64,
    pub(super) number: u64,
}

impl Stage {
    /// A layer with this number of inputs, weights and biases zero.
    pub(super) fn zeros(layer: Layer, inputs: usize) -> Self {
        match layer {
            Layer::Dense { outputs } => Self::Dense {
                weight: Matrix::zeros(outputs, inputs),
                bias: Matrix::zeros(1, outputs),
            },
            Layer::Relu => Self::Relu,
            Layer::Tanh => Self::Tanh,
            Layer::BatchNorm => Self::BatchNorm(BatchNorm::new(inputs)),
            Layer::Dropout { probability } => Self::Dropout { probability },
        }
    }

    /// Draws the weights of a dense layer: normal with variance `2 / inputs` (He et al.).
    pub(super) fn draw(&mut self, rng: &mut impl Rng) {
        if let Self::Dense { weight, .. } = self {
            let sigma = (2.0 / weight.columns() as f64).sqrt();
            for value in weight.values_mut() {
                let normal: f64 = StandardNormal.sample(rng);
                *value = (sigma * normal) as f32;
            }
        }
    }

    pub(super) fn layer(&self) -> Layer {
        match self {
            Self::Dense { weight, .. } => Layer::Dense {
                outputs: weight.rows(),
            },
            Self::Relu => Layer::Relu,
            Self::Tanh => Layer::Tanh,
            Self::BatchNorm(_) => Layer::BatchNorm,
            Self::Dropout { probability } => Layer::Dropout {
                probability: *probability,
            },
        }
    }

    /// All arrays under PyTorch's names: weight and bias, which are learnt, then running statistics.
    pub(super) fn arrays(&self) -> Vec<(&'static str, &Matrix)> {
        match self {
            Self::Dense { weight, bias } => vec![("weight", weight), ("bias", bias)],
            Self::BatchNorm(norm) => vec![
                ("weight", &norm.weight),
                ("bias", &norm.bias),
                ("running_mean", &norm.running_mean),
                (RUNNING_VARIANCE, &norm.running_var),
            ],
            Self::Relu | Self::Tanh | Self::Dropout { .. } => Vec::new(),
        }
    }

    /// The arrays that are learnt.
    pub(super) fn parameters(&self) -> Vec<&Matrix> {
        let arrays = self.arrays().into_iter().take(PARAMETERS);
        arrays.map(|(_, matrix)| matrix).collect()
    }

    /// As [`Self::arrays`], to change.
    pub(super) fn arrays_mut(&mut self) -> Vec<(&'static str, &mut Matrix)> {
        match self {
            Self::Dense { weight, bias } => vec![("weight", weight), ("bias", bias)],
            Self::BatchNorm(norm) => vec![
                ("weight", &mut norm.weight),
                ("bias", &mut norm.bias),
                ("running_mean", &mut norm.running_mean),
                (RUNNING_VARIANCE, &mut norm.running_var),
            ],
            Self::Relu | Self::Tanh | Self::Dropout { .. } => Vec::new(),
        }
    }

    /// Outputs for evaluation.
    pub(super) fn evaluate(
        &self,
        mut values: Matrix,
        workers: &dyn Workers,
    ) -> Result<Matrix, TrainError> {
        match self {
            Self::Dense { weight, bias } => {
                return dense_evaluated(weight, bias, &values, workers);
            }
            Self::Relu => in_place(&mut values, relu),
            Self::Tanh => in_place(&mut values, f32::tanh),
            Self::BatchNorm(norm) => norm.evaluate(&mut values),
            Self::Dropout { .. } => {}
        }
        Ok(values)
    }

    /// Outputs while learning, and the memory for the backward pass.
    pub(super) fn learn(
        &mut self,
        input: &Matrix,
        (output, memory): (&mut Matrix, &mut Memory),
        draw: Draw,
        workers: &dyn Workers,
    ) -> Result<(), TrainError> {
        match self {
            Self::Dense { weight, bias } => *output = dense(weight, bias, input, workers)?,
            Self::Relu => apply(input, output, relu),
            Self::Tanh => apply(input, output, f32::tanh),
            Self::BatchNorm(norm) => {
                norm.learn(input, output, (&mut memory.matrix, &mut memory.row))?;
            }
            Self::Dropout { probability } => {
                let mut rng = stream(draw.seed, Purpose::Dropout, draw.number);
                let kept = (1.0 - *probability).recip() as f32;
                memory.matrix.reshape(input.rows(), input.columns());
                for factor in memory.matrix.values_mut() {
                    let is_dropped = rng.random::<f64>() < *probability;
                    *factor = if is_dropped { 0.0 } else { kept };
                }
                output.copy_from(input);
                multiply(output, &memory.matrix);
            }
        }
        Ok(())
    }

    /// Computes from the gradient of the outputs those of the parameters, into `into`, and returns that
    /// of the inputs (not computed for the `first` layer). The gradient must have the shape of the
    /// outputs.
    pub(super) fn backward(
        &self,
        passed: &Passed<'_>,
        mut gradient: Matrix,
        into: &mut [Matrix],
        first: bool,
        workers: &dyn Workers,
    ) -> Matrix {
        match self {
            Self::Dense { weight, .. } => {
                if let [of_weight, of_bias] = into {
                    gradient.transposed_times_into(passed.input, workers, of_weight);
                    let sums = gradient.column_sums();
                    for (to, sum) in of_bias.values_mut().iter_mut().zip(sums) {
                        *to = sum as f32;
                    }
                }
                if !first {
                    gradient = gradient.times(weight, workers).unwrap_or_default();
                }
            }
            Self::Relu => by_output(&mut gradient, passed, |y| if y > 0.0 { 1.0 } else { 0.0 }),
            Self::Tanh => by_output(&mut gradient, passed, |y| 1.0 - y * y),
            Self::BatchNorm(norm) => {
                let normal = (&passed.memory.matrix, &passed.memory.row[..]);
                norm.backward(normal, &mut gradient, into);
            }
            Self::Dropout { .. } => multiply(&mut gradient, &passed.memory.matrix),
        }
        gradient
    }
}

/// As [`dense`], for evaluation.
pub(super) fn dense_evaluated(
    weight: &Matrix,
    bias: &Matrix,
    input: &Matrix,
    workers: &dyn Workers,
) -> Result<Matrix, TrainError> {
    let product = input.times_transposed_once(weight, workers);
    with_bias(product, weight, bias, input)
}

fn dense(
    weight: &Matrix,
    bias: &Matrix,
    input: &Matrix,
    workers: &dyn Workers,
) -> Result<Matrix, TrainError> {
    let product = input.times_transposed(weight, workers);
    with_bias(product, weight, bias, input)
}

/// Adds the bias to the product of inputs and weights, if their shapes fit.
fn with_bias(
    product: Option<Matrix>,
    weight: &Matrix,
    bias: &Matrix,
    input: &Matrix,
) -> Result<Matrix, TrainError> {
    expect_size("the number of inputs", weight.columns(), input.columns())?;
    let mut output = product.unwrap_or_default();
    for i in 0..output.rows() {
        for (value, bias) in output.row_mut(i).iter_mut().zip(bias.values()) {
            *value += bias;
        }
    }
    Ok(output)
}

fn relu(x: f32) -> f32 {
    // Not `max`, which would turn NaN into zero.
    if x < 0.0 { 0.0 } else { x }
}

fn in_place(values: &mut Matrix, function: impl Fn(f32) -> f32) {
    for value in values.values_mut() {
        *value = function(*value);
    }
}

fn apply(input: &Matrix, output: &mut Matrix, function: impl Fn(f32) -> f32) {
    output.copy_from(input);
    in_place(output, function);
}

fn multiply(values: &mut Matrix, factors: &Matrix) {
    for (value, factor) in values.values_mut().iter_mut().zip(factors.values()) {
        *value *= factor;
    }
}

/// Multiplies by the derivative, as a function of the output.
fn by_output(gradient: &mut Matrix, passed: &Passed<'_>, derivative: impl Fn(f32) -> f32) {
    for (value, y) in (gradient.values_mut().iter_mut()).zip(passed.output.values()) {
        *value *= derivative(*y);
    }
}
