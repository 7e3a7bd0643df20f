//! Exact solutions for an integrator with two lags and dead time (SOIPTD) under a PD.
//!
//! ```text
//! G(s) = K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))         u = Kp (r - y) - Kd dy/dt
//! ```
//!
//! | module | content |
//! |--------|---------|
//! | [`open_loop`] | open loop, gain crossover, phase crossover |
//! | [`mod@margins`] | phase, gain and delay margin |
//! | [`cost`] | integral of the squared error (ISE) of a unit step, in closed form |
//! | [`criterion`] | the other integrals of the error: IAE and ITAE |
//! | [`optimum`] | PD of least ISE, IAE or ITAE at a phase margin |
//! | [`mod@deterioration`] | cost of a controller on a process, relative to the optimum of that process |
//! | [`mod@loop_response`] | open loop at a frequency |
//! | [`mod@step_response`], [`step_metrics`] | response to a unit step, with its overshoot, rise time and settling time |

pub mod cost;
pub mod criterion;
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
pub use criterion::Criterion;
pub use deterioration::{Deterioration, deterioration};
pub use loop_response::{LoopResponse, loop_response};
pub use margins::{Margins, margins};
pub use optimum::{Optimum, OptimumError, pd, pd_at_phase_margin, pd_by};
pub use step_metrics::StepMetrics;
pub use step_response::{Sample, StepResponse, StepResponseError, step_response};
