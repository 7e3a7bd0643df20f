//! What commands compute, as plain data: that of the library, and one file for each further command.

pub(crate) mod fly;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod live;

pub(crate) use onecycle::results::{answer, controllers, family, flight, log_gains};
