//! What commands compute, as plain data, one file for each command. Commands fill it, reports show it; nothing here
//! reads arguments or prints.

pub(crate) mod bench;
pub(crate) mod campaign;
pub(crate) mod certify;
pub(crate) mod classifier;
pub(crate) mod classify;
pub(crate) mod dataset;
pub(crate) mod grid;
pub(crate) mod identifier;
pub(crate) mod pack;
pub(crate) mod phase;
pub(crate) mod reproduction;
