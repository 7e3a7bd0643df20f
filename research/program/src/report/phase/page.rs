//! A distinguishing phase as a page: deterioration over the phase of the rule, and the best phase of each shape.

use onecycle_cli::pages::page::{self, Section, page};
use onecycle_cli::pages::plot::{
    Axis, Field, FieldKind, Figure, Hue, Marks, Note, Panel, Places, Series,
};
use onecycle_cli::report::number::{degrees, percent, significant};
use onecycle_lab::space::phase::{AppliedRule, LocalRule};
use onecycle_lab::space::surface::Direction;

use super::times;
use crate::results::phase::PhaseSearch;

/// The paper's phase (deg).
const PAPER_DEG: f64 = -46.89;
/// The deterioration axis ends at this multiple of the minimum: a few shapes have much worse rules.
const HIGHEST: f64 = 8.0;
/// Least end of the deterioration axis (%), where all are zero.
const LEAST_HIGHEST: f64 = 0.1;
/// Height of the marks, as a part of the axis.
const MARK: f64 = 0.8;

/// The page of a distinguishing phase.
pub(crate) fn html(found: &PhaseSearch) -> String {
    let best = &found.phase.best;
    let lead = page::paragraph(
        "lead",
        "The optimal controller of one shape of process is a tuning rule for all others. The distinguishing phase is the \
         relay phase of the rule whose worst deterioration over the space is least.",
    ) + &page::facts(&[
        ("distinguishing phase", degrees(best.applied.phase_rad)),
        (
            "relay parameter beta",
            format!("{:.4}", best.applied.rule.beta),
        ),
        (
            "rule c1, c3",
            format!("{:.4}, {:.4}", best.applied.rule.c1, best.applied.rule.c3),
        ),
        (
            "deterioration",
            format!(
                "worst {}, mean {}",
                percent(best.applied.worst),
                percent(best.applied.mean)
            ),
        ),
        ("optimal for", times(best.times_s)),
        ("worst on", times(best.applied.worst_on_s)),
        (
            "space",
            format!(
                "{} shapes at a phase margin of {} deg",
                found.phase.rules.len(),
                found.space.phase_margin_deg
            ),
        ),
    ]);
    let sections = [
        Section::new("cost", "Deterioration over the phase", cost(found)),
        Section::new("shapes", "Best phase of each shape", shapes(found)),
    ];
    page("Distinguishing phase", &lead, &sections)
}

fn phase_deg(applied: &AppliedRule) -> f64 {
    applied.phase_rad.to_degrees()
}

/// The curve of the deterioration, and the table of round phases.
fn cost(found: &PhaseSearch) -> String {
    let rules = &found.phase.rules;
    let minimax = &found.phase.minimax;
    let worst = rules.iter().map(|local| local.applied.worst);
    let top = (110.0 * worst.fold(0.0, f64::max))
        .min(100.0 * HIGHEST * minimax.worst)
        .max(LEAST_HIGHEST);
    let curve = |name, of: fn(&AppliedRule) -> f64| {
        let points = (found.curve.iter()).map(|rule| (phase_deg(rule), 100.0 * of(rule)));
        Series::of_points(name, Marks::Line, points.filter(|point| point.1 <= top))
    };
    let dots = rules.iter().map(|local| {
        let applied = &local.applied;
        (phase_deg(applied), 100.0 * applied.worst)
    });
    let dots = dots.filter(|point| point.1 <= top);
    let mut series = vec![
        curve("worst shape", |rule| rule.worst).hue(Hue::Model),
        curve("mean of all shapes", |rule| rule.mean).hue(Hue::Measured),
        Series::of_points("rules of single shapes, worst", Marks::Points, dots).hue(Hue::Model),
    ];
    let mut panel = Panel::new(Axis::titled("deterioration (%)").spanning(0.0, top), vec![]);
    let ends = found.curve.first().zip(found.curve.last());
    let (low, high) = ends.map_or((0.0, 0.0), |(first, last)| {
        (phase_deg(first), phase_deg(last))
    });
    let marks = [
        ("best", phase_deg(minimax), Hue::Input, 1.0),
        ("paper", PAPER_DEG, Hue::Reference, 0.86),
    ];
    for (name, at_deg, hue, height) in marks {
        if (low..high).contains(&at_deg) {
            let height = MARK * height * top;
            let line = [(at_deg, 0.0), (at_deg, height)];
            series.push(Series::of_points("", Marks::Dashes, line).hue(hue));
            panel.notes.push(Note {
                text: format!("{name} {at_deg:.2} deg"),
                x: at_deg,
                y: height,
                away: (if name == "best" { -60.0 } else { 60.0 }, -12.0),
            });
        }
    }
    panel.series = series;
    let figure = Figure::single(
        "Deterioration of the optimal cost under the rule of each relay phase.",
        Axis::titled("phase of the relay, asin(beta) (deg)"),
        panel,
    );
    page::figure(&figure) + &table(found)
}

