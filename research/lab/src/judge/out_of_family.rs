//! Evaluation on out-of-family processes: does the classification of one cycle, or the identification
//! from one, two and eight cycles, refuse them, and what would the controller do?

use onecycle_design::Specification;
use onecycle_identify::{About, Identification, Options, identify};
use onecycle_onboard::classify::{Calibration, Classification, Familiarity, OUTPUTS, classify};
use onecycle_onboard::signature::Signature;
use onecycle_plant::Trace;

use super::harm::Harm;
use crate::experiments::{
    DefectKind, ExperimentError, Recipe, RelayExperiment, SteadyCycle, last_steady_cycle,
    signals_of,
};

/// Duration of an experiment (periods): until the relay is steady, and the eight cycles of the
/// identification.
pub const PERIODS: f64 = 26.0;

/// Numbers of cycles that the identification fits.
pub const CYCLES: [usize; 3] = [1, 2, 8];

/// A network: outputs for a signature.
pub type NetworkFn<'a> = &'a (dyn Fn(&Signature) -> [f32; OUTPUTS] + Sync);

/// A network with its calibration.
#[derive(Clone, Copy)]
pub struct CycleClassifier<'a> {
    /// The network.
    pub network: NetworkFn<'a>,
    /// Calibration of the network's posterior and score.
    pub calibration: Calibration,
}

/// Result of the classification of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scored {
    /// Misfit score (limit 1).
    pub score: f64,
    /// Whether the cycle is taken for one of the family.
    pub verdict: Familiarity,
    /// Effect of the controller of the most probable candidate.
    pub harm: Harm,
}

/// Result of one experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluated {
    /// Whether the last three cycles are alike.
    pub is_steady: bool,
    /// Result of the classification; `None` without a network or a steady cycle, or if the outputs are no
    /// process.
    pub scored: Option<Scored>,
    /// For each number of [`CYCLES`], what the identification accepted; `None` if it refused.
    pub identified: [Option<Accepted>; CYCLES.len()],
}

/// An accepted identification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accepted {
    /// Effect of the identified process's controller.
    pub harm: Harm,
    /// Whether no remark is [about the recording](About::Recording).
    pub is_silent: bool,
}

/// Runs and evaluates experiment `n` of a recipe with a defect; `None` if the relay does not make the
/// process oscillate.
///
/// # Errors
/// [`ExperimentError`]: a field of the recipe is out of its range.
pub fn evaluate(
    recipe: &Recipe,
    kind: DefectKind,
    n: u64,
    classifier: Option<&CycleClassifier<'_>>,
) -> Result<Option<Evaluated>, ExperimentError> {
    let Some(experiment) = recipe.experiment_with_defect(kind, n)? else {
        return Ok(None);
    };
    let (trace, _) = experiment.run(PERIODS)?;
    Ok(Some(Evaluated {
        is_steady: last_steady_cycle(&trace).is_some(),
        scored: classifier.and_then(|classifier| scored(&experiment, &trace, classifier)),
        identified: CYCLES.map(|cycles| identified(&experiment, &trace, cycles)),
    }))
}

/// Noise of a sample over the amplitude.
pub(super) fn relative_noise(cycle: &SteadyCycle) -> f64 {
    cycle.noise_sigma / cycle.signature.amplitude
}

/// Classification of a cycle from the outputs of a network; `None` if the outputs are no process.
pub(super) fn classification(
    cycle: &SteadyCycle,
    outputs: &[f32; OUTPUTS],
    calibration: &Calibration,
) -> Option<Classification> {
    classify(
        outputs,
        &cycle.signature,
        cycle.period_s,
        cycle.noise_sigma,
        calibration,
    )
    .ok()
}

/// Classification of the last cycle of a recorded experiment; `None` if there is no steady cycle, or the
/// outputs are no process.
#[must_use]
pub fn scored(
    experiment: &RelayExperiment,
    trace: &Trace,
    classifier: &CycleClassifier<'_>,
) -> Option<Scored> {
    let cycle = SteadyCycle::last_of(trace, experiment.sample_s)?;
    let outputs = (classifier.network)(&cycle.signature);
    let found = classification(&cycle, &outputs, &classifier.calibration)?;
    Some(Scored {
        score: found.score,
        verdict: found.familiarity,
        harm: Harm::of(experiment, &found.candidates[0].process),
    })
}

fn identified(experiment: &RelayExperiment, trace: &Trace, cycles: usize) -> Option<Accepted> {
    let signals = signals_of(trace, experiment.sample_s);
    let options = Options::default()
        .cycles(cycles)
        .specification(Specification::paper());
    let Identification {
        outcome, remarks, ..
    } = identify(&signals, &options);
    Some(Accepted {
        harm: Harm::of(experiment, &outcome.ok()?.model.soiptd()?),
        is_silent: !(remarks.iter()).any(|remark| remark.about() == About::Recording),
    })
}
