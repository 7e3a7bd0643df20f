//! The paper's classifier.

// The lint excepts tests, but not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

mod classifier;
mod network;
