//! From a process model to its controller: exact cost, margins, step response, optimal gains.
//!
//! Nothing is simulated to get a cost, nothing is searched on a grid to get an optimum, and a dead time stays a dead
//! time: there is no Pade approximation.
//!
//! | question | answer |
//! |----------|--------|
//! | Which controller is best for a model, or over draws from a posterior? | [`design()`], [`design_over()`] |
//! | What does a controller cost? | [`ise()`]: squared error of a unit step, in closed form |
//! | How far is the loop from instability? | [`margins()`] |
//! | What is the open loop at a frequency? | [`loop_response()`] |
//! | What does a step look like? | [`step_response()`] |
//! | What do step and loop look like over the posterior? | [`bands::step_bands()`], [`bands::loop_bands()`] |
//! | What does a cascade with a PID of the rate cost? | [`Cascade`] |
//!
//! [`Model`] and [`Controller`] are values. Today there is one structure and one form, whose exact solutions are in
//! [`soiptd_pd`].
//!
//! ```
//! use onecycle_design::{Model, Specification, design, step_response};
//! use onecycle_onboard::Soiptd;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = Model::from(Soiptd::new(1.0, 0.3, 2.0, 0.1)?);
//! let asked = Specification::default().with_phase_margin_rad(45_f64.to_radians());
//! let best = design(&model, &asked)?;
//! assert!((best.margins.phase_margin_rad.to_degrees() - 45.0).abs() < 1e-6);
//! assert!(step_response(&model, &best.controller)?.metrics.overshoot < 0.1);
//! # Ok(())
//! # }
//! ```
//!
//! Reference: A. Ayyad, M. Chehadeh, M. I. Awad, Y. Zweiri, "Real-time system identification using deep learning for
//! linear processes with application to unmanned aerial vehicles", IEEE Access 8 (2020): "the paper" throughout.

pub mod bands;
pub mod cascade;
pub mod closed_loop;
pub mod controller;
pub mod model;
pub mod roots;
pub mod soiptd_pd;
pub mod tuning;

pub use cascade::{Cascade, CascadeCost};
pub use closed_loop::{ise, loop_response, margins, step_response};
pub use controller::{Controller, Form};
pub use model::{Model, Parameter, Structure, Unit};
pub use soiptd_pd::loop_response::LoopResponse;
pub use soiptd_pd::margins::Margins;
pub use soiptd_pd::step_metrics::StepMetrics;
pub use soiptd_pd::step_response::{Sample, StepResponse, StepResponseError};
pub use tuning::{Design, DesignError, Specification, design, design_over};
