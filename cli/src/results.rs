//! What commands compute, as plain data, one file for each command. Commands fill it, reports show it; nothing here
//! reads arguments or prints.

pub(crate) mod answer;
pub(crate) mod controllers;
pub(crate) mod family;
pub(crate) mod flight;
pub(crate) mod fly;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod live;
pub(crate) mod log_gains;
