//! Table VII: cycles of one run, each identified by itself, and what the controller of each costs on the
//! process of every other.

use onecycle_lab::evaluate::{Answer, Contender, Judge, Seen};
use onecycle_lab::identify::{Signals, find_oscillation};
use onecycle_plant::Trace;
use serde::Deserialize;

use super::part::{Found, Row};
use super::single::{SAMPLE_S, Setup, shown};
use crate::failure::Failure;
use crate::pages::plot::{Marks, Series};
use crate::report::number::percent;

/// The run.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Settings {
    setup: Setup,
    /// Input bias, in parts of the relay's amplitude.
    input_bias: f64,
    /// Cycles at its end.
    cycles: usize,
}

/// Where a recording is cut, in periods behind the end of a cycle: far from that end and from the next.
const BEHIND: f64 = 0.25;

pub(super) fn find(settings: &Settings) -> Result<Found, Failure> {
    let (truth, trace) = settings.setup.run(settings.input_bias)?;
    let signals = Signals::of_trace(&trace, SAMPLE_S);
    let found = find_oscillation(&signals, settings.cycles).map_err(Failure::usage)?;
    let mut answers = Vec::with_capacity(settings.cycles);
    for later in (0..settings.cycles).rev() {
        let cut_s = found.end_s - (later as f64 - BEHIND) * found.period_s;
        let points = trace.time_s.partition_point(|&time_s| time_s < cut_s);
        let before = Signals {
            time_s: &trace.time_s[..points],
            input: &trace.input[..points],
            output: &trace.output[..points],
            ..signals
        };
        let answer = Contender::OneCycle(1).answer(&Seen::of(before));
        let process = answer.map_err(Failure::usage)?.process;
        let process = process.ok_or_else(|| Failure::usage("a cycle tells no process"))?;
        let answer = Answer::of_process(process).map_err(Failure::usage)?;
        answers.push((answer.pd, Judge::new(&process).map_err(Failure::usage)?));
    }
    let judge = Judge::new(&truth.process).map_err(Failure::usage)?;
    let mut largest = 0.0_f64;
    let mut rows = Vec::with_capacity(answers.len());
    for (i, (pd, _)) in answers.iter().enumerate() {
        let mut cells = Vec::with_capacity(answers.len() + 1);
        for (j, (_, of_j)) in answers.iter().enumerate() {
            let cost = of_j.deterioration(*pd);
            if i == j {
                cells.push("-".to_owned());
            } else {
                largest = largest.max(cost.relative().unwrap_or(f64::INFINITY));
                cells.push(shown(Some(cost)));
            }
        }
        cells.push(shown(Some(judge.deterioration(*pd))));
        rows.push(Row::new((i + 1).to_string(), cells));
    }
    let from_s = found.end_s - settings.cycles as f64 * found.period_s;
    Ok(Found {
        tables: vec![
            rows,
            vec![Row::new("largest J_ij of two cycles", [percent(largest)])],
        ],
        figures: vec![vec![
            relative("output", &trace, &trace.output, (from_s, found.end_s)),
            relative("input", &trace, &trace.input, (from_s, found.end_s)),
        ]],
    })
}

/// A signal over its largest size, from one time to another (s).
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
