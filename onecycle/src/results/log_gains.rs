//! Gains of a flight log: read back, laid over the log, and the parameters that were written.

use std::path::PathBuf;

use onecycle_design::{Assessment, LeastMargins};
use onecycle_link::{Change, ControlLoop, ParameterFiles, ReadBack};

/// What a log tells about the gains of the loop that was identified.
pub struct LogGains {
    /// Which loop it is.
    pub control_loop: ControlLoop,
    /// `None`: not a rate loop, or the log has no gains of it.
    pub read_back: Option<ReadBack>,
    /// The closed loop with the gains in force beside the logged output.
    pub overlay: Option<Overlay>,
    /// Parameters to write, or why they were not. `None`: not asked for.
    pub written: Option<Result<Written, String>>,
}

/// The simulated closed loop, driven by the logged set-point.
pub struct Overlay {
    /// Time stamps (s).
    pub time_s: Vec<f64>,
    /// The logged set-point.
    pub set_point: Vec<f64>,
    /// The logged output.
    pub logged: Vec<f64>,
    /// The simulated output.
    pub simulated: Vec<f64>,
    /// Share of the variance of the logged output that the simulation explains.
    pub explained: f64,
}

/// Parameter files by name.
#[derive(Clone, Debug)]
pub struct NamedFiles {
    /// The file with the new values.
    pub path: PathBuf,
    /// The file with the old values.
    pub restore: PathBuf,
    /// What stands in both.
    pub text: ParameterFiles,
}

/// Parameters on their way to the vehicle.
pub struct Written {
    /// The files to write. `None`: not asked for.
    pub files: Option<NamedFiles>,
    /// The parameters that change.
    pub changes: Vec<Change>,
    /// Share of the way from the gains in force to the proposed ones.
    pub share: f64,
    /// Overshoot after a step of the set-point, as a share of the step. `None`: the response is too long to simulate.
    pub overshoot: Option<f64>,
    /// Of the gains as written, on the most probable process and over the posterior.
    pub figures: Assessment,
    /// Margins at the bad end of the posterior. `None` without one.
    pub least: Option<LeastMargins>,
    /// The limits of the style that they break.
    pub broken: Option<String>,
    /// Whether they are exported on demand only.
    pub needs_consent: bool,
}

impl Written {
    /// What to ask before these gains are exported. `None`: nothing.
    #[must_use]
    pub fn question(&self) -> Option<&str> {
        self.broken.as_deref().filter(|_| self.needs_consent)
    }
}
