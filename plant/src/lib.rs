//! Exact simulation of the process with delay and its closed loops, and of a multirotor.
//!
//! The input of a sampled loop is constant between samples, so the propagation is exact for any delay, without
//! an ODE solver and without step-size error. The exception is [`multirotor`]: the equations of a whole vehicle
//! are nonlinear and are integrated numerically.

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
