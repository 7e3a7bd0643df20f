//! HTML pages: one file each, which works offline.

mod bundle;
mod escape;
pub(crate) mod page;
pub(crate) mod plot;
