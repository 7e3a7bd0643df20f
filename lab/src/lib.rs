//! Research behind onecycle: how the identifier is made and judged. Nothing that ships depends on it.

pub mod experiments;
pub mod judge;
pub mod learn;
pub mod paper;
pub mod space;
pub mod workers;

/// This program and its version, as files name their maker.
pub(crate) const PROGRAM: &str = concat!("onecycle ", env!("CARGO_PKG_VERSION"));
