//! What the phase of a rule costs, and which phase every shape would want.

use std::path::Path;

use onecycle_lab::space::Space;
use onecycle_lab::space::phase::LocalRule;
use onecycle_lab::space::phase::{DistinguishingPhase, LocalOptima};
use onecycle_lab::space::surface::Direction;
use plotters::prelude::*;

use super::{Area, BLUE, CAPTION, Drawn, GREY, LABEL, RED, tick, write_svg};
use crate::failure::Failure;

const SIZE: (u32, u32) = (1100, 440);
const CURVE_WIDTH: u32 = 560;
const MAP_WIDTH: u32 = 450;
const CURVE_POINTS: usize = 300;

/// The paper's phase (deg).
const PAPER_DEG: f64 = -46.89;

/// Of the curve beyond the local rules, as a part of their range, and at least this (deg).
const BEYOND: f64 = 0.06;
const LEAST_BEYOND_DEG: f64 = 0.5;

/// The curve is cut at this multiple of its minimum, where one shape has a much worse rule.
const HIGHEST: f64 = 8.0;
/// An axis for deteriorations that are all zero (%).
const LEAST_HIGHEST: f64 = 0.1;
/// Height of the marks, as a part of the axis: the legend is above.
const MARK: f64 = 0.62;

/// Half the width of a cell that is alone in its row or column.
const ALONE: f64 = 0.05;
/// Two angles of one row differ by rounding (rad).
const SAME_ROW_RAD: f64 = 1e-9;
const PALE: RGBColor = RGBColor(240, 240, 240);
const BAR_STEPS: i32 = 40;

/// Draws both and writes them.
pub(crate) fn write(
    path: &Path,
    space: &Space,
    optima: &LocalOptima,
    phase: &DistinguishingPhase,
) -> Result<(), Failure> {
    write_svg(path, SIZE, |area| {
        let (left, right) = area.split_horizontally(CURVE_WIDTH);
        let (map, bar) = right.split_horizontally(MAP_WIDTH);
        let colors = Colors::of(phase);
        draw_curve(&left, space, optima, phase)?;
        draw_map(&map, phase, &colors)?;
        draw_bar(&bar, &colors)
    })
}

fn draw_curve(
    area: &Area<'_>,
    space: &Space,
    optima: &LocalOptima,
    phase: &DistinguishingPhase,
) -> Drawn {
    let (low, high) = phases_deg(phase);
    let beyond = (BEYOND * (high - low)).max(LEAST_BEYOND_DEG);
    let (low, high) = (low - beyond, high + beyond);
    let worst = phase.rules.iter().map(|local| local.applied.worst);
    let top = (110.0 * worst.fold(0.0, f64::max))
        .min(100.0 * HIGHEST * phase.minimax.worst)
        .max(LEAST_HIGHEST);
    let mut chart = ChartBuilder::on(area)
        .caption("What the phase of a tuning rule costs", CAPTION)
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(52)
        .build_cartesian_2d(low..high, 0.0..top)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .label_style(LABEL)
        .y_label_formatter(&tick)
        .x_desc("phase of the relay, asin(beta) (deg)")
        .y_desc("deterioration (%)")
        .draw()?;

    let applied = (0..=CURVE_POINTS).filter_map(|point| {
        let phase_deg = low + (high - low) * point as f64 / CURVE_POINTS as f64;
        optima
            .apply((space.phase_margin_deg - phase_deg).to_radians())
            .ok()
    });
    let (worst, mean): (Vec<_>, Vec<_>) = applied
        .map(|applied| {
            let phase_deg = applied.phase_rad.to_degrees();
            (
                (phase_deg, 100.0 * applied.worst),
                (phase_deg, 100.0 * applied.mean),
            )
        })
        .unzip();
    let inside = |point: &(f64, f64)| point.1 <= top;
    for (points, color) in [(mean, GREY), (worst, BLUE)] {
        let points = points.into_iter().filter(inside);
        chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?;
    }
    let dots = phase
        .rules
        .iter()
        .map(|LocalRule { applied, .. }| (applied.phase_rad.to_degrees(), 100.0 * applied.worst));
    chart.draw_series(
        dots.filter(inside)
            .map(|point| Circle::new(point, 2, BLUE.filled())),
    )?;
    let best_deg = phase.minimax.phase_rad.to_degrees();
    let mut legend = vec![
        ("the worst shape; dots: rules of shapes".to_owned(), BLUE),
        ("mean of all shapes".to_owned(), GREY),
    ];
    for (name, mark_deg, color) in [("best", best_deg, RED), ("the paper's", PAPER_DEG, BLACK)] {
        if (low..high).contains(&mark_deg) {
            let line = [(mark_deg, 0.0), (mark_deg, MARK * top)];
            chart.draw_series(LineSeries::new(line, color.stroke_width(1)))?;
            legend.push((format!("{name}: {mark_deg:.2} deg"), color));
        }
    }
    for (row, (text, color)) in legend.into_iter().enumerate() {
        let at = (low + 0.27 * (high - low), top * (0.97 - 0.07 * row as f64));
        let style = LABEL.into_font().color(&color);
        chart.draw_series(std::iter::once(Text::new(text, at, style)))?;
    }
    Ok(())
}

