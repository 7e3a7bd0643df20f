//! Tests in several modes of operation, and roll with and without compensation of its bias.

use onecycle_cli::failure::Failure;
use onecycle_cli::report::cycles::cost_cell;
use onecycle_cli::report::number::percent;
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_lab::experiments::{SAMPLE_S, signals_of};
use onecycle_lab::judge::evaluate::{Answer, Contender, Judge, Seen};
use onecycle_lab::paper::modes::Mode;
use onecycle_onboard::Soiptd;
use onecycle_plant::multirotor::{Axis, Mission, Tuned, fly};
use serde::Deserialize;

use crate::results::reproduction::{Numbers, Row, or_dash};
use crate::workers::Workers;

/// The modes and the flights.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ModeSettings {
    /// `T_prop`, `T_body`, `tau` (s) of the process behind the curve.
    times_s: [f64; 3],
    modes: Vec<Mode>,
    /// Noise over the amplitude of the oscillation, and its seed.
    sigma: f64,
    seed: u64,
    /// Number of flights with and without compensation, and the first seed.
    flights: usize,
    first_flight: u64,
}

pub(super) fn find(settings: &ModeSettings, workers: &Workers) -> Result<Numbers, Failure> {
    Ok(Numbers {
        tables: vec![modes(settings)?, roll(settings, workers)?],
        figures: vec![],
    })
}

/// One row for each mode.
fn modes(settings: &ModeSettings) -> Result<Vec<Row>, Failure> {
    let [t_prop_s, t_body_s, tau_s] = settings.times_s;
    let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s).map_err(Failure::usage)?;
    let found = settings.modes.iter().map(|mode| {
        let local = mode.local(&process).map_err(Failure::usage)?;
        let trace = mode
            .test(&process, settings.sigma, settings.seed)
            .map_err(Failure::usage)?;
        let answer = Contender::OneCycle(1).answer(&Seen::of(signals_of(&trace, SAMPLE_S)));
        Ok((mode, local, answer.map_err(Failure::usage)?))
    });
    let found: Vec<(&Mode, Soiptd, Answer)> = found.collect::<Result<_, Failure>>()?;
    let row = |(mode, local, answer): &(&Mode, Soiptd, Answer)| {
        let judge = Judge::new(local).map_err(Failure::usage)?;
        let error = answer
            .process
            .map(|process| process.k_over_t_body() / local.k_over_t_body() - 1.0);
        let first = found
            .first()
            .map(|(_, _, first)| judge.deterioration(first.feedback));
        Ok(Row::new(
            format!("u0 = {}", mode.at),
            [
                format!("{:.2}", local.k_over_t_body() * t_body_s / mode.amplitude),
                or_dash(error, percent),
                cost_cell(Some(judge.deterioration(answer.feedback))),
                cost_cell(first),
            ],
        ))
    };
    found.iter().map(row).collect()
}

/// What the controllers found without compensation cost on the processes found with it.
fn roll(settings: &ModeSettings, workers: &Workers) -> Result<Vec<Row>, Failure> {
    let flown = workers.map(settings.flights, |number| {
        let seed = settings.first_flight + number as u64;
        let tuned = |mission| {
            let flown = fly(mission, seed).map_err(Failure::usage)?;
            let roll = flown.tuned.iter().find(|tuned| tuned.axis == Axis::Roll);
            Ok::<Option<Tuned>, Failure>(roll.copied())
        };
        let both = (tuned(Mission::Roll)?, tuned(Mission::RollUncompensated)?);
        Ok::<_, Failure>(both)
    });
    let mut costs = Vec::new();
    let mut truths = Vec::new();
    for pair in flown {
        let (Some(with), Some(without)) = pair? else {
            continue;
        };
        let judge = Judge::new(&with.identified.process).map_err(Failure::usage)?;
        costs.push(judge.deterioration(without.identified.pd));
        for tuned in [with, without] {
            let judge = Judge::new(&tuned.truth).map_err(Failure::usage)?;
            truths.push(judge.deterioration(tuned.identified.pd));
        }
    }
    let row = |name, costs: &[Deterioration]| {
        let sizes = costs
            .iter()
            .map(|cost| cost.relative().unwrap_or(f64::INFINITY).abs());
        let sizes: Vec<f64> = sizes.collect();
        let mean = sizes.iter().sum::<f64>() / sizes.len().max(1) as f64;
        let worst = sizes.iter().copied().fold(0.0, f64::max);
        Row::new(
            name,
            [costs.len().to_string(), percent(mean), percent(worst)],
        )
    };
    Ok(vec![
        row(
            "found without compensation, on the process found with it",
            &costs,
        ),
        row("all of them, on the true process", &truths),
    ])
}
