//! One file for each command: takes the arguments, computes the result, prints the report.

pub(crate) mod completions;
pub(crate) mod fly;
pub(crate) mod identify;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod live;
pub(crate) mod log;
pub(crate) mod man;
pub(crate) mod simulate;
pub(crate) mod studio;
pub(crate) mod tune;

/// The name before every message.
pub(crate) const PROGRAM: &str = "onecycle";
