//! One file for each command: takes the arguments, computes the result, prints the report.

mod answer;
pub(crate) mod bench;
pub(crate) mod campaign;
pub(crate) mod certify;
mod clock;
pub(crate) mod completions;
mod controllers;
pub(crate) mod dataset;
pub(crate) mod flight;
pub(crate) mod fly;
pub(crate) mod grid;
pub(crate) mod identify;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod live;
pub(crate) mod log;
pub(crate) mod log_gains;
mod log_overlay;
pub(crate) mod man;
pub(crate) mod pack;
pub(crate) mod phase;
pub(crate) mod reproduce;
pub(crate) mod simulate;
pub(crate) mod studio;
pub(crate) mod train;
pub(crate) mod tune;
mod workers;
