//! Identification on board, in slices: from the samples of a running relay test to a process and its controller.
//!
//! ```text
//! wait -> collect -> sign -> classify -> refine -> judge -> gains -> design -> result
//!   ^         |         |        |          |        |        |         |
//!   +---------+---------+--------+----------+--------+--------+---------+  next cycle
//! ```
//!
//! - **wait** for three cycles that are alike and for the next rise of the relay;
//! - **collect** the last cycles into two windows: a coarse one of all cycles for the fit, a fine one of the
//!   last cycle for the pack. If the relay reverses a switch, collection starts again;
//! - **sign**, **classify**: the signature of the last cycle, and what the pack reads from it;
//! - **refine**: the most probable process, starting from there; **judge**: whether to accept it;
//! - **gains** from the pack's lead table; **design**: the uncertainty of their phase margin.
//!
//! After [`Collector::confirm`] one more cycle is collected, at another amplitude of the relay, and refine fits
//! its gain alone, which must be that of the process found ([`amplitude`](crate::amplitude)).
//!
//! Two parts share a [`Desk`] by turns, so that they may run in two threads:
//!
//! - the [`Collector`] waits and collects, a few operations a sample, and leaves an order on the desk;
//! - the [`Analysis`] does the rest in slices of a few thousand operations at most (see the table in
//!   [`refine`](crate::refine)), and leaves its outcome there.

mod analysis;
mod collector;
mod desk;
mod past;
mod refusal;

pub use self::analysis::{Analysis, Bench};
pub use self::collector::Collector;
pub use self::desk::Desk;
pub use self::refusal::Refusal;
use crate::control::Pd;
use crate::judgement::Deviations;
use crate::process::Soiptd;

/// Rows of the window for the fit, five of them reserved for prior knowledge: at least 32 bins after a merge.
/// The fit takes 200 bytes per row.
pub const BINS: usize = 69;
/// Rows of the window for the pack: at least 64 bins after a merge, which a signature needs.
pub const FINE_BINS: usize = 133;
/// Input edges in the window for the fit: [`PAST_EDGES`] and those of the cycles.
pub const EDGES: usize = 20;
/// Input edges before the window: four periods, with which a fit without noise is exact. Without any past its
/// error is 2e-6.
pub const PAST_EDGES: usize = 8;
/// Maximum number of cycles that are fitted together, given by the number of edges.
pub const MOST_CYCLES: u8 = 4;

/// Result of a test: process, controller and their uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TuningResult {
    /// The most probable process.
    pub process: Soiptd,
    /// Standard deviations of its parameters and of the phase margin.
    pub deviations: Deviations,
    /// The best controller with at least the phase margin of the pack.
    pub pd: Pd,
    /// Phase margin of the controller with the process (rad).
    pub phase_margin_rad: f64,
    /// Constant input that the recorded input does not contain (input unit). Minus this value holds the process
    /// at rest.
    pub input_bias: f64,
    /// Misfit score of the last cycle against the pack's family (limit 1).
    pub score: f64,
    /// Period of the last cycle (s).
    pub period_s: f64,
    /// Half the peak-to-peak output of the last cycle (output unit).
    pub amplitude: f64,
    /// Standard deviation of the noise of one sample (output unit).
    pub noise_sigma: f64,
}

/// Sample of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestSample {
    /// Time (s).
    pub time_s: f64,
    /// Input held from then on (input unit).
    pub input: f64,
    /// Output (output unit).
    pub output: f64,
    /// Whether the relay is high from then on.
    pub is_high: bool,
    /// Number of switches that the relay has reversed so far.
    pub undone: u32,
}

/// Next step of the identification. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum Stage {
    /// Wait for a steady oscillation and a rise.
    Wait,
    /// Collect cycles.
    Collect,
    /// Compute the signature of the last cycle.
    Sign,
    /// Classify the signature with the pack.
    Classify,
    /// Fit the process.
    Refine,
    /// Accept or refuse the fit.
    Judge,
    /// Take the gains from the lead table.
    Gains,
    /// Compute the uncertainty of the phase margin.
    Design,
}

impl Stage {
    /// Name, for logs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wait => "wait",
            Self::Collect => "collect",
            Self::Sign => "sign",
            Self::Classify => "classify",
            Self::Refine => "refine",
            Self::Judge => "judge",
            Self::Gains => "gains",
            Self::Design => "design",
        }
    }
}
