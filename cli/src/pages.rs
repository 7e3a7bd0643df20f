//! Pages for a browser: one file each, which needs no network.

mod bundle;
pub(crate) mod escape;
pub(crate) mod page;
pub(crate) mod plot;
