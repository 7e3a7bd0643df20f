//! What is flown: exact simulation of the delayed process and its closed loops.
//!
//! The input of a sampled loop is constant between samples, so propagation is exact: no ODE
//! solver, no step-size error, and a delay of any length. The exception is [`multirotor`], a whole
//! vehicle, whose equations are not linear: it is integrated.

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
