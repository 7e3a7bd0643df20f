//! From one cycle of a relay oscillation to the process and its optimal controller.
//!
//! A process under a relay oscillates by itself. A recording of that oscillation tells gain, lags and delay of
//!
//! ```text
//! G(s) = K e^(-tau s) / (s (T_prop s + 1) (T_body s + 1))
//! ```
//!
//! and with them the PD controller `u = Kp (r - y) - Kd dy/dt` of least squared error at a phase margin:
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let recording = onecycle::read("../examples/simulated_hover.csv", &Default::default())?;
//! let found = onecycle::identify(&recording).outcome?;
//! let (process, pd) = (found.refined.process, found.controller.pd);
//! println!("K/T_body {:.4}, delay {:.4} s", process.k_over_t_body(), process.tau_s());
//! println!("Kp {:.3}, Kd {:.3}", pd.kp, pd.kd);
//! # // The file names its process, and the 90 % intervals hold it: K/T_body 0.5922, delay 23.7 ms.
//! # assert!(found.process.k_over_t_body.holds(0.592_206_56) && found.process.tau_s.holds(0.0237));
//! # // The optimum of that process is 192.92 and 29.523; 2 % of noise leave 0.3 % of the derivative gain.
//! # assert!((pd.kp - 192.92).abs() < 0.2 && (pd.kd - 29.523).abs() < 0.2);
//! # Ok(())
//! # }
//! ```
//!
//! [`Identified::process`] has every parameter as an [`Interval`]: its estimate, and the ends that hold the truth with
//! a probability of 90 %.
//!
//! # From samples in memory
//!
//! The input is held from each stamp to the next, the output is measured at it. Here they are simulated; a
//! driver of one's own pushes what it commands and what it reads.
//!
//! ```
//! use onecycle::plant::FixedStepProcess;
//! use onecycle::{Soiptd, Recording, Relay, RelaySettings};
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
//! let found = onecycle::identify(&recording).outcome?;
//! let process = found.refined.process;
//! // Without noise the model is exact.
//! assert!((process.tau_s() - truth.tau_s()).abs() < 1e-8);
//! # Ok(())
//! # }
//! ```
//!
//! # A refusal
//!
//! Where the recording does not tell there is a [`Verdict`] instead of numbers: a value with a reason, a sentence
//! of advice and a fixed name for programs. What stands beside numbers is a [`Remark`].
//!
//! ```
//! use onecycle::{Recording, Verdict};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let time_s: Vec<f64> = (0..1000).map(|tick| 1e-3 * f64::from(tick)).collect();
//! let recording = Recording::from_samples(&time_s, &[0.2; 1000], &[0.0; 1000])?;
//! let found = onecycle::identify(&recording);
//! match &found.outcome {
//!     Ok(identified) => {
//!         println!("Kp {:.3}", identified.controller.pd.kp);
//!         found.remarks.iter().for_each(|remark| println!("{remark}"));
//!     }
//!     Err(verdict) => println!("{verdict}. {}", verdict.advice()),
//! }
//! assert_eq!(found.outcome, Err(Verdict::ConstantInput));
//! # Ok(())
//! # }
//! ```
//!
//! # Options, and an identifier of one's own
//!
//! [`Options`] hold the number of cycles, the phase margin and the method. A [`Pack`] is an identifier in one file, as
//! `onecycle train` writes it; one is built in.
//!
//! ```
//! use onecycle::{CsvOptions, Options, Pack};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let columns = CsvOptions {
//!     output_column: Some("output".into()),
//!     ..CsvOptions::default()
//! };
//! let recording = onecycle::read("../examples/simulated_hover.csv", &columns)?;
//! let options = Options {
//!     cycles: 2,
//!     phase_margin_rad: 45_f64.to_radians(),
//!     ..Options::default()
//! };
//! let found = onecycle::identify_with(&recording, &options);
//!
//! let bytes = std::fs::read("../onboard/packs/default.pack")?;
//! let by_file = onecycle::identify_by(&recording, &options, Some(&Pack::read(&bytes)?));
//! assert_eq!(found, by_file);
//! # assert_eq!(found.oscillation.map(|oscillation| oscillation.cycles_used), Some(2));
//! # Ok(())
//! # }
//! ```
//!
//! # Design without a recording
//!
//! ```
//! use onecycle::{Pd, Soiptd, margins, step_response, tune};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237)?;
//! let best = tune(&process, 45_f64.to_radians())?;
//! let step = step_response(&process, best.pd)?.metrics;
//! println!("settles in {:.3} s, overshoots by {:.0} %", step.settling_time_s, 100.0 * step.overshoot);
//!
//! // Half the gains are slower and further from instability.
//! let half = Pd { kp: 0.5 * best.pd.kp, kd: 0.5 * best.pd.kd };
//! let margins = margins(&process, half).ok_or("no positive gain")?;
//! assert!(margins.delay_margin_s > best.margins.delay_margin_s);
//! # // `tune` keeps the margin that it is asked for, to rounding.
//! # assert!((best.margins.phase_margin_rad.to_degrees() - 45.0).abs() < 1e-6);
//! # Ok(())
//! # }
//! ```
//!
//! # What is where
//!
//! | for                                                                     | look into |
//! |-------------------------------------------------------------------------|-----------|
//! | recordings: other columns, text tables, gaps, what a reader forgave     | [`link`]  |
//! | identification, optimal controllers, exact cost, margins, campaigns, grids, training | [`lab`] |
//! | simulation: exact processes, noisy sensors, loops, a whole multirotor   | [`plant`] |
//! | firmware, without std and heap: relay, estimator, the tuner of an axis  | [`onboard`] |
//!
//! This crate adds to them [`identify`] and what goes with it, and with the feature `cli`, which is on by default,
//! the program `onecycle`. As a library take it without:
//!
//! ```toml
//! onecycle = { path = "onecycle/app", default-features = false }
//! ```
//!
//! The library prints nothing, starts no thread and panics on no input. The method is that of A. Ayyad, M. Chehadeh,
//! M. I. Awad, Y. Zweiri, "Real-time system identification using deep learning for linear processes with application to
//! unmanned aerial vehicles", IEEE Access 8 (2020).

