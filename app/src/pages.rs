//! Pages for a browser: one file each, which needs no network.

pub(crate) mod page;
pub(crate) mod plot;
