//! Tests of the public interface, in one program.

// The lint does not see that helpers of tests are tests.
#![allow(clippy::unwrap_used)]

mod common;
mod crossover;
mod pack;
mod pid;
mod recorded;
mod refine;
mod relay;
mod slices;
mod tuner;
