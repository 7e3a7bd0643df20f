//! The model over the data, and the residuals.

use onecycle::Identified;
use onecycle_identify::{Evidence, FitPoint, Whiteness, whiteness};
use onecycle_onboard::refine::Refined;

use super::significant;
use crate::pages::page::{self, Section};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Panel, Series};
use crate::report::number::percent;
use crate::report::units::Units;

/// Lags that residuals are compared at, and the least number of residuals for each.
const LAGS: usize = 25;
const RESIDUALS_PER_LAG: usize = 4;

pub(super) fn section(identified: &Identified, units: &Units) -> Section {
    let mut body = page::figure(&over_data(&identified.fit.points, units));
    let residuals: Vec<f64> = (identified.fit.points.iter())
        .map(|point| point.measured - point.fitted)
        .collect();
    let lags = LAGS.min(residuals.len() / RESIDUALS_PER_LAG);
    // No parameter was fitted to these bins alone: zero degrees of freedom are subtracted.
    if let Some(white) = whiteness(&residuals, lags, 0) {
        body += &page::figure(&correlogram(&white));
        body += &page::facts(&facts(identified, &white));
    }
    Section {
        id: "fit".to_owned(),
        title: "Fit".to_owned(),
        body,
    }
}

fn over_data(fit: &[FitPoint], units: &Units) -> Figure {
    let series = |name, marks, value: fn(&FitPoint) -> f64| {
        let points = fit.iter().map(|point| (point.time_s, value(point)));
        Series::of_points(name, marks, points)
    };
    let upper = vec![
        series("fitted", Marks::Line, |point| point.fitted).hue(Hue::Model),
        series("measured", Marks::Points, |point| point.measured).hue(Hue::Measured),
    ];
    let residual = series("", Marks::Points, |point| point.measured - point.fitted);
    Figure::stacked(
        "Measured output, and output of the identified model for the recorded input; below, the residuals. Each point is \
         the mean of the samples in a short interval, as used in the fit.",
        Axis::titled("time (s)"),
        vec![
            Panel::new(Axis::titled(Units::titled("output", &units.output)), upper),
            Panel::new(Axis::titled("residual"), vec![residual.hue(Hue::Measured)]),
        ],
    )
}

fn correlogram(white: &Whiteness) -> Figure {
    let lags = || (1..=white.autocorrelation.len()).map(|lag| lag as f64);
    let bars = lags().zip(white.autocorrelation.iter().copied());
    let ends = [0.0, white.autocorrelation.len() as f64 + 1.0];
    let edge = |name, value: f64| {
        let points = ends.map(|lag| (lag, value));
        Series::of_points(name, Marks::Dashes, points).hue(Hue::Reference)
    };
    Figure::single(
        "Autocorrelation of the residuals. Of white residuals 19 in 20 bars stay between the dashed lines; a slow wave \
         means that the model misses a part of the process.",
        Axis::titled("lag (points)"),
        Panel::new(
            Axis::titled("autocorrelation").spanning(-1.0, 1.0),
            vec![
                Series::of_points("residuals", Marks::Bars, bars).hue(Hue::Model),
                edge("95 % of white residuals", white.band),
                edge("", -white.band),
            ],
        ),
    )
}

/// Probability below which residuals are called not white.
const LEAST_PROBABILITY: f64 = 0.01;

fn facts(identified: &Identified, white: &Whiteness) -> Vec<(&'static str, String)> {
    let lags = white.autocorrelation.len();
    let is_white = white.probability >= LEAST_PROBABILITY;
    let judgement = if is_white {
        "white: nothing is left to explain"
    } else {
        "not white: the model misses a part of the process, or the noise is so small that any error shows"
    };
    let mut facts = match &identified.fit.evidence {
        Evidence::Relay(refined) => of_relay(identified.fit.misfit, refined),
        _ => vec![],
    };
    facts.push(
        (
            "whiteness",
            format!(
                "{} of {lags} lags outside; Ljung-Box {:.1}, which white residuals exceed in {} of cases: {judgement}",
                white.outside,
                white.portmanteau,
                percent(white.probability),
            ),
        ),
    );
    facts
}

fn of_relay(misfit: f64, refined: &Refined) -> Vec<(&'static str, String)> {
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
