//! From a recording of a relay test to a process model with error bars and its optimal controller.
//!
//! A process under a relay oscillates by itself. A recording of that oscillation gives the gain, the lags and the dead time
//! of
//!
//! ```text
//! G(s) = K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))
//! ```
//!
//! and with them the PD controller `u = Kp (r - y) - Kd dy/dt` of least squared error at a phase margin:
//!
//! ```
//! use onecycle::{Identify, Parameter};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let recording = onecycle::read("../examples/simulated_hover.csv", &Default::default())?;
//! let found = Identify::new().cycles(2).run(&recording).outcome?;
//! for (parameter, interval) in found.estimate.iter() {
//!     println!("{} {:?}", parameter.symbol(), interval);
//! }
//! println!("Kp {:.3}, Kd {:.3}", found.design.controller.kp(), found.design.controller.kd());
//! # // The file names its process, and the 90 % intervals hold it: K/T_body 0.5922, delay 23.7 ms.
//! # let holds = |parameter, truth| found.estimate.get(parameter).is_some_and(|of| of.holds(truth));
//! # assert!(holds(Parameter::KOverTBody, 0.592_206_56) && holds(Parameter::Tau, 0.0237));
//! # // The optimum of that process is 192.92 and 29.523; two cycles with 2 % of noise are within 3 %.
//! # assert!((found.design.controller.kp() / 192.92 - 1.0).abs() < 0.03);
//! # assert!((found.design.controller.kd() / 29.523 - 1.0).abs() < 0.03);
//! # Ok(())
//! # }
//! ```
//!
//! # From samples in memory
//!
//! The input is held from each time stamp to the next; the output is measured at the stamp. Here a relay on a simulated
//! process makes the samples.
//!
//! ```
//! use onecycle::{FixedStepProcess, Identify, Model, Recording, Relay, RelaySettings, Soiptd};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let truth = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?;
//! let mut axis = FixedStepProcess::new(&truth, 1e-3);
//! let mut relay = Relay::new(RelaySettings::new(0.5, RelaySettings::DISTINGUISHING_BETA))?;
//! let (mut time_s, mut input, mut output) = (vec![], vec![], vec![]);
//! for tick in 0..8000 {
//!     let measured = axis.output();
//!     let command = f64::from(relay.step((0.0 - measured) as f32, 1e-3));
//!     time_s.push(1e-3 * f64::from(tick));
//!     input.push(command);
//!     output.push(measured);
//!     axis.step(command);
//! }
//! let recording = Recording::from_samples(&time_s, &input, &output)?;
//! let found = Identify::new().run(&recording).outcome?;
//! // Without noise the model is exact.
//! let Model::Soiptd(process) = found.model else { unreachable!() };
//! assert!((process.tau_s() - truth.tau_s()).abs() < 1e-8);
//! # Ok(())
//! # }
//! ```
//!
//! # When there is no answer
//!
//! Where the recording does not support an answer there is a [`Verdict`] instead of numbers: a value with the facts, and a
//! fixed name for programs. [`Remark`]s say what limits a result.
//!
//! ```
//! use onecycle::{Identify, Recording, Verdict};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let time_s: Vec<f64> = (0..1000).map(|tick| 1e-3 * f64::from(tick)).collect();
//! let recording = Recording::from_samples(&time_s, &[0.2; 1000], &[0.0; 1000])?;
//! let found = Identify::new().run(&recording);
//! match &found.outcome {
//!     Ok(identified) => println!("{:?} {:?}", identified.design.controller, found.remarks),
//!     Err(verdict) => println!("{}: {verdict}", verdict.kind()),
//! }
//! assert_eq!(found.outcome, Err(Verdict::ConstantInput));
//! # Ok(())
//! # }
//! ```
//!
//! # Design without a recording
//!
//! ```
//! use onecycle::{Controller, Model, Pd, Soiptd, Specification, design, margins, step_response};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = Model::from(Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?);
//! let asked = Specification::default().with_phase_margin_rad(45_f64.to_radians());
//! let best = design(&model, &asked)?;
//! let step = step_response(&model, &best.controller)?.metrics;
//! println!("settles in {:.3} s, overshoots by {:.0} %", step.settling_time_s, 100.0 * step.overshoot);
//!
//! // Half the gains are slower and further from instability.
//! let half = Controller::from(Pd { kp: 0.5 * best.controller.kp(), kd: 0.5 * best.controller.kd() });
//! let slower = margins(&model, &half).ok_or("no positive gain")?;
//! assert!(slower.delay_margin_s > best.margins.delay_margin_s);
//! # // `design` keeps the margin that it is asked for, to rounding.
//! # assert!((best.margins.phase_margin_rad.to_degrees() - 45.0).abs() < 1e-6);
//! # Ok(())
//! # }
//! ```
//!
//! # What it is made of
//!
//! This crate collects the names that a user needs. The rest is in the crates behind it: `onecycle-link` (readers and
//! writers), `onecycle-identify` (estimation), `onecycle-design` (cost, margins, bands), `onecycle-plant` (simulation, a
//! whole multirotor), `onecycle-onboard` (firmware: relay, estimator and tuner without std and heap). The program is the
//! crate `onecycle-cli`.
//!
//! The library prints nothing, starts no thread and panics on no input. The method is that of A. Ayyad, M. Chehadeh,
//! M. I. Awad, Y. Zweiri, "Real-time system identification using deep learning for linear processes with application to
//! unmanned aerial vehicles", IEEE Access 8 (2020).

mod builder;

pub use builder::{Identify, with_signals};

// Recordings.
#[doc(inline)]
pub use onecycle_link::{
    ChosenBy, ColumnLabel, ColumnRef, CsvOptions, Gap, Note, ReadError, Recording, RecordingError,
    TimeUnit, read, read_from, write_csv,
};

// Identification.
#[doc(inline)]
pub use onecycle_identify::{
    Estimate, Excitation, Identification, Identified, Interval, Method, Oscillation, Posterior,
    Remark, Verdict,
};
#[doc(inline)]
pub use onecycle_onboard::pack::{Pack, PackError};

// Models, controllers, design.
#[doc(inline)]
pub use onecycle_design::{
    Controller, Design, DesignError, Form, Margins, Model, Parameter, Specification, StepMetrics,
    StepResponse, StepResponseError, Structure, design, ise, margins, step_response,
};
#[doc(inline)]
pub use onecycle_onboard::{Pd, Soiptd, SoiptdError};

// Simulation.
#[doc(inline)]
pub use onecycle_onboard::{Relay, RelayError, RelaySettings};
#[doc(inline)]
pub use onecycle_plant::{Experiment, FixedStepProcess, Noise, Sensor, Trace};

// Compiles the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
