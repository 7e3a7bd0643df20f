//! Nyquist's plot.

use std::f64::consts::{PI, TAU};

use onecycle_design::bands::LoopBands;
use onecycle_design::soiptd_pd::loop_response::LoopResponse;

use super::{BAND, Loop, MEASURED, OWN, TRUTH};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Note, Panel, Series, Shape};

/// What is shown at least: left, right, below, above. The unit circle, and the circle of Ms about -1.
const PLANE: [f64; 4] = [-2.1, 1.2, -1.5, 1.2];
/// The farthest that is shown to the left and below, so that the circles stay to be seen.
const FARTHEST: f64 = -2.5;
/// Radius beyond which nothing is drawn.
const FAR: f64 = 30.0;

pub(super) fn figure(of: &Loop) -> Figure {
    let mut panel = Panel::new(Axis::titled("imaginary part"), series(of));
    panel.notes = notes(of);
    let [left, right, below, above] = of.measured.first().map_or(PLANE, |(_, at)| {
        let (re, im) = point(at);
        let [left, right, below, above] = PLANE;
        [
            left.min((1.2 * re).max(FARTHEST)),
            right.max((1.2 * re).min(-FARTHEST)),
            below.min((1.2 * im).max(FARTHEST)),
            above.max((1.2 * im).min(-FARTHEST)),
        ]
    });
    panel.y = panel.y.spanning(below, above);
    let mut caption =
        "Nyquist's plot of the open loop: the farther from -1 (ring), the better.".to_owned();
    if of.ms.is_some() {
        caption += " The circle about -1 is that of the maximum sensitivity Ms: the curve touches it and stays outside.";
    }
    if !of.measured.is_empty() {
        caption += " The points under the relay are measured, output over input at the oscillation's harmonics, times \
                    the controller: no model is in them.";
    }
    let x = Axis::titled("real part").spanning(left, right);
    Figure::single(&caption, x, panel).shaped(Shape::ToScale)
}

fn point(at: &LoopResponse) -> (f64, f64) {
    let (sin, cos) = at.phase_rad.sin_cos();
    (at.magnitude * cos, at.magnitude * sin)
}

fn series(of: &Loop) -> Vec<Series> {
    let near = |&(re, im): &(f64, f64)| f64::hypot(re, im) < FAR;
    let locus = |name, marks, curve: &[LoopResponse]| {
        Series::of_points(name, marks, curve.iter().map(point).filter(near))
    };
    let arc = |from: f64, to: f64, marks| {
        let angles = (0..=120).map(|k| from + (to - from) * f64::from(k) / 120.0);
        Series::of_points("", marks, angles.map(|angle| (angle.cos(), angle.sin())))
    };
    let mut series = vec![arc(0.0, TAU, Marks::Dashes).hue(Hue::Reference)];
    if let Some(ms) = of.ms {
        let circle = arc(0.0, TAU, Marks::Line);
        let around = |(x, y): (&f64, &f64)| (-1.0 + x / ms, y / ms);
        let points: Vec<_> = circle.x.iter().zip(&circle.y).map(around).collect();
        let name = format!("Ms {ms:.2}");
        series.push(Series::of_points(&name, Marks::Line, points).hue(Hue::Measured));
    }
    if let Some(LoopBands {
        locus: (low, high), ..
    }) = &of.bands
    {
        let edges = low.iter().chain(high.iter().rev()).map(|at| (at.re, at.im));
        series.push(Series::of_points(BAND, Marks::Area, edges.filter(near)).hue(Hue::Model));
    }
    series.push(locus(OWN, Marks::Line, &of.own).hue(Hue::Model));
    if !of.truth.is_empty() {
        series.push(locus(TRUTH, Marks::Dashes, &of.truth).hue(Hue::Measured));
    }
    series.push(arc(-PI, -PI + of.margins.phase_margin_rad, Marks::Line).hue(Hue::Input));
    series.push(Series::of_points("", Marks::Rings, [(-1.0, 0.0)]).hue(Hue::Measured));
    if !of.measured.is_empty() {
        let points = of.measured.iter().map(|(_, at)| point(at));
        series.push(Series::of_points(MEASURED, Marks::Rings, points).hue(Hue::Input));
    }
    series
}

fn notes(of: &Loop) -> Vec<Note> {
    let crossing = -PI + of.margins.phase_margin_rad;
    let mut notes = vec![Note {
        text: format!("phase margin {}", of.phase_margin()),
        x: crossing.cos(),
        y: crossing.sin(),
        away: (60.0, 55.0),
    }];
    if let (Some(factor), Some(text)) = (of.margins.gain_margin, of.gain_margin()) {
        notes.push(Note {
            text: format!("gain margin {text}"),
            x: -1.0 / factor,
            y: 0.0,
            away: (10.0, -70.0),
        });
    }
    notes
}
