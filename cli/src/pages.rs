//! HTML pages: one file each, which works offline.

// The code of build.rs, for its tests.
#[cfg(test)]
#[path = "../build/bundle.rs"]
mod bundle;
mod escape;
pub mod page;
pub mod plot;
