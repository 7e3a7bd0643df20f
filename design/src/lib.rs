//! From a process model to its controller.

pub mod bands;
pub mod cascade;
pub mod decision;
pub mod roots;
pub mod soiptd_pd;

pub use soiptd_pd::*;

// Compiles and runs the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
