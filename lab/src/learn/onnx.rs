//! Networks in ONNX, for whatever else runs networks, and from wherever else they learn.
//!
//! | written               | as                                                                 |
//! |-----------------------|--------------------------------------------------------------------|
//! | normalisation         | `Sub` offsets, `Mul` scales                                        |
//! | dense layer           | `Gemm` with `transB`: weights lie as PyTorch has them              |
//! | tanh, ReLU            | `Tanh`, `Relu`                                                     |
//! | batch normalisation   | folded into the dense layer before or behind it                    |
//! | dropout               | left out                                                           |
//!
//! in f32, IR version 8, opset 17, which every runtime since 2022 reads; the input is
//! `inputs: [batch, in]`, the output `outputs: [batch, out]`.
//!
//! Read are chains of `Gemm`, `MatMul`, `Relu`, `Tanh`, `Identity`, `BatchNormalization`, and `Sub`,
//! `Mul`, `Add`, `Div` with constants, as PyTorch's exporters write them. Whatever only scales and
//! shifts is folded into the dense layer next to it; before the first one it is the normalisation.
//! Any other node is refused by its name.
//!
//! Reference: ONNX, "Open Neural Network Exchange intermediate representation specification", IR
//! version 8, and its operators; the messages (field numbers) are those of `onnx.proto`.
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

/// What a network sees of its inputs: `(x - offset) scale`.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalisation {
    /// What is subtracted.
    pub offsets: Vec<f32>,
    /// What is then multiplied with.
    pub scales: Vec<f32>,
}

/// Why there is no network, or no file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OnnxError {
    /// The bytes are no ONNX.
    #[error("the file is no ONNX model: {0}")]
    File(String),
    /// Something of the model as a whole.
    #[error("the model cannot be read: {0}")]
    Model(String),
    /// A node that is none of those that can be read, or not so.
    #[error("node {node}, {op}: {reason}")]
    Node {
        /// Its name, or its number where it has none.
        node: String,
        /// Its operator.
        op: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A layer that cannot be written.
    #[error("layer {index} of the network cannot be written to ONNX: {reason}")]
    Layer {
        /// Which, from 0; those of dropout are left out before.
        index: usize,
        /// Why.
        reason: &'static str,
    },
    /// Offsets or scales that are not as many as the inputs.
    #[error("the normalisation is of {found} inputs, the network of {expected}")]
    Normalisation {
        /// Inputs of the network.
        expected: usize,
        /// Offsets or scales.
        found: usize,
    },
    /// Sizes or numbers that no network has.
    #[error("{0}")]
    Train(#[from] TrainError),
}
