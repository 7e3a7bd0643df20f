#![doc = include_str!("../README.md")]

pub mod closed_loop;
pub mod delay;
pub mod exact;
pub mod multirotor;
pub mod noise;
pub mod sensor;
pub mod trace;

pub use closed_loop::{Controller, Experiment, SampledPd, Sensed};
pub use delay::VariableStepProcess;
pub use exact::FixedStepProcess;
pub use noise::{Noise, NoiseSource};
pub use sensor::Sensor;
pub use trace::Trace;
