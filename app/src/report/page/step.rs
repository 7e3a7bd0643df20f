//! The step that will come.

use onecycle_lab::StepResponse;
use onecycle_lab::bands::StepBands;

use super::significant;
use crate::pages::page::{self, Section};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Note, Panel, Series};
use crate::report::number::percent;

pub(super) fn section(
    response: &StepResponse,
    bands: Option<&StepBands>,
    times_s: &[f64],
) -> Section {
    let metrics = &response.metrics;
    let curve = |name, value: fn((f64, f64)) -> f64| {
        let points = times_s
            .iter()
            .map(|&time_s| (time_s, value(response.at(time_s))));
        Series::of_points(name, Marks::Line, points).hue(Hue::Model)
    };
    let end_s = times_s.last().copied().unwrap_or(1.0);
    let reference = Series::of_points("reference", Marks::Dashes, [(0.0, 1.0), (end_s, 1.0)]);
    let mut output = vec![reference.hue(Hue::Reference)];
    let mut input = vec![];
    if let Some(StepBands {
        output: of_output,
        input: of_input,
        ..
    }) = bands
    {
        output.push(
            Series::between("90 % band", times_s, &of_output.low, &of_output.high).hue(Hue::Model),
        );
        input.push(Series::between("", times_s, &of_input.low, &of_input.high).hue(Hue::Input));
    }
    output.push(curve("output", |(output, _)| output));
    input.push(curve("", |(_, input)| input).hue(Hue::Input));
    let mut upper = Panel::new(Axis::titled("output"), output);
    upper.notes.extend(metrics.peak_time_s.map(|peak_s| Note {
        text: format!("overshoot {:.0} %", 100.0 * metrics.overshoot),
        x: peak_s,
        y: 1.0 + metrics.overshoot,
        away: (60.0, -20.0),
    }));
    upper.notes.push(Note {
        text: format!("settled after {} s", significant(metrics.settling_time_s)),
        x: metrics.settling_time_s,
        y: response.at(metrics.settling_time_s).0,
        away: (0.0, 60.0),
    });
    let figure = Figure::stacked(
        "Response to a unit step of the reference, and what the controller puts out for it. Nothing saturates here: \
         scale the step to what the actuator can do.",
        Axis::titled("time (s)"),
        vec![
            upper,
            Panel::new(Axis::titled("controller's output"), input),
        ],
    );
    let mut facts = vec![
        ("overshoot", percent(metrics.overshoot)),
        (
            "rise, 10 to 90 %",
            format!("{} s", significant(metrics.rise_time_s)),
        ),
        (
            "settling, within 2 %",
            format!("{} s", significant(metrics.settling_time_s)),
        ),
        (
            "largest input",
            format!("{} per unit of the step", significant(metrics.peak_input)),
        ),
        ("squared error", format!("{} s", significant(response.ise))),
    ];
    if let Some(bands) = bands.filter(|bands| bands.settling < 1.0) {
        facts.push((
            "settling",
            format!(
                "of all that the process may be, {} settle",
                percent(bands.settling)
            ),
        ));
    }
    let facts: Vec<_> = facts
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect();
    Section {
        id: "step".to_owned(),
        title: "Predicted step".to_owned(),
        body: page::figure(&figure) + &page::facts(&facts),
    }
}
