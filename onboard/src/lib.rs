//! What flies: the relay, cycle detection and the estimator.
//!
//! No standard library, no heap, no clock, no input or output: firmware links this crate, the
//! simulator and the program run the very same code.
#![no_std]

pub mod classify;
mod complex;
pub mod control;
pub mod cycle;
mod distortion;
mod fit_score;
pub mod floats;
pub mod gains;
pub mod guard;
pub mod identification;
pub mod judgement;
mod least_squares;
pub mod network;
pub mod pack;
mod prediction;
pub mod process;
pub mod refine;
pub mod relay;
mod response;
pub mod signature;
mod take_off;
pub mod transition;
pub mod tuner;
pub mod window;

pub use control::Pd;
pub use process::{Soiptd, SoiptdError};
pub use relay::{Relay, RelayError, RelayPhase, RelaySettings};
pub use transition::Transition;

// Compiles and runs the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
