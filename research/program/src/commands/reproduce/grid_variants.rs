//! Grids of other costs and margins, where their members are, and the work that a grid takes.

use std::collections::BTreeSet;

use onecycle_cli::failure::Failure;
use onecycle_cli::report::number::{degrees, percent, seconds};
use onecycle_design::soiptd_pd::criterion::Criterion;
use onecycle_lab::judge::evaluate::quantile;
use onecycle_lab::space::Space;
use onecycle_lab::space::candidate::{Candidate, CandidateError};
use onecycle_lab::space::grid::{Check, Grid, GridSettings, check};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Deserialize;

use crate::args::Cost;
use crate::commands::clock::thread_seconds;
use crate::results::reproduction::{Numbers, Row};
use crate::workers::Workers;

/// The grids and their check.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GridVariantSettings {
    deterioration: f64,
    /// Names of the costs; one row each.
    costs: Vec<String>,
    /// Phase margins (degrees); one grid and one row each.
    margins_deg: Vec<f64>,
    /// Number of random processes of a check, and their seed.
    processes: u64,
    seed: u64,
    /// Number of random processes on which controllers are compared.
    compared: usize,
    /// Costs that a search for one neighbour evaluates.
    costs_a_search: f64,
    /// Time of one cost in the paper's program (s): a guess from below and from above.
    simulation_s: [f64; 2],
}

pub(super) fn find(settings: &GridVariantSettings, workers: &Workers) -> Result<Numbers, Failure> {
    let base = GridSettings {
        deterioration: settings.deterioration,
        ..GridSettings::default()
    };
    let checked = |wanted: GridSettings| {
        let grid = Grid::build(&wanted, workers).map_err(Failure::usage)?;
        let check = check(&grid, settings.processes, settings.seed, workers);
        Ok::<_, Failure>((grid, check.map_err(Failure::usage)?))
    };
    let costs = settings.costs.iter().map(|name| {
        let Cost(criterion) = name.parse().map_err(Failure::usage)?;
        let grid = GridSettings { criterion, ..base };
        let cells = controllers(&grid, settings, workers).map_err(Failure::usage)?;
        Ok(Row::new(criterion.name().to_uppercase(), cells))
    });
    let costs: Vec<Row> = costs.collect::<Result<_, Failure>>()?;
    let margins = settings.margins_deg.iter().map(|&phase_margin_deg| {
        let space = Space {
            phase_margin_deg,
            ..base.space
        };
        let (grid, check) = checked(GridSettings { space, ..base })?;
        Ok(Row::new(
            format!("{phase_margin_deg} deg"),
            facts(&grid, &check),
        ))
    });
    let margins: Vec<Row> = margins.collect::<Result<_, Failure>>()?;
    let grid = Grid::build(&base, workers).map_err(Failure::usage)?;
    Ok(Numbers {
        tables: vec![
            costs,
            margins,
            density(&grid, settings),
            work(&grid, settings),
        ],
        figures: vec![],
    })
}

fn facts(grid: &Grid, check: &Check) -> [String; 4] {
    let cost = |cost: Option<f64>| cost.map_or("unstable".to_owned(), percent);
    [
        grid.members.len().to_string(),
        check.beyond.to_string(),
        cost(check.worst),
        cost(check.mean),
    ]
}

/// Medians over random processes: phase margin of the controllers; their gains over those of least ISE, and their ISE over
/// the least.
fn controllers(
    grid: &GridSettings,
    settings: &GridVariantSettings,
    workers: &Workers,
) -> Result<[String; 4], CandidateError> {
    let by_ise = GridSettings {
        criterion: Criterion::Ise,
        ..*grid
    };
    let pairs = workers.map(settings.compared, |k| {
        let mut rng = Pcg64Mcg::seed_from_u64(settings.seed + k as u64);
        let times_s = grid.space.random(&mut rng);
        Ok::<_, CandidateError>((grid.candidate(times_s)?, by_ise.candidate(times_s)?))
    });
    let pairs: Vec<(Candidate, Candidate)> = pairs.into_iter().collect::<Result<_, _>>()?;
    let median = |of: &dyn Fn(&Candidate, &Candidate) -> f64| {
        let mut values: Vec<f64> = pairs.iter().map(|(one, ise)| of(one, ise)).collect();
        quantile(&mut values, 0.5).unwrap_or(f64::NAN)
    };
    Ok([
        degrees(median(&|one, _| one.optimum.margins.phase_margin_rad)),
        format!(
            "{:.2}",
            median(&|one, ise| one.optimum.pd.kp / ise.optimum.pd.kp)
        ),
        format!(
            "{:.2}",
            median(&|one, ise| one.optimum.pd.kd / ise.optimum.pd.kd)
        ),
        percent(median(&|one, ise| one.optimum.ise / ise.optimum.ise - 1.0)),
    ])
}

