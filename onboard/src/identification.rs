//! From the samples of a running relay test to a process and its controller, a slice at a time.
//!
//! ```text
//! wait -> collect -> sign -> classify -> refine -> judge -> gains -> design -> identified
//!   ^         |         |        |          |        |        |         |
//!   +---------+---------+--------+----------+--------+--------+---------+  another cycle
//! ```
//!
//! - **wait** for three cycles alike and for the next rise of the relay;
//! - **collect** the last cycles into two windows: a coarse one of all of them to refine, a fine one of the
//!   last to read. A switch that the relay takes back spoils them;
//! - **sign**, **classify**: the pack reads the last cycle, or does not know it;
//! - **refine**: the most probable process from there; **judge**: is it one to be believed?
//! - **gains** from the pack's table; **design**: how far may their margin be off?
//!
//! [`StagedIdentification::observe`] takes a sample, [`StagedIdentification::advance`] does one slice of the work, of a
//! few thousand operations at most (the table is in [`refine`](crate::refine)): a board without double
//! precision does one at each tick, others more.

use core::fmt;

use crate::classify::{Classifier, Familiarity};
use crate::control::Pd;
use crate::cycle::{Cycle, CycleDetector, SteadyRun};
use crate::judgement::{
    COORDINATES, Deviations, HALF_90_PERCENT, MOST_MISFIT, Spread, largest_response_error, misfit,
};
use crate::pack::Pack;
use crate::process::Soiptd;
use crate::refine::{DomainEdge, PriorKnowledge, Refined, Refiner, ShapePrior};
use crate::signature::Signature;
use crate::window::{Edge, Window};

/// Rows of the window that is refined, five of them for what is known beforehand, and of the one that is
/// read: at least 32 and 64 bins once they have been merged in pairs. A signature needs the finer ones, and a
/// refinement takes 200 bytes for each of its own.
pub const BINS: usize = 69;
/// Rows of the window that the pack reads.
pub const FINE_BINS: usize = 133;
/// Changes of the input in the window that is refined: [`PAST_EDGES`] and those of the cycles.
pub const EDGES: usize = 20;
/// Changes of the input before the window: four periods, with which a fit without noise is exact; without any
/// it errs by 2e-6.
pub const PAST_EDGES: usize = 8;
/// Most cycles that are refined together: as many as the edges leave room for.
pub const MOST_CYCLES: u8 = 4;

/// Why a cycle has led to no controller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Refusal {
    /// The last cycle has no signature: the output does not move or samples are missing.
    NoSignature,
    /// No process of the pack's family explains the last cycle: its score, one being the limit.
    Unknown(f64),
    /// The window holds no process.
    NoFit,
    /// The fit leaves this part of the oscillation unexplained.
    Misfit(f64),
    /// The best fit lies at a limit of the domain.
    Edge(DomainEdge),
    /// The pack's table has no gains for the process.
    NoGains,
    /// The margin may be lost: it, and its standard deviation (rad).
    TooUncertain(f64, f64),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSignature => write!(f, "the last cycle has no shape"),
            Self::Unknown(score) => write!(
                f,
                "no process of the pack's family explains the last cycle (score {score:.1}, the \
                 limit is 1)"
            ),
            Self::NoFit => write!(f, "the output does not follow the input"),
            Self::Misfit(part) => write!(
                f,
                "the best fit leaves {:.1} % of the oscillation unexplained",
                100.0 * part
            ),
            Self::Edge(_) => write!(f, "the best fit is at the edge of the domain"),
            Self::NoGains => write!(f, "the table has no gains for the process"),
            Self::TooUncertain(margin, sigma) => write!(
                f,
                "the phase margin of {:.0} degrees is known to {:.0} degrees only",
                margin.to_degrees(),
                sigma.to_degrees()
            ),
        }
    }
}

/// What the test has told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TuningResult {
    /// The most probable process.
    pub process: Soiptd,
    /// How well it is known.
    pub deviations: Deviations,
    /// Its controller: the best with at least the margin of the pack.
    pub pd: Pd,
    /// Phase margin of that controller on the process (rad).
    pub phase_margin_rad: f64,
    /// Constant input that the recorded one lacks (input unit): minus what holds the process at rest.
    pub input_bias: f64,
    /// How badly the pack's family explains the last cycle; one is the limit.
    pub score: f64,
    /// Period of the last cycle (s).
    pub period_s: f64,
    /// Half the peak-to-peak output of the last cycle (output unit).
    pub amplitude: f64,
    /// Standard deviation of the noise on a sample (output unit).
    pub noise_sigma: f64,
}

