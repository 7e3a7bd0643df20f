//! Where the relay meets the process, by the describing function and exactly, and what a bias does.

use std::f64::consts::TAU;
use std::path::Path;

use onecycle_lab::space::certificate::{Certificate, Summary};
use onecycle_onboard::Soiptd;
use plotters::prelude::*;

use super::{Area, BLUE, CAPTION, Drawn, GREY, LABEL, RED, write_svg};
use crate::failure::Failure;
use crate::results::certify::CertifiedSpace;

const SIZE: (u32, u32) = (1180, 480);
const LOCI_WIDTH: u32 = 590;

/// Part of the complex plane that is shown, in units of the oscillation's `|G|`.
const REAL: std::ops::Range<f64> = -2.3..0.5;
const IMAGINARY: std::ops::Range<f64> = -1.1..1.2;
/// Frequencies that are drawn, in those of the describing function.
const FREQUENCIES: (f64, f64) = (0.5, 8.0);
const LOCUS_POINTS: i32 = 400;

/// Parts of a deviation between which the axis runs; what is more is drawn at its end.
const LEFT: std::ops::Range<f64> = 0.003..10.0;

const GREEN: RGBColor = RGBColor(70, 140, 80);

/// Draws both and writes them.
pub(crate) fn draw(path: &Path, certified: &CertifiedSpace) -> Result<(), Failure> {
    write_svg(path, SIZE, |area| {
        let (left, right) = area.split_horizontally(LOCI_WIDTH);
        draw_loci(&left, certified)?;
        draw_stability(&right, certified)
    })
}

fn draw_loci(area: &Area<'_>, certified: &CertifiedSpace) -> Drawn {
    let beta = certified.space.beta;
    let mut chart = ChartBuilder::on(area)
        .caption("Processes at the corners, and the relay", CAPTION)
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(52)
        .build_cartesian_2d(REAL, IMAGINARY)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .label_style(LABEL)
        .x_desc("real part, over |G| of the oscillation")
        .y_desc("imaginary part")
        .draw()?;
    let inside = |&(x, y): &(f64, f64)| REAL.contains(&x) && IMAGINARY.contains(&y);
    for certificate in &certified.corners {
        let Some(locus) = Locus::of(certificate) else {
            continue;
        };
        let (from, to) = (FREQUENCIES.0.ln(), FREQUENCIES.1.ln());
        let points = (0..=LOCUS_POINTS)
            .map(|k| (from + (to - from) * f64::from(k) / f64::from(LOCUS_POINTS)).exp())
            .map(|frequency| locus.at(frequency))
            .filter(inside);
        chart.draw_series(LineSeries::new(points, GREY.stroke_width(1)))?;
        let exact = certificate.unbiased.map(|cycle| cycle.period_s());
        let points = exact.map(|period_s| locus.at(locus.period_s / period_s));
        chart.draw_series(points.map(|point| Circle::new(point, 4, BLUE.filled())))?;
    }
    // -1/N(a) = -pi a / (4 h) (sqrt(1 - beta^2) + j beta), a ray from the origin.
    let (x, y) = (-(1.0 - beta * beta).sqrt(), -beta);
    let far = (REAL.start / x).min(if y > 0.0 {
        IMAGINARY.end / y
    } else {
        IMAGINARY.start / y
    });
    chart.draw_series(LineSeries::new(
        [(0.0, 0.0), (far * x, far * y)],
        RED.stroke_width(2),
    ))?;
    chart.draw_series(std::iter::once(Circle::new((x, y), 4, RED.filled())))?;
    for (row, (text, color)) in [
        ("process, G(jw)", GREY),
        (
            "relay, -1/N(a); where the describing function puts the oscillation",
            RED,
        ),
        ("where it is: fundamental of the exact limit cycle", BLUE),
    ]
    .into_iter()
    .enumerate()
    {
        let style = LABEL.into_font().color(&color);
        let place = (
            REAL.start + 0.05,
            IMAGINARY.start + 0.30 - 0.11 * row as f64,
        );
        chart.draw_series(std::iter::once(Text::new(text, place, style)))?;
    }
    Ok(())
}

/// `G(jw)` of a process in units of the describing function's oscillation.
struct Locus {
    process: Soiptd,
    omega: f64,
    period_s: f64,
    magnitude: f64,
}

impl Locus {
    fn of(certificate: &Certificate) -> Option<Self> {
        let (period_s, _) = certificate.describing_function?;
        let [t_prop_s, t_body_s, tau_s] = certificate.times_s;
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).ok()?;
        let omega = TAU / period_s;
        Some(Self {
            process,
            omega,
            period_s,
            magnitude: process.magnitude(omega),
        })
    }

    fn at(&self, frequency: f64) -> (f64, f64) {
        let omega = frequency * self.omega;
        let (sin, cos) = self.process.phase_rad(omega).sin_cos();
        let magnitude = self.process.magnitude(omega) / self.magnitude;
        (magnitude * cos, magnitude * sin)
    }
}

fn draw_stability(area: &Area<'_>, certified: &CertifiedSpace) -> Drawn {
    let biases = || certified.rows.iter().map(|row| row.summary.bias);
    let low = biases().fold(0.0, f64::min);
    let high = biases().fold(0.1, f64::max);
    let mut chart = ChartBuilder::on(area)
        .caption("Least stable process under a bias", CAPTION)
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(low..high, LEFT.log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .label_style(LABEL)
        .x_desc("bias, in amplitudes of the relay")
        .y_desc("deviation left after a cycle")
        .y_label_formatter(&|left| format!("{left}"))
        .draw()?;
    chart.draw_series(LineSeries::new(
        [(low, 1.0), (high, 1.0)],
        GREY.stroke_width(1),
    ))?;
    type Radius = fn(&Summary) -> Option<f64>;
    let curves: [(&str, RGBColor, Radius); 3] = [
        ("bare relay, where it has a cycle", RED, |s| s.bare.radius),
        ("with trim", BLUE, |s| s.trimmed_radius),
        ("turned back: the most stable of its cycles", GREEN, |s| {
            s.turned_back.best_radius
        }),
    ];
    for (row, (text, color, radius)) in curves.into_iter().enumerate() {
        let points = || {
            certified.rows.iter().filter_map(move |row| {
                let left = radius(&row.summary)?.clamp(LEFT.start, LEFT.end);
                Some((row.summary.bias, left))
            })
        };
        chart.draw_series(LineSeries::new(points(), color.stroke_width(2)))?;
        chart.draw_series(points().map(|point| Circle::new(point, 3, color.filled())))?;
        let style = LABEL.into_font().color(&color);
        let place = (low + 0.03 * (high - low), 0.02 * 0.6_f64.powi(row as i32));
        chart.draw_series(std::iter::once(Text::new(text, place, style)))?;
    }
    Ok(())
}