/// Quarters of a space by a ratio of its times.
const QUARTERS: [&str; 4] = ["lowest quarter", "second", "third", "highest quarter"];

/// Share of the members in each quarter of the space, by `tau/T_prop` and by `tau/T_body`; the quarters hold equal numbers of
/// processes that are uniform in their times, then of those that are uniform in the logarithms.
fn density(grid: &Grid, settings: &GridVariantSettings) -> Vec<Row> {
    let space = &grid.settings.space;
    let ratios: [fn([f64; 3]) -> f64; 2] = [
        |[t_prop_s, _, tau_s]| tau_s / t_prop_s,
        |[_, t_body_s, tau_s]| tau_s / t_body_s,
    ];
    let mut rng = Pcg64Mcg::seed_from_u64(settings.seed);
    let uniform: Vec<[f64; 3]> = (0..settings.processes)
        .map(|_| space.random(&mut rng))
        .collect();
    let logarithmic = (0..settings.processes).map(|_| {
        let of = |(low, high): (f64, f64)| low * (high / low).powf(rng.random_range(0.0..1.0));
        space.ranges_s().map(of)
    });
    let logarithmic: Vec<[f64; 3]> = logarithmic.collect();
    let members: Vec<[f64; 3]> = (grid.members.iter())
        .map(|member| member.candidate.times_s())
        .collect();
    let mut rows = QUARTERS.map(|name| Row::new(name, []));
    for processes in [&uniform, &logarithmic] {
        for ratio in ratios {
            let mut values: Vec<f64> = processes.iter().map(|&times_s| ratio(times_s)).collect();
            let bounds = [0.25, 0.5, 0.75].map(|part| quantile(&mut values, part).unwrap_or(0.0));
            let mut counts = [0; 4];
            for &times_s in &members {
                counts[bounds
                    .iter()
                    .filter(|&&bound| ratio(times_s) > bound)
                    .count()] += 1;
            }
            for (row, count) in rows.iter_mut().zip(counts) {
                row.cells
                    .push(percent(f64::from(count) / members.len() as f64));
            }
        }
    }
    rows.into()
}

/// Costs that are evaluated on the sphere and in the whole space, and how long they take: by the closed form, by exact
/// simulation, by a simulation of the paper's time.
fn work(grid: &Grid, settings: &GridVariantSettings) -> Vec<Row> {
    let rays: BTreeSet<(usize, usize)> = (grid.members.iter())
        .filter_map(|member| member.place)
        .map(|place| (place.row, place.ray))
        .collect();
    let time_s = |criterion: Criterion| {
        let begin_s = thread_seconds();
        for member in &grid.members {
            let candidate = &member.candidate;
            std::hint::black_box(criterion.cost(&candidate.process, candidate.optimum.pd));
        }
        (thread_seconds() - begin_s) / grid.members.len() as f64
    };
    let [closed_s, simulated_s] = [Criterion::Ise, Criterion::Iae].map(time_s);
    // Two coordinates on the sphere, three in the space.
    let of = |name: &str, places: usize, coordinates: f64| {
        let costs = places as f64 * coordinates * settings.costs_a_search;
        let [low_d, high_d] = settings.simulation_s.map(|one_s| costs * one_s / 86_400.0);
        Row::new(
            name,
            [
                format!("{:.1} million", 1e-6 * costs),
                seconds(costs * closed_s),
                seconds(costs * simulated_s),
                format!("{low_d:.1} to {high_d:.0} days"),
            ],
        )
    };
    vec![
        of("on the sphere, then scaled", rays.len(), 2.0),
        of("in the whole space", grid.members.len(), 3.0),
    ]
}
