//! Identification on board, in slices: from the samples of a running relay test to a process and its controller.
//!
//! ```text
//! wait -> collect -> sign -> classify -> refine -> judge -> gains -> design -> result
//!   ^         |         |        |          |        |        |         |
//!   +---------+---------+--------+----------+--------+--------+---------+  next cycle
//! ```
//!
//! - **wait** for three cycles that are alike and for the next rise of the relay;
//! - **collect** the last cycles into two windows: a coarse one of all cycles for the fit, a fine one of the
//!   last cycle for the pack. If the relay reverses a switch, collection starts again;
//! - **sign**, **classify**: the signature of the last cycle, and what the pack reads from it;
//! - **refine**: the most probable process, starting from there; **judge**: whether to accept it;
//! - **gains** from the pack's lead table; **design**: the uncertainty of their phase margin.
//!
//! After [`StagedIdentification::confirm`] one more cycle is collected, at another amplitude of the relay, and refine fits
//! its gain alone, which must be that of the process found ([`amplitude`]).
//!
//! [`StagedIdentification::observe`] takes a sample. [`StagedIdentification::advance`] does one slice of the
//! work, a few thousand operations at most (see the table in [`refine`](crate::refine)). A board without double
//! precision in hardware does one slice per tick, others several.

mod past;
mod refusal;

use self::past::Past;
pub use self::refusal::Refusal;
use crate::amplitude;
use crate::classify::{Classifier, Familiarity};
use crate::control::Pd;
use crate::cycle::{Cycle, CycleDetector, SteadyRun};
use crate::judgement::{
    COORDINATES, Deviations, HALF_90_PERCENT, MOST_MISFIT, Spread, largest_response_error, misfit,
};
use crate::pack::Pack;
use crate::process::Soiptd;
use crate::refine::{PriorKnowledge, Refined, Refiner, ShapePrior};
use crate::signature::Signature;
use crate::window::{Edge, Window};

/// Rows of the window for the fit, five of them reserved for prior knowledge: at least 32 bins after a merge.
/// The fit takes 200 bytes per row.
pub const BINS: usize = 69;
/// Rows of the window for the pack: at least 64 bins after a merge, which a signature needs.
pub const FINE_BINS: usize = 133;
/// Input edges in the window for the fit: [`PAST_EDGES`] and those of the cycles.
pub const EDGES: usize = 20;
/// Input edges before the window: four periods, with which a fit without noise is exact. Without any past its
/// error is 2e-6.
pub const PAST_EDGES: usize = 8;
/// Maximum number of cycles that are fitted together, given by the number of edges.
pub const MOST_CYCLES: u8 = 4;

/// Result of a test: process, controller and their uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TuningResult {
    /// The most probable process.
    pub process: Soiptd,
    /// Standard deviations of its parameters and of the phase margin.
    pub deviations: Deviations,
    /// The best controller with at least the phase margin of the pack.
    pub pd: Pd,
    /// Phase margin of the controller with the process (rad).
    pub phase_margin_rad: f64,
    /// Constant input that the recorded input does not contain (input unit). Minus this value holds the process
    /// at rest.
    pub input_bias: f64,
    /// Misfit score of the last cycle against the pack's family (limit 1).
    pub score: f64,
    /// Period of the last cycle (s).
    pub period_s: f64,
    /// Half the peak-to-peak output of the last cycle (output unit).
    pub amplitude: f64,
    /// Standard deviation of the noise of one sample (output unit).
    pub noise_sigma: f64,
}

/// Sample of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestSample {
    /// Time (s).
    pub time_s: f64,
    /// Input held from then on (input unit).
    pub input: f64,
    /// Output (output unit).
    pub output: f64,
    /// Whether the relay is high from then on.
    pub is_high: bool,
    /// Number of switches that the relay has reversed so far.
    pub undone: u32,
}

/// Next step of the identification. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum Stage {
    /// Wait for a steady oscillation and a rise.
    Wait,
    /// Collect cycles.
    Collect,
    /// Compute the signature of the last cycle.
    Sign,
    /// Classify the signature with the pack.
    Classify,
    /// Fit the process.
    Refine,
    /// Accept or refuse the fit.
    Judge,
    /// Take the gains from the lead table.
    Gains,
    /// Compute the uncertainty of the phase margin.
    Design,
}

