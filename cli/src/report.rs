//! Reports: results as text for people, as JSON for programs, and as HTML pages.

mod answer;
mod controllers;
pub mod cycles;
mod family;
pub(crate) mod flight;
pub(crate) mod fly;
pub(crate) mod hand;
pub mod json;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod live;
pub(crate) mod log;
pub(crate) mod log_gains;
pub(crate) mod page;
mod record;
pub(crate) mod text;
pub mod wrap;

pub use onecycle::words::number;
pub(crate) use onecycle::words::units;