// The four crates in full.
pub use {onecycle_link as link, onecycle_onboard as onboard, onecycle_plant as plant};

// Recordings.
#[doc(inline)]
pub use onecycle_link::{
    ColumnRef, CsvOptions, Gap, Note, ReadError, Recording, RecordingError, TimeUnit, read,
    read_from, write_csv,
};

// What a recording tells.
#[doc(inline)]
pub use onecycle_identify::{
    Identification, Identified, Interval, Method, Options, OscillationFound, ProcessEstimate,
    Remark, Signals, Verdict,
};
#[doc(inline)]
pub use onecycle_onboard::pack::{Pack, PackError};

// Design.
#[doc(inline)]
pub use onecycle_design::{
    Margins, Optimum, OptimumError, StepMetrics, StepResponse, StepResponseError, margins,
    pd as tune, step_response,
};
#[doc(inline)]
pub use onecycle_onboard::{Pd, Soiptd, SoiptdError};

// Simulation.
#[doc(inline)]
pub use onecycle_onboard::{Relay, RelayError, RelaySettings};
#[doc(inline)]
pub use onecycle_plant::{Experiment, Noise, Sensor, Trace};

/// The process behind a recorded relay test and its controller, with the default [`Options`] and the pack that is
/// built in.
///
/// What cannot be told is a [`Verdict`] in [`Identification::outcome`].
#[must_use]
pub fn identify(recording: &Recording) -> Identification {
    identify_with(recording, &Options::default())
}

/// The same with options of one's own.
#[must_use]
pub fn identify_with(recording: &Recording, options: &Options) -> Identification {
    with_signals(recording, |signals| {
        onecycle_identify::identify(signals, options)
    })
}

/// The same with a pack of one's own, or none: [`Method::Refine`] then works as ever, [`Method::Map`] fits without
/// knowing what is likely, [`Method::Classify`] refuses.
#[must_use]
pub fn identify_by(
    recording: &Recording,
    options: &Options,
    pack: Option<&Pack<'_>>,
) -> Identification {
    with_signals(recording, |signals| {
        onecycle_identify::identify_by(signals, options, pack)
    })
}

/// Hands a recording to a function that takes [`Signals`], as those of [`lab`] do: no cycle reaches across a gap.
pub fn with_signals<T>(recording: &Recording, read: impl FnOnce(&Signals<'_>) -> T) -> T {
    let breaks: Vec<usize> = recording.gaps().iter().map(|gap| gap.index).collect();
    read(&Signals {
        time_s: recording.time_s(),
        input: recording.input(),
        output: recording.output(),
        // A power of two: above u32 after 2^54 samples.
        samples_per_point: recording.samples_per_point() as u32,
        sample_period_s: recording.sample_period_s(),
        breaks: &breaks,
    })
}
