//! Evaluation: every method runs on the same experiments and gets a score.

pub mod baselines;
pub mod bound;
pub mod calibrate;
pub mod evaluate;
pub mod harm;
pub mod honesty;
pub mod out_of_family;
pub mod outcome;
pub mod promises;
pub mod recording;
