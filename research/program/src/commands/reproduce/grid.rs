//! The grid of the paper's space.

use onecycle_cli::failure::Failure;
use onecycle_cli::pages::plot::{Marks, Series};
use onecycle_cli::report::number::{degrees, percent};
use onecycle_lab::space::candidate::Gains;
use onecycle_lab::space::grid;
use onecycle_lab::space::grid::{Check, Grid, check};
use serde::Deserialize;

use crate::results::reproduction::{Numbers, Row, or_dash};
use crate::workers::Workers;

/// The grids and their check.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GridCheckSettings {
    deterioration: f64,
    /// One grid, and one column, for each rule of comparing gains.
    gains: Vec<Gains>,
    /// Number of random processes of the check, and their seed.
    processes: u64,
    seed: u64,
}

pub(super) fn find(settings: &GridCheckSettings, workers: &Workers) -> Result<Numbers, Failure> {
    let grids = settings.gains.iter().map(|&gains| {
        let wanted = grid::GridSettings {
            deterioration: settings.deterioration,
            gains,
            ..grid::GridSettings::default()
        };
        let grid = Grid::build(&wanted, workers).map_err(Failure::usage)?;
        let check =
            check(&grid, settings.processes, settings.seed, workers).map_err(Failure::usage)?;
        Ok((grid, check))
    });
    let grids: Vec<(Grid, Check)> = grids.collect::<Result<_, Failure>>()?;
    let row = |name: &str, cell: &dyn Fn(&(Grid, Check)) -> String| {
        Row::new(name, grids.iter().map(cell))
    };
    let or_unstable = |cost: Option<f64>| cost.map_or("unstable".to_owned(), percent);
    Ok(Numbers {
        tables: vec![vec![
            row("members", &|(grid, _)| grid.members.len().to_string()),
            row("random processes", &|(_, check)| {
                check.processes.to_string()
            }),
            row("farther than J* from every member", &|(_, check)| {
                check.beyond.to_string()
            }),
            row("largest distance to a member", &|(_, check)| {
                or_unstable(check.worst)
            }),
            row("mean distance to a member", &|(_, check)| {
                or_unstable(check.mean)
            }),
            row(
                "smallest phase margin under its controller",
                &|(_, check)| or_dash(check.least_margin_rad, degrees),
            ),
        ]],
        figures: vec![
            grids
                .first()
                .map(|(grid, _)| members(grid))
                .into_iter()
                .collect(),
        ],
    })
}

/// Members over `T_body` and `tau` (s).
fn members(grid: &Grid) -> Series {
    let times_s = grid.members.iter().map(|member| member.candidate.times_s());
    Series::of_points(
        "members",
        Marks::Points,
        times_s.map(|[_, t_body_s, tau_s]| (t_body_s, tau_s)),
    )
}
