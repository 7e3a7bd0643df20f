//! The exact road of one family: an integrator with two lags and a delay under a PD.

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
