//! The distinguishing phase of the paper's space.

use onecycle_cli::failure::Failure;
use onecycle_cli::pages::plot::{Marks, Series};
use onecycle_cli::report::number::{degrees, percent};
use onecycle_lab::space::Space;
use onecycle_lab::space::phase::LocalOptima;
use onecycle_lab::space::phase::{AppliedRule, LocalRule};
use serde::Deserialize;

use crate::results::reproduction::{Numbers, Row};

/// Resolution of the space.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PhaseSettings {
    /// Number of ratios of the time constants, and of dead times for each ratio.
    shapes: [usize; 2],
}

pub(super) fn find(settings: &PhaseSettings) -> Result<Numbers, Failure> {
    let space = Space::MULTIROTOR;
    let [rows, columns] = settings.shapes;
    let optima = LocalOptima::of_shapes(&space, rows, columns).map_err(Failure::usage)?;
    let phase = optima.distinguishing_phase().map_err(Failure::usage)?;
    let lead_rad = space.phase_margin_rad() - space.beta.asin();
    let papers = optima.apply(lead_rad).map_err(Failure::usage)?;
    let rules = [&phase.best.applied, &phase.minimax, &papers];
    let row = |name: &str, cell: fn(&AppliedRule) -> String| Row::new(name, rules.map(cell));
    Ok(Numbers {
        tables: vec![vec![
            row("phase", |rule| degrees(rule.phase_rad)),
            row("beta", |rule| format!("{:.3}", rule.rule.beta)),
            row("largest deterioration", |rule| percent(rule.worst)),
            row("mean deterioration", |rule| percent(rule.mean)),
        ]],
        figures: vec![vec![
            series("largest", &phase.rules, |rule| rule.worst),
            series("mean", &phase.rules, |rule| rule.mean),
        ]],
    })
}

/// Deterioration (%) over the phase (degrees) of every rule whose relay makes all processes oscillate.
fn series(name: &str, rules: &[LocalRule], of: fn(&AppliedRule) -> f64) -> Series {
    let rules = rules.iter().map(|rule| &rule.applied);
    let points = rules.map(|rule| (rule.phase_rad.to_degrees(), 100.0 * of(rule)));
    Series::of_points(name, Marks::Points, points.filter(|(_, y)| y.is_finite()))
}
