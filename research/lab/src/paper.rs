//! The paper's classifier, which only reproduces the paper. Nothing outside this room uses it.

pub mod classifier;
pub mod modes;
pub mod network;
