//! What commands compute, as plain data, one file for each command. Commands fill it, reports show it; nothing here
//! reads arguments or prints.

pub(crate) mod answer;
pub(crate) mod bench;
pub(crate) mod campaign;
pub(crate) mod certify;
pub(crate) mod classifier;
pub(crate) mod controllers;
pub(crate) mod dataset;
pub(crate) mod family;
pub(crate) mod flight;
pub(crate) mod fly;
pub(crate) mod grid;
pub(crate) mod identifier;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod live;
pub(crate) mod log_gains;
pub(crate) mod pack;
pub(crate) mod phase;
pub(crate) mod reproduction;
