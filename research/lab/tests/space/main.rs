//! Spaces of processes: limit cycles, certificates, phases, grids.

// The lint exempts test functions, but not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;

mod certificate;
mod grid;
mod limit_cycle;
mod optimum_table;
mod phase;
