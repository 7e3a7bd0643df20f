//! Reports: results as text for people, as JSON for programs, and as HTML pages.

mod answer;
pub(crate) mod bench;
pub(crate) mod campaign;
pub(crate) mod certificate;
pub(crate) mod classifier;
mod controllers;
pub(crate) mod cycles;
pub(crate) mod dataset;
mod family;
pub(crate) mod flight;
pub(crate) mod fly;
pub(crate) mod grid;
pub(crate) mod hand;
pub(crate) mod identifier;
pub(crate) mod json;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod live;
pub(crate) mod log;
pub(crate) mod log_gains;
pub(crate) mod number;
pub(crate) mod pack;
pub(crate) mod page;
pub(crate) mod phase;
mod record;
pub(crate) mod reproduction;
pub(crate) mod text;
pub(crate) mod units;
mod wrap;
