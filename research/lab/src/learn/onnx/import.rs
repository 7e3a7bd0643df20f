//! Reads the nodes of a model into steps.

use std::collections::BTreeMap;

use prost::Message;

use super::chain::{Affine, Chain, Dense, Step};
use super::message::{EXTERNAL, FLOAT, Graph, Model, Node, Tensor};
use super::{Normalisation, OnnxError};
use crate::learn::train::{Layer, Network};

/// From this opset on, constants are broadcast without an attribute.
const OLDEST_OPSET: i64 = 7;

/// A network that was trained by another program.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// Normalisation before the first dense layer, if there is one.
    pub normalisation: Option<Normalisation>,
    /// The network after the normalisation.
    pub network: Network,
    /// Keys and values that the model carries along.
    pub metadata: BTreeMap<String, String>,
}

/// Reads the bytes of a model.
///
/// # Errors
/// [`OnnxError`]: names the node that cannot be read, or says what else is wrong.
pub fn import(bytes: &[u8]) -> Result<Imported, OnnxError> {
    let model = Model::decode(bytes).map_err(|error| OnnxError::File(error.to_string()))?;
    let Some(graph) = model.graph else {
        return Err(OnnxError::File("it holds no graph".to_owned()));
    };
    let is_default = |domain: &str| ["", "ai.onnx"].contains(&domain);
    let opset = (model.opset_import.iter()).find(|opset| is_default(&opset.domain));
    let version = opset.map_or(1, |opset| opset.version);
    if version < OLDEST_OPSET {
        return Err(OnnxError::Model(format!(
            "it is of opset {version}; export it with opset 17"
        )));
    }
    let mut reader = Reader::new(&graph)?;
    for (number, node) in graph.node.iter().enumerate() {
        let refused = |reason| OnnxError::Node {
            node: match &node.name[..] {
                "" => format!("number {number}"),
                name => shown(name),
            },
            op: shown(&node.op_type),
            reason,
        };
        if !is_default(&node.domain) {
            return Err(refused(format!(
                "operators of the domain {} are not supported",
                shown(&node.domain)
            )));
        }
        reader.take(node).map_err(refused)?;
    }
    let output = only("output", graph.output.iter().map(|output| &output.name[..]))?;
    if reader.current != output {
        return Err(OnnxError::Model(format!(
            "its output {} is not the output of its last node",
            shown(output)
        )));
    }
    let (normalisation, network) = reader.chain.network()?;
    let metadata = model.metadata_props.iter();
    Ok(Imported {
        normalisation,
        network,
        metadata: metadata
            .map(|one| (one.key.clone(), one.value.clone()))
            .collect(),
    })
}

/// The only name.
fn only<'a>(what: &str, mut names: impl Iterator<Item = &'a str>) -> Result<&'a str, OnnxError> {
    match (names.next(), names.next()) {
        (Some(name), None) => Ok(name),
        (None, _) => Err(OnnxError::Model(format!("it has no {what}"))),
        (Some(_), Some(_)) => Err(OnnxError::Model(format!("it has more than one {what}"))),
    }
}

/// State of the reader.
struct Reader<'a> {
    constants: BTreeMap<&'a str, &'a Tensor>,
    /// Name of the last node's output.
    current: &'a str,
    chain: Chain,
}

impl<'a> Reader<'a> {
    fn new(graph: &'a Graph) -> Result<Self, OnnxError> {
        let constants: BTreeMap<_, _> = (graph.initializer.iter())
            .map(|tensor| (&tensor.name[..], tensor))
            .collect();
        // Older models list constants among the inputs.
        let inputs = (graph.input.iter().map(|input| &input.name[..]))
            .filter(|name| !constants.contains_key(name));
        let current = only("input", inputs)?;
        Ok(Self {
            constants,
            current,
            chain: Chain::default(),
        })
    }

