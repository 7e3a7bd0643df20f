//! What is made of a case: by a network and the score of one cycle, and by the identification of one,
//! two and eight.

use onecycle_onboard::classify::{Calibration, Classification, Familiarity, OUTPUTS, classify};
use onecycle_onboard::signature::Signature;
use onecycle_plant::Trace;

use super::harm::Harm;
use crate::experiments::Recipe;
use crate::experiments::outsiders::{Case, Kind, case};
use crate::learn::dataset::{ExampleError, last_steady_cycle, window};
use onecycle_identify::{Options, Signals, identify};

/// Cycles that the identification is given.
pub const CYCLES: [usize; 3] = [1, 2, 8];

/// A network: outputs for a signature.
pub type Classifier<'a> = &'a (dyn Fn(&Signature) -> [f32; OUTPUTS] + Sync);

/// A network and its calibration.
#[derive(Clone, Copy)]
pub struct Road<'a> {
    /// The network.
    pub network: Classifier<'a>,
    /// What belongs to it.
    pub calibration: Calibration,
}

/// What the road of one cycle and a network made of a case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scored {
    /// The score; one is the limit.
    pub score: f64,
    /// Whether the cycle is of the family.
    pub verdict: Familiarity,
    /// What the controller of the most probable candidate would do.
    pub harm: Harm,
}

/// What became of a case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// Whether the relay came to three cycles alike at the end.
    pub is_steady: bool,
    /// By the score; `None` without a network or a steady cycle, or where the outputs are no process.
    pub scored: Option<Scored>,
    /// For each of [`CYCLES`]: what the identified process's controller would do; `None` where the
    /// identification refused.
    pub identified: [Option<Harm>; CYCLES.len()],
}

/// Runs and judges case `n` of a recipe; `None` where the relay does not make the process without its
/// defect oscillate.
///
/// # Errors
/// See [`ExampleError`].
pub fn judge(
    recipe: &Recipe,
    kind: Kind,
    n: u64,
    road: Option<&Road<'_>>,
) -> Result<Option<Judgement>, ExampleError> {
    let Some(case) = case(recipe, kind, n)? else {
        return Ok(None);
    };
    let trace = case.run()?;
    Ok(Some(Judgement {
        is_steady: last_steady_cycle(&trace).is_some(),
        scored: road.and_then(|road| scored(&case, &trace, road)),
        identified: CYCLES.map(|cycles| identified(&case, &trace, cycles)),
    }))
}

/// What the board sees of a case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    pub(super) signature: Signature,
    pub(super) period_s: f64,
    pub(super) noise_sigma: f64,
}

impl Seen {
    /// The last cycle, where that is steady.
    pub(super) fn of(case: &Case, trace: &Trace) -> Option<Self> {
        let cycle = last_steady_cycle(trace)?;
        let window = window(trace, &cycle, case.sample_s)?;
        Some(Self {
            signature: Signature::new(&window, &cycle).ok()?,
            period_s: cycle.period_s,
            noise_sigma: window.noise_sigma(),
        })
    }

    /// Noise of a sample, over the amplitude.
    pub(super) fn noise(&self) -> f64 {
        self.noise_sigma / self.signature.amplitude
    }

    pub(super) fn classify(
        &self,
        outputs: &[f32; OUTPUTS],
        calibration: &Calibration,
    ) -> Option<Classification> {
        classify(
            outputs,
            &self.signature,
            self.period_s,
            self.noise_sigma,
            calibration,
        )
        .ok()
    }
}

/// What the network and the score make of the last cycle of a case that was run; `None` where there is
/// no steady cycle, or the outputs are no process.
#[must_use]
pub fn scored(case: &Case, trace: &Trace, road: &Road<'_>) -> Option<Scored> {
    let seen = Seen::of(case, trace)?;
    let found = seen.classify(&(road.network)(&seen.signature), &road.calibration)?;
    Some(Scored {
        score: found.score,
        verdict: found.familiarity,
        harm: Harm::of(case, &found.candidates[0].process),
    })
}

fn identified(case: &Case, trace: &Trace, cycles: usize) -> Option<Harm> {
    let signals = Signals {
        time_s: &trace.time_s,
        input: &trace.input,
        output: &trace.output,
        samples_per_point: 1,
        sample_period_s: case.sample_s,
        breaks: &[],
    };
    let options = Options::default().cycles(cycles);
    let found = identify(&signals, &options).outcome.ok()?;
    Some(Harm::of(case, &found.fit.refined.process))
}
