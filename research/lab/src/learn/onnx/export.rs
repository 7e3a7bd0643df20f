//! A network as a chain of nodes.

use prost::Message;

use super::message::{
    Attribute, Dimension, FLOAT, Graph, INT, Model, Node, OperatorSet, Property, Shape, Tensor,
    TensorType, Type, ValueInfo,
};
use super::{Normalisation, OnnxError};
use crate::learn::train::{Layer, Network};

/// Of 2022, with opset 17; nothing newer is needed.
const IR_VERSION: i64 = 8;
const OPSET: i64 = 17;

const INPUT: &str = "inputs";
const OUTPUT: &str = "outputs";

/// The bytes of a model that normalises its inputs and then computes the network; `metadata` are keys
/// and values that the model carries along.
///
/// # Errors
/// [`OnnxError`]: batch normalisation has no dense layer to be folded into, the network has no layer,
/// or the normalisation has another number of inputs.
pub fn export(
    network: &Network,
    normalisation: Option<&Normalisation>,
    metadata: &[(&str, String)],
) -> Result<Vec<u8>, OnnxError> {
    let folded = network.folded();
    let mut chain = Chain::default();
    if let Some(Normalisation { offsets, scales }) = normalisation {
        for (op, values) in [("Sub", offsets), ("Mul", scales)] {
            let (expected, found) = (network.inputs(), values.len());
            if expected != found {
                return Err(OnnxError::Normalisation { expected, found });
            }
            let name = format!("normalise_{}", op.to_lowercase());
            let constant = chain.constant(format!("{name}.values"), &[found], values);
            chain.add(name, op, vec![constant], Vec::new());
        }
    }
    let mut parameters = folded.parameters();
    for (index, layer) in folded.layers().into_iter().enumerate() {
        let refused = |reason| OnnxError::Layer { index, reason };
        match layer {
            Layer::Dense { outputs } => {
                let (Some(weight), Some(bias)) = (parameters.next(), parameters.next()) else {
                    return Err(refused("the dense layer has no weights"));
                };
                let name = format!("dense_{index}");
                let shape = [outputs, weight.columns()];
                let constants = vec![
                    chain.constant(format!("{name}.weight"), &shape, weight.values()),
                    chain.constant(format!("{name}.bias"), &[outputs], bias.values()),
                ];
                let transposed = Attribute {
                    name: "transB".to_owned(),
                    i: 1,
                    kind: INT,
                    ..Attribute::default()
                };
                chain.add(name, "Gemm", constants, vec![transposed]);
            }
            Layer::Relu => chain.add(format!("relu_{index}"), "Relu", Vec::new(), Vec::new()),
            Layer::Tanh => chain.add(format!("tanh_{index}"), "Tanh", Vec::new(), Vec::new()),
            Layer::BatchNorm => {
                return Err(refused(
                    "batch normalisation needs a dense layer before or after it",
                ));
            }
            Layer::Dropout { .. } => return Err(refused("dropout is for training only")),
        }
    }
    let Some(last) = chain.nodes.last_mut() else {
        let reason = "the network has no layers";
        return Err(OnnxError::Layer { index: 0, reason });
    };
    last.output = vec![OUTPUT.to_owned()];
    Ok(chain
        .model(network.inputs(), network.outputs(), metadata)
        .encode_to_vec())
}

/// Nodes in a chain.
#[derive(Default)]
struct Chain {
    nodes: Vec<Node>,
    constants: Vec<Tensor>,
}

impl Chain {
    /// Adds a constant; returns its name.
    fn constant(&mut self, name: String, shape: &[usize], values: &[f32]) -> String {
        self.constants.push(Tensor {
            // A network holds less than 2^30 numbers.
            dims: shape.iter().map(|&size| size as i64).collect(),
            data_type: FLOAT,
            name: name.clone(),
            raw_data: values
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect(),
            ..Tensor::default()
        });
        name
    }

    /// Adds a node whose inputs are the output of the last node and constants.
    fn add(&mut self, name: String, op: &str, constants: Vec<String>, attribute: Vec<Attribute>) {
        let before = match self.nodes.last() {
            Some(last) => last.output.clone(),
            None => vec![INPUT.to_owned()],
        };
        self.nodes.push(Node {
            input: before.into_iter().chain(constants).collect(),
            output: vec![format!("{name}.output")],
            name,
            op_type: op.to_owned(),
            attribute,
            domain: String::new(),
        });
    }

    fn model(self, inputs: usize, outputs: usize, metadata: &[(&str, String)]) -> Model {
        Model {
            ir_version: IR_VERSION,
            producer_name: "onecycle".to_owned(),
            producer_version: env!("CARGO_PKG_VERSION").to_owned(),
            graph: Some(Graph {
                node: self.nodes,
                name: "onecycle".to_owned(),
                initializer: self.constants,
                input: vec![rows(INPUT, inputs)],
                output: vec![rows(OUTPUT, outputs)],
            }),
            opset_import: vec![OperatorSet {
                domain: String::new(),
                version: OPSET,
            }],
            metadata_props: (metadata.iter())
                .map(|(key, value)| Property {
                    key: (*key).to_owned(),
                    value: value.clone(),
                })
                .collect(),
        }
    }
}

/// An input or output of any number of rows with this number of columns.
fn rows(name: &str, columns: usize) -> ValueInfo {
    let batch = Dimension {
        dim_param: Some("batch".to_owned()),
        dim_value: None,
    };
    let columns = Dimension {
        dim_param: None,
        dim_value: Some(columns as i64),
    };
    ValueInfo {
        name: name.to_owned(),
        kind: Some(Type {
            tensor: Some(TensorType {
                elem_type: FLOAT,
                shape: Some(Shape {
                    dim: vec![batch, columns],
                }),
            }),
        }),
    }
}
