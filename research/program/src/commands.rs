//! One file for each command: takes the arguments, computes the result, prints the report.

pub(crate) mod bench;
pub(crate) mod campaign;
pub(crate) mod certify;
pub(crate) mod classify;
mod clock;
pub(crate) mod dataset;
pub(crate) mod grid;
pub(crate) mod pack;
pub(crate) mod phase;
pub(crate) mod reproduce;
pub(crate) mod train;
