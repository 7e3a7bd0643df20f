//! Research behind onecycle: training and evaluation of the identifier. Nothing that ships depends on
//! this crate.
//!
//! A room may use the rooms above it in this table, never those below.
//!
//! | room            | what it holds                                                          |
//! |-----------------|------------------------------------------------------------------------|
//! | [`workers`]     | threads of the caller                                                  |
//! | [`space`]       | spaces of processes: phase of the relay, grid, certificate             |
//! | [`experiments`] | random relay experiments: draw, run, cut                               |
//! | [`judge`]       | evaluation: baselines, benchmark scores, out-of-family processes       |
//! | [`learn`]       | training: datasets, networks, the shipped pack                         |
//! | [`paper`]       | the classifier of the paper; no other room uses it                     |

pub mod experiments;
pub mod judge;
pub mod learn;
pub mod paper;
pub mod space;
pub mod workers;

/// This program and its version, as files name their maker.
pub(crate) const PROGRAM: &str = concat!("onecycle ", env!("CARGO_PKG_VERSION"));
