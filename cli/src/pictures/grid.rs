//! A grid on the surface of shapes and in the space of times, and what makes its steps: the
//! deterioration along a ray (after the paper's figures 2 and 3).

use std::ops::Range;
use std::path::Path;

use onecycle_lab::space::Space;
use onecycle_lab::space::candidate::{Candidate, CandidateError};
use onecycle_lab::space::grid::{Grid, GridSettings, step};
use onecycle_lab::space::surface::Direction;
use plotters::prelude::*;

use super::{Area, BLUE, CAPTION, Drawn, GREY, LABEL, RED, tick, write_svg};
use crate::failure::Failure;

const SIZE: (u32, u32) = (1180, 900);
const HALF_WIDTH: u32 = 590;
const UPPER_HEIGHT: u32 = 480;

/// Points of a side of the outline, or of a curve.
const POINTS: i32 = 200;
/// What an axis of logarithms shows beyond its values, as a part of them.
const AROUND: f64 = 0.25;
/// A dead time of zero is drawn at this part of the longest, or of a process's radius.
const NO_DELAY: f64 = 1e-5;

/// What is shown of a ray: so many steps of the grid to either side.
const STEPS_ALONG: f64 = 1.8;
/// The deterioration axis, in that of the grid.
pub(crate) const STEPS_UP: Range<f64> = -0.4..2.5;

/// Draws all and writes them.
pub(crate) fn write(path: &Path, grid: &Grid) -> Result<(), Failure> {
    write_svg(path, SIZE, |area| {
        let (upper, lower) = area.split_vertically(UPPER_HEIGHT);
        let (left, right) = upper.split_horizontally(HALF_WIDTH);
        draw_surface(&left, grid)?;
        draw_space(&right, grid)?;
        let (left, right) = lower.split_horizontally(HALF_WIDTH);
        let [lags, delay] = rays(&grid.settings.space);
        draw_ray(&left, &grid.settings, lags)?;
        draw_ray(&right, &grid.settings, delay)
    })
}

/// A shape as it is drawn: `tan theta` and `cos phi`, whose logarithms show every corner.
pub(crate) fn place(shape: Direction) -> (f64, f64) {
    let [t_prop, t_body, delay] = shape.at(1.0);
    (t_body / t_prop, delay.max(NO_DELAY))
}

fn draw_surface(area: &Area<'_>, grid: &Grid) -> Drawn {
    let outline = outline(&grid.settings.space);
    let x = around(outline.iter().map(|point| point.0));
    let y = around(outline.iter().map(|point| point.1));
    let mut shapes: Vec<Direction> = grid.members.iter().map(|member| member.direction).collect();
    shapes.dedup();
    let mut chart = ChartBuilder::on(area)
        .caption(
            format!("{} rays on the surface of shapes", shapes.len()),
            CAPTION,
        )
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(x.log_scale(), y.log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .label_style(LABEL)
        .x_desc("tan theta = T_body / T_prop")
        .y_desc("cos phi = tau / r")
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .draw()?;
    chart.draw_series(LineSeries::new(outline, GREY.stroke_width(2)))?;
    let dots = shapes
        .into_iter()
        .map(|shape| Circle::new(place(shape), 3, RED.filled()));
    chart.draw_series(dots)?;
    Ok(())
}

/// The border of the space's patch.
pub(crate) fn outline(space: &Space) -> Vec<(f64, f64)> {
    let parts = || (0..=POINTS).map(|k| f64::from(k) / f64::from(POINTS));
    let sides: [Vec<(f64, f64)>; 4] = [
        parts().map(|part| (part, 0.0)).collect(),
        parts().map(|part| (1.0, part)).collect(),
        parts().map(|part| (1.0 - part, 1.0)).collect(),
        parts().map(|part| (0.0, 1.0 - part)).collect(),
    ];
    sides
        .concat()
        .into_iter()
        .filter_map(|(across, along)| space.shape(across, along))
        .map(place)
        .collect()
}

/// From the least of positive values to the greatest, and a little more.
fn around(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), value| {
        (low.min(value), high.max(value))
    });
    low / (1.0 + AROUND)..high * (1.0 + AROUND)
}

/// Labels that fit beside each other on an axis of the cube.
const LABELS: usize = 5;

