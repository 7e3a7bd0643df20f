//! Tests of the public interface, in one program.

// The lint does not see that helpers of tests are tests.
#![allow(clippy::unwrap_used)]

mod calibration;
mod closed_loop;
mod limit_cycle;
mod linear;
mod multirotor_flight;
mod multirotor_ground;
mod multirotor_linearised;
mod multirotor_missions;
mod multirotor_relay;
mod pid;
mod propagation;
mod sensor;
mod signature;
mod test_signal;
