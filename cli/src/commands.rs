//! One file for each command: takes the arguments, computes the result, prints the report.

mod answer;
pub(crate) mod completions;
mod controllers;
pub(crate) mod flight;
pub(crate) mod fly;
pub(crate) mod identify;
mod in_force;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod live;
pub(crate) mod log;
pub(crate) mod log_gains;
mod log_overlay;
pub(crate) mod man;
pub(crate) mod simulate;
pub(crate) mod studio;
pub(crate) mod tune;
