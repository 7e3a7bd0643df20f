//! Members of a grid, and their distance to random processes: as text and as JSON; `page` has the figures.

mod page;

use std::fmt::Write;

use onecycle_lab::space::candidate::Gains;
use onecycle_lab::space::grid::{Check, Grid, GridSettings, Layout};
use serde::Serialize;

use crate::results::grid::GridRun;
use onecycle_cli::report::json::to_text;
use onecycle_cli::report::number::significant;
use onecycle_cli::report::wrap::wrapped;
use onecycle_cli::style::{headed, verdict};

pub(crate) use self::page::html;

/// Version of the JSON; raised with every change that a reader could notice.
const SCHEMA: &str = "onecycle.grid.summary/1";

#[derive(Serialize)]
struct Summary<'a> {
    schema: &'static str,
    settings: &'a GridSettings,
    members: usize,
    members_per_row: Vec<usize>,
    alpha: Option<Alpha>,
    has_matrix: bool,
    check: Option<&'a Check>,
    holds: Option<bool>,
    seconds: f64,
}

/// Range of the ratios of neighbouring radii.
#[derive(Serialize)]
struct Alpha {
    least: f64,
    most: f64,
}

impl Alpha {
    fn of(grid: &Grid) -> Option<Self> {
        let alphas = || {
            let places = grid.members.iter().filter_map(|member| member.place);
            places.map(|place| place.alpha)
        };
        Some(Self {
            least: alphas().reduce(f64::min)?,
            most: alphas().reduce(f64::max)?,
        })
    }
}

fn members_per_row(grid: &Grid) -> Vec<usize> {
    let mut counts = Vec::new();
    for place in grid.members.iter().filter_map(|member| member.place) {
        if counts.len() <= place.row {
            counts.resize(place.row + 1, 0);
        }
        counts[place.row] += 1;
    }
    counts
}

/// The summary as JSON.
pub(crate) fn json(run: &GridRun) -> String {
    to_text(&Summary {
        schema: SCHEMA,
        settings: &run.grid.settings,
        members: run.grid.members.len(),
        members_per_row: members_per_row(&run.grid),
        alpha: Alpha::of(&run.grid),
        has_matrix: run.has_matrix,
        check: run.check.as_ref(),
        holds: run.check.map(|_| run.holds()),
        seconds: run.took.as_secs_f64(),
    })
}

/// The summary as text.
pub(crate) fn text(run: &GridRun) -> String {
    let mut text = String::new();
    let space = &run.grid.settings.space;
    let range = |(low, high): (f64, f64)| format!("{low} .. {high} s");
    let _ = writeln!(
        text,
        "Space    T_prop {}, T_body {}, tau {}\n         phase margin at least {} deg, relay beta {}",
        range(space.t_prop_s),
        range(space.t_body_s),
        range(space.tau_s),
        space.phase_margin_deg,
        space.beta,
    );
    let _ = writeln!(text, "Grid     {}", kind(&run.grid.settings));
    let mut lead = "Members  ";
    for line in members(&run.grid) {
        wrapped(&mut text, lead, &line);
        lead = "         ";
    }
    let _ = writeln!(text, "Time     {} s", significant(run.took.as_secs_f64()));
    text = headed(&text);
    if let Some(check) = &run.check {
        let _ = writeln!(
            text,
            "\n{}",
            headed(&format!(
                "Check    {} random processes, seed {}",
                check.processes, check.seed
            ))
        );
        for (name, value) in check_facts(check) {
            let _ = writeln!(text, "  {name:<36}{value}");
        }
        let limit = run.grid.settings.deterioration;
        let _ = writeln!(
            text,
            "\n{}",
            verdict(run.holds(), &check_verdict(check, limit))
        );
    }
    text
}

/// How the members are placed.
fn kind(settings: &GridSettings) -> String {
    let limit = percent(settings.deterioration);
    let layout = match settings.layout {
        Layout::Rays => format!("neighbours {limit} apart"),
        Layout::Fewest => format!("the fewest within {limit} of every process"),
        Layout::Lattice => format!("lattice of the authors' published code, {limit}"),
    };
    let gains = match settings.gains {
        Gains::SameAmplitude => "gains by the amplitude",
        Gains::Equal => "equal velocity gains",
        Gains::SameMagnitude => "gains by the magnitude at the phase of the relay",
    };
    let criterion = settings.criterion.name().to_uppercase();
    format!("{layout}, {gains}, least {criterion}")
}

/// Number and arrangement of the members, one line for each fact.
fn members(grid: &Grid) -> Vec<String> {
    let counts = members_per_row(grid);
    let count = grid.members.len();
    if counts.is_empty() {
        return vec![count.to_string()];
    }
    let rows: Vec<String> = counts.iter().map(ToString::to_string).collect();
    let mut lines = vec![format!(
        "{count} in {} rows: {}",
        rows.len(),
        rows.join(" ")
    )];
    let alone = grid.members.iter().filter(|member| member.place.is_none());
    match alone.count() {
        0 => {}
        alone => lines.push(format!("{alone} of them where the rows left holes")),
    }
    if let Some(Alpha { least, most }) = Alpha::of(grid) {
        lines.push(format!(
            "ratio of neighbouring radii of a ray {least:.3} to {most:.3}"
        ));
    }
    lines
}

fn check_facts(check: &Check) -> [(&'static str, String); 4] {
    let [t_prop, t_body, tau] = check.worst_at_s.map(significant);
    let cost = |cost: Option<f64>| cost.map_or("unstable".to_owned(), percent);
    let margin = check.least_margin_rad;
    let both = |worst, mean| format!("worst {}, mean {}", cost(worst), cost(mean));
    [
        (
            "distance to the nearest member",
            both(check.worst, check.mean),
        ),
        (
            "deterioration under its controller",
            both(check.worst_cost, check.mean_cost),
        ),
        (
            "smallest phase margin under it",
            margin.map_or("unstable".to_owned(), |margin| {
                format!("{:.1} deg", margin.to_degrees())
            }),
        ),
        (
            "farthest process",
            format!("T_prop {t_prop} s, T_body {t_body} s, tau {tau} s"),
        ),
    ]
}

fn check_verdict(check: &Check, limit: f64) -> String {
    let limit = percent(limit);
    match check.beyond {
        0 => format!("Every process of the check is within {limit} of a member."),
        beyond => {
            format!("{beyond} processes of the check are farther than {limit} from every member.")
        }
    }
}

fn percent(fraction: f64) -> String {
    format!("{} %", significant(100.0 * fraction))
}
