//! From the samples of a running relay test to a process and its controller, a slice at a time.
//!
//! ```text
//! wait -> collect -> sign -> classify -> refine -> judge -> design -> identified
//!   ^         |         |        |          |        |         |
//!   +---------+---------+--------+----------+--------+---------+  another cycle
//! ```
//!
//! - **wait** for three cycles alike and for the next rise of the relay;
//! - **collect** the last cycles into two windows: a coarse one of all of them to refine, a fine one of the
//!   last to read. A switch that the relay takes back spoils them;
//! - **sign**, **classify**: the pack reads the last cycle, or does not know it;
//! - **refine**: the most probable process from there; **judge**: is it one to be believed?
//! - **design**: gains from the pack's table, how far the margin may be off.
//!
//! [`Identification::observe`] takes a sample, [`Identification::advance`] does one slice of the work, of a
//! few thousand operations at most (the table is in [`refine`](crate::refine)): a board without double
//! precision does one at each tick, others more.

use core::fmt;

use crate::classify::{Classification, Classifier, Verdict};
use crate::control::Pd;
use crate::cycle::{Cycle, CycleDetector, SteadyRun};
use crate::gains::LeadTable;
use crate::judgement::{COORDINATES, Deviations, MOST_MISFIT, MOST_RESPONSE_ERROR, Spread, misfit};
use crate::pack::Pack;
use crate::process::Process;
use crate::refine::{Beforehand, DomainEdge, Refined, Refiner, ShapePrior};
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

/// Standard deviations by which the phase margin must be positive: 95 % of a Gaussian lie above.
const SURE: f64 = 1.645;

/// Why a cycle has led to no controller.
#[derive(Clone, Copy, Debug, PartialEq)]
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
pub struct Identified {
    /// The most probable process.
    pub process: Process,
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

/// What is done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Wait,
    /// Rises and complete cycles since the windows were opened, and switches taken back when they were.
    Collect {
        rises: u8,
        complete: u8,
        undone: u32,
    },
    Sign,
    Classify,
    Refine,
    Judge,
    Design,
}

/// What is large: each is needed only before the next.
#[allow(clippy::large_enum_variant)] // The largest is what there must be room for.
enum Bench {
    /// Samples of the last cycle.
    Reading(Window<FINE_BINS, 0>),
    /// The pack's answer in the making.
    Classifying(Classifier),
    /// The process in the making.
    Refining(Refiner<BINS>),
}

/// A controller in the making: how many of the coordinates have been followed.
#[derive(Clone, Copy, Debug)]
struct Design {
    refined: Refined,
    pd: Pd,
    spread: Spread,
    followed: usize,
}

/// The identification of one axis. See the [module](self).
pub struct Identification<'a> {
    pack: Pack<'a>,
    sample_s: f64,
    cycles: u8,
    detector: CycleDetector,
    run: SteadyRun,
    past: Past,
    was_high: bool,
    coarse: Window<BINS, EDGES>,
    bench: Bench,
    /// The last cycle, and what has been made of it so far.
    last: Option<Cycle>,
    score: f64,
    refined: Option<Refined>,
    design: Option<Design>,
    stage: Stage,
}

impl<'a> Identification<'a> {
    /// Of samples every `sample_s`, from so many cycles, with a pack.
    #[must_use]
    pub fn new(pack: Pack<'a>, sample_s: f64, cycles: u8) -> Self {
        Self {
            pack,
            sample_s,
            cycles: cycles.clamp(1, MOST_CYCLES),
            detector: CycleDetector::new(),
            run: SteadyRun::default(),
            past: Past::default(),
            was_high: true,
            coarse: Window::new(0.0, sample_s),
            bench: Bench::Reading(Window::new(0.0, sample_s)),
            last: None,
            score: f64::INFINITY,
            refined: None,
            design: None,
            stage: Stage::Wait,
        }
    }

    /// The steady oscillation so far.
    #[must_use]
    pub fn oscillation(&self) -> &SteadyRun {
        &self.run
    }

