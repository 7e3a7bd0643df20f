//! Result of `onecycle-lab grid`: the members and how near they are to random processes.

use std::time::Duration;

use onecycle_lab::space::grid::{Check, Grid};

/// A grid, made or read.
pub(crate) struct GridRun {
    pub(crate) grid: Grid,
    pub(crate) check: Option<Check>,
    pub(crate) has_matrix: bool,
    /// For the page; empty without one.
    pub(crate) rays: Vec<CostsAlongRay>,
    pub(crate) took: Duration,
}

impl GridRun {
    /// Whether the check found a member near every process; also true without a check.
    pub(crate) fn holds(&self) -> bool {
        self.check.is_none_or(|check| check.beyond == 0)
    }
}

/// Costs of the controllers of a process `i` and of processes `j` of the same shape for each other.
pub(crate) struct CostsAlongRay {
    pub(crate) name: &'static str,
    /// Ratio of the radii of neighbours of the grid.
    pub(crate) step: f64,
    /// Radius of each `j` over that of `i`.
    pub(crate) ratios: Vec<f64>,
    /// Deterioration of `j` under the controller of `i`.
    pub(crate) own_on_other: Vec<f64>,
    /// Deterioration of `i` under the controller of `j`.
    pub(crate) other_on_own: Vec<f64>,
}
