//! Evaluation: methods on the same experiments, scored.

pub mod baselines;
pub mod calibrate;
pub mod campaign;
pub mod evaluate;
pub mod flights;
pub mod harm;
pub mod outsiders;
