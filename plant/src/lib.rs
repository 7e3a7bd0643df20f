#![doc = include_str!("../README.md")]

pub mod closed_loop;
pub mod controller;
pub mod delay;
pub mod disturbance;
pub mod exact;
pub mod linear;
pub mod multirotor;
pub mod noise;
pub mod overlay;
pub mod sensor;
pub mod test_signal;
pub mod trace;

pub use closed_loop::Experiment;
pub use controller::{Controller, Entry, ExcitedLoop, FilteredPd, SampledPd, Sensed};
pub use delay::VariableStepProcess;
pub use disturbance::{Bandwidths, Disturbances};
pub use exact::FixedStepProcess;
pub use linear::{FixedStepLinear, VariableStepLinear};
pub use noise::{Noise, NoiseSource};
pub use overlay::FollowedLoop;
pub use sensor::Sensor;
pub use test_signal::{Stimulus, TestSignal, TestSignalError};
pub use trace::{Row, Trace};
