//! Reports: results as text for people, as JSON for programs, and as HTML pages.

mod answer;
mod controllers;
pub mod cycles;
mod family;
pub mod flight;
#[cfg(feature = "program")]
pub(crate) mod fly;
#[cfg(feature = "program")]
pub(crate) mod hand;
pub mod identify;
pub mod json;
#[cfg(all(feature = "program", not(target_family = "wasm")))]
pub(crate) mod live;
#[cfg(feature = "program")]
pub(crate) mod log;
pub(crate) mod log_gains;
pub(crate) mod page;
mod record;
pub(crate) mod text;
pub mod tune;
pub mod wrap;

pub use onecycle::words::number;
pub(crate) use onecycle::words::units;