impl Stage {
    /// Name, for logs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wait => "wait",
            Self::Collect => "collect",
            Self::Sign => "sign",
            Self::Classify => "classify",
            Self::Refine => "refine",
            Self::Judge => "judge",
            Self::Gains => "gains",
            Self::Design => "design",
        }
    }
}

/// Counters since the windows were opened: rises of the relay, complete cycles; and the switches reversed
/// before.
#[derive(Clone, Copy, Debug, Default)]
struct Collected {
    rises: u8,
    complete: u8,
    undone: u32,
}

/// Controller whose uncertainty is being computed: number of coordinates already followed.
#[derive(Clone, Copy, Debug)]
struct Design {
    pd: Pd,
    spread: Spread,
    followed: usize,
}

/// Work memory for one axis: nearly all memory of the tuner.
pub struct Workspace {
    coarse: Window<BINS, EDGES>,
    fine: Window<FINE_BINS, 0>,
    classifier: Classifier,
    refiner: Refiner<BINS>,
}

impl Workspace {
    /// A workspace for any axis, all zeros.
    pub const NEW: Self = Self {
        coarse: Window::NONE,
        fine: Window::NONE,
        classifier: Classifier::new(),
        refiner: Refiner::new(),
    };
}

/// Identification of one axis. Every call must be given the same [`Workspace`]. See the [module](self).
pub struct StagedIdentification<'a> {
    pack: Pack<'a>,
    cycles: u8,
    detector: CycleDetector,
    run: SteadyRun,
    past: Past,
    was_high: bool,
    sample_s: f64,
    collected: Collected,
    /// The last cycle and the results so far.
    last: Option<Cycle>,
    score: f64,
    refined: Option<Refined>,
    design: Option<Design>,
    /// Whether a cycle at another amplitude has to confirm the result.
    is_confirming: bool,
    gain_deviation: f64,
    stage: Stage,
}

impl<'a> StagedIdentification<'a> {
    /// An identification from `cycles` cycles with samples every `sample_s`.
    #[must_use]
    pub fn new(pack: Pack<'a>, sample_s: f64, cycles: u8) -> Self {
        Self {
            pack,
            cycles: cycles.clamp(1, MOST_CYCLES),
            detector: CycleDetector::new(),
            run: SteadyRun::default(),
            past: Past::default(),
            was_high: true,
            sample_s,
            collected: Collected::default(),
            last: None,
            score: f64::INFINITY,
            refined: None,
            design: None,
            is_confirming: false,
            gain_deviation: 0.0,
            stage: Stage::Wait,
        }
    }

    /// Resets the identification in place.
    pub fn restart(&mut self) {
        self.detector = CycleDetector::new();
        self.run = SteadyRun::default();
        self.past = Past::default();
        self.was_high = true;
        self.is_confirming = false;
        self.stage = Stage::Wait;
    }

    /// After a result: goes on with one cycle at another amplitude of the relay, which changes with the next sample. The next
    /// outcome is the same result if the gain is the same there.
    pub fn confirm(&mut self) {
        self.is_confirming = true;
        self.run = SteadyRun::default();
        self.stage = Stage::Wait;
    }

    /// Number of cycles to collect.
    fn wanted(&self) -> u8 {
        if self.is_confirming { 1 } else { self.cycles }
    }

    /// The latest changes of the input.
    #[must_use]
    pub fn past_edges(&self) -> &[Edge] {
        self.past.edges()
    }

    /// The next step.
    #[must_use]
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// Whether complete cycles wait for [`StagedIdentification::advance`].
    #[must_use]
    pub fn has_work(&self) -> bool {
        !matches!(self.stage, Stage::Wait | Stage::Collect)
    }

    /// Takes a sample of the running test. While there is work, samples only update the cycle detection.
    pub fn observe(&mut self, workspace: &mut Workspace, sample: &TestSample) {
        let cycle = self
            .detector
            .push(sample.time_s, sample.is_high, sample.output);
        if let Some(cycle) = &cycle {
            self.run.push(cycle);
        }
        let rises = sample.is_high && !self.was_high;
        self.was_high = sample.is_high;
        match self.stage {
            Stage::Wait if rises && self.run.is_steady() => self.open(workspace, sample),
            Stage::Collect => self.collect(workspace, sample, rises, cycle),
            _ => {}
        }
        self.past.push(sample.time_s, sample.input);
    }