    /// The pack that it reads with.
    #[must_use]
    pub fn pack(&self) -> &Pack<'a> {
        &self.pack
    }

    /// The latest changes of the input.
    #[must_use]
    pub fn past_edges(&self) -> &[Edge] {
        self.past.edges()
    }

    /// Whether cycles are complete and wait for [`Identification::advance`].
    #[must_use]
    pub fn has_work(&self) -> bool {
        !matches!(self.stage, Stage::Wait | Stage::Collect { .. })
    }

    /// Takes a sample of the running test; those that come while there is work tell of the oscillation only.
    pub fn observe(&mut self, sample: &Observed) {
        let cycle = self
            .detector
            .push(sample.time_s, sample.is_high, sample.output);
        if let Some(cycle) = &cycle {
            self.run.push(cycle);
        }
        let rises = sample.is_high && !self.was_high;
        self.was_high = sample.is_high;
        match self.stage {
            Stage::Wait if rises && self.run.is_steady() => self.open(sample),
            Stage::Collect { .. } => self.collect(sample, rises, cycle),
            _ => {}
        }
        self.past.push(sample.time_s, sample.input);
    }

    /// New windows from this rise on, the first that of the cycles' input.
    fn open(&mut self, sample: &Observed) {
        self.coarse = Window::new(sample.time_s, self.sample_s);
        for edge in self.past.edges() {
            // There are fewer than the window holds.
            let _ = self.coarse.push_input(edge.time_s, edge.input);
        }
        self.bench = Bench::Reading(Window::new(sample.time_s, self.sample_s));
        self.stage = Stage::Collect {
            rises: 0,
            complete: 0,
            undone: sample.undone,
        };
        self.take(sample);
    }

    fn collect(&mut self, sample: &Observed, rises_now: bool, cycle: Option<Cycle>) {
        let Stage::Collect {
            mut rises,
            mut complete,
            undone,
        } = self.stage
        else {
            return;
        };
        if sample.undone != undone || !self.run.is_steady() {
            self.stage = Stage::Wait;
            return;
        }
        rises += u8::from(rises_now);
        if rises_now && rises < self.cycles {
            self.bench = Bench::Reading(Window::new(sample.time_s, self.sample_s));
        }
        if let Some(cycle) = cycle
            && cycle.start_s >= self.coarse.start_s()
        {
            complete += 1;
            if complete == self.cycles {
                self.last = Some(cycle);
                self.stage = Stage::Sign;
                return;
            }
        }
        self.stage = Stage::Collect {
            rises,
            complete,
            undone,
        };
        // What comes behind the last cycle is no part of it, though it is not yet sure to have ended.
        if rises < self.cycles {
            self.take(sample);
        }
    }

    fn take(&mut self, sample: &Observed) {
        if self.coarse.push_input(sample.time_s, sample.input).is_err() {
            self.stage = Stage::Wait;
        }
        self.coarse.push_output(sample.time_s, sample.output);
        if let Bench::Reading(fine) = &mut self.bench {
            fine.push_output(sample.time_s, sample.output);
        }
    }

    /// One slice of the work; `None` where there is none or more to come. After a refusal another cycle is
    /// waited for.
    pub fn advance(&mut self) -> Option<Result<Identified, Refusal>> {
        let outcome = match (self.stage, self.last) {
            (Stage::Sign, Some(cycle)) => self.sign(&cycle).map(|()| None),
            (Stage::Classify, Some(cycle)) => self.classify(&cycle).map(|()| None),
            (Stage::Refine, Some(_)) => self.refine().map(|()| None),
            (Stage::Judge, Some(_)) => self.judge().map(|()| None),
            (Stage::Design, Some(cycle)) => self.design(&cycle),
            _ => return None,
        };
        let outcome = outcome.transpose()?;
        self.stage = Stage::Wait;
        Some(outcome)
    }

    fn sign(&mut self, cycle: &Cycle) -> Result<(), Refusal> {
        let Bench::Reading(fine) = &self.bench else {
            return Err(Refusal::NoSignature);
        };
        let signature = Signature::new(fine, cycle).map_err(|_| Refusal::NoSignature)?;
        let noise_sigma = fine.noise_sigma();
        self.bench = Bench::Classifying(Classifier::new());
        if let Bench::Classifying(classifier) = &mut self.bench {
            classifier
                .begin(&self.pack, &signature, cycle.period_s, noise_sigma)
                .map_err(|_| Refusal::Unknown(f64::INFINITY))?;
        }
        self.stage = Stage::Classify;
        Ok(())
    }

    fn classify(&mut self, cycle: &Cycle) -> Result<(), Refusal> {
        let Bench::Classifying(classifier) = &mut self.bench else {
            return Err(Refusal::NoSignature);
        };
        let Some(read) = classifier.advance(&self.pack) else {
            return Ok(());
        };
        let read = read.map_err(|_| Refusal::Unknown(f64::INFINITY))?;
        if read.verdict == Verdict::Unknown {
            return Err(Refusal::Unknown(read.score));
        }
        self.score = read.score;
        self.begin_refinement(cycle, &read)
    }

    fn begin_refinement(&mut self, cycle: &Cycle, read: &Classification) -> Result<(), Refusal> {
        self.bench = Bench::Refining(Refiner::new());
        if let Bench::Refining(refiner) = &mut self.bench {
            let beforehand = Beforehand {
                starts: &read.starts(cycle.period_s),
                prior: ShapePrior::of_pack(&self.pack),
            };
            refiner
                .begin(&self.coarse, cycle.period_s, &beforehand)
                .map_err(|_| Refusal::NoFit)?;
        }
        self.stage = Stage::Refine;
        Ok(())
    }

    fn refine(&mut self) -> Result<(), Refusal> {
        let Bench::Refining(refiner) = &mut self.bench else {
            return Err(Refusal::NoFit);
        };
        if let Some(refined) = refiner.advance(&self.coarse) {
            self.refined = Some(refined.map_err(|_| Refusal::NoFit)?);
            self.stage = Stage::Judge;
        }
        Ok(())
    }

    fn judge(&mut self) -> Result<(), Refusal> {
        let refined = self.refined.ok_or(Refusal::NoFit)?;
        let misfit = misfit(&refined, &self.coarse);
        if misfit > MOST_MISFIT || refined.response_error > MOST_RESPONSE_ERROR {
            return Err(Refusal::Misfit(misfit.max(refined.response_error)));
        }
        if let Some(edge) = refined.edge {
            return Err(Refusal::Edge(edge));
        }
        let table =
            LeadTable::from_bytes(self.pack.lead_table().bytes).map_err(|_| Refusal::NoGains)?;
        let pd = table.pd(&refined.process).map_err(|_| Refusal::NoGains)?;
        self.design = Some(Design {
            refined,
            pd,
            spread: Spread::new(&refined.process, &pd).ok_or(Refusal::NoGains)?,
            followed: 0,
        });
        self.stage = Stage::Design;
        Ok(())
    }

    fn design(&mut self, cycle: &Cycle) -> Result<Option<Identified>, Refusal> {
        let Some(design) = &mut self.design else {
            return Ok(None);
        };
        let Design {
            refined,
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
        let is_sure = phase_margin_rad > SURE * deviations.phase_margin_rad;
        if !is_sure {
            return Err(uncertain(deviations.phase_margin_rad));
        }
        Ok(Some(Identified {
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
