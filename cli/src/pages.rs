//! HTML pages: one file each, which works offline.

// The code of build.rs, for its tests.
#[cfg(test)]
#[path = "../build/bundle.rs"]
mod bundle;
mod escape;
pub(crate) mod page;
pub(crate) mod plot;
