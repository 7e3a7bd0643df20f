#![doc = include_str!("../README.md")]

mod altitude;
mod channel;
mod error;
mod log;
mod mode;
mod parameters;
mod signing;
mod state;
mod vehicle;
mod wire;
mod write;

pub use altitude::{
    AltitudeAbort, AltitudeFlight, AltitudeRefusal, AltitudeTest, HandBack, Sample, ThrustSource,
};
pub use error::LiveError;
pub use log::{LogEntry, LogError};
pub use parameters::Parameter;
pub use signing::Key;
pub use state::{Battery, LoopParameters, State};
pub use vehicle::Vehicle;
pub use wire::{Address, AddressError, Udp, Wire};
pub use write::{Assignment, Cause, InForce, Outcome, Plan, Refusal, Step};
