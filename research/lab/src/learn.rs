//! Training: examples, networks, packs.

pub mod dataset;
pub mod identifier;
pub mod lead_table;
pub mod npz;
pub mod onnx;
pub mod pack;
pub mod train;
