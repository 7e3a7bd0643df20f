//! Networks of the layers of a pack, and of tensors that came without their layers.
//!
//! A file of tensors names them as PyTorch does in a `Sequential`: `0.weight`, `0.bias`, `2.weight`.
//! What stands at the numbers without tensors it does not say: the first behind a dense layer is
//! its activation, which somebody else must know, and any further one is dropout.

use std::collections::BTreeMap;

use onecycle_onboard::network::Activation;

use super::{PackContentsError, PackedLayer};
use crate::learn::train::{Layer, Network, Tensor, TensorFile, TensorFileError};

/// The network that these layers are.
///
/// # Errors
/// Where they are none.
pub fn network_of_layers(layers: &[PackedLayer]) -> Result<Network, PackContentsError> {
    let (mut file, mut kinds) = (TensorFile::default(), Vec::new());
    for layer in layers {
        let outputs = layer.biases.len();
        let mut tensor = |name: &str, shape: Vec<usize>, values: Vec<f32>| {
            let name = format!("{}.{name}", kinds.len());
            file.tensors.push(Tensor {
                name,
                shape,
                values,
            });
        };
        tensor("weight", vec![outputs, layer.inputs], layer.values());
        tensor("bias", vec![outputs], layer.biases.clone());
        kinds.push(Layer::Dense { outputs });
        kinds.extend(kind(layer.activation));
    }
    let inputs = layers.first().map_or(0, |layer| layer.inputs);
    let mut network = Network::zeros(inputs, &kinds)?;
    network.take(&mut file, "")?;
    Ok(network)
}

/// The network of a safetensors file, whose dense layers have these activations.
///
/// # Errors
/// Says what is wrong with the file, or which tensor is not of such a network.
pub fn network_of_tensors(
    bytes: &[u8],
    activations: &[Activation],
) -> Result<Network, PackContentsError> {
    let file = TensorFile::from_bytes(bytes)?;
    let mut held: Vec<Option<Layer>> = Vec::new();
    let mut dense: BTreeMap<usize, &Tensor> = BTreeMap::new();
    for tensor in &file.tensors {
        let unknown = || PackContentsError::Name(tensor.name.clone());
        let (number, name) = tensor.name.split_once('.').ok_or_else(unknown)?;
        // A network has a few layers; a number beyond is none of one.
        let number: usize = number.parse().map_err(|_| unknown())?;
        if number >= MOST_NUMBERED {
            return Err(unknown());
        }
        if held.len() <= number {
            held.resize(number + 1, None);
        }
        match (name, &tensor.shape[..]) {
            ("weight", &[outputs, _]) => {
                held[number] = Some(Layer::Dense { outputs });
                dense.insert(number, tensor);
            }
            ("running_mean", _) => held[number] = Some(Layer::BatchNorm),
            ("weight" | "bias" | "running_var", _) => {}
            _ => return Err(unknown()),
        }
    }
    let layers = with_activations(&held, activations)?;
    let inputs = chained(dense.values().copied())?;
    let mut network = Network::zeros(inputs, &layers)?;
    network.load(bytes)?;
    Ok(network)
}

/// The inputs of the first of these weights; refuses any that do not take what the one before puts
/// out, before memory is asked for.
fn chained<'a>(weights: impl Iterator<Item = &'a Tensor>) -> Result<usize, TensorFileError> {
    let mut first = None;
    let mut width = None;
    for tensor in weights {
        let &[outputs, inputs] = &tensor.shape[..] else {
            continue;
        };
        first.get_or_insert(inputs);
        match width.replace(outputs) {
            Some(width) if width != inputs => {
                return Err(TensorFileError::Shape {
                    name: tensor.name.clone(),
                    expected: vec![outputs, width],
                    found: tensor.shape.clone(),
                });
            }
            _ => {}
        }
    }
    Ok(first.unwrap_or(0))
}

/// Numbers of layers in a file, far more than any network here has.
const MOST_NUMBERED: usize = 1000;

/// The layers of a file with activations, one for each dense layer, and dropout where it has none.
fn with_activations(
    held: &[Option<Layer>],
    activations: &[Activation],
) -> Result<Vec<Layer>, PackContentsError> {
    let is_dense = |layer: &Option<Layer>| matches!(layer, Some(Layer::Dense { .. }));
    let found = held.iter().filter(|layer| is_dense(layer)).count();
    let expected = activations.len();
    if found != expected {
        return Err(PackContentsError::Depth { expected, found });
    }
    let mut layers = Vec::new();
    let mut waiting = Activation::None;
    let mut activations = activations.iter();
    for (number, layer) in held.iter().enumerate() {
        if is_dense(layer) && waiting != Activation::None {
            return Err(PackContentsError::NoGap(number - 1));
        }
        layers.push(match layer {
            Some(layer) => *layer,
            None => kind(std::mem::replace(&mut waiting, Activation::None))
                .unwrap_or(Layer::Dropout { probability: 0.0 }),
        });
        if is_dense(layer) {
            waiting = activations.next().copied().unwrap_or(Activation::None);
        }
    }
    layers.extend(kind(waiting));
    Ok(layers)
}

fn kind(activation: Activation) -> Option<Layer> {
    match activation {
        Activation::None => None,
        Activation::Relu => Some(Layer::Relu),
        Activation::Tanh => Some(Layer::Tanh),
    }
}