fn draw_space(area: &Area<'_>, grid: &Grid) -> Drawn {
    let [x, z, y] = grid.settings.space.ranges_s().map(|(low, high)| {
        let ends = around([low.max(NO_DELAY * high), high].into_iter());
        ends.start.log10()..ends.end.log10()
    });
    let log10 = |time_s: f64, axis: &Range<f64>| time_s.log10().max(axis.start);
    let count = grid.members.len();
    let mut chart = ChartBuilder::on(area)
        .caption(
            format!("{count} members in the space of times (s)"),
            CAPTION,
        )
        .margin(20)
        .build_cartesian_3d(x.clone(), y.clone(), z.clone())?;
    chart.with_projection(|mut projection| {
        projection.yaw = 0.6;
        projection.pitch = 0.3;
        projection.scale = 0.8;
        projection.into_matrix()
    });
    chart
        .configure_axes()
        .light_grid_style(TRANSPARENT)
        .label_style(LABEL)
        .x_labels(LABELS)
        .y_labels(LABELS)
        .z_labels(LABELS)
        .x_formatter(&two_digits)
        .y_formatter(&two_digits)
        .z_formatter(&two_digits)
        .draw()?;
    let members = grid.members.iter().map(|member| {
        let [t_prop_s, t_body_s, tau_s] = member.candidate.times_s();
        (log10(t_prop_s, &x), log10(tau_s, &y), log10(t_body_s, &z))
    });
    chart.draw_series(members.map(|point| Circle::new(point, 2, RED.filled())))?;
    for (row, text) in ["right: T_prop", "up: tau", "back: T_body"]
        .into_iter()
        .enumerate()
    {
        let style = LABEL.into_font().color(&BLACK);
        area.draw(&Text::new(text, (20, 40 + 18 * row as i32), style))?;
    }
    Ok(())
}

/// A number beside an axis of its logarithms.
fn two_digits(log10: &f64) -> String {
    let rounded = format!("{:.1e}", 10.0_f64.powf(*log10));
    rounded
        .parse()
        .map_or(rounded, |value: f64| value.to_string())
}

/// A process of a ray beside another one.
pub(crate) struct Along {
    /// Its radius over the other's.
    pub(crate) alpha: f64,
    /// What the other's controller costs on it, and its own on the other.
    pub(crate) there: f64,
    pub(crate) here: f64,
}

/// Two rays of a space, each with its name: `T_prop`, `T_body`, `tau` (s).
pub(crate) fn rays(space: &Space) -> [(&'static str, [f64; 3]); 2] {
    let [t_prop_s, t_body_s, tau_s] = space.ranges_s();
    [
        ("A ray of long lags", [t_prop_s.1, t_body_s.1, tau_s.0]),
        ("A ray of long dead time", [t_prop_s.0, t_body_s.0, tau_s.1]),
    ]
}

fn draw_ray(
    area: &Area<'_>,
    settings: &GridSettings,
    (caption, times_s): (&str, [f64; 3]),
) -> Drawn {
    let (alpha, points) = along(settings, times_s)?;
    let percent = 100.0 * settings.deterioration;
    let x = alpha.powf(-STEPS_ALONG)..alpha.powf(STEPS_ALONG);
    let y = STEPS_UP.start * percent..STEPS_UP.end * percent;
    let mut chart = ChartBuilder::on(area)
        .caption(format!("{caption}: steps of {alpha:.3}"), CAPTION)
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(x, y.clone())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .label_style(LABEL)
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .x_desc("alpha")
        .y_desc("deterioration (%)")
        .draw()?;
    type Cost = fn(&Along) -> f64;
    let curves: [(&str, Cost, ShapeStyle); 3] = [
        (
            "J_(ij)",
            |at| at.there.max(at.here).max(0.0),
            GREY.stroke_width(7),
        ),
        ("J_ij", |at| at.there, BLUE.stroke_width(2)),
        ("J_ji", |at| at.here, RED.stroke_width(2)),
    ];
    for (name, cost, style) in curves {
        let shown = points.iter().map(|at| (at.alpha, 100.0 * cost(at)));
        let shown = shown.filter(|(_, cost)| y.contains(cost));
        chart
            .draw_series(LineSeries::new(shown, style))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 24, y)], style));
    }
    let ends = [alpha.powf(-STEPS_ALONG), alpha.powf(STEPS_ALONG)];
    chart.draw_series(LineSeries::new(
        ends.map(|at| (at, percent)),
        BLACK.stroke_width(1),
    ))?;
    for at in [alpha.recip(), 1.0, alpha] {
        let mark = [(at, y.start), (at, percent)];
        chart.draw_series(LineSeries::new(mark, BLACK.stroke_width(1)))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperMiddle)
        .label_font(LABEL)
        .background_style(WHITE)
        .border_style(GREY)
        .draw()?;
    Ok(())
}

/// The grid's step along the ray through a process, and processes to either side of it.
pub(crate) fn along(
    settings: &GridSettings,
    times_s: [f64; 3],
) -> Result<(f64, Vec<Along>), CandidateError> {
    let candidate = Candidate::new(&settings.space, settings.gains, times_s)?;
    let step = step(&candidate, settings.deterioration);
    let points = (-POINTS..=POINTS).map(|k| {
        let alpha = step.powf(STEPS_ALONG * f64::from(k) / f64::from(POINTS));
        let other = candidate.scaled(alpha)?;
        Ok(Along {
            alpha,
            there: candidate.cost_on(&other),
            here: other.cost_on(&candidate),
        })
    });
    Ok((step, points.collect::<Result<_, CandidateError>>()?))
}
