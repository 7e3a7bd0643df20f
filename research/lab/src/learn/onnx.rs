//! ONNX export and import of networks.
//!
//! | written               | as                                                                 |
//! |-----------------------|--------------------------------------------------------------------|
//! | normalisation         | `Sub` offsets, `Mul` scales                                        |
//! | dense layer           | `Gemm` with `transB`: weights lie as PyTorch has them              |
//! | tanh, ReLU            | `Tanh`, `Relu`                                                     |
//! | batch normalisation   | folded into the dense layer before or behind it                    |
//! | dropout               | left out                                                           |
//!
//! Numbers are f32, IR version 8, opset 17, which every runtime since 2022 reads. The input is `inputs:
//! [batch, in]`, the output `outputs: [batch, out]`.
//!
//! The import reads chains of `Gemm`, `MatMul`, `Relu`, `Tanh`, `Identity`, `BatchNormalization`, and
//! `Sub`, `Mul`, `Add`, `Div` with constants, as PyTorch's exporters write them. Nodes that only scale
//! and shift are folded into the dense layer next to them; before the first layer they are the
//! normalisation. Any other node is refused by its name.
//!
//! Reference: ONNX, "Open Neural Network Exchange intermediate representation specification", IR
//! version 8, and its operators; the messages (field numbers) follow `onnx.proto`.
//!
//! ```
//! use onecycle_lab::learn::onnx;
//! use onecycle_lab::learn::train::{Layer, Network};
//! use rand::SeedableRng;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let layers = [Layer::Dense { outputs: 8 }, Layer::Tanh, Layer::Dense { outputs: 2 }];
//! let network = Network::new(3, &layers, &mut rand_pcg::Pcg64Mcg::seed_from_u64(1))?;
//! let bytes = onnx::export(&network, None, &[])?;
//! assert_eq!(onnx::import(&bytes)?.network, network);
//! # Ok(())
//! # }
//! ```

mod chain;
mod export;
mod import;
mod message;

use crate::learn::train::TrainError;

pub use export::export;
pub use import::{Imported, import};

/// Normalisation of the inputs: the network sees `(x - offset) scale`.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalisation {
    /// Offsets, one for each input.
    pub offsets: Vec<f32>,
    /// Scales, one for each input.
    pub scales: Vec<f32>,
}

/// Why a model cannot be read or written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OnnxError {
    /// The bytes are not ONNX.
    #[error("the file is not an ONNX model: {0}")]
    File(String),
    /// The model as a whole cannot be read.
    #[error("the model cannot be read: {0}")]
    Model(String),
    /// A node cannot be read.
    #[error("node {node}, {op}: {reason}")]
    Node {
        /// Name of the node, or its number if it has no name.
        node: String,
        /// Operator of the node.
        op: String,
        /// What is wrong with the node.
        reason: String,
    },
    /// A layer cannot be written.
    #[error("layer {index} of the network cannot be written to ONNX: {reason}")]
    Layer {
        /// Number of the layer, from 0, without dropout layers.
        index: usize,
        /// The reason.
        reason: &'static str,
    },
    /// The number of offsets or scales differs from the number of inputs.
    #[error("the normalisation has {found} inputs, but the network has {expected}")]
    Normalisation {
        /// Number of inputs of the network.
        expected: usize,
        /// Number of offsets or scales.
        found: usize,
    },
    /// Sizes or numbers that no network has.
    #[error("{0}")]
    Train(#[from] TrainError),
}
