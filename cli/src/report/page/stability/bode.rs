//! Bode's plot.

use onecycle_design::bands::Band;
use onecycle_design::soiptd_pd::loop_response::LoopResponse;

use super::{BAND, Loop, MEASURED, OWN, TRUTH};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Note, Panel, Series};

/// Phases that are shown (degrees).
const PHASES_DEG: (f64, f64) = (-360.0, 0.0);

pub(super) fn figure(of: &Loop) -> Figure {
    let names = [OWN, TRUTH, MEASURED, BAND];
    let magnitude = Axis::titled("magnitude (dB)").every(20.0);
    let phase = Axis::titled("phase (deg)")
        .spanning(PHASES_DEG.0, PHASES_DEG.1)
        .every(90.0);
    let magnitudes = (of.bands.as_ref()).map(|bands| mapped(&bands.magnitude, decibels));
    let phases = (of.bands.as_ref()).map(|bands| mapped(&bands.phase_rad, f64::to_degrees));
    let mut upper = Panel::new(
        magnitude,
        series(of, names, magnitudes.as_ref(), 0.0, |at| {
            decibels(at.magnitude)
        }),
    );
    let lower = series(of, [""; 4], phases.as_ref(), -180.0, |at| {
        at.phase_rad.to_degrees()
    });
    let mut lower = Panel::new(phase, lower);
    lower.notes.push(Note {
        text: format!("phase margin {}", of.phase_margin()),
        x: of.margins.gain_crossover_rad_per_s,
        y: -180.0 + of.margins.phase_margin_rad.to_degrees(),
        away: (-10.0, -40.0),
    });
    let margins = &of.margins;
    if let (Some(factor), Some(omega), Some(text)) = (
        margins.gain_margin,
        margins.phase_crossover_rad_per_s,
        of.gain_margin(),
    ) {
        upper.notes.push(Note {
            text: format!("gain margin {text}"),
            x: omega,
            y: -decibels(factor),
            away: (10.0, -40.0),
        });
    }
    let caption = match of.bands {
        Some(_) => {
            "Bode's plot of the open loop, with the band that holds it with 90 % at each frequency."
        }
        None => "Bode's plot of the open loop.",
    };
    let x = Axis::titled("frequency (rad/s)").logarithmic();
    Figure::stacked(caption, x, vec![upper, lower])
}

fn mapped(band: &Band, unit: fn(f64) -> f64) -> Band {
    let all = |values: &[f64]| values.iter().map(|value| unit(*value)).collect();
    Band {
        low: all(&band.low),
        high: all(&band.high),
    }
}

fn decibels(factor: f64) -> f64 {
    20.0 * factor.log10()
}

/// The curves of a panel; `level` is what margins count from.
fn series(
    of: &Loop,
    [own, truth, measured, band_name]: [&str; 4],
    band: Option<&Band>,
    level: f64,
    value: fn(&LoopResponse) -> f64,
) -> Vec<Series> {
    let omegas = &of.omegas_rad_per_s;
    let line = |name, marks, curve: &[LoopResponse]| {
        let values = curve.iter().map(value);
        Series::of_points(name, marks, omegas.iter().copied().zip(values))
    };
    let ends = omegas.first().into_iter().chain(omegas.last());
    let mut series = vec![];
    series.extend(
        band.map(|Band { low, high }| {
            Series::between(band_name, omegas, low, high).hue(Hue::Model)
        }),
    );
    series.push(
        Series::of_points("", Marks::Dashes, ends.map(|&omega| (omega, level))).hue(Hue::Reference),
    );
    series.push(line(own, Marks::Line, &of.own).hue(Hue::Model));
    if !of.truth.is_empty() {
        series.push(line(truth, Marks::Dashes, &of.truth).hue(Hue::Measured));
    }
    if !of.measured.is_empty() {
        let points = of.measured.iter().map(|(omega, at)| (*omega, value(at)));
        series.push(Series::of_points(measured, Marks::Rings, points).hue(Hue::Input));
    }
    series
}
