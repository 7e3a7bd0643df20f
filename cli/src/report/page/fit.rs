//! The model over the data, and the residuals.

use onecycle::{Innovations, ResponsePoint, SetPointResponse, Structure};
use onecycle_identify::{Fit, FitPoint, Whiteness, whiteness};
use onecycle_onboard::refine::Refined;

use super::significant;
use super::thin::thinned;
use crate::pages::page::{self, Section};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Panel, Series};
use crate::report::number::percent;
use crate::report::record::{self, Fact};
use crate::report::units::Units;

/// Relative deviation of a measured response above which it is not drawn.
const LARGEST_DEVIATION: f64 = 1.0 / 3.0;
/// Lags that residuals are compared at, and the least number of residuals for each.
const LAGS: usize = 25;
const RESIDUALS_PER_LAG: usize = 4;

/// The fit of a `structure`, which was accepted unless `title` says otherwise.
pub(super) fn section(title: &str, structure: Structure, fit: &Fit, units: &Units) -> Section {
    if let Some(response) = fit.set_point_response() {
        return Section {
            id: "fit".to_owned(),
            title: title.to_owned(),
            body: page::figure(&of_response(response))
                + &page::facts(&record::of_response(structure, response, units)),
        };
    }
    let (figure, what, residuals) = match fit.innovations() {
        None => (
            over_cycles(&fit.points, units),
            "residuals",
            fit.points.iter().map(residual).collect::<Vec<f64>>(),
        ),
        Some(found) => (
            over_record(&fit.points, found, units),
            "innovations",
            found.rows.iter().map(|row| row.innovation).collect(),
        ),
    };
    let mut body = page::figure(&figure);
    let mut facts = match fit.innovations() {
        None => fit
            .refined()
            .map_or(vec![], |refined| of_relay(fit.misfit, refined)),
        Some(found) => record::of_model(structure, found, units),
    };
    let lags = LAGS.min(residuals.len() / RESIDUALS_PER_LAG);
    // No parameter was fitted to these bins alone: zero degrees of freedom are subtracted.
    if let Some(white) = whiteness(&residuals, lags, 0) {
        body += &page::figure(&correlogram(&white, what));
        facts.push(("whiteness", judgement(&white)));
    }
    body += &page::facts(&facts);
    Section {
        id: "fit".to_owned(),
        title: title.to_owned(),
        body,
    }
}

fn residual(point: &FitPoint) -> f64 {
    point.measured - point.fitted
}

fn output(fit: &[FitPoint], fitted: &str, units: &Units) -> Panel {
    let series = |name, marks, value: fn(&FitPoint) -> f64| {
        let points = fit.iter().map(|point| (point.time_s, value(point)));
        Series::of_points(name, marks, thinned(points))
    };
    let series = vec![
        series(fitted, Marks::Line, |point| point.fitted).hue(Hue::Model),
        series("measured", Marks::Points, |point| point.measured).hue(Hue::Measured),
    ];
    Panel::new(Axis::titled(Units::titled("output", &units.output)), series)
}

fn over_cycles(fit: &[FitPoint], units: &Units) -> Figure {
    let points = fit.iter().map(|point| (point.time_s, residual(point)));
    let residuals = Series::of_points("", Marks::Points, points).hue(Hue::Measured);
    Figure::stacked(
        "Measured output, and output of the identified model for the recorded input; below, the residuals. Each point is \
         the mean of the samples in a short interval, as used in the fit.",
        Axis::titled("time (s)"),
        vec![
            output(fit, "fitted", units),
            Panel::new(Axis::titled("residual"), vec![residuals]),
        ],
    )
}

fn over_record(fit: &[FitPoint], found: &Innovations, units: &Units) -> Figure {
    let innovations = (found.rows.iter()).map(|row| (row.time_s, row.innovation));
    let disturbance = (found.rows.iter()).map(|row| (row.time_s, row.disturbance));
    let panel = |title: String, marks, hue, points| {
        let series = Series::of_points("", marks, points).hue(hue);
        Panel::new(Axis::titled(title), vec![series])
    };
    let mut upper = output(fit, "model without disturbances", units);
    // The model's line is drawn last: the points of a long record would hide it.
    upper.series.reverse();
    let mut panels = vec![
        upper,
        panel(
            "innovation / deviation".to_owned(),
            Marks::Points,
            Hue::Measured,
            thinned(innovations),
        ),
    ];
    // A constant is the input bias alone.
    if found.noise.w1_rad_per_s.is_some() {
        panels.push(panel(
            Units::titled("disturbance", &units.input),
            Marks::Line,
            Hue::Input,
            thinned(disturbance),
        ));
    }
    Figure::stacked(
        "Measured output, and output of the identified model for the recorded input alone, without disturbances; below, \
         the innovations: what the model could not predict from the samples before. The disturbance, where there is \
         one, acts at the process input. Each point is the mean of consecutive samples, as used in the fit.",
        Axis::titled("time (s)"),
        panels,
    )
}