/// Least and greatest phase of the local rules (deg).
fn phases_deg(phase: &DistinguishingPhase) -> (f64, f64) {
    let phases = phase.rules.iter().map(phase_deg);
    phases.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}

fn phase_deg(local: &LocalRule) -> f64 {
    local.applied.phase_rad.to_degrees()
}

/// Red above the distinguishing phase, blue below it.
struct Colors {
    best_deg: f64,
    farthest_deg: f64,
}

impl Colors {
    fn of(phase: &DistinguishingPhase) -> Self {
        let best_deg = phase.minimax.phase_rad.to_degrees();
        let (low, high) = phases_deg(phase);
        Self {
            best_deg,
            farthest_deg: (best_deg - low).max(high - best_deg).max(LEAST_BEYOND_DEG),
        }
    }

    fn at(&self, phase_deg: f64) -> RGBColor {
        let offset = (phase_deg - self.best_deg) / self.farthest_deg;
        let full = if offset > 0.0 { RED } else { BLUE };
        let part = offset.abs().min(1.0);
        let mix = |from: u8, to: u8| {
            (f64::from(from) + part * (f64::from(to) - f64::from(from))).round() as u8
        };
        RGBColor(
            mix(PALE.0, full.0),
            mix(PALE.1, full.1),
            mix(PALE.2, full.2),
        )
    }
}

/// A cell for every shape: `tau / (tau + T_prop)` across, `T_body / T_prop` up.
fn draw_map(area: &Area<'_>, phase: &DistinguishingPhase, colors: &Colors) -> Drawn {
    let theta = |local: &LocalRule| Direction::of(local.times_s).0.theta_rad;
    let rows: Vec<_> = phase
        .rules
        .chunk_by(|a, b| (theta(a) - theta(b)).abs() < SAME_ROW_RAD)
        .collect();
    let ln_ratios: Vec<_> = rows.iter().map(|row| theta(&row[0]).tan().ln()).collect();
    let heights = cells(&ln_ratios);
    let (Some(bottom), Some(top)) = (heights.first(), heights.last()) else {
        return Ok(());
    };
    let mut chart = ChartBuilder::on(area)
        .caption("The phase that each shape would want", CAPTION)
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..1.0, (bottom.0.exp()..top.1.exp()).log_scale())?;
    for (row, height) in rows.iter().zip(&heights) {
        let shares: Vec<_> = row
            .iter()
            .map(|LocalRule { times_s, .. }| times_s[2] / (times_s[2] + times_s[0]))
            .collect();
        let rectangles = row.iter().zip(cells(&shares)).map(|(local, width)| {
            let corners = [(width.0, height.0.exp()), (width.1, height.1.exp())];
            Rectangle::new(corners, colors.at(phase_deg(local)).filled())
        });
        chart.draw_series(rectangles)?;
    }
    chart
        .configure_mesh()
        .disable_mesh()
        .label_style(LABEL)
        .x_labels(6)
        .y_label_formatter(&tick)
        .x_desc("dead time, tau / (tau + T_prop)")
        .y_desc("T_body / T_prop")
        .draw()?;
    Ok(())
}

/// Where the cells of ascending positions begin and end: half way to the neighbours.
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

fn draw_bar(area: &Area<'_>, colors: &Colors) -> Drawn {
    let step_deg = colors.farthest_deg / f64::from(BAR_STEPS);
    let at = |step: i32| colors.best_deg + f64::from(step) * step_deg;
    let mut chart = ChartBuilder::on(area)
        .caption("deg", LABEL)
        .margin(10)
        .margin_bottom(50)
        .y_label_area_size(46)
        .build_cartesian_2d(0.0..1.0, at(-BAR_STEPS)..at(BAR_STEPS))?;
    // Each step reaches to the top and is painted over by the next: no seams.
    chart.draw_series((-BAR_STEPS..BAR_STEPS).map(|step| {
        let middle_deg = at(step) + 0.5 * step_deg;
        Rectangle::new(
            [(0.0, at(step)), (1.0, at(BAR_STEPS))],
            colors.at(middle_deg).filled(),
        )
    }))?;
    chart
        .configure_mesh()
        .disable_mesh()
        .disable_x_axis()
        .label_style(LABEL)
        .y_label_formatter(&|value| format!("{value:.1}"))
        .draw()?;
    Ok(())
}
