//! Outcomes of a campaign's experiments: whether the relay becomes steady, how good the identified
//! process is.

use onecycle_design::Specification;
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_identify::{Identification, Options, identify};
use onecycle_onboard::Soiptd;
use onecycle_onboard::cycle::SteadyRun;
use onecycle_onboard::refine::Refined;

use super::bound::{BOUND_DRAWS, SHAPE_AND_GAIN, coordinates, costs_at_bound};
use super::evaluate::{Judge, PHASE_MARGIN_DEG, in_order};
use super::promises::{PROMISES, promises};
use crate::experiments::{
    Campaign, ExperimentError, IDENTIFICATION_PERIODS, RelayExperiment, cycles, signals_of,
};

/// How a relay test went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelayOutcome {
    /// Number of the cycle at which three in a row were alike; `None` if that never happened.
    pub steady_at: Option<u32>,
    /// Largest excursion over the amplitude of the oscillation by the describing function.
    pub excursion: f64,
    /// Period at the end over the period of the describing function.
    pub period_ratio: f64,
    /// Whether the relay was still switching at the end; if not, the process ran away.
    pub alive: bool,
    /// Switches taken back.
    pub undone: u32,
}

/// Duration of a relay test, in periods of the describing function: twice what the slowest processes need.
pub const RELAY_PERIODS: f64 = 40.0;
/// A relay that has not switched for this many periods has run away.
const DEAD_PERIODS: f64 = 8.0;

/// Runs the relay of an experiment.
///
/// # Errors
/// [`ExperimentError`]: parameters outside their range.
pub fn relay_outcome(experiment: &RelayExperiment) -> Result<RelayOutcome, ExperimentError> {
    let (trace, relay) = experiment.run(RELAY_PERIODS)?;
    let oscillation = experiment.oscillation;
    let mut run = SteadyRun::default();
    let (mut steady_at, mut last_end_s) = (None, 0.0);
    for (cycles, cycle) in (1..).zip(cycles(&trace, &trace.true_output)) {
        run.push(&cycle);
        last_end_s = cycle.start_s + cycle.period_s;
        if run.is_steady() {
            steady_at = steady_at.or(Some(cycles));
        }
    }
    let end_s = trace.time_s.last().copied().unwrap_or(0.0);
    let farthest = trace
        .true_output
        .iter()
        .fold(0.0_f64, |most, y| most.max(y.abs()));
    Ok(RelayOutcome {
        steady_at,
        excursion: farthest / oscillation.amplitude,
        period_ratio: run.period_s / oscillation.period_s,
        alive: end_s - last_end_s < DEAD_PERIODS * oscillation.period_s,
        undone: relay.undone(),
    })
}

/// The identified process beside the true one.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentificationOutcome {
    /// Result of the identification.
    pub found: Identification,
    /// The true process, lags in order.
    pub truth: Soiptd,
    /// True input bias (input unit).
    pub bias: f64,
    /// Cost of the identified process's controller on the true one.
    pub deterioration: Option<Deterioration>,
    /// Costs of the controllers of an ideal estimator with the same window. `None` as for `errors`.
    pub bound: Option<[Option<Deterioration>; BOUND_DRAWS]>,
    /// Whether the intervals of the [`PROMISES`] hold what the controller does on the true process. `None` without a
    /// controller.
    pub promises_held: Option<[bool; PROMISES.len()]>,
    /// Errors of the coordinates of the fit, without the bias, over the standard deviations that the
    /// estimator states: the Cramer-Rao bound of the window and the prior. `None` if there is no fit, or
    /// if the estimator found a model error.
    pub errors: Option<[f64; SHAPE_AND_GAIN]>,
}

/// Errors of a fit over its standard deviations; `None` without a covariance or with a model error.
fn errors(refined: &Refined, truth: &Soiptd) -> Option<[f64; SHAPE_AND_GAIN]> {
    let covariance = refined
        .covariance
        .filter(|_| refined.response_error == 0.0)?;
    let (found, truth) = (coordinates(&refined.process), coordinates(truth));
    Some(std::array::from_fn(|k| {
        (found[k] - truth[k]) / covariance[k][k].sqrt()
    }))
}

/// Runs the relay of an experiment and identifies the process from its recording, as the campaign says.
///
/// The controllers that are compared have the paper's phase margin, [`PHASE_MARGIN_DEG`].
///
/// # Errors
/// [`ExperimentError`]: parameters outside their range.
pub fn identification_outcome(
    campaign: &Campaign,
    experiment: &RelayExperiment,
) -> Result<IdentificationOutcome, ExperimentError> {
    let (trace, _) = experiment.run(IDENTIFICATION_PERIODS)?;
    let signals = signals_of(&trace, experiment.sample_s);
    let paper = Specification::paper().with_phase_margin_rad(PHASE_MARGIN_DEG.to_radians());
    let options = Options::default()
        .cycles(campaign.cycles)
        .specification(paper)
        .method(campaign.method);
    let found = identify(&signals, &options);
    let truth = in_order(&experiment.instruments.behind(&experiment.process)?)?;
    let judge = Judge::new(&truth).ok();
    let identified = found.outcome.as_ref().ok();
    let deterioration = (identified.zip(judge)).and_then(|(identified, judge)| {
        Some(judge.deterioration(identified.design?.controller.pd()?))
    });
    let refined = identified.and_then(|identified| identified.fit.refined());
    let errors = refined.and_then(|refined| errors(refined, &truth));
    let bound =
        (refined.zip(judge)).and_then(|(refined, judge)| costs_at_bound(refined, &truth, &judge));
    let promised = identified.and_then(|identified| promises(identified, &truth.into()));
    Ok(IdentificationOutcome {
        promises_held: promised
            .map(|promised| promised.map(|promise| promise.interval.holds(promise.truth))),
        errors,
        bound,
        found,
        truth,
        bias: experiment.input_bias,
        deterioration,
    })
}