/// Measured response above the model's, where the set-point shows.
fn of_response(found: &SetPointResponse) -> Figure {
    let shown = || (found.points.iter()).filter(|point| point.deviation < LARGEST_DEVIATION);
    let model = |value: fn(&ResponsePoint) -> f64, name| {
        let points = found.points.iter();
        let points = points.map(|point| (point.omega_rad_per_s, value(point)));
        Series::of_points(name, Marks::Line, points).hue(Hue::Model)
    };
    let measured = |points: Vec<(f64, f64)>, name| {
        Series::of_points(name, Marks::Points, points).hue(Hue::Measured)
    };
    let magnitudes =
        shown().map(|point| (point.omega_rad_per_s, 20.0 * point.measured.norm().log10()));
    let errors = shown().map(|point| {
        let turn = (point.measured / point.fitted).arg();
        (point.omega_rad_per_s, turn.to_degrees())
    });
    Figure::stacked(
        "Response of the process: output over input, both as far as the set-point caused them, and the model. Below, the \
         phase that the model leaves. Frequencies at which the measured response is uncertain by more than a third are \
         left out; the fit uses them with their small weight.",
        Axis::titled("frequency (rad/s)").logarithmic(),
        vec![
            Panel::new(
                Axis::titled("magnitude (dB)"),
                vec![
                    model(|point| 20.0 * point.fitted.norm().log10(), "model"),
                    measured(magnitudes.collect(), "measured"),
                ],
            ),
            Panel::new(
                Axis::titled("phase error (deg)"),
                vec![model(|_| 0.0, ""), measured(errors.collect(), "")],
            ),
        ],
    )
}

fn correlogram(white: &Whiteness, what: &str) -> Figure {
    let lags = || (1..=white.autocorrelation.len()).map(|lag| lag as f64);
    let bars = lags().zip(white.autocorrelation.iter().copied());
    let ends = [0.0, white.autocorrelation.len() as f64 + 1.0];
    let edge = |name: &str, value: f64| {
        let points = ends.map(|lag| (lag, value));
        Series::of_points(name, Marks::Dashes, points).hue(Hue::Reference)
    };
    Figure::single(
        &format!(
            "Autocorrelation of the {what}. Of white {what} 19 in 20 bars stay between the dashed lines; a slow wave \
             means that the model misses a part of the process."
        ),
        Axis::titled("lag (points)"),
        Panel::new(
            Axis::titled("autocorrelation").spanning(-1.0, 1.0),
            vec![
                Series::of_points(what, Marks::Bars, bars).hue(Hue::Model),
                edge(&format!("95 % of white {what}"), white.band),
                edge("", -white.band),
            ],
        ),
    )
}

/// Probability below which residuals are called not white.
const LEAST_PROBABILITY: f64 = 0.01;

/// How many lags are outside the band, and what that means.
fn judgement(white: &Whiteness) -> String {
    let lags = white.autocorrelation.len();
    let judgement = if white.probability >= LEAST_PROBABILITY {
        "white: nothing is left to explain"
    } else {
        "not white: the model misses a part of the process, or the noise is so small that any error shows"
    };
    format!(
        "{} of {lags} lags outside; Ljung-Box {:.1}, which white residuals exceed in {} of cases: {judgement}",
        white.outside,
        white.portmanteau,
        percent(white.probability),
    )
}

fn of_relay(misfit: f64, refined: &Refined) -> Vec<Fact> {
    [
        (
            "unexplained",
            format!("{} of the oscillation, beyond the noise", percent(misfit)),
        ),
        (
            "residual, noise",
            format!(
                "{}, {} (standard deviations of a sample)",
                significant(refined.residual_sigma),
                significant(refined.noise_sigma)
            ),
        ),
    ]
    .into()
}
