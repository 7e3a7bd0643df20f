//! Reports: results as text for people, as JSON for programs, and as HTML pages.

pub(crate) mod bench;
pub(crate) mod campaign;
pub(crate) mod certificate;
pub(crate) mod classifier;
pub(crate) mod classify;
pub(crate) mod dataset;
pub(crate) mod grid;
pub(crate) mod identifier;
pub(crate) mod pack;
pub(crate) mod phase;
pub(crate) mod reproduction;
