//! On-board tuner: relay test, cycle detection, identification and PD design for firmware.
//!
//! `no_std`, no heap, no clock, no input or output; the only dependency is `libm`. Firmware links this crate;
//! the simulator and the program call the same code, so a result on the board and a result on the desk have the
//! same bits.
//!
//! # One process family, one controller, one excitation
//!
//! Everything here is specialised, on purpose, because a microcontroller has to run it in the gaps of its control
//! loop:
//!
//! | choice     | value                                                      | file             |
//! |------------|------------------------------------------------------------|------------------|
//! | process    | integrator, two lags and delay ([`Soiptd`])                 | `process.rs`     |
//! | controller | PD with the derivative on the measurement ([`Pd`]), and an integral beside it | `control.rs`, `integral.rs` |
//! | excitation | two-level relay with hysteresis or lead ([`Relay`])         | `relay.rs`       |
//!
//! ```text
//!              K e^(-tau s)
//! G(s) = ----------------------------,    u = offset + kp (r - y) - kd dy/dt,    u_relay = trim +/- h
//!        s (T_prop s + 1)(T_body s + 1)
//! ```
//!
//! Off board the structure of the process, the excitation and the controller are values: see the crates
//! `onecycle-identify` and `onecycle-design`. They call this crate where the choice above applies.
//!
//! # From relay to controller
//!
//! | step                                                     | module                                  |
//! |----------------------------------------------------------|-----------------------------------------|
//! | excite an oscillation                                    | [`relay`], [`cycle`]                    |
//! | collect its last cycles in bins                          | [`window`]                              |
//! | read the last cycle with a network                       | [`signature`], [`network`], [`classify`]|
//! | fit the process by variable projection                   | [`refine`], [`transition`]              |
//! | accept or refuse the fit, follow the margin's uncertainty| [`judgement`]                           |
//! | take the optimal PD from a table                         | [`gains`], [`pack`]                     |
//! | all of it in slices of one control tick                  | [`identification`]                      |
//! | fly it: state machine, limits, check of the response     | [`tuner`], [`guard`], [`control`]       |
//!
//! Symbols and units: `SYMBOLS.md` of the repository. Reference: A. Ayyad, M. Chehadeh, M. I. Awad, Y. Zweiri,
//! "Real-time system identification using deep learning for linear processes with application to unmanned aerial
//! vehicles", IEEE Access 8 (2020); called "the paper" throughout.
#![no_std]

pub mod amplitude;
pub mod classify;
mod complex;
pub mod control;
pub mod crossover;
pub mod cycle;
mod distortion;
mod fit_score;
pub mod floats;
pub mod gains;
pub mod guard;
pub mod identification;
pub mod integral;
pub mod judgement;
mod least_squares;
pub mod network;
pub mod pack;
pub mod pid;
mod prediction;
pub mod process;
pub mod refine;
pub mod relay;
mod response;
pub mod signature;
mod take_off;
pub mod transition;
pub mod tuner;
pub mod window;

pub use control::Pd;
pub use pid::{PidLaw, PidSettings};
pub use process::{Soiptd, SoiptdError};
pub use relay::{Relay, RelayError, RelayPhase, RelaySettings};
pub use transition::Transition;

// Compiles and runs the code of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