/// A sample of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observed {
    /// Its time (s).
    pub time_s: f64,
    /// Input held from it on (input unit).
    pub input: f64,
    /// Output (output unit).
    pub output: f64,
    /// Whether the relay is high from it on.
    pub is_high: bool,
    /// Switches that the relay has taken back so far.
    pub undone: u32,
}

/// What is done next: see the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum Stage {
    /// Waits for a steady oscillation and a rise.
    Wait,
    /// Collects cycles.
    Collect,
    /// Takes the signature of the last.
    Sign,
    /// The pack reads it.
    Classify,
    /// The process is found.
    Refine,
    /// Is it to be believed?
    Judge,
    /// The pack's controller for it.
    Gains,
    /// How far may its margin be off?
    Design,
}

impl Stage {
    /// Its name, for logs.
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

/// Since the windows were opened: rises of the relay, complete cycles; and the switches taken back until then.
#[derive(Clone, Copy, Debug, Default)]
struct Collected {
    rises: u8,
    complete: u8,
    undone: u32,
}

/// A controller in the making: how many of the coordinates have been followed.
#[derive(Clone, Copy, Debug)]
struct Design {
    pd: Pd,
    spread: Spread,
    followed: usize,
}

/// Workspace for the work of one axis: nearly all of its memory, and all zeros at first.
pub struct Workspace {
    coarse: Window<BINS, EDGES>,
    fine: Window<FINE_BINS, 0>,
    classifier: Classifier,
    refiner: Refiner<BINS>,
}

impl Workspace {
    /// For any axis.
    pub const NEW: Self = Self {
        coarse: Window::NONE,
        fine: Window::NONE,
        classifier: Classifier::new(),
        refiner: Refiner::new(),
    };
}

/// The identification of one axis, in a [`Workspace`] that is always the same. See the [module](self).
pub struct StagedIdentification<'a> {
    pack: Pack<'a>,
    cycles: u8,
    detector: CycleDetector,
    run: SteadyRun,
    past: Past,
    was_high: bool,
    sample_s: f64,
    collected: Collected,
    /// The last cycle, and what has been made of it so far.
    last: Option<Cycle>,
    score: f64,
    refined: Option<Refined>,
    design: Option<Design>,
    stage: Stage,
}

