//! Research behind onecycle: how the identifier is made and judged. Nothing that ships depends on it.

pub mod experiments;
pub mod judge;
pub mod learn;
pub mod paper;
pub mod space;

// Compiles and runs the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
