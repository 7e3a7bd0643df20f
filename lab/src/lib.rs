//! How the identifier is made and judged: exact cost, margins and optimal controllers.
//!
//! Everything here is off board and exact: no time simulation is needed for a cost, no grid for an
//! optimum, and a dead time is a dead time, not a Pade fraction.
//!
//! | question                                         | answer                               |
//! |--------------------------------------------------|--------------------------------------|
//! | what does a PD cost on a process?                | [`ise`], in closed form              |
//! | how far is it from instability?                  | [`margins()`]                        |
//! | what is the best PD, at or above a phase margin? | [`pd_at_phase_margin`], [`pd`]       |
//! | which relay and tuning rule give that PD?        | [`TuningRule`]                       |
//! | what does one process's PD cost on another?      | [`deterioration()`]                  |
//! | and a cascade with a PID of the rate?            | [`Cascade`]                          |
//! | what is the open loop at a frequency?            | [`loop_response()`]                  |
//! | what does a recording say without a model?       | [`harmonics()`]                      |
//! | what will the step look like?                    | [`step_response()`]                  |
//! | what would other methods make of the experiment? | [`baselines`]                        |
//!
//! The method is that of A. Ayyad, M. Chehadeh, M. I. Awad, Y. Zweiri, "Real-time system
//! identification using deep learning for linear processes with application to unmanned aerial
//! vehicles", IEEE Access 8 (2020): "the paper" throughout.
//!
//! ```
//! use onecycle_lab::{ise, pd_at_phase_margin};
//! use onecycle_onboard::Process;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let process = Process::new(1.0, 0.3, 2.0, 0.1)?;
//! let best = pd_at_phase_margin(&process, 20_f64.to_radians())?;
//! assert!((best.lead_rad.to_degrees() - 66.877).abs() < 0.001);
//! assert_eq!(ise(&process, best.pd).is_some(), best.margins.is_stable());
//! # Ok(())
//! # }
//! ```

pub mod bands;
pub mod baselines;
pub mod campaign;
pub mod candidate;
pub mod cascade;
pub mod certificate;
mod cholesky;
pub mod classifier;
pub mod cost;
pub mod dataset;
pub mod density;
pub mod deterioration;
pub mod evaluate;
pub mod flights;
pub mod grid;
pub mod harmonics;
pub mod identifier;
pub mod identify;
pub mod lead_table;
pub mod limit_cycle;
pub mod loop_response;
pub mod margins;
pub mod onnx;
mod open_loop;
pub mod optimum;
pub mod outsiders;
pub mod pack;
pub mod phase;
mod propagation;
mod roots;
pub mod rule;
pub mod space;
mod step_metrics;
pub mod step_response;
pub mod surface;
pub mod train;
pub mod whiteness;

pub use candidate::{Candidate, CandidateError, Gains};
pub use cascade::{Cascade, CascadeCost};
pub use cost::ise;
pub use density::{Density, density};
pub use deterioration::{Deterioration, deterioration};
pub use harmonics::{Harmonic, harmonics};
pub use limit_cycle::LimitCycle;
pub use loop_response::{LoopResponse, loop_response};
pub use margins::{Margins, margins};
pub use optimum::{Optimum, OptimumError, pd, pd_at_phase_margin};
pub use phase::{DistinguishingPhase, LocalOptima, distinguishing_phase};
pub use rule::TuningRule;
pub use space::{FieldError, Space};
pub use step_metrics::StepMetrics;
pub use step_response::{Sample, StepResponse, StepResponseError, step_response};
pub use surface::Direction;
pub use whiteness::{Whiteness, whiteness};
