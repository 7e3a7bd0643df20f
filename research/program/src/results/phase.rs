//! Result of `onecycle-lab phase`: tuning rules of a space and the one with the least worst deterioration.

use onecycle_lab::space::Space;
use onecycle_lab::space::phase::{AppliedRule, DistinguishingPhase};

/// The distinguishing phase of a space and the deterioration around it.
pub(crate) struct PhaseSearch {
    pub(crate) space: Space,
    pub(crate) phase: DistinguishingPhase,
    /// Rules at round phases that cover all local rules.
    pub(crate) table: Vec<RoundPhase>,
    /// Rules of many phases, in order, for the page; empty without one.
    pub(crate) curve: Vec<AppliedRule>,
}

/// The rule of a round phase.
pub(crate) struct RoundPhase {
    pub(crate) phase_deg: f64,
    /// Local rules nearer to this phase than to another one of the table.
    pub(crate) local_rules: usize,
    pub(crate) applied: AppliedRule,
}