    /// Opens new windows at this rise, which is the first of the cycles.
    fn open(&mut self, workspace: &mut Workspace, sample: &TestSample) {
        workspace.coarse.begin(sample.time_s, self.sample_s);
        for edge in self.past.edges() {
            // The window holds more edges than the past.
            let _ = workspace.coarse.push_input(edge.time_s, edge.input);
        }
        workspace.fine.begin(sample.time_s, self.sample_s);
        self.collected = Collected {
            undone: sample.undone,
            ..Collected::default()
        };
        self.stage = Stage::Collect;
        self.take(workspace, sample);
    }

    fn collect(
        &mut self,
        workspace: &mut Workspace,
        sample: &TestSample,
        rises_now: bool,
        cycle: Option<Cycle>,
    ) {
        let wanted = self.wanted();
        let so_far = &mut self.collected;
        if sample.undone != so_far.undone || !self.run.is_steady() {
            self.stage = Stage::Wait;
            return;
        }
        so_far.rises += u8::from(rises_now);
        // Samples after the last cycle do not belong to it, although its end is not yet certain.
        let is_inside = so_far.rises < wanted;
        if let Some(cycle) = cycle
            && cycle.start_s >= workspace.coarse.start_s()
        {
            so_far.complete += 1;
            if so_far.complete == wanted {
                if !self.is_confirming {
                    self.last = Some(cycle);
                }
                self.stage = Stage::Sign;
                return;
            }
        }
        if rises_now && is_inside {
            workspace.fine.begin(sample.time_s, self.sample_s);
        }
        if is_inside {
            self.take(workspace, sample);
        }
    }

    fn take(&mut self, workspace: &mut Workspace, sample: &TestSample) {
        if workspace
            .coarse
            .push_input(sample.time_s, sample.input)
            .is_err()
        {
            self.stage = Stage::Wait;
        }
        workspace.coarse.push_output(sample.time_s, sample.output);
        workspace.fine.push_output(sample.time_s, sample.output);
    }

    /// Does one slice of the work. `None` if there is no work or if it is not finished. After a refusal the
    /// identification waits for another cycle.
    pub fn advance(&mut self, workspace: &mut Workspace) -> Option<Result<TuningResult, Refusal>> {
        let outcome = match (self.stage, self.last) {
            (Stage::Sign, Some(cycle)) if self.is_confirming => {
                self.begin_comparison(workspace, &cycle).map(|()| None)
            }
            (Stage::Sign, Some(cycle)) => self.sign(workspace, &cycle).map(|()| None),
            (Stage::Classify, Some(cycle)) => self.classify(workspace, &cycle).map(|()| None),
            (Stage::Refine, Some(_)) => self.refine(workspace).map(|()| None),
            (Stage::Judge, Some(_)) => self.judge(workspace).map(|()| None),
            (Stage::Gains, Some(_)) => self.gains().map(|()| None),
            (Stage::Design, Some(cycle)) => self.design(&cycle),
            _ => return None,
        };
        let outcome = outcome.transpose()?;
        self.stage = Stage::Wait;
        Some(outcome)
    }

    fn sign(&mut self, workspace: &mut Workspace, cycle: &Cycle) -> Result<(), Refusal> {
        let signature = Signature::new(&workspace.fine, cycle).map_err(|_| Refusal::NoSignature)?;
        let noise_sigma = workspace.fine.noise_sigma();
        workspace
            .classifier
            .begin(&self.pack, &signature, cycle.period_s, noise_sigma)
            .map_err(|_| Refusal::Unknown(f64::INFINITY))?;
        self.stage = Stage::Classify;
        Ok(())
    }

    fn classify(&mut self, workspace: &mut Workspace, cycle: &Cycle) -> Result<(), Refusal> {
        let Some(read) = workspace.classifier.advance(&self.pack) else {
            return Ok(());
        };
        let read = read.map_err(|_| Refusal::Unknown(f64::INFINITY))?;
        if read.familiarity == Familiarity::Unknown {
            return Err(Refusal::Unknown(read.score));
        }
        self.score = read.score;
        let prior_knowledge = PriorKnowledge {
            starts: &read.starts(cycle.period_s),
            prior: ShapePrior::of_pack(&self.pack),
        };
        workspace
            .refiner
            .begin(&workspace.coarse, cycle.period_s, &prior_knowledge)
            .map_err(|_| Refusal::NoFit)?;
        self.stage = Stage::Refine;
        Ok(())
    }

