//! Learning: examples, networks, packs, exchange with other programs.

// The lint excepts tests, but not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;

mod dataset;
mod lead_table;
mod onnx;
mod pack;
mod shards;
mod train;
