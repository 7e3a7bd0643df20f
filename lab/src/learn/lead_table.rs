//! Tables of optimal controllers for the board, and what they cost beside the exact optimum.
//!
//! A node holds the lead of the best PD at the margin of the table, and margin and lead of the best
//! PD of all. Each of the three is smooth over the shapes; their combination, the best PD above a
//! margin, has a crease where the margin stops to bind, and no cubic follows a crease.
//!
//! Worst excess over all shapes, by margin and points along an axis; it meets 0.1 % but at small
//! margins, and there the exact one fails where two similar lags vanish beside the dead time:
//!
//! | margin       | at least, 9 | at least, 13 | exactly, 9 | exactly, 13 |
//! |--------------|-------------|--------------|------------|-------------|
//! | 5 deg        | 0.20 %      | 0.09 %       | 0.30 %     | 0.09 %      |
//! | 10 deg       | 0.09 %      | 0.04 %       | 1.6 %      | 1.1 %       |
//! | 16 deg       | 0.04 %      | 0.013 %      | 0.34 %     | 0.05 %      |
//! | 20 deg       | 0.014 %     | 0.004 %      | 0.045 %    | 0.034 %     |
//! | 25 to 80 deg | 0.012 %     | 0.0011 %     | 0.04 %     | 0.020 %     |
//!
//! | symbol | name               | unit                                                     |
//! |--------|--------------------|----------------------------------------------------------|
//! | `PM`   | `phase_margin_rad` | rad                                                      |
//! | `c`    | stretch            | 1, of an axis of [`onecycle_onboard::gains`]             |
//! | excess | `CostExcess`       | 1, ISE above that of the exact optimum as a part of it   |
//!
//! Reference: the paper's equations 11 to 13 (Ayyad, Chehadeh, Awad, Zweiri 2020).

use std::f64::consts::FRAC_PI_2;

use onecycle_onboard::gains::{GainsError, LARGEST_DELAY_IN_LAGS, LeadTable, Nodes};
use onecycle_onboard::{Pd, Soiptd, SoiptdError};
use rand::{Rng, RngExt};

use onecycle_design::soiptd_pd::cost::ise;
use onecycle_design::soiptd_pd::optimum::{Optimum, OptimumError, pd, pd_at_phase_margin};

/// Points along an axis: 81 nodes, 247 numbers. At 20 deg no cost is 0.05 % above the optimum.
pub const POINTS: usize = 9;

/// Fewest and most points along an axis: a cubic needs four, and a hundred take seconds.
const POINTS_RANGE: (usize, usize) = (4, 100);

/// Margin (rad), 15 deg, below which the lead falls steeply with the first of the dead time: the
/// crossover without it is far above that with it.
const STEEP_IN_DELAY_BELOW_RAD: f64 = 0.26;

/// Distance of the margin from `pi/2` (rad), 60 deg, below which the lead falls steeply with the
/// first of the damping: the crossover without it is far below that with it.
const STEEP_IN_LAG_BELOW_RAD: f64 = 1.05;

/// Free margins are followed down to this part of the table's margin. The others answer no
/// question, but a cubic near the table's margin runs through some of them.
const LEAST_FREE_PART: f64 = 0.25;

/// Why there is no table, or none to compare with.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LeadTableError {
    /// The number of points is out of range.
    #[error("a lead table has 4 to 100 points along an axis, not {0}")]
    Points(usize),
    /// A process has no optimum.
    #[error(transparent)]
    Optimum(#[from] OptimumError),
    /// The table has no gains for a process.
    #[error(transparent)]
    Gains(#[from] GainsError),
}

/// The numbers of the table of a phase margin, with so many points along either axis.
///
/// # Errors
/// [`LeadTableError::Points`]; [`LeadTableError::Optimum`] for a margin outside `(0, pi/2)`.
pub fn build(phase_margin_rad: f64, points: usize) -> Result<Vec<f32>, LeadTableError> {
    if !(POINTS_RANGE.0..=POINTS_RANGE.1).contains(&points) {
        return Err(LeadTableError::Points(points));
    }
    let to_one = |part: f64| part.min(1.0) as f32;
    let nodes = Nodes {
        phase_margin_rad: phase_margin_rad as f32,
        delay_stretch: to_one(phase_margin_rad / STEEP_IN_DELAY_BELOW_RAD),
        lag_stretch: to_one((FRAC_PI_2 - phase_margin_rad) / STEEP_IN_LAG_BELOW_RAD),
        points,
    };
    let margin_rad = f64::from(nodes.phase_margin_rad);
    let mut numbers = nodes.header().to_vec();
    for delay_index in 0..points {
        for lag_index in 0..points {
            let process = nodes.process(delay_index, lag_index);
            let process = process.ok_or(OptimumError::PhaseMargin(phase_margin_rad))?;
            let bound = pd_at_phase_margin(&process, margin_rad)?;
            let free = pd(&process, LEAST_FREE_PART * margin_rad)?;
            let angles = [bound.lead_rad, free.margins.phase_margin_rad, free.lead_rad];
            numbers.extend(angles.map(|angle_rad| angle_rad as f32));
        }
    }
    Ok(numbers)
}

/// The numbers of a table as little-endian bytes, for a file.
#[must_use]
pub fn to_bytes(numbers: &[f32]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}

/// What is asked of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// At least the margin of the table.
    AtLeast,
    /// Exactly the margin of the table.
    Exactly,
}

