//! Tables of optimal controllers for the board.
//!
//! A node holds the lead of the best PD at exactly the margin of the table, and margin and lead of the best
//! PD whose margin is free (down to a quarter of the table's). Each of the three is smooth over the shapes.
//! Their combination, the best PD with at least the margin, has a crease where the margin stops to bind, and
//! a cubic does not follow a crease.
//!
//! Largest cost above the exact optimum, by margin and points along an axis (`research/lab/tests/learn/lead_table.rs`).
//! It exceeds 0.1 % at small margins: for exactly the margin, where two similar lags vanish beside the dead
//! time:
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
//!
//! Reference: the paper's equations 11 to 13 (Ayyad, Chehadeh, Awad, Zweiri 2020).

use std::f64::consts::FRAC_PI_2;

use onecycle_design::soiptd_pd::optimum::{OptimumError, pd, pd_at_phase_margin, quieter};
use onecycle_onboard::gains::Nodes;

/// Points along an axis: 81 nodes, 247 numbers. At 20 deg no cost is more than 0.05 % above the optimum.
pub const POINTS: usize = 9;

/// Fewest and most points along an axis: a cubic needs four, and a hundred take seconds.
const POINTS_RANGE: (usize, usize) = (4, 100);

/// Margin (rad), 15 deg, below which the lead falls steeply with a small dead time: without dead time the
/// crossover is far higher.
const STEEP_IN_DELAY_BELOW_RAD: f64 = 0.26;

/// Distance of the margin from `pi/2` (rad), 60 deg, below which the lead falls steeply with a small
/// damping: without damping the crossover is far lower.
const STEEP_IN_LAG_BELOW_RAD: f64 = 1.05;

/// Free margins are followed down to this part of the table's margin. A cubic near the table's margin runs
/// through some of them, although no controller has them.
const LEAST_FREE_PART: f64 = 0.25;

/// Why there is no table.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LeadTableError {
    /// The number of points is out of range.
    #[error("a lead table has 4 to 100 points along an axis, not {0}")]
    Points(usize),
    /// A process has no optimum.
    #[error(transparent)]
    Optimum(#[from] OptimumError),
}

/// The numbers of the table of a phase margin, with this number of points along either axis. Its controllers cost the fraction
/// `excess` more than the optimum and are as quiet as that allows ([`quieter`]).
///
/// # Errors
/// [`LeadTableError::Points`]; [`LeadTableError::Optimum`] for a margin outside `(0, pi/2)`.
pub fn build(
    phase_margin_rad: f64,
    excess: f64,
    points: usize,
) -> Result<Vec<f32>, LeadTableError> {
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
            let bound = quieter(&process, &bound, excess)?;
            let free = quieter(&process, &free, excess)?;
            let angles = [bound.lead_rad, free.margins.phase_margin_rad, free.lead_rad];
            numbers.extend(angles.map(|angle_rad| angle_rad as f32));
        }
    }
    Ok(numbers)
}
