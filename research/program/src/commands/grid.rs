//! `onecycle-lab grid`: choose processes that represent a space, or read them; check and write them.

mod kept;

use std::io::BufWriter;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use onecycle_cli::failure::{Failure, exit};
use onecycle_lab::space::candidate::{CandidateError, Gains};
use onecycle_lab::space::grid;
use onecycle_lab::space::grid::{Check, Grid, GridFile, GridSettings, Layout, check};

use self::kept::KeptGrid;
use crate::args;
use crate::output::{print, write_file, write_text};
use crate::reading::{MOST_OF_A_TABLE, text_at_most};
use crate::results::grid::{CostsAlongRay, GridRun};
use crate::workers::Workers;
use crate::{report, settings};

/// Largest number of members whose matrix is written by default: four million numbers, 40 MB.
const MOST_IN_MATRIX: usize = 2000;

/// Rows of members, and of the matrix, of each thread between two writes to the journal: about a second of work.
const ROWS_PER_THREAD: usize = 2;
const COSTS_PER_THREAD: usize = 64;

pub(crate) fn run(arguments: &args::Grid) -> Result<ExitCode, Failure> {
    let begin = Instant::now();
    let workers = Workers::new(arguments.threads)?;
    let mut run = match &arguments.from {
        Some(path) => read(arguments, path, &workers)?,
        None => make(arguments, &workers)?,
    };
    run.took = begin.elapsed();
    workers.finish();
    if let Some(path) = &arguments.report {
        run.rays = rays(&run.grid.settings).map_err(Failure::usage)?;
        write_text(path, &report::grid::html(&run))?;
    }
    print(&if arguments.json {
        report::grid::json(&run)
    } else {
        report::grid::text(&run)
    })?;
    Ok(ExitCode::from(if run.holds() {
        exit::DONE
    } else {
        exit::NO_PROCESS
    }))
}

fn read(arguments: &args::Grid, path: &Path, workers: &Workers) -> Result<GridRun, Failure> {
    let failed = |reason: String| Failure::unreadable(path, reason);
    let text = text_at_most(path, MOST_OF_A_TABLE)?;
    let file = GridFile::read(&text).map_err(|error| failed(error.to_string()))?;
    let grid = file
        .grid(workers)
        .map_err(|error| failed(error.to_string()))?;
    let check = match arguments.check {
        Some(_) => checked(arguments, &grid, workers)?,
        None => file.check,
    };
    Ok(GridRun {
        grid,
        check,
        has_matrix: file.matrix.is_some(),
        rays: vec![],
        took: Duration::ZERO,
    })
}

fn make(arguments: &args::Grid, workers: &Workers) -> Result<GridRun, Failure> {
    let settings = GridSettings {
        space: settings::space(arguments.space.as_deref())?,
        deterioration: arguments.deterioration,
        layout: match (arguments.fewest, arguments.lattice) {
            (true, _) => Layout::Fewest,
            (false, true) => Layout::Lattice,
            (false, false) => Layout::Rays,
        },
        gains: match (arguments.equal_gains, arguments.lattice) {
            (true, _) => Gains::Equal,
            (false, true) => Gains::SameMagnitude,
            (false, false) => Gains::SameAmplitude,
        },
        criterion: arguments.cost.0,
    };
    // With --fewest there are only a few members, which are computed quickly.
    let mut kept = match (&arguments.out, settings.layout) {
        (Some(out), Layout::Rays) => Some(KeptGrid::open(out, &settings, arguments.restart)?),
        _ => None,
    };
    let grid = lay(&settings, kept.as_mut(), workers)?;
    let has_matrix =
        arguments.out.is_some() && (arguments.matrix || grid.members.len() <= MOST_IN_MATRIX);
    if let (true, Some(kept)) = (has_matrix, &mut kept) {
        keep_costs(&grid, kept, workers)?;
    }
    let check = checked(arguments, &grid, workers)?;
    if let Some(out) = &arguments.out {
        write(out, &grid, check.as_ref(), has_matrix, kept)?;
    }
    Ok(GridRun {
        grid,
        check,
        has_matrix,
        rays: vec![],
        took: Duration::ZERO,
    })
}

