//! From a recording of a relay test to a process model with error bars and a controller with known margins.
//!
//! A process under a relay oscillates by itself. From a recording of this oscillation the library identifies
//!
//! ```text
//! G(s) = K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))
//! ```
//!
//! with a 90 % interval for each parameter, and designs a PID that keeps its maximum sensitivity on 95 % of the processes
//! that the recording leaves possible. Other recordings lead to the simplest of nine structures:
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
//! let controller = found.design.ok_or("no controller")?.controller;
//! println!("Kp {:.1}, Ki {:.1}, Kd {:.2}", controller.kp(), controller.ki(), controller.kd());
//! # // The file names the true process; the 90 % intervals hold K/T_body = 0.5922 and tau = 23.7 ms.
//! # let holds = |parameter, truth| found.estimate.get(parameter).is_some_and(|of| of.holds(truth));
//! # assert!(holds(Parameter::KOverTBody, 0.592_206_56) && holds(Parameter::Tau, 0.0237));
//! # // The limits hold on the true process too: Ms of 1.6 at most.
//! # let truth = onecycle::Model::from(onecycle::Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?);
//! # assert!(onecycle::sensitivity(&truth, &controller).is_some_and(|peaks| peaks.ms < 1.6));
//! # Ok(())
//! # }
//! ```
//!
//! | task | names |
//! |------|-------|
//! | read and write recordings | [`read`], [`read_from`], [`CsvOptions`], [`ColumnRef`], [`TimeUnit`], [`Recording`], [`Gap`], [`Note`], [`write_csv`] |
//! | ask for everything at once | [`Request`], [`Source`], [`Report`], [`Answer`], [`Advice`], [`Controllers`], [`Survey`], [`DesignRequest`], [`DesignReport`], [`Requirements`], [`LogFile`], [`Error`] |
//! | identify | [`Identify`], [`Structure`], [`Hold`], [`Method`], [`Pack`] |
//! | use the result | [`Identification`], [`Identified`], [`Estimate`], [`Interval`], [`Posterior`], [`StepIntervals`] |
//! | see what the estimate rests on | [`Excitation`], [`Oscillation`], [`Recorded`], [`Evidence`], [`Innovations`], [`SetPointResponse`] |
//! | find out why there is no result, or what limits it | [`Verdict`], [`Remark`] |
//! | describe a process | [`Model`], [`Structure`], [`Parameter`], [`Unit`], [`Soiptd`], [`Linear`] |
//! | design a controller | [`design()`], [`design_over()`], [`Specification`], [`Style`], [`MeasurementNoise`], [`Execution`], [`LowPass`], [`Design`], [`Robustness`] |
//! | type a controller in | [`Controller`], [`Form`], [`Pid`], [`Pd`], [`Ideal`], [`Series`], [`Autopilot`], [`Cascade`] |
//! | choose between controllers, judge the gains in force | [`Proposal`], [`proposals()`], [`assess()`], [`Assessment`], [`least_margins()`], [`LeastMargins`], [`Comparison`], [`Effect`], [`Felt`] |
//! | analyse a loop | [`margins()`], [`Margins`], [`sensitivity()`], [`Sensitivity`], [`ise()`], [`load_iae()`], [`step_response()`], [`StepResponse`], [`step_metrics()`], [`StepMetrics`], [`load_response()`], [`LoadResponse`] |
//! | simulate a relay test | [`Experiment`], [`Sensor`], [`Trace`], [`FixedStepProcess`], [`Relay`], [`RelaySettings`] |
//! | handle errors | [`ReadError`], [`RecordingError`], [`PackError`], [`DesignError`], [`StepResponseError`], [`SoiptdError`], [`LinearError`], [`RelayError`] |
//!
//! # Ask for everything at once
//!
//! A [`Request`] is what the program, the Python package and the studio ask for; its [`Report`] is what they show. Of a flight log
//! it takes one loop, or all of them ([`Request::survey`]), judges the gains in force and makes the files with parameters.
//!
//! ```
//! use std::path::PathBuf;
//!
//! use onecycle::{Advice, Request};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut request = Request::default();
//! request.set("against", "40,5,12")?;
//! let report = request.identify(&PathBuf::from("../examples/simulated_hover.csv"))?;
//! let answer = &report.answer;
//! println!("{:?}: {}. {}", answer.verdict, answer.reason, answer.next);
//! assert!(matches!(answer.verdict, Advice::Change | Advice::Keep));
//! for gain in &answer.gains {
//!     println!("{} now {:?}, proposed {:?}", gain.name, gain.now, gain.full);
//! }
//! // A setting that there is not is named.
//! assert_eq!(request.set("colour", "red").unwrap_err().to_string(), "there is no setting colour");
//! # Ok(())
//! # }
//! ```
//!
//! # Read a recording
//!
//! A CSV file needs three columns: time, input (output of the relay) and output (measurement). The reader recognises
//! common names and units. [`CsvOptions`] state what it cannot know; [`Recording::notes`] lists what it assumed.
//!
//! ```
//! use onecycle::{ColumnRef, CsvOptions, ReadError, TimeUnit};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let file = "stamp,torque,roll\n0,1,0.00\n10,1,0.02\n20,-1,0.05\n";
//! let mut options = CsvOptions::default();
//! options.time_unit = Some(TimeUnit::Milliseconds);
//! options.output_column = Some(ColumnRef::Name("roll".to_owned()));
//! let recording = onecycle::read_from(file.as_bytes(), &options)?;
//! assert_eq!(recording.time_s(), [0.0, 0.01, 0.02]);
//! assert_eq!(recording.input(), [1.0, 1.0, -1.0]);
//! assert!(recording.gaps().is_empty());
//! for note in recording.notes() {
//!     println!("{note}");
//! }
//!
//! // An error names the place.
//! let damaged = onecycle::read_from("t,u,y\n0,1,x\n".as_bytes(), &CsvOptions::default());
//! assert!(matches!(damaged, Err(ReadError::NotANumber { line: 2, .. })));
//!
//! let mut copy = Vec::new();
//! onecycle::write_csv(&mut copy, &recording, &["roll axis"])?;
//! # assert!(copy.starts_with(b"# roll axis\ntime_s,output,input\n"));
//! # Ok(())
//! # }
//! ```
//!
//! # Identify from samples in memory
//!
//! [`Recording::from_samples`] takes three vectors. The input is held from each time stamp to the next; the output is
//! measured at the time stamp. Here a [`Relay`] on a simulated process makes the samples, tick by tick as in firmware.
//!
//! ```
//! use onecycle::{FixedStepProcess, Identify, Recording, Relay, RelaySettings, Soiptd};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // K, T_prop (s), T_body (s), tau (s).
//! let truth = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?;
//! let mut axis = FixedStepProcess::new(&truth, 1e-3);
//! let settings = RelaySettings::new(0.5, RelaySettings::DISTINGUISHING_BETA);
//! let mut relay = Relay::new(settings)?;
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
//! let process = found.model.soiptd().ok_or("another structure")?;
//! assert!((process.tau_s() - truth.tau_s()).abs() < 1e-8);
//! # Ok(())
//! # }
//! ```
//!
//! [`Experiment`] runs the same test with sensor noise, input bias and jitter in one call and returns a [`Trace`]: see
//! the example `identify_samples`.
//!
//! # Use the result
//!
//! ```
//! use onecycle::{Controller, Excitation, Identify, Pd, Structure};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let recording = onecycle::read("../examples/simulated_hover.csv", &Default::default())?;
//! let found = Identify::new().run(&recording);
//! if let Some(Excitation::Relay { oscillation, .. }) = &found.excitation {
//!     println!("{} cycles of {:.3} s", oscillation.cycles_used, oscillation.period_s);
//! }
//! let identified = found.outcome?;
//! assert_eq!(identified.model.structure(), Structure::Soiptd);
//!
//! // The phase margin (rad) of your own gains, with its 90 % interval over the posterior.
//! let own = Controller::from(Pd { kp: 50.0, kd: 15.0 });
//! let margin_rad = identified.posterior.phase_margin_rad(&own);
//! assert!(margin_rad.low.is_some_and(|low| low > 40_f64.to_radians()));
//! # Ok(())
//! # }
//! ```
//!
//! # Choose a controller
//!
//! ```
//! use onecycle::{Controller, Identify, Pid, Proposal, Specification, Style, assess, least_margins};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let recording = onecycle::read("../examples/simulated_hover.csv", &Default::default())?;
//! let calm = Specification::new(Specification::default().form, Style::Calm);
//! let identified = Identify::new().specification(calm).run(&recording).outcome?;
//! // The recording has completed the requirements with its noise and its sample period.
//! let noise = identified.specification.noise.ok_or("no noise")?;
//! for choice in Proposal::choices(identified.model.structure(), &identified.specification) {
//!     let controller = identified.propose(&choice).outcome?.controller;
//!     let figures = assess(&identified.model, &controller, Some(&noise)).ok_or("unstable")?;
//!     println!("{}: Ms {:.2}, noise {:?}", choice.style.name(), figures.ms, figures.noise_share);
//! }
//! // The gains in force, on 200 processes that the recording leaves possible.
//! let own = Controller::from(Pid::new(50.0, 0.0, 15.0));
//! let (_, draws) = identified.for_design(200);
//! let least = least_margins(&draws, &own).ok_or("no draws")?;
//! assert!(least.stable == 1.0 && least.ms < 2.0);
//! # Ok(())
//! # }
//! ```
//!
//! # When no process is identified
//!
//! If the recording does not support an answer, the outcome is a [`Verdict`]: an error with the facts and with a fixed
//! name for programs. If it does, [`Remark`]s say what limits the result.
//!
//! ```
//! use onecycle::{Identify, Recording, Verdict};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let time_s: Vec<f64> = (0..1000).map(|tick| 1e-3 * f64::from(tick)).collect();
//! let recording = Recording::from_samples(&time_s, &[0.2; 1000], &[0.0; 1000])?;
//! let found = Identify::new().run(&recording);
//! match &found.outcome {
//!     Ok(identified) => println!("{:?}", identified.design),
//!     Err(verdict) => println!("{}: {verdict}", verdict.kind()),
//! }
//! for remark in &found.remarks {
//!     println!("{}: {remark:?}", remark.kind());
//! }
//! assert_eq!(found.outcome, Err(Verdict::ConstantInput));
//! # Ok(())
//! # }
//! ```
//!
//! # Design without a recording
//!
//! ```
//! use onecycle::{
//!     Controller, DesignError, Model, Parameter, Pd, Soiptd, SoiptdError, Specification,
//!     StepResponseError, Unit, design, ise, margins, step_response,
//! };
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = Model::from(Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?);
//! assert_eq!(model.structure().name(), "soiptd");
//! assert_eq!(model.parameter(Parameter::Tau), Some(0.0237));
//! assert_eq!(model.structure().unit(Parameter::Tau), Unit::Second);
//!
//! let asked = Specification::paper().with_phase_margin_rad(45_f64.to_radians());
//! let best = design(&model, &asked)?;
//! let (kp, kd) = (best.controller.kp(), best.controller.kd());
//! println!("{}, Kp {kp:.2}, Kd {kd:.3}", best.controller.form().law());
//! let step = step_response(&model, &best.controller)?.metrics;
//! println!("settles in {:.3} s, overshoot {:.2}", step.settling_time_s, step.overshoot);
//!
//! // Half the gains: a larger squared error and a larger delay margin.
//! let half = Controller::from(Pd { kp: 0.5 * kp, kd: 0.5 * kd });
//! let slower = margins(&model, &half).ok_or("no positive gain")?;
//! assert!(slower.delay_margin_s > best.margins.delay_margin_s);
//! assert!(ise(&model, &half).is_some_and(|cost| cost > best.ise));
//!
//! // Errors name the value that is out of range.
//! let impossible = design(&model, &asked.with_phase_margin_rad(2.0));
//! assert_eq!(impossible, Err(DesignError::PhaseMargin(2.0)));
//! assert_eq!(Soiptd::new(1.0, 0.0321, 1.6886, -0.1), Err(SoiptdError::Tau(-0.1)));
//! let unstable = Controller::from(Pd { kp: 1e4, kd: 0.0 });
//! assert_eq!(step_response(&model, &unstable), Err(StepResponseError::Unstable));
//! # // `design` keeps the specified margin, to rounding.
//! # assert!((best.margins.phase_margin_rad.to_degrees() - 45.0).abs() < 1e-6);
//! # Ok(())
//! # }
//! ```
//!
//! # Crates behind this one
//!
//! | crate | content |
//! |-------|---------|
//! | `onecycle-link` | readers and writers of recordings |
//! | `onecycle-identify` | estimation, diagnostics of a fit |
//! | `onecycle-design` | cost, margins, step responses, bands over a posterior |
//! | `onecycle-plant` | exact simulation, a whole multirotor |
//! | `onecycle-onboard` | firmware without std and heap: relay, estimator, tuner (example `on_board`) |
//! | `onecycle-cli` | the program |
//!
//! The library prints nothing, does not panic on any input, and starts threads with the feature `threads` only.
//!
//! Reference: A. Ayyad, M. Chehadeh, M. I. Awad, Y. Zweiri, "Real-time system identification using deep learning for
//! linear processes with application to unmanned aerial vehicles", IEEE Access 8 (2020).

