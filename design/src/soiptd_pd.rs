//! Exact solutions for an integrator with two lags and a delay (SOIPTD) under a PD.
//!
//! | file | what it computes |
//! |------|------------------|
//! | `open_loop` | the loop cut open: gain and phase crossover |
//! | `margins` | phase, gain and delay margin |
//! | `cost` | squared error of a unit step, in closed form |
//! | `optimum` | the PD of least cost at a phase margin |
//! | `deterioration` | what a controller costs on another process than its own |
//! | `loop_response` | the open loop at a frequency |
//! | `step_response`, `step_metrics` | the closed loop's step and its figures |

pub mod cost;
pub mod deterioration;
mod feedback;
pub mod loop_response;
pub mod margins;
pub mod open_loop;
pub mod optimum;
mod propagation;
pub mod step_metrics;
pub mod step_response;

pub use cost::ise;
pub use deterioration::{Deterioration, deterioration};
pub use loop_response::{LoopResponse, loop_response};
pub use margins::{Margins, margins};
pub use optimum::{Optimum, OptimumError, pd, pd_at_phase_margin};
pub use step_metrics::StepMetrics;
pub use step_response::{Sample, StepResponse, StepResponseError, step_response};
