//! `onecycle campaign`: many random experiments, and a table of what became of them.

mod unknown;

use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};

use onecycle::Model;
use onecycle_lab::experiments::{Campaign, ExperimentError, Measure, RelayExperiment};
use onecycle_lab::judge::evaluate::Costs;
use onecycle_lab::judge::outcome::{
    IdentificationOutcome, RelayOutcome, SHAPE_AND_GAIN, identification_outcome, relay_outcome,
};
use onecycle_onboard::refine::coordinate;
use rayon::prelude::*;

use crate::failure::{Failure, exit};
use crate::output::{print, progress_bar};
use crate::{args, settings};

pub(crate) fn run(arguments: &args::Campaign) -> Result<ExitCode, Failure> {
    let mut campaign: Campaign = settings::read(&arguments.file)?;
    campaign.cases = arguments.cases.unwrap_or(campaign.cases);
    campaign.cycles = arguments
        .cycles
        .map_or(campaign.cycles, |cycles| cycles as usize);
    campaign.time_scale = arguments.time_scale.unwrap_or(campaign.time_scale);
    campaign.method = arguments.method.map_or(campaign.method, Into::into);
    if let Some(sigma) = arguments.sigma {
        (campaign.sigma, campaign.sigma_uniform) = (sigma, false);
    }
    campaign
        .validate()
        .map_err(|error| settings::out_of_range(&arguments.file, error))?;
    let table = match campaign.measure {
        Measure::Relay => {
            let outcomes = all(&campaign, |_, experiment| relay_outcome(experiment))?;
            relay_table(&campaign, &outcomes)
        }
        Measure::Identification => {
            identification_table(&campaign, &all(&campaign, identification_outcome)?)
        }
        Measure::Unknown => unknown::table(&arguments.file, &campaign)?,
    };
    print(&table)?;
    Ok(ExitCode::from(exit::DONE))
}

/// Every case's outcome, in order whatever the number of threads.
fn all<T: Send>(
    campaign: &Campaign,
    outcome: impl Fn(&Campaign, &RelayExperiment) -> Result<T, ExperimentError> + Sync,
) -> Result<Vec<T>, Failure> {
    let bar = progress_bar(campaign.cases);
    let done = AtomicU64::new(0);
    let outcomes = (0..campaign.cases)
        .into_par_iter()
        .map(|n| {
            let experiment = campaign.experiment(n);
            let result = experiment.and_then(|experiment| outcome(campaign, &experiment));
            bar.set_position(done.fetch_add(1, Ordering::Relaxed) + 1);
            result
        })
        .collect::<Result<_, _>>()
        .map_err(Failure::usage);
    bar.finish_and_clear();
    outcomes
}

/// A quantile as text, `-` where there are no values.
fn quantile(values: &mut [f64], q: f64, decimals: usize) -> String {
    or_dash(onecycle_lab::judge::evaluate::quantile(values, q), decimals)
}

/// A value as text, `-` where there is none.
fn or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"))
}

fn relay_table(campaign: &Campaign, outcomes: &[RelayOutcome]) -> String {
    let steady = outcomes
        .iter()
        .filter(|outcome| outcome.steady_at.is_some())
        .count();
    let run_away = outcomes.iter().filter(|outcome| !outcome.alive).count();
    let undone: u32 = outcomes.iter().map(|outcome| outcome.undone).sum();
    let mut at: Vec<f64> = outcomes
        .iter()
        .filter_map(|o| o.steady_at)
        .map(f64::from)
        .collect();
    let mut ratio: Vec<f64> = outcomes
        .iter()
        .map(|outcome| outcome.period_ratio)
        .collect();
    let mut farthest: Vec<f64> = outcomes.iter().map(|outcome| outcome.excursion).collect();
    format!(
        "{} random processes, bias up to {} h, noise up to {} of the amplitude, offset {}, trim {}\n\
         steady oscillation      {steady} ({:.2} %)\n\
         run away                {run_away}\n\
         cycles until steady     median {}, 99 % {}, most {}\n\
         period / describing fn  {} .. {}, median {}\n\
         farthest / amplitude    median {}, most {}\n\
         switches taken back     {undone}\n",
        outcomes.len(),
        campaign.bias,
        campaign.sigma,
        campaign.offset,
        if campaign.trim { "on" } else { "off" },
        100.0 * steady as f64 / outcomes.len() as f64,
        quantile(&mut at, 0.5, 0),
        quantile(&mut at, 0.99, 0),
        quantile(&mut at, 1.0, 0),
        quantile(&mut ratio, 0.0, 2),
        quantile(&mut ratio, 1.0, 2),
        quantile(&mut ratio, 0.5, 2),
        quantile(&mut farthest, 0.5, 1),
        quantile(&mut farthest, 1.0, 1),
    )
}