impl<'a> StagedIdentification<'a> {
    /// Of samples every `sample_s`, from so many cycles, with a pack.
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
            stage: Stage::Wait,
        }
    }

    /// As new, where it lies.
    pub fn restart(&mut self) {
        self.detector = CycleDetector::new();
        self.run = SteadyRun::default();
        self.past = Past::default();
        self.was_high = true;
        self.stage = Stage::Wait;
    }

    /// The latest changes of the input.
    #[must_use]
    pub fn past_edges(&self) -> &[Edge] {
        self.past.edges()
    }

    /// What it does next.
    #[must_use]
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// Whether cycles are complete and wait for [`StagedIdentification::advance`].
    #[must_use]
    pub fn has_work(&self) -> bool {
        !matches!(self.stage, Stage::Wait | Stage::Collect)
    }

    /// Takes a sample of the running test; those that come while there is work tell of the oscillation only.
    pub fn observe(&mut self, room: &mut Workspace, sample: &Observed) {
        let cycle = self
            .detector
            .push(sample.time_s, sample.is_high, sample.output);
        if let Some(cycle) = &cycle {
            self.run.push(cycle);
        }
        let rises = sample.is_high && !self.was_high;
        self.was_high = sample.is_high;
        match self.stage {
            Stage::Wait if rises && self.run.is_steady() => self.open(room, sample),
            Stage::Collect => self.collect(room, sample, rises, cycle),
            _ => {}
        }
        self.past.push(sample.time_s, sample.input);
    }

    /// New windows from this rise on, the first that of the cycles' input.
    fn open(&mut self, room: &mut Workspace, sample: &Observed) {
        room.coarse.begin(sample.time_s, self.sample_s);
        for edge in self.past.edges() {
            // There are fewer than the window holds.
            let _ = room.coarse.push_input(edge.time_s, edge.input);
        }
        room.fine.begin(sample.time_s, self.sample_s);
        self.collected = Collected {
            undone: sample.undone,
            ..Collected::default()
        };
        self.stage = Stage::Collect;
        self.take(room, sample);
    }

    fn collect(
        &mut self,
        room: &mut Workspace,
        sample: &Observed,
        rises_now: bool,
        cycle: Option<Cycle>,
    ) {
        let so_far = &mut self.collected;
        if sample.undone != so_far.undone || !self.run.is_steady() {
            self.stage = Stage::Wait;
            return;
        }
        so_far.rises += u8::from(rises_now);
        // What comes behind the last cycle is no part of it, though it is not yet sure to have ended.
        let is_inside = so_far.rises < self.cycles;
        if let Some(cycle) = cycle
            && cycle.start_s >= room.coarse.start_s()
        {
            so_far.complete += 1;
            if so_far.complete == self.cycles {
                self.last = Some(cycle);
                self.stage = Stage::Sign;
                return;
            }
        }
        if rises_now && is_inside {
            room.fine.begin(sample.time_s, self.sample_s);
        }
        if is_inside {
            self.take(room, sample);
        }
    }

    fn take(&mut self, room: &mut Workspace, sample: &Observed) {
        if room.coarse.push_input(sample.time_s, sample.input).is_err() {
            self.stage = Stage::Wait;
        }
        room.coarse.push_output(sample.time_s, sample.output);
        room.fine.push_output(sample.time_s, sample.output);
    }

    /// One slice of the work; `None` where there is none or more to come. After a refusal another cycle is
    /// waited for.
    pub fn advance(&mut self, room: &mut Workspace) -> Option<Result<TuningResult, Refusal>> {
        let outcome = match (self.stage, self.last) {
            (Stage::Sign, Some(cycle)) => self.sign(room, &cycle).map(|()| None),
            (Stage::Classify, Some(cycle)) => self.classify(room, &cycle).map(|()| None),
            (Stage::Refine, Some(_)) => self.refine(room).map(|()| None),
            (Stage::Judge, Some(_)) => self.judge(room).map(|()| None),
            (Stage::Gains, Some(_)) => self.gains().map(|()| None),
            (Stage::Design, Some(cycle)) => self.design(&cycle),
            _ => return None,
        };
        let outcome = outcome.transpose()?;
        self.stage = Stage::Wait;
        Some(outcome)
    }

    fn sign(&mut self, room: &mut Workspace, cycle: &Cycle) -> Result<(), Refusal> {
        let signature = Signature::new(&room.fine, cycle).map_err(|_| Refusal::NoSignature)?;
        let noise_sigma = room.fine.noise_sigma();
        room.classifier
            .begin(&self.pack, &signature, cycle.period_s, noise_sigma)
            .map_err(|_| Refusal::Unknown(f64::INFINITY))?;
        self.stage = Stage::Classify;
        Ok(())
    }

    fn classify(&mut self, room: &mut Workspace, cycle: &Cycle) -> Result<(), Refusal> {
        let Some(read) = room.classifier.advance(&self.pack) else {
            return Ok(());
        };
        let read = read.map_err(|_| Refusal::Unknown(f64::INFINITY))?;
        if read.familiarity == Familiarity::Unknown {
            return Err(Refusal::Unknown(read.score));
        }
        self.score = read.score;
        let beforehand = PriorKnowledge {
            starts: &read.starts(cycle.period_s),
            prior: ShapePrior::of_pack(&self.pack),
        };
        room.refiner
            .begin(&room.coarse, cycle.period_s, &beforehand)
            .map_err(|_| Refusal::NoFit)?;
        self.stage = Stage::Refine;
        Ok(())
    }

    fn refine(&mut self, room: &mut Workspace) -> Result<(), Refusal> {
        if let Some(refined) = room.refiner.advance(&room.coarse) {
            self.refined = Some(refined.map_err(|_| Refusal::NoFit)?);
            self.stage = Stage::Judge;
        }
        Ok(())
    }

    fn judge(&mut self, room: &mut Workspace) -> Result<(), Refusal> {
        let refined = self.refined.ok_or(Refusal::NoFit)?;
        let misfit = misfit(&refined, &room.coarse);
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
}

/// The latest switches, for the window that opens behind them.
#[derive(Clone, Copy, Debug, Default)]
struct Past {
    edges: [Edge; PAST_EDGES],
    count: usize,
}

impl Past {
    fn push(&mut self, time_s: f64, input: f64) {
        if self.edges().last().is_some_and(|edge| edge.input == input) {
            return;
        }
        self.edges.rotate_left(1);
        self.edges[PAST_EDGES - 1] = Edge { time_s, input };
        self.count = PAST_EDGES.min(self.count + 1);
    }

    fn edges(&self) -> &[Edge] {
        &self.edges[PAST_EDGES - self.count..]
    }
}
