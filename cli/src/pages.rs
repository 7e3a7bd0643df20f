//! Pages for a browser: one file each, which needs no network.

mod bundle;
mod escape;
pub(crate) mod page;
pub(crate) mod plot;
