//! Cycles of one run, each identified separately, and the cost of each one's controller on the
//! processes of all others: the paper's Table VII.

use onecycle_plant::Trace;

use super::{Answer, Contender, Judge, Seen};
use crate::experiments::signals_of;
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_design::soiptd_pd::optimum::OptimumError;
use onecycle_identify::{Signals, Verdict, find_oscillation};

/// Why cycles cannot be identified one by one.
#[derive(Clone, Debug, thiserror::Error)]
pub enum CyclesError {
    /// The recording has too few steady cycles.
    #[error("{0}")]
    Oscillation(Verdict),
    /// No process could be identified from one of the cycles.
    #[error("a cycle cannot be identified: {0}")]
    Cycle(String),
    /// A process has no controller.
    #[error(transparent)]
    Optimum(#[from] OptimumError),
}

/// The last cycles of a recording, each identified separately.
#[derive(Clone, Debug)]
pub struct Cycles {
    /// Start of the first cycle and end of the last one (s).
    pub range_s: (f64, f64),
    /// For each cycle the answer, and the reference for others on its process.
    pub answers: Vec<(Answer, Judge)>,
}

/// Where the recording is cut, in periods after the end of a cycle: far from that end and from the next
/// one.
const BEHIND: f64 = 0.25;

impl Cycles {
    /// Identifies each of the last `count` cycles as if the recording ended there.
    ///
    /// # Errors
    /// [`CyclesError`]: the cycles are not steady, or no process could be identified from one of them.
    pub fn of(trace: &Trace, sample_s: f64, count: usize) -> Result<Self, CyclesError> {
        Self::by(trace, sample_s, count, |signals| {
            Contender::OneCycle(1).answer(&Seen::of(*signals))
        })
    }

    /// The same by another method.
    ///
    /// # Errors
    /// [`CyclesError`]: the cycles are not steady, or the method identifies no process from one of them.
    pub fn by(
        trace: &Trace,
        sample_s: f64,
        count: usize,
        method: impl Fn(&Signals<'_>) -> Result<Answer, String>,
    ) -> Result<Self, CyclesError> {
        let signals = signals_of(trace, sample_s);
        let found = find_oscillation(&signals, count).map_err(CyclesError::Oscillation)?;
        let mut answers = Vec::with_capacity(count);
        for later in (0..count).rev() {
            let cut_s = found.end_s - (later as f64 - BEHIND) * found.period_s;
            let points = trace.time_s.partition_point(|&time_s| time_s < cut_s);
            let before = Signals {
                time_s: &trace.time_s[..points],
                input: &trace.input[..points],
                output: &trace.output[..points],
                ..signals
            };
            let answer = method(&before).map_err(CyclesError::Cycle)?;
            let process = answer
                .process
                .ok_or_else(|| CyclesError::Cycle("no fit".to_owned()))?;
            answers.push((Answer::of_process(process)?, Judge::new(&process)?));
        }
        let from_s = found.end_s - count as f64 * found.period_s;
        Ok(Self {
            range_s: (from_s, found.end_s),
            answers,
        })
    }

    /// `J_ij`: cost of the controller of cycle `i` on the process of cycle `j`.
    #[must_use]
    pub fn cross(&self) -> Vec<Vec<Deterioration>> {
        let row = |(answer, _): &(Answer, Judge)| {
            let cost = |(_, judge): &(Answer, Judge)| judge.deterioration(answer.feedback);
            self.answers.iter().map(cost).collect()
        };
        self.answers.iter().map(row).collect()
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