fn table(found: &PhaseSearch) -> String {
    let columns = [
        "phase (deg)",
        "local rules near it",
        "worst (%)",
        "mean (%)",
        "worst on T_prop, T_body, tau (ms)",
    ];
    let rows = found.table.iter().map(|line| {
        let worst_on = line
            .applied
            .worst_on_s
            .map(|time_s| significant(1e3 * time_s));
        let cells = [
            line.local_rules.to_string(),
            format!("{:.2}", 100.0 * line.applied.worst),
            format!("{:.2}", 100.0 * line.applied.mean),
            worst_on.join(", "),
        ];
        (line.phase_deg.to_string(), cells)
    });
    page::plain_table("Rules at round phases", &columns, rows)
}

/// Cells across the map.
const ACROSS: usize = 96;
/// Half the width of a cell that is alone in its row or column.
const ALONE: f64 = 0.05;
/// Least end of the scale of phases, on either side of the best (deg).
const LEAST_REACH_DEG: f64 = 0.5;
/// Angles of one row differ by rounding only (rad).
const SAME_ROW_RAD: f64 = 1e-9;

/// The map of the phase that is best for each shape: `tau / (tau + T_prop)` across, `T_body / T_prop` up.
fn shapes(found: &PhaseSearch) -> String {
    let theta = |local: &LocalRule| Direction::of(local.times_s).0.theta_rad;
    let rules = &found.phase.rules;
    let rows: Vec<&[LocalRule]> = rules
        .chunk_by(|a, b| (theta(a) - theta(b)).abs() < SAME_ROW_RAD)
        .collect();
    let ln_ratios: Vec<f64> = rows.iter().map(|row| theta(&row[0]).tan().ln()).collect();
    let heights = cells(&ln_ratios);
    let edges = heights.iter().map(|(low, _)| *low);
    let edges = edges.chain(heights.last().map(|(_, high)| *high));
    let middle = phase_deg(&found.phase.minimax);
    let reach = rules.iter().fold(LEAST_REACH_DEG, |reach, local| {
        reach.max((phase_deg(&local.applied) - middle).abs())
    });
    let mut panel = Panel::new(Axis::titled("T_body / T_prop").logarithmic(), vec![]);
    panel.field = Some(Field {
        kind: FieldKind::Diverging { middle, reach },
        x: Places::Numbers((0..=ACROSS).map(|k| k as f64 / ACROSS as f64).collect()),
        y: Places::Numbers(edges.map(f64::exp).collect()),
        z: rows.iter().map(|row| rastered(row)).collect(),
    });
    let figure = Figure::single(
        "The relay phase (deg) whose rule is optimal for each shape of process. The middle of the scale is the best phase \
         for all.",
        Axis::titled("dead time, tau / (tau + T_prop)").spanning(0.0, 1.0),
        panel,
    );
    page::figure(&figure)
}

/// The phases (deg) of a row of shapes at [`ACROSS`] equal cells; NaN where the space has no shape.
fn rastered(row: &[LocalRule]) -> Vec<f64> {
    let part = |local: &LocalRule| {
        let [t_prop_s, _, tau_s] = local.times_s;
        tau_s / (tau_s + t_prop_s)
    };
    let widths = cells(&row.iter().map(part).collect::<Vec<_>>());
    (0..ACROSS)
        .map(|k| {
            let middle = (k as f64 + 0.5) / ACROSS as f64;
            let mut all = widths.iter().zip(row);
            let found = all.find(|((a, b), _)| (a.min(*b)..=a.max(*b)).contains(&middle));
            found.map_or(f64::NAN, |(_, local)| phase_deg(&local.applied))
        })
        .collect()
}

/// Edges of cells about positions in order: half way to the neighbours.
fn cells(positions: &[f64]) -> Vec<(f64, f64)> {
    if let [alone] = positions {
        return vec![(alone - ALONE, alone + ALONE)];
    }
    let between = |a: usize, b: usize| 0.5 * (positions[a] + positions[b]);
    let last = positions.len().saturating_sub(1);
    (0..positions.len())
        .map(|k| {
            (
                between(k.saturating_sub(1), k),
                between(k, (k + 1).min(last)),
            )
        })
        .collect()
}
