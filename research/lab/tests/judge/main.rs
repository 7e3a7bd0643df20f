//! Experiments and evaluation: campaigns, baselines, the benchmark, out-of-family processes.

// The lint exempts test functions, but not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;

mod baselines;
mod campaigns;
mod evaluate;
mod harmonics;
mod honesty;
mod one_cycle;
mod out_of_family;
mod recordings;