fn lay(
    settings: &GridSettings,
    kept: Option<&mut KeptGrid>,
    workers: &Workers,
) -> Result<Grid, Failure> {
    let Some(kept) = kept else {
        return Grid::build(settings, workers).map_err(Failure::usage);
    };
    let thetas_rad = match kept.thetas_rad() {
        Some(thetas_rad) => thetas_rad.to_vec(),
        None => {
            let thetas_rad = grid::rows(settings, workers).map_err(Failure::usage)?;
            kept.keep_thetas(thetas_rad.clone())?;
            thetas_rad
        }
    };
    workers.expect(thetas_rad.len(), kept.rows().len());
    let at_once = ROWS_PER_THREAD * workers.threads();
    for some in thetas_rad[kept.rows().len()..].to_vec().chunks(at_once) {
        for row in workers.run(some.len(), |k| grid::row(settings, some[k])) {
            kept.keep_row(row.map_err(Failure::usage)?)?;
        }
    }
    Grid::of_rays(settings, kept.rows(), workers).map_err(Failure::usage)
}

fn keep_costs(grid: &Grid, kept: &mut KeptGrid, workers: &Workers) -> Result<(), Failure> {
    let count = grid.members.len();
    let at_once = COSTS_PER_THREAD * workers.threads();
    workers.expect(count, kept.costs());
    while kept.costs() < count {
        let first = kept.costs();
        let some = at_once.min(count - first);
        for costs in workers.run(some, |k| costs(grid, first + k)) {
            kept.keep_costs(costs)?;
        }
    }
    Ok(())
}

/// A row of the matrix, rounded as in files.
fn costs(grid: &Grid, of: usize) -> Vec<Option<f64>> {
    let costs = grid.costs(of).into_iter();
    costs.map(|cost| cost.map(grid::rounded)).collect()
}

fn checked(
    arguments: &args::Grid,
    grid: &Grid,
    workers: &Workers,
) -> Result<Option<Check>, Failure> {
    let processes = arguments.check;
    processes
        .map(|processes| check(grid, processes, arguments.seed, workers))
        .transpose()
        .map_err(Failure::usage)
}

/// Number of points of a ray on each side of its middle, and their range in steps of the grid.
const POINTS_ALONG: i32 = 200;
const STEPS_ALONG: f64 = 1.8;

/// Two rays of the space: longest time constants with the shortest dead time, and shortest with the longest.
fn rays(settings: &GridSettings) -> Result<Vec<CostsAlongRay>, CandidateError> {
    let [t_prop_s, t_body_s, tau_s] = settings.space.ranges_s();
    [
        ("A ray of long lags", [t_prop_s.1, t_body_s.1, tau_s.0]),
        ("A ray of long dead time", [t_prop_s.0, t_body_s.0, tau_s.1]),
    ]
    .into_iter()
    .map(|(name, times_s)| {
        let own = settings.candidate(times_s)?;
        let step = grid::step(&own, settings.deterioration);
        let mut ray = CostsAlongRay {
            name,
            step,
            ratios: vec![],
            own_on_other: vec![],
            other_on_own: vec![],
        };
        for k in -POINTS_ALONG..=POINTS_ALONG {
            let ratio = step.powf(STEPS_ALONG * f64::from(k) / f64::from(POINTS_ALONG));
            let other = own.scaled(ratio)?;
            ray.ratios.push(ratio);
            ray.own_on_other.push(own.cost_on(&other));
            ray.other_on_own.push(other.cost_on(&own));
        }
        Ok(ray)
    })
    .collect()
}

fn write(
    path: &Path,
    grid: &Grid,
    check: Option<&Check>,
    has_matrix: bool,
    kept: Option<KeptGrid>,
) -> Result<(), Failure> {
    write_file(path, |file| {
        let mut file = BufWriter::new(file);
        match (&kept, has_matrix) {
            (_, false) => grid::write(&mut file, grid, check, None),
            (Some(kept), true) => {
                grid::write(&mut file, grid, check, Some(&mut kept.read_costs()?))
            }
            (None, true) => {
                let mut rows = (0..grid.members.len()).map(|i| Ok(costs(grid, i)));
                grid::write(&mut file, grid, check, Some(&mut rows))
            }
        }?;
        std::io::Write::flush(&mut file)
    })?;
    kept.map_or(Ok(()), KeptGrid::remove)
}
