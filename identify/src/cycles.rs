//! Cycles of one run, each identified separately, and the cost of each one's controller on the processes of all others:
//! the paper's Table VII.

use std::fmt;

use onecycle_design::Specification;
use onecycle_design::soiptd_pd::deterioration::{Deterioration, PHASE_MARGIN_DEG, Reference};
use onecycle_design::soiptd_pd::optimum::OptimumError;
use onecycle_onboard::Soiptd;

use crate::{Method, Options, Signals, Verdict, find_oscillation, identify};

/// Why cycles cannot be identified one by one.
#[derive(Clone, Debug)]
pub enum CyclesError {
    /// The recording has too few steady cycles.
    Oscillation(Verdict),
    /// No process could be identified from one of the cycles.
    Cycle(String),
    /// A process has no controller.
    Optimum(OptimumError),
}

impl fmt::Display for CyclesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Oscillation(verdict) => verdict.fmt(f),
            Self::Cycle(reason) => write!(f, "a cycle cannot be identified: {reason}"),
            Self::Optimum(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for CyclesError {}

impl From<OptimumError> for CyclesError {
    fn from(error: OptimumError) -> Self {
        Self::Optimum(error)
    }
}

/// The last cycles of a recording, each identified separately.
#[derive(Clone, Debug)]
pub struct Cycles {
    /// Start of the first cycle and end of the last one (s).
    pub range_s: (f64, f64),
    /// The process of each cycle, with its controller.
    pub found: Vec<Reference>,
}

/// Where the recording is cut, in periods after the end of a cycle: far from that end and from the next one.
const BEHIND: f64 = 0.25;

impl Cycles {
    /// Identifies each of the last `count` cycles as if the recording ended there.
    ///
    /// # Errors
    /// [`CyclesError`]: the cycles are not steady, or no process could be identified from one of them.
    pub fn of(signals: &Signals<'_>, count: usize) -> Result<Self, CyclesError> {
        Self::by(signals, count, last_cycle)
    }

    /// The same by another method.
    ///
    /// # Errors
    /// [`CyclesError`]: the cycles are not steady, or the method identifies no process from one of them.
    pub fn by(
        signals: &Signals<'_>,
        count: usize,
        method: impl Fn(&Signals<'_>) -> Result<Soiptd, String>,
    ) -> Result<Self, CyclesError> {
        let oscillation = find_oscillation(signals, count).map_err(CyclesError::Oscillation)?;
        let mut found = Vec::with_capacity(count);
        for later in (0..count).rev() {
            let cut_s = oscillation.end_s - (later as f64 - BEHIND) * oscillation.period_s;
            let points = signals.time_s.partition_point(|&time_s| time_s < cut_s);
            let before = Signals {
                time_s: &signals.time_s[..points],
                input: &signals.input[..points],
                output: &signals.output[..points],
                ..*signals
            };
            let process = method(&before).map_err(CyclesError::Cycle)?;
            found.push(Reference::new(&process)?);
        }
        let from_s = oscillation.end_s - count as f64 * oscillation.period_s;
        Ok(Self {
            range_s: (from_s, oscillation.end_s),
            found,
        })
    }

    /// `J_ij`: cost of the controller of cycle `i` on the process of cycle `j`.
    #[must_use]
    pub fn cross(&self) -> Vec<Vec<Deterioration>> {
        let row = |own: &Reference| {
            let cost = |other: &Reference| other.deterioration(own.optimum.pd);
            self.found.iter().map(cost).collect()
        };
        self.found.iter().map(row).collect()
    }

    /// The largest `J_ij` off the diagonal, as a fraction; infinite if one loop is unstable.
    #[must_use]
    pub fn largest(&self) -> f64 {
        let mut largest = 0.0_f64;
        for (i, row) in self.cross().iter().enumerate() {
            for (_, cost) in row.iter().enumerate().filter(|(j, _)| *j != i) {
                largest = largest.max(cost.relative().unwrap_or(f64::INFINITY));
            }
        }
        largest
    }
}

/// The process of the last cycle, if it has a controller.
fn last_cycle(signals: &Signals<'_>) -> Result<Soiptd, String> {
    let paper = Specification::paper().with_phase_margin_rad(PHASE_MARGIN_DEG.to_radians());
    let options = Options::default()
        .cycles(1)
        .method(Method::Map)
        .specification(paper);
    let identified = identify(signals, &options).outcome;
    let identified = identified.map_err(|verdict| verdict.to_string())?;
    let pd = identified.design.and_then(|design| design.controller.pd());
    pd.ok_or("there is no PD controller")?;
    Ok(identified.model.soiptd().ok_or("no fit")?)
}
