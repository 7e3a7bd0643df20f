//! Result of `onecycle grid`: the members and how near they are to random processes.

use std::time::Duration;

use onecycle_lab::paper::grid::{Check, Grid};

/// A grid, made or read.
pub(crate) struct GridRun {
    pub(crate) grid: Grid,
    pub(crate) check: Option<Check>,
    pub(crate) has_matrix: bool,
    pub(crate) took: Duration,
}

impl GridRun {
    /// Whether the check found a member near every process; also true without a check.
    pub(crate) fn holds(&self) -> bool {
        self.check.is_none_or(|check| check.beyond == 0)
    }
}