    /// Adds a node. The error says why it cannot be read.
    fn take(&mut self, node: &'a Node) -> Result<(), String> {
        let [output] = &node.output[..] else {
            return Err(format!("it has {} outputs, not one", node.output.len()));
        };
        match &node.op_type[..] {
            "Constant" => {
                let value = node.attribute.iter().find_map(|value| value.t.as_ref());
                let value = value.ok_or("its value is not a tensor")?;
                self.constants.insert(output, value);
                return Ok(());
            }
            "Identity" if (node.input.first()).is_some_and(|name| self.is_constant(name)) => {
                let tensor = self.constants[&node.input[0][..]];
                self.constants.insert(output, tensor);
                return Ok(());
            }
            _ => {}
        }
        let step = match &node.op_type[..] {
            "Identity" => None,
            "Relu" => Some(Step::Activation(Layer::Relu)),
            "Tanh" => Some(Step::Activation(Layer::Tanh)),
            "Gemm" => Some(Step::Dense(self.gemm(node)?)),
            "MatMul" => Some(Step::Dense(self.product(node)?)),
            "Sub" | "Mul" | "Add" | "Div" => Some(Step::Affine(self.elementwise(node)?)),
            "BatchNormalization" => Some(Step::Affine(self.batch_normalisation(node)?)),
            _ => {
                return Err(
                    "this operator is not supported; supported are Gemm, MatMul, Relu, Tanh, \
                            Identity, BatchNormalization, and Sub, Mul, Add or Div with a constant"
                        .to_owned(),
                );
            }
        };
        if !node.input.iter().any(|name| name == self.current) {
            let found = node.input.first().map_or("nothing", String::as_str);
            return Err(format!(
                "its input is {found}, not {}, the output of the node before it; only a chain of nodes \
                 can be read",
                self.current
            ));
        }
        if let Some(step) = step {
            self.chain.take(step)?;
        }
        self.current = output;
        Ok(())
    }

    fn is_constant(&self, name: &str) -> bool {
        self.constants.contains_key(name)
    }

    /// Shape and numbers of the constant at input `index`.
    fn constant(&self, node: &Node, index: usize) -> Result<(Vec<usize>, Vec<f32>), String> {
        let name = node.input.get(index).map_or("", String::as_str);
        match self.constants.get(name) {
            Some(tensor) => numbers(tensor),
            None => Err(format!("its input {index}, {name:?}, must be a constant")),
        }
    }

    /// A constant of one number, or one for each column.
    fn row(&self, node: &Node, index: usize) -> Result<Vec<f32>, String> {
        let (shape, values) = self.constant(node, index)?;
        match shape.split_last() {
            Some((_, rows)) if rows.iter().any(|&size| size != 1) => Err(format!(
                "its input {index} must be a row, but has the shape {shape:?}"
            )),
            _ if values.is_empty() => Err(format!("its input {index} is empty")),
            _ => Ok(values),
        }
    }

    /// `alpha A B + beta C`, or `B` transposed.
    fn gemm(&self, node: &Node) -> Result<Dense, String> {
        let number = |name, default: f32| attribute(node, name).map_or(default, |value| value.f);
        let is_set = |name| attribute(node, name).is_some_and(|value| value.i != 0);
        if is_set("transA") {
            return Err("transA is not supported".to_owned());
        }
        let mut dense = self.weight(node, is_set("transB"))?;
        let (alpha, beta) = (number("alpha", 1.0), number("beta", 1.0));
        (dense.weight.iter_mut()).for_each(|weight| *weight *= alpha);
        // The third input is optional.
        if node.input.get(2).is_some_and(|name| !name.is_empty()) {
            let bias = self.row(node, 2)?;
            let outputs = dense.bias.len();
            if bias.len() != 1 && bias.len() != outputs {
                let found = bias.len();
                return Err(format!("it has {found} biases for {outputs} outputs"));
            }
            let every = bias.iter().cycle().zip(&mut dense.bias);
            every.for_each(|(value, bias)| *bias = beta * value);
        }
        Ok(dense)
    }

    fn product(&self, node: &Node) -> Result<Dense, String> {
        self.weight(node, false)
    }

    /// A dense layer of the constant at input 1: `in x out`, or `out x in` if transposed.
    fn weight(&self, node: &Node, is_transposed: bool) -> Result<Dense, String> {
        let (shape, values) = self.constant(node, 1)?;
        let &[rows, columns] = &shape[..] else {
            return Err(format!(
                "its weights must be a matrix, but have the shape {shape:?}"
            ));
        };
        if rows == 0 || columns == 0 {
            return Err(format!("its weights are empty: their shape is {shape:?}"));
        }
        let (inputs, outputs) = if is_transposed {
            (columns, rows)
        } else {
            (rows, columns)
        };
        let weight = if is_transposed {
            values
        } else {
            (0..outputs)
                .flat_map(|o| values[o..].iter().step_by(columns).copied())
                .collect()
        };
        Ok(Dense {
            inputs,
            weight,
            bias: vec![0.0; outputs],
        })
    }

