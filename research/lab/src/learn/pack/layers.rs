//! Layers of a pack: weights in bytes, with a scale for each row.
//!
//! ```text
//! s_o = max_i |w_oi| / 127,   q_oi = w_oi / s_o to the nearest whole number
//! ```
//!
//! The error of a weight is at most `s_o / 2`, 0.4 % of the largest weight in its row.

use onecycle_onboard::network::{Activation, Dense, Weights};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::signature::LENGTH;

use super::PackContentsError;
use crate::learn::train::{Layer, Matrix, Network, TrainError};
use crate::workers::OneThread;

/// Largest magnitude in a signed byte with both signs.
const LARGEST: f32 = 127.0;

/// A dense layer of a pack.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedLayer {
    /// Number of inputs.
    pub inputs: usize,
    /// Weights, one row for each output.
    pub weights: PackedWeights,
    /// Biases, one for each output.
    pub biases: Vec<f32>,
    /// Activation of the sums.
    pub activation: Activation,
}

/// Weights of a layer, row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum PackedWeights {
    /// Single precision.
    Floats(Vec<f32>),
    /// Whole numbers, -127 to 127.
    Bytes {
        /// The numbers.
        rows: Vec<i8>,
        /// Value of a step in each row.
        scales: Vec<f32>,
    },
}

/// Storage of the weights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Four bytes for each weight.
    Floats,
    /// One byte for each weight, and a scale for each row.
    #[default]
    Bytes,
}

/// Effect of weights in bytes on the outputs of a network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantisation {
    /// The largest difference of any output.
    pub largest: f64,
    /// Root mean square of the differences.
    pub rms: f64,
    /// Root mean square of the outputs.
    pub size: f64,
}

impl PackedLayer {
    pub(super) fn of(dense: &Dense<'_>) -> Self {
        let weights = match dense.weights() {
            Weights::Floats(weights) => PackedWeights::Floats(weights.iter().collect()),
            Weights::Bytes { rows, scales } => PackedWeights::Bytes {
                rows: rows.iter().map(|byte| byte.cast_signed()).collect(),
                scales: scales.iter().collect(),
            },
        };
        Self {
            inputs: dense.inputs(),
            weights,
            biases: dense.biases().iter().collect(),
            activation: dense.activation(),
        }
    }

    /// The weights that the layer computes with, row by row.
    #[must_use]
    pub fn values(&self) -> Vec<f32> {
        match &self.weights {
            PackedWeights::Floats(weights) => weights.clone(),
            PackedWeights::Bytes { rows, scales } => (rows.chunks(self.inputs).zip(scales))
                .flat_map(|(row, scale)| row.iter().map(move |&weight| scale * f32::from(weight)))
                .collect(),
        }
    }
}

/// The layers of a network, with batch normalisation folded into them and without dropout.
///
/// # Errors
/// [`PackContentsError::Layer`]: names a layer that a pack cannot hold.
pub fn layers(
    network: &Network,
    precision: Precision,
) -> Result<Vec<PackedLayer>, PackContentsError> {
    let network = network.folded();
    let mut parameters = network.parameters();
    let mut layers: Vec<PackedLayer> = Vec::new();
    for (index, layer) in network.layers().into_iter().enumerate() {
        let refused = |layer| PackContentsError::Layer { index, layer };
        let (activation, name) = match layer {
            Layer::Dense { .. } => {
                let (Some(weight), Some(bias)) = (parameters.next(), parameters.next()) else {
                    return Err(refused("a dense layer without weights"));
                };
                layers.push(dense(weight, bias, precision));
                continue;
            }
            Layer::Relu => (Activation::Relu, "a relu"),
            Layer::Tanh => (Activation::Tanh, "a tanh"),
            Layer::BatchNorm => return Err(refused("a batch normalisation")),
            Layer::Dropout { .. } => return Err(refused("a dropout")),
        };
        match layers.last_mut() {
            Some(last) if last.activation == Activation::None => last.activation = activation,
            _ => return Err(refused(name)),
        }
    }
    Ok(layers)
}

fn dense(weight: &Matrix, bias: &Matrix, precision: Precision) -> PackedLayer {
    PackedLayer {
        inputs: weight.columns(),
        weights: match precision {
            Precision::Floats => PackedWeights::Floats(weight.values().to_vec()),
            Precision::Bytes => quantised(weight),
        },
        biases: bias.values().to_vec(),
        activation: Activation::None,
    }
}

fn quantised(weight: &Matrix) -> PackedWeights {
    let (mut rows, mut scales) = (Vec::new(), Vec::new());
    for row in weight.iter_rows() {
        let largest = row
            .iter()
            .fold(0.0_f32, |most, weight| most.max(weight.abs()));
        let scale = largest / LARGEST;
        // A row of zeros has the scale zero.
        let steps = if scale > 0.0 { scale.recip() } else { 0.0 };
        rows.extend(row.iter().map(|weight| (weight * steps).round() as i8));
        scales.push(scale);
    }
    PackedWeights::Bytes { rows, scales }
}

/// The network that these layers are.
///
/// # Errors
/// Sizes or numbers that no network has.
pub(super) fn network(layers: &[PackedLayer]) -> Result<Network, PackContentsError> {
    let (mut kinds, mut numbers) = (Vec::new(), Vec::new());
    for layer in layers {
        numbers.extend(layer.values());
        numbers.extend(&layer.biases);
        let outputs = layer.biases.len();
        kinds.push(Layer::Dense { outputs });
        kinds.extend(match layer.activation {
            Activation::None => None,
            Activation::Relu => Some(Layer::Relu),
            Activation::Tanh => Some(Layer::Tanh),
        });
    }
    let inputs = layers.first().map_or(0, |layer| layer.inputs);
    Ok(Network::zeros(inputs, &kinds)?.with_numbers(&numbers)?)
}

/// Compares the outputs of a pack with those of its network for these signatures.
///
/// # Errors
/// [`TrainError`]: the network has other sizes, or there is no signature.
pub fn quantisation(
    pack: &Pack<'_>,
    network: &Network,
    signatures: &[[f32; LENGTH]],
) -> Result<Quantisation, TrainError> {
    let normalised = signatures.iter().flat_map(|signature| {
        let normalise = (pack.input_offsets().iter()).zip(pack.input_scales().iter());
        (signature.iter().zip(normalise)).map(|(value, (offset, scale))| (value - offset) * scale)
    });
    let inputs = Matrix::from_rows(signatures.len(), LENGTH, normalised.collect());
    let inputs = inputs
        .filter(|inputs| inputs.rows() > 0)
        .ok_or(TrainError::NoSample("compare on"))?;
    let expected = network.evaluate(&inputs, &OneThread)?;
    let (mut largest, mut off, mut size, mut count) = (0.0_f64, 0.0, 0.0, 0.0);
    for (signature, expected) in signatures.iter().zip(expected.iter_rows()) {
        for (found, expected) in pack.outputs(signature).iter().zip(expected) {
            let difference = f64::from(found - expected);
            largest = largest.max(difference.abs());
            off += difference * difference;
            size += f64::from(*expected) * f64::from(*expected);
            count += 1.0;
        }
    }
    Ok(Quantisation {
        largest,
        rms: (off / count).sqrt(),
        size: (size / count).sqrt(),
    })
}