impl Constraint {
    fn exact(self, process: &Soiptd, phase_margin_rad: f64) -> Result<Optimum, OptimumError> {
        match self {
            Self::AtLeast => pd(process, phase_margin_rad),
            Self::Exactly => pd_at_phase_margin(process, phase_margin_rad),
        }
    }

    fn tabled(self, process: &Soiptd, table: &LeadTable) -> Result<Pd, GainsError> {
        match self {
            Self::AtLeast => table.pd(process),
            Self::Exactly => table.pd_at_phase_margin(process),
        }
    }
}

/// Cost of a table's controllers above the exact optima, as parts of those.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostExcess {
    /// The largest; infinite where a controller is unstable.
    pub worst: f64,
    /// Where that is; `None` without processes.
    pub worst_process: Option<Soiptd>,
    /// The mean; zero without processes.
    pub mean: f64,
}

/// Compares a table with the exact optima of some processes.
///
/// # Errors
/// Of the first process that has no optimum or that the table does not reach.
pub fn cost_excess(
    table: &LeadTable,
    constraint: Constraint,
    processes: impl IntoIterator<Item = Soiptd>,
) -> Result<CostExcess, LeadTableError> {
    let phase_margin_rad = f64::from(table.nodes().phase_margin_rad);
    let (mut sum, mut count) = (0.0, 0.0);
    let (mut worst, mut worst_process) = (f64::NEG_INFINITY, None);
    for process in processes {
        let best = constraint.exact(&process, phase_margin_rad)?;
        let cost = ise(&process, constraint.tabled(&process, table)?);
        let excess = cost.map_or(f64::INFINITY, |cost| cost / best.ise - 1.0);
        if excess > worst {
            (worst, worst_process) = (excess, Some(process));
        }
        sum += excess;
        count += 1.0;
    }
    Ok(CostExcess {
        worst,
        worst_process,
        mean: if count > 0.0 { sum / count } else { 0.0 },
    })
}

/// A process of any shape that a table reaches, of either sign; of eight, one is without damping,
/// one has equal lags, one has the shorter lag in the body, one no dead time, one the largest.
///
/// # Errors
/// None: all its parameters are in range.
pub fn random_process(rng: &mut impl Rng) -> Result<Soiptd, SoiptdError> {
    let mut decades = |from: f64, to: f64| 10_f64.powf(rng.random_range(from..=to));
    let mut lag_s = decades(-3.0, 1.0);
    let mut inv_other_per_s = decades(-4.0, 0.0) / lag_s;
    let mut tau_s = decades(-3.0, LARGEST_DELAY_IN_LAGS.log10()) * lag_s;
    let gain = decades(-2.0, 2.0);
    match rng.random_range(0..8) {
        0 => inv_other_per_s = 0.0,
        1 => inv_other_per_s = 1.0 / lag_s,
        2 => (lag_s, inv_other_per_s) = (1.0 / inv_other_per_s, 1.0 / lag_s),
        3 => tau_s = 0.0,
        4 => tau_s = LARGEST_DELAY_IN_LAGS * lag_s,
        _ => {}
    }
    let sign = if rng.random() { 1.0 } else { -1.0 };
    Soiptd::from_acceleration_gain(sign * gain, lag_s, inv_other_per_s, tau_s)
}
