//! What is found, as plain data.

pub mod answer;
pub mod controllers;
pub mod family;
pub mod flight;
pub mod log_gains;
