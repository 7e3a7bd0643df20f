//! Table VII: cycles of one run, each identified alone, and the cost of each controller on the processes of the others.

use onecycle_lab::judge::evaluate::{Cycles, Judge};
use onecycle_lab::paper::network::PaperNetwork;
use onecycle_plant::Trace;
use serde::Deserialize;

use super::single::{SAMPLE_S, Setup};
use crate::failure::Failure;
use crate::pages::plot::{Marks, Series};
use crate::report::cycles::{cost_cell, cross_table};
use crate::report::number::percent;
use crate::results::reproduction::{Numbers, Row};

/// The relay test.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CyclesSettings {
    setup: Setup,
    /// Input bias, as a fraction of the relay's amplitude.
    input_bias: f64,
    /// Number of cycles at the end of the test.
    cycles: usize,
}

pub(super) fn find(settings: &CyclesSettings, network: &PaperNetwork) -> Result<Numbers, Failure> {
    let (truth, trace) = settings.setup.run(settings.input_bias)?;
    let by_network = Cycles::by(&trace, SAMPLE_S, settings.cycles, |signals| {
        network.answer(signals).map_err(|error| error.to_string())
    });
    let by_network = by_network.map_err(Failure::usage)?;
    let cycles = Cycles::of(&trace, SAMPLE_S, settings.cycles).map_err(Failure::usage)?;
    let judge = Judge::new(&truth.process).map_err(Failure::usage)?;
    let rows = |cycles: &Cycles| {
        let mut rows = cross_table(cycles);
        for (row, (answer, _)) in rows.iter_mut().zip(&cycles.answers) {
            row.cells
                .push(cost_cell(Some(judge.deterioration(answer.feedback))));
        }
        rows
    };
    let signal = |name, values| relative(name, &trace, values, cycles.range_s);
    let largest = [&by_network, &cycles].map(|cycles| percent(cycles.largest()));
    Ok(Numbers {
        tables: vec![
            rows(&by_network),
            rows(&cycles),
            vec![Row::new("largest J_ij of two cycles", largest)],
        ],
        figures: vec![vec![
            signal("output", &trace.output),
            signal("input", &trace.input),
        ]],
    })
}

/// A signal divided by its largest absolute value, in a range of time (s).
pub(super) fn relative(
    name: &str,
    trace: &Trace,
    signal: &[f64],
    (from_s, to_s): (f64, f64),
) -> Series {
    let points = trace.time_s.iter().copied().zip(signal.iter().copied());
    let inside = points.filter(|(time_s, _)| (from_s..=to_s).contains(time_s));
    let inside: Vec<(f64, f64)> = inside.collect();
    let size = inside
        .iter()
        .fold(0.0_f64, |most, (_, y)| most.max(y.abs()));
    let scale = if size > 0.0 { 1.0 / size } else { 1.0 };
    let marks = Marks::Line;
    Series::of_points(name, marks, inside.iter().map(|&(t, y)| (t, scale * y)))
}
