//! Gains of a flight log: read back, laid over the log, and the parameters that were written.

use std::path::PathBuf;

use onecycle::{Assessment, LeastMargins};
use onecycle_link::{Change, ControlLoop, ReadBack};

/// What a log tells about the gains of the loop that was identified.
pub(crate) struct LogGains {
    pub(crate) control_loop: ControlLoop,
    /// `None`: not a rate loop, or the log has no gains of it.
    pub(crate) read_back: Option<ReadBack>,
    /// The closed loop with the gains in force beside the logged output.
    pub(crate) overlay: Option<Overlay>,
    /// Parameters to write, or why they were not. `None`: not asked for.
    pub(crate) written: Option<Result<Written, String>>,
}

/// The simulated closed loop, driven by the logged set-point.
pub(crate) struct Overlay {
    pub(crate) time_s: Vec<f64>,
    pub(crate) set_point: Vec<f64>,
    pub(crate) logged: Vec<f64>,
    pub(crate) simulated: Vec<f64>,
    /// Share of the variance of the logged output that the simulation explains.
    pub(crate) explained: f64,
}

/// Parameters on their way to the vehicle.
pub(crate) struct Written {
    pub(crate) path: PathBuf,
    pub(crate) restore: PathBuf,
    pub(crate) changes: Vec<Change>,
    /// Share of the way from the gains in force to the proposed ones.
    pub(crate) share: f64,
    /// Overshoot after a step of the set-point, as a share of the step. `None`: the response is too long to simulate.
    pub(crate) overshoot: Option<f64>,
    /// Of the gains as written, on the most probable process and over the posterior.
    pub(crate) figures: Assessment,
    pub(crate) least: Option<LeastMargins>,
    /// The limits of the style that they break.
    pub(crate) broken: Option<String>,
    /// Whether they are exported on demand only.
    pub(crate) needs_consent: bool,
}

impl Written {
    /// What to ask before these gains are exported. `None`: nothing.
    pub(crate) fn question(&self) -> Option<&str> {
        self.broken.as_deref().filter(|_| self.needs_consent)
    }
}