fn identification_table(campaign: &Campaign, outcomes: &[IdentificationOutcome]) -> String {
    let refused = outcomes
        .iter()
        .filter(|outcome| outcome.found.outcome.is_err())
        .count();
    let identified = outcomes.len() - refused;
    let costs = Costs::of(outcomes.iter().map(|outcome| outcome.deterioration));
    let percent = |cost: Option<f64>, decimals| or_dash(cost.map(|cost| 100.0 * cost), decimals);
    let bound = error_over_bound(outcomes);
    let held = coverage(outcomes).map(|count| 100.0 * count as f64 / identified.max(1) as f64);
    let [k, k_over_t_body, t_prop, t_body, tau, bias] = held;
    format!(
        "{} random processes, bias up to {} h, noise {}{} of the amplitude, trim {}, {} cycle(s)\n\
         refused                 {refused}\n\
         unstable                {}\n\
         deterioration |J| (%)   mean {}, median {}, 95 % {}, 99 % {}, worst {}\n\
         least phase margin      {} deg\n\
         90 % intervals hold (%) K {k:.1}, K/T_body {k_over_t_body:.1}, T_prop {t_prop:.1}, \
         T_body {t_body:.1}, tau {tau:.1}, bias {bias:.1}\n\
         error / Cramer-Rao      {bound}\n",
        outcomes.len(),
        campaign.bias,
        if campaign.sigma_uniform { "up to " } else { "" },
        campaign.sigma,
        if campaign.trim { "on" } else { "off" },
        campaign.cycles,
        costs.unstable,
        percent(costs.mean, 3),
        percent(costs.median, 3),
        percent(costs.percentile_95, 2),
        percent(costs.percentile_99, 2),
        percent(costs.worst, 2),
        or_dash(costs.least_phase_margin_deg, 1),
    )
}

/// Root mean squares of the errors over their standard deviations, five of which count at most: a wild
/// one is the cost's to show.
fn error_over_bound(outcomes: &[IdentificationOutcome]) -> String {
    let errors: Vec<_> = outcomes
        .iter()
        .filter_map(|outcome| outcome.errors)
        .collect();
    let rms = |k: usize| {
        let square = |errors: &[f64; SHAPE_AND_GAIN]| errors[k].powi(2).min(25.0);
        (errors.iter().map(square).sum::<f64>() / errors.len().max(1) as f64).sqrt()
    };
    format!(
        "pole sum {:.2}, pole ratio {:.2}, tau {:.2}, gain {:.2} (of {} cases)",
        rms(coordinate::LN_POLE_SUM),
        rms(coordinate::POLE_RATIO),
        rms(coordinate::TAU_S),
        rms(coordinate::LN_JERK_GAIN),
        errors.len()
    )
}

/// Of each parameter, in how many cases the interval holds the truth.
fn coverage(outcomes: &[IdentificationOutcome]) -> [usize; 6] {
    let mut held = [0; 6];
    for outcome in outcomes {
        let Ok(identified) = &outcome.found.outcome else {
            continue;
        };
        let truth = Model::from(outcome.truth);
        // The five parameters of the model, then the input bias.
        for (count, (parameter, interval)) in held.iter_mut().zip(identified.estimate.iter()) {
            let truth = truth.parameter(parameter).unwrap_or(outcome.bias);
            *count += usize::from(interval.holds(truth));
        }
    }
    held
}
