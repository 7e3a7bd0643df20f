//! What commands compute, as plain data: that of the library, and one file for each further command.

#[cfg(feature = "program")]
pub(crate) mod fly;
#[cfg(all(feature = "program", not(target_family = "wasm")))]
pub(crate) mod live;

pub(crate) use onecycle::results::{answer, controllers, family, flight, log_gains};
