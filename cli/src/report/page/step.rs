//! The predicted step response.

use onecycle::{Controller, LoadResponse, Model, StepResponse, load_response, step_response};
use onecycle_design::bands::StepBands;

use super::significant;
use crate::pages::page::{self, Section};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Note, Panel, Series};
use crate::report::number::percent;

pub(super) fn section(
    response: &StepResponse,
    bands: Option<&StepBands>,
    times_s: &[f64],
    load: Option<(&LoadResponse, Option<&StepBands>)>,
) -> Section {
    let load = load.map_or(String::new(), |(load, bands)| {
        page::figure(&load_figure(load, bands, times_s))
    });
    let mut upper = Panel::new(
        Axis::titled("output"),
        output("output", response, bands, times_s),
    );
    upper.notes = notes(response);
    let lower = Panel::new(
        Axis::titled("controller's output"),
        input(response, bands, times_s),
    );
    let figure = Figure::stacked(
        "Response to a unit step of the reference, and the output of the controller. The prediction is linear, without \
         saturation: scale the step to what the actuator can do.",
        Axis::titled("time (s)"),
        vec![upper, lower],
    );
    Section {
        id: "step".to_owned(),
        title: "Predicted responses".to_owned(),
        body: page::figure(&figure) + &load + &page::facts(&facts(response, bands)),
    }
}

/// Steps of the reference and of the load with the proposed controller and with that in force.
pub(super) fn compared(
    (model, now): (&Model, Option<&Controller>),
    (response, bands): (&StepResponse, Option<&StepBands>),
    load: Option<(&LoadResponse, Option<&StepBands>)>,
    times_s: &[f64],
) -> Figure {
    let curve = |name: &str, value: &dyn Fn(f64) -> f64| {
        let points = times_s.iter().map(|&time_s| (time_s, value(time_s)));
        Series::of_points(name, Marks::Line, points)
    };
    let mut upper = output("proposed", response, bands, times_s);
    let old = now.and_then(|now| step_response(model, now).ok());
    upper.extend(old.map(|old| curve("now", &|time_s| old.at(time_s).0).hue(Hue::Measured)));
    let mut panels = vec![Panel::new(Axis::titled("step of the set-point"), upper)];
    if let Some((load, bands)) = load {
        let mut lower = load_curves(load, bands, times_s);
        let old = now.and_then(|now| load_response(model, now).ok());
        let old = old.map(|old| curve("", &|time_s| old.at(time_s).0).hue(Hue::Measured));
        lower.extend(old);
        panels.push(Panel::new(Axis::titled("step of the load"), lower));
    }
    let now = if now.is_some() {
        ", and with those of today"
    } else {
        ""
    };
    let caption = format!(
        "Response to a unit step of the set-point and of the load with the proposed gains (90 % band){now}."
    );
    Figure::stacked(&caption, Axis::titled("time (s)"), panels)
}

fn load_curves(load: &LoadResponse, bands: Option<&StepBands>, times_s: &[f64]) -> Vec<Series> {
    let band = bands.map(|StepBands { output, .. }| {
        Series::between("", times_s, &output.low, &output.high).hue(Hue::Model)
    });
    let points = times_s.iter().map(|&time_s| (time_s, load.at(time_s).0));
    let curve = Series::of_points("", Marks::Line, points).hue(Hue::Model);
    band.into_iter().chain([curve]).collect()
}

fn load_figure(load: &LoadResponse, bands: Option<&StepBands>, times_s: &[f64]) -> Figure {
    let panel = Panel::new(Axis::titled("output"), load_curves(load, bands, times_s));
    Figure::single(
        "Response to a unit step of the load at the input of the process, such as wind or payload.",
        Axis::titled("time (s)"),
        panel,
    )
}

fn output(
    name: &str,
    response: &StepResponse,
    bands: Option<&StepBands>,
    times_s: &[f64],
) -> Vec<Series> {
    let end_s = times_s.last().copied().unwrap_or(1.0);
    let reference = Series::of_points("reference", Marks::Dashes, [(0.0, 1.0), (end_s, 1.0)]);
    let band = bands.map(|StepBands { output, .. }| {
        Series::between("90 % band", times_s, &output.low, &output.high).hue(Hue::Model)
    });
    let points = times_s
        .iter()
        .map(|&time_s| (time_s, response.at(time_s).0));
    let curve = Series::of_points(name, Marks::Line, points).hue(Hue::Model);
    [Some(reference.hue(Hue::Reference)), band, Some(curve)]
        .into_iter()
        .flatten()
        .collect()
}

fn input(response: &StepResponse, bands: Option<&StepBands>, times_s: &[f64]) -> Vec<Series> {
    let band = bands.map(|StepBands { input, .. }| {
        Series::between("", times_s, &input.low, &input.high).hue(Hue::Input)
    });
    let points = times_s
        .iter()
        .map(|&time_s| (time_s, response.at(time_s).1));
    let curve = Series::of_points("", Marks::Line, points).hue(Hue::Input);
    band.into_iter().chain([curve]).collect()
}

fn notes(response: &StepResponse) -> Vec<Note> {
    let metrics = &response.metrics;
    let peak = metrics.peak_time_s.map(|peak_s| Note {
        text: format!("overshoot {:.0} %", 100.0 * metrics.overshoot),
        x: peak_s,
        y: 1.0 + metrics.overshoot,
        away: (60.0, -20.0),
    });
    let settled = Note {
        text: format!("settled after {} s", significant(metrics.settling_time_s)),
        x: metrics.settling_time_s,
        y: response.at(metrics.settling_time_s).0,
        away: (0.0, 60.0),
    };
    peak.into_iter().chain([settled]).collect()
}

fn facts(response: &StepResponse, bands: Option<&StepBands>) -> Vec<(&'static str, String)> {
    let metrics = &response.metrics;
    let seconds = |time_s: f64| format!("{} s", significant(time_s));
    let largest = significant(metrics.peak_input);
    let mut facts = vec![
        ("overshoot", percent(metrics.overshoot)),
        ("rise, 10 to 90 %", seconds(metrics.rise_time_s)),
        ("settling, within 2 %", seconds(metrics.settling_time_s)),
        ("largest input", format!("{largest} per unit of the step")),
        ("squared error", seconds(response.ise)),
    ];
    if let Some(bands) = bands.filter(|bands| bands.settling < 1.0) {
        let part = percent(bands.settling);
        facts.push((
            "stable",
            format!("on {part} of the draws from the posterior"),
        ));
    }
    facts
}