    /// Sum, difference, product or quotient with a constant.
    fn elementwise(&self, node: &Node) -> Result<Affine, String> {
        let [left, right] = &node.input[..] else {
            return Err(format!("it has {} inputs, not two", node.input.len()));
        };
        let (is_left, index) = match (self.is_constant(left), self.is_constant(right)) {
            (true, false) => (true, 0),
            (false, true) => (false, 1),
            _ => return Err("exactly one of its two inputs must be a constant".to_owned()),
        };
        let values: Vec<f64> = (self.row(node, index)?.into_iter())
            .map(f64::from)
            .collect();
        let one = || vec![1.0];
        let (scale, shift) = match (&node.op_type[..], is_left) {
            ("Add", _) => (one(), values),
            ("Sub", false) => (one(), values.iter().map(|value| -value).collect()),
            ("Sub", true) => (vec![-1.0], values),
            ("Mul", _) => (values, vec![0.0]),
            ("Div", false) => (
                values.iter().map(|value| value.recip()).collect(),
                vec![0.0],
            ),
            _ => return Err("division of a constant by the input is not supported".to_owned()),
        };
        Ok(Affine { scale, shift })
    }

    fn batch_normalisation(&self, node: &Node) -> Result<Affine, String> {
        if attribute(node, "training_mode").is_some_and(|value| value.i != 0) {
            return Err("it is in training mode: call eval() before the export".to_owned());
        }
        // The operator's default.
        let epsilon = attribute(node, "epsilon").map_or(1e-5, |value| value.f);
        let mut rows = Vec::new();
        for index in 1..5 {
            let row = self.row(node, index)?;
            rows.push(row.into_iter().map(f64::from).collect::<Vec<_>>());
        }
        let [weight, bias, mean, variance] = &rows[..] else {
            return Err("it needs four constants: scale, shift, mean and variance".to_owned());
        };
        if rows.iter().any(|row| row.len() != weight.len()) {
            return Err("its constants differ in width".to_owned());
        }
        let scale: Vec<f64> = (weight.iter().zip(variance))
            .map(|(weight, variance)| weight / (variance + f64::from(epsilon)).sqrt())
            .collect();
        let shift = (bias.iter().zip(mean).zip(&scale)).map(|((b, mean), scale)| b - mean * scale);
        Ok(Affine {
            shift: shift.collect(),
            scale,
        })
    }
}

fn attribute<'a>(node: &'a Node, name: &str) -> Option<&'a super::message::Attribute> {
    node.attribute
        .iter()
        .find(|attribute| attribute.name == name)
}

/// A name of the file as a message shows it: on one line, without control characters.
fn shown(name: &str) -> String {
    name.escape_debug().to_string()
}

/// Shape and numbers of a constant.
fn numbers(tensor: &Tensor) -> Result<(Vec<usize>, Vec<f32>), String> {
    let name = shown(&tensor.name);
    if tensor.data_location == EXTERNAL {
        return Err(format!(
            "the numbers of {name} are in another file: export the model with \
             external_data=False"
        ));
    }
    if tensor.data_type != FLOAT {
        return Err(format!(
            "{name} must hold f32 (type {FLOAT}), but has type {}",
            tensor.data_type
        ));
    }
    let shape: Option<Vec<usize>> = (tensor.dims.iter())
        .map(|&size| usize::try_from(size).ok())
        .collect();
    let count = shape
        .as_ref()
        .and_then(|shape| (shape.iter()).try_fold(1_usize, |count, &size| count.checked_mul(size)));
    let values = match tensor.raw_data.as_chunks() {
        ([], []) => tensor.float_data.clone(),
        (values, []) => values.iter().copied().map(f32::from_le_bytes).collect(),
        _ => return Err(format!("{name} ends within a number")),
    };
    match shape {
        Some(shape) if count == Some(values.len()) => Ok((shape, values)),
        _ => Err(format!(
            "{name} has {} numbers, which does not match its shape {:?}",
            values.len(),
            tensor.dims
        )),
    }
}
