//! What only reproduces the paper: its classifier and its grid.

pub mod classifier;
pub mod grid;
