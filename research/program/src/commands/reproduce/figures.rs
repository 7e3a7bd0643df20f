//! The paper's figures of signals: the input of its network, and the data of PEM.

use onecycle_cli::failure::Failure;
use onecycle_cli::pages::plot::{Marks, Series};
use onecycle_identify::find_oscillation;
use onecycle_lab::experiments::{RelayTest, signals_of};
use onecycle_lab::paper::classifier::{
    Fit, INPUTS, NoiseKind, Prepared, Protocol, RelayKind, SAMPLES, Trials,
};
use onecycle_lab::space::Space;
use onecycle_plant::Trace;
use serde::Deserialize;

use super::cycles::relative;
use super::single::{SAMPLE_S, Setup};
use crate::results::reproduction::Numbers;

/// The processes and their experiments.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SignalSettings {
    /// Cycle of the network: `T_prop`, `T_body`, `tau` (s); largest bias and noise, and their seed.
    times_s: [f64; 3],
    bias: f64,
    sigma: f64,
    seed: u64,
    /// Data of PEM.
    setup: Setup,
    input_bias: f64,
}

pub(super) fn find(settings: &SignalSettings) -> Result<Numbers, Failure> {
    let (truth, trace) = settings.setup.run(settings.input_bias)?;
    let found = find_oscillation(&signals_of(&trace, SAMPLE_S), 1);
    let cycle = found.map_err(Failure::usage)?;
    let swept = truth
        .recorded_by(RelayTest::Swept)
        .map_err(Failure::usage)?
        .ok_or_else(|| Failure::usage("there is no swept recording"))?;
    let mut sweep = Trace::with_capacity(swept.time_s.len());
    for (index, &time_s) in swept.time_s.iter().enumerate() {
        let output = swept.output[index];
        sweep.push(time_s, swept.input[index], output, output);
    }
    let both = |trace: &Trace, range_s| {
        vec![
            relative("output", trace, &trace.output, range_s),
            relative("input", trace, &trace.input, range_s),
        ]
    };
    Ok(Numbers {
        tables: vec![],
        figures: vec![
            prepared(settings)?,
            both(&trace, (cycle.start_s, cycle.end_s)),
            both(&sweep, (0.0, f64::INFINITY)),
        ],
    })
}

/// Both halves of the network's inputs over their index.
fn prepared(settings: &SignalSettings) -> Result<Vec<Series>, Failure> {
    let trials = Trials {
        space: Space::MULTIROTOR,
        seed: settings.seed,
        bias: settings.bias,
        sigma: settings.sigma,
        protocol: Protocol::Untrimmed,
        relay: RelayKind::Protected,
        noise: NoiseKind::Inside,
        duration_s: 0.0,
    };
    let trial = trials.trial(0, Some(settings.times_s));
    let trial = trial
        .map_err(Failure::usage)?
        .ok_or_else(|| Failure::usage("the oscillation does not become steady"))?;
    let mut inputs = [0.0; INPUTS];
    Prepared::of(&trial.cycle, Fit::Padded).fill(&mut inputs);
    let (output, input) = inputs.split_at(SAMPLES);
    let series = |name, values: &[f32]| {
        let points = values.iter().enumerate();
        let points = points.map(|(number, &value)| (number as f64, f64::from(value)));
        Series::of_points(name, Marks::Line, points)
    };
    Ok(vec![series("output", output), series("input", input)])
}