mod answer;
mod builder;
mod controllers;
mod design;
mod device_model;
mod error;
mod feedback;
mod in_force;
#[cfg(feature = "serde")]
#[doc(hidden)]
pub mod json;
pub mod log_gains;
mod overlay;
mod report;
pub mod request;
pub mod results;
mod run;
pub mod source;
mod survey;
mod threads;
#[doc(hidden)]
pub mod words;

pub use builder::{Identify, with_signals};
pub use design::DesignReport;
pub use error::Error;
pub use in_force::full_scale;
pub use report::Report;
pub use request::{DesignRequest, Request, Requirements};
pub use results::answer::{Advice, Answer};
pub use results::controllers::Controllers;
pub use results::flight::Survey;
pub use source::{LogFile, Source, shown};

// Recordings.
#[doc(inline)]
pub use onecycle_link::{
    ChosenBy, ColumnLabel, ColumnRef, CsvOptions, Gap, Note, ReadError, Recording, RecordingError,
    TimeUnit, read, read_from, write_csv,
};

// Identification.
#[doc(inline)]
pub use onecycle_identify::progress::with_progress;
#[doc(inline)]
pub use onecycle_identify::{
    About, Estimate, Evidence, Excitation, Hold, Identification, Identified, Innovations, Interval,
    Method, Oscillation, Posterior, Recorded, Refused, Remark, ResponsePoint, SetPointResponse,
    StepIntervals, Verdict,
};
#[doc(inline)]
pub use onecycle_onboard::pack::{Pack, PackError};

// Models, controllers, design.
#[doc(inline)]
pub use onecycle_design::{
    Assessment, Autopilot, Cascade, Comparison, Controller, Design, DesignError, Effect, Execution,
    Felt, Form, Ideal, LeastMargins, Linear, LinearError, LoadResponse, LowPass, Margins,
    MeasurementNoise, Model, Parameter, Pid, Proposal, Robustness, Sensitivity, Series,
    Specification, StepMetrics, StepResponse, StepResponseError, Structure, Style, Unit, assess,
    design, design_over, ise, least_margins, load_iae, load_response, margins, proposals,
    sensitivity, step_metrics, step_response,
};
#[doc(inline)]
pub use onecycle_onboard::{Pd, Soiptd, SoiptdError};

// Simulation.
#[doc(inline)]
pub use onecycle_onboard::{Relay, RelayError, RelaySettings};
#[doc(inline)]
pub use onecycle_plant::{Experiment, FixedStepProcess, FollowedLoop, Noise, Sensor, Trace};

// Compiles the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
