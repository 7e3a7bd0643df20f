//! From a process model to its controller: cost, stability margins, step response, optimal gains.
//!
//! The cost is a closed form, not a simulation. The optimal gains are the root of a derivative, not the best point of a
//! grid. The dead time is exact: there is no Pade approximation.
//!
//! | to compute | call |
//! |------------|------|
//! | the controller of least cost for a model | [`design()`] |
//! | the controller of least expected cost for draws from a posterior | [`design_over()`] |
//! | the cost of a controller: integral of the squared error (ISE) of a unit step | [`ise()`] |
//! | phase, gain and delay margin | [`margins()`] |
//! | the open loop at a frequency, for a Bode or Nyquist plot | [`loop_response()`] |
//! | the response to a unit step of the reference | [`step_response()`] |
//! | 90 % bands of step response and open loop for draws from a posterior | [`bands::step_bands()`], [`bands::loop_bands()`] |
//! | cost and phase margin of a cascade with a PID rate loop | [`Cascade::cost()`] |
//!
//! The process is a [`Model`], the controller a [`Controller`]. Both are enums, with one variant each: an integrator
//! with two lags and dead time (SOIPTD), and a PD. The exact solutions for this pair are in [`soiptd_pd`].
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

mod analysis;
pub mod bands;
pub mod cascade;
mod closed_loop;
mod controller;
mod model;
pub mod roots;
pub mod rules;
pub mod soiptd_pd;
mod synthesis;
pub mod tuning;

pub use analysis::sensitivity::Sensitivity;
pub use cascade::{Cascade, CascadeCost};
pub use closed_loop::{
    LoadResponse, ise, load_iae, load_response, loop_response, margins, noise_amplification,
    reference_iae, sensitivity, step_response,
};
pub use controller::{Autopilot, Controller, Execution, Form, Ideal, LowPass, Pid, Series};
pub use model::{Linear, LinearError, Model, Parameter, Stages, Structure, Unit, state_space};
pub use soiptd_pd::loop_response::LoopResponse;
pub use soiptd_pd::margins::Margins;
pub use soiptd_pd::step_metrics::StepMetrics;
pub use soiptd_pd::step_response::{Sample, StepResponse, StepResponseError};
pub use tuning::{
    Design, DesignError, MeasurementNoise, Robustness, Specification, Style, design, design_over,
};

// Compiles and runs the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
