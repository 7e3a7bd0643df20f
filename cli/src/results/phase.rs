//! Result of `onecycle phase`: tuning rules of a space and the one with the least worst deterioration.

use onecycle_lab::space::Space;
use onecycle_lab::space::phase::{DistinguishingPhase, LocalOptima};

/// The search for the distinguishing phase of a space.
pub(crate) struct PhaseSearch {
    pub(crate) space: Space,
    /// Optimal controllers of the shapes; applies any rule to them.
    pub(crate) optima: LocalOptima,
    pub(crate) phase: DistinguishingPhase,
}
