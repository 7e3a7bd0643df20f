//! Gains of the altitude that a relay test over a link proposes.

use onecycle::{Assessment, LeastMargins};

/// Parameters to write.
pub(crate) struct AltitudeGains {
    pub(crate) changes: Vec<ProposedChange>,
    /// Share of the way from the gains in force to the proposed ones.
    pub(crate) share: f64,
    /// Of the gains to write, on the most probable process and over the posterior.
    pub(crate) figures: Assessment,
    pub(crate) least: Option<LeastMargins>,
}

/// A parameter.
pub(crate) struct ProposedChange {
    pub(crate) name: &'static str,
    pub(crate) old: f64,
    pub(crate) new: f64,
}
