//! Check of a grid: distances of random processes of its space from their best members.

use super::index::Index;
use super::{Grid, GridError, draws};
use crate::workers::Workers;
use onecycle_design::soiptd_pd::deterioration::Deterioration;

/// Distances and costs of random processes on their best members. Infinite values are `None`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// Number of processes: the corners of the space first, then a quarter of them uniform, a quarter
    /// uniform in logarithms, and half of either kind moved to faces, edges and corners.
    pub processes: u64,
    /// Seed of the draws.
    pub seed: u64,
    /// Largest `J_(ij)` between a process and its best member, as a fraction.
    pub worst: Option<f64>,
    /// Mean `J_(ij)`.
    pub mean: Option<f64>,
    /// Number of processes farther away than the grid's `J*`.
    pub beyond: u64,
    /// `T_prop`, `T_body`, `tau` (s) of the farthest process.
    pub worst_at_s: [f64; 3],
    /// Number of its best member.
    pub worst_member: usize,
    /// Largest `J_ij`: cost of the best member's controller on a process.
    pub worst_cost: Option<f64>,
    /// Mean `J_ij`; it may be negative, bought with margin.
    pub mean_cost: Option<f64>,
    /// Least phase margin of the best member's controller (rad).
    pub least_margin_rad: Option<f64>,
}

/// One process of a check.
struct Found {
    times_s: [f64; 3],
    member: usize,
    distance: f64,
    cost: f64,
    margin_rad: f64,
}

/// Draws this many processes and finds the best member of each.
///
/// # Errors
/// [`GridError`]: a process has no controller or no oscillation.
pub fn check(
    grid: &Grid,
    processes: u64,
    seed: u64,
    workers: &dyn Workers,
) -> Result<Check, GridError> {
    let index = Index::new(grid.members.iter().map(|member| &member.candidate));
    let found = workers.map(processes as usize, |n| find(grid, &index, seed, n as u64));
    let found: Vec<Found> = found.into_iter().collect::<Result<_, _>>()?;
    Ok(summary(grid, seed, &found))
}

fn find(grid: &Grid, index: &Index<'_>, seed: u64, n: u64) -> Result<Found, GridError> {
    let times_s = draws::times_s(&grid.settings.space, seed, n);
    let process = grid.settings.candidate(times_s)?;
    let (member, distance) = index.nearest(&process).unwrap_or((0, f64::INFINITY));
    let applied = grid
        .members
        .get(member)
        .map_or(Deterioration::Unstable, |member| {
            member.candidate.on(&process)
        });
    let (cost, margin_rad) = match applied {
        Deterioration::Stable {
            relative,
            phase_margin_rad,
        } => (relative, phase_margin_rad),
        Deterioration::Unstable => (f64::INFINITY, f64::NEG_INFINITY),
    };
    Ok(Found {
        times_s,
        member,
        distance,
        cost,
        margin_rad,
    })
}

fn summary(grid: &Grid, seed: u64, found: &[Found]) -> Check {
    let finite = |value: f64| value.is_finite().then_some(value);
    let mean =
        |of: fn(&Found) -> f64| finite(found.iter().map(of).sum::<f64>() / found.len() as f64);
    let most =
        |of: fn(&Found) -> f64| finite(found.iter().map(of).fold(f64::NEG_INFINITY, f64::max));
    let farthest = found
        .iter()
        .max_by(|a, b| a.distance.total_cmp(&b.distance));
    let limit = grid.settings.deterioration;
    Check {
        processes: found.len() as u64,
        seed,
        worst: most(|one| one.distance),
        mean: mean(|one| one.distance),
        beyond: found.iter().filter(|one| one.distance > limit).count() as u64,
        worst_at_s: farthest.map_or([0.0; 3], |one| one.times_s),
        worst_member: farthest.map_or(0, |one| one.member),
        worst_cost: most(|one| one.cost),
        mean_cost: mean(|one| one.cost),
        least_margin_rad: most(|one| -one.margin_rad).map(|margin| -margin),
    }
}
