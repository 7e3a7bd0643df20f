//! Tests with a scripted vehicle: over simulated time, and over UDP on the loopback. All are modules of one test program.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests are tests too, which the lint does not see"
)]

mod altitude;
mod connection;
mod hovering;
mod log;
mod state;
mod vehicle;
mod world;
mod write;
