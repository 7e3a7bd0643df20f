//! Table VII: cycles of one run, each identified alone, and the cost of each controller on the processes of the others.

use onecycle_cli::failure::Failure;
use onecycle_cli::pages::plot::{Marks, Series};
use onecycle_cli::report::cycles::{cost_cell, cross_table};
use onecycle_cli::report::number::percent;
use onecycle_design::soiptd_pd::deterioration::Reference;
use onecycle_identify::cycles::Cycles;
use onecycle_lab::experiments::signals_of;
use onecycle_lab::paper::network::PaperNetwork;
use onecycle_plant::Trace;
use serde::Deserialize;

use super::single::{SAMPLE_S, Setup};
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
    let signals = signals_of(&trace, SAMPLE_S);
    let by_network = Cycles::by(&signals, settings.cycles, |signals| {
        let answer = network.answer(signals).map_err(|error| error.to_string())?;
        Ok(answer.process.ok_or("no fit")?)
    });
    let by_network = by_network.map_err(Failure::usage)?;
    let cycles = Cycles::of(&signals, settings.cycles).map_err(Failure::usage)?;
    let truth = Reference::new(&truth.process).map_err(Failure::usage)?;
    let rows = |cycles: &Cycles| -> Vec<Row> {
        (cross_table(cycles).into_iter().zip(&cycles.found).zip(1..))
            .map(|((mut cells, found), number)| {
                cells.push(cost_cell(Some(truth.deterioration(found.optimum.pd))));
                Row::new(format!("{number}"), cells)
            })
            .collect()
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
