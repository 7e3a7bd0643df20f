//! From a process model to its controller: robust PID and cascade gains, stability margins, responses.
//!
//! The dead time is exact everywhere: there is no Pade approximation. Designs minimise the exact IAE within limits of the
//! sensitivity, the margins and the noise at the actuator, for one model or for 95 % of the draws from a posterior.
//!
//! | to compute | call |
//! |------------|------|
//! | the controller of least cost for a model | [`design()`] |
//! | the controller of least expected cost for draws from a posterior | [`design_over()`] |
//! | one controller in each style | [`proposals()`] |
//! | all figures of a given controller; its margins over draws | [`assess()`], [`least_margins()`] |
//! | phase, gain and delay margin; `Ms` and `Mt` | [`margins()`], [`sensitivity()`] |
//! | the cost of a controller: ISE or IAE of a unit step of the reference, IAE of one of the load | [`ise()`], [`reference_iae()`], [`load_iae()`] |
//! | noise at the actuator | [`noise_amplification()`] |
//! | the open loop at a frequency, for a Bode or Nyquist plot | [`loop_response()`] |
//! | the response to a unit step of the reference or the load | [`step_response()`], [`step_metrics()`], [`load_response()`] |
//! | 90 % bands of step response and open loop for draws from a posterior | [`bands::step_bands()`], [`bands::load_bands()`], [`bands::loop_bands()`] |
//! | the gains of SIMC, AMIGO, Ziegler-Nichols, Tyreus-Luyben | [`rules`] |
//! | the processes that one oscillation leaves possible, at the ultimate gain or under a relay | [`oscillation`] |
//! | cost and phase margin of a cascade with a PID rate loop | [`Cascade::cost()`] |
//!
//! The process is a [`Model`] of nine [`Structure`]s, the controller a [`Controller`] of six [`Form`]s with filters and
//! sampling. For an integrator with two lags and dead time (SOIPTD) under a PD, the paper's pair, there are exact solutions
//! in [`soiptd_pd`].
//!
//! ```
//! use onecycle_design::{Form, Model, Specification, Style, design, load_iae, sensitivity};
//! use onecycle_onboard::Soiptd;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = Model::from(Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?);
//! let best = design(&model, &Specification::new(Form::Pid, Style::Balanced))?;
//! let peaks = sensitivity(&model, &best.controller).ok_or("unstable")?;
//! assert!(peaks.ms < 1.6001 && peaks.mt < 1.6001);
//! assert!(load_iae(&model, &best.controller).ok_or("unstable")? < 0.0134);
//! # Ok(())
//! # }
//! ```
//!
//! The paper's controller, a PD of least ISE at a phase margin:
//!
//! ```
//! use onecycle_design::{Model, Specification, design, step_response};
//! use onecycle_onboard::Soiptd;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = Model::from(Soiptd::new(1.0, 0.3, 2.0, 0.1)?);
//! let asked = Specification::paper().with_phase_margin_rad(45_f64.to_radians());
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
pub mod matrix;
mod model;
pub mod oscillation;
pub mod roots;
pub mod rules;
pub mod soiptd_pd;
mod synthesis;
pub mod tuning;

pub use analysis::sensitivity::Sensitivity;
pub use cascade::{Cascade, CascadeCost};
pub use closed_loop::{
    LoadResponse, ise, load_iae, load_response, loop_response, margins, noise_amplification,
    reference_iae, sensitivity, step_metrics, step_response,
};
pub use controller::{
    Autopilot, Controller, Execution, Form, Ideal, LowPass, Pid, Series, Spans, TypedGain, Vendor,
    VendorError, VendorLaw,
};
pub use model::{Linear, LinearError, Model, Parameter, Stages, Structure, Unit, state_space};
pub use soiptd_pd::loop_response::LoopResponse;
pub use soiptd_pd::margins::Margins;
pub use soiptd_pd::step_metrics::StepMetrics;
pub use soiptd_pd::step_response::{Sample, StepResponse, StepResponseError};
pub use tuning::{
    Assessment, Comparison, Design, DesignError, Effect, FELT, Felt, LeastMargins, Limit,
    MeasurementNoise, Missed, Proposal, Responses, Robustness, Specification, Style, assess,
    assess_and_simulate, design, design_over, forms, least_margins, proposals, reference_filter_s,
};

// Compiles and runs the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