    fn refine(&mut self, workspace: &mut Workspace) -> Result<(), Refusal> {
        let Some(refined) = workspace.refiner.advance(&workspace.coarse) else {
            return Ok(());
        };
        let refined = refined.map_err(|_| Refusal::NoFit)?;
        if self.is_confirming {
            return self.compare(workspace, &refined);
        }
        self.refined = Some(refined);
        self.gain_deviation = workspace.refiner.gain_deviation();
        self.stage = Stage::Judge;
        Ok(())
    }

    fn judge(&mut self, workspace: &mut Workspace) -> Result<(), Refusal> {
        let refined = self.refined.ok_or(Refusal::NoFit)?;
        let misfit = misfit(&refined, &workspace.coarse);
        let table = self.pack.gains_table().ok_or(Refusal::NoGains)?;
        let most_error = largest_response_error(table.phase_margin_rad());
        if misfit > MOST_MISFIT || refined.response_error > most_error {
            return Err(Refusal::Misfit(misfit.max(refined.response_error)));
        }
        if let Some(edge) = refined.edge {
            return Err(Refusal::Edge(edge));
        }
        self.stage = Stage::Gains;
        Ok(())
    }

    fn gains(&mut self) -> Result<(), Refusal> {
        let refined = self.refined.ok_or(Refusal::NoFit)?;
        let table = self.pack.gains_table().ok_or(Refusal::NoGains)?;
        let pd = table.pd(&refined.process).map_err(|_| Refusal::NoGains)?;
        self.design = Some(Design {
            pd,
            spread: Spread::new(&refined.process, &pd).ok_or(Refusal::NoGains)?,
            followed: 0,
        });
        self.stage = Stage::Design;
        Ok(())
    }

    fn design(&mut self, cycle: &Cycle) -> Result<Option<TuningResult>, Refusal> {
        let (Some(refined), Some(design)) = (&self.refined, &mut self.design) else {
            return Ok(None);
        };
        let Design {
            pd,
            spread,
            followed,
        } = design;
        if *followed < COORDINATES {
            spread
                .follow(*followed, &refined.process, pd)
                .ok_or(Refusal::NoGains)?;
            *followed += 1;
            return Ok(None);
        }
        let phase_margin_rad = spread.phase_margin_rad();
        let uncertain = |sigma| Refusal::TooUncertain(phase_margin_rad, sigma);
        let covariance = refined.covariance.ok_or(uncertain(f64::INFINITY))?;
        let deviations = spread.deviations(&covariance);
        let is_sure = phase_margin_rad > HALF_90_PERCENT * deviations.phase_margin_rad;
        if !is_sure {
            return Err(uncertain(deviations.phase_margin_rad));
        }
        Ok(Some(TuningResult {
            process: refined.process,
            deviations,
            pd: *pd,
            phase_margin_rad,
            input_bias: refined.input_bias,
            score: self.score,
            period_s: cycle.period_s,
            amplitude: cycle.amplitude,
            noise_sigma: refined.noise_sigma,
        }))
    }

    fn begin_comparison(
        &mut self,
        workspace: &mut Workspace,
        cycle: &Cycle,
    ) -> Result<(), Refusal> {
        let found = self.refined.as_ref().ok_or(Refusal::NoFit)?;
        (workspace.refiner)
            .begin_gain(&workspace.coarse, cycle.period_s, &found.process)
            .map_err(|_| Refusal::NoFit)?;
        self.stage = Stage::Refine;
        Ok(())
    }

    /// Accepts or refuses the fit at the second amplitude. The design, which is complete, leads to the result again.
    fn compare(&mut self, workspace: &Workspace, refined: &Refined) -> Result<(), Refusal> {
        let found = self.refined.as_ref().ok_or(Refusal::NoFit)?;
        let ratio = refined.process.k_over_t_body() / found.process.k_over_t_body();
        let deviations = [self.gain_deviation, workspace.refiner.gain_deviation()];
        if !amplitude::is_alike(ratio, deviations) {
            return Err(Refusal::AmplitudeDependent(ratio));
        }
        let misfit = misfit(refined, &workspace.coarse);
        if misfit > MOST_MISFIT {
            return Err(Refusal::Misfit(misfit));
        }
        self.stage = Stage::Design;
        Ok(())
    }
}
