//! Why no process was identified.

use std::fmt;

use onecycle_design::DesignError;
use onecycle_onboard::refine::DomainEdge;

/// A refusal: the facts behind it. It displays as one clause that says what was seen; what to do about it is for the
/// program that shows it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Verdict {
    /// The input is the same throughout.
    ConstantInput,
    /// The output is the same throughout.
    ConstantOutput,
    /// Values so large or small that their squares overflow or vanish.
    Units,
    /// The input changes, but not between two levels.
    NoRelay {
        /// Whether the output does: the columns are swapped.
        output_is_relay: bool,
    },
    /// The input changes its level a few times, then stays where it is.
    FewSwitches {
        /// Number of changes between levels that are held.
        switches: usize,
    },
    /// Too few usable cycles: none, one in a recording with gaps, or two or three that are not all alike.
    TooShort {
        /// Number of complete cycles.
        cycles: usize,
    },
    /// The cycles differ too much from each other.
    NotSteady {
        /// Number of complete cycles.
        cycles: usize,
        /// Length of the longest run of cycles that are alike.
        alike: usize,
        /// Length that such a run must have.
        needed: usize,
    },
    /// Too few samples in the cycles.
    TooCoarse {
        /// Number of samples.
        points: usize,
    },
    /// The output is clipped.
    Saturated {
        /// Share of the time that it spends at its limit.
        part: f64,
    },
    /// The fit leaves too much unexplained.
    NotThisProcess {
        /// Root mean square of the residual beyond the noise, over that of the oscillation.
        misfit: f64,
    },
    /// No process of the pack's family explains the last cycle.
    Unknown {
        /// Misfit score of the best one, with limit 1; `None` where the pack has no answer.
        score: Option<f64>,
    },
    /// The intervals hold processes on which the controller is unstable.
    TooUncertain,
    /// The best fit lies on a limit of the estimator's domain.
    EdgeOfDomain(DomainEdge),
    /// The output does not follow the input.
    NoFit,
    /// The process was found, but has no controller within the specification.
    NoController(DesignError),
}

impl Verdict {
    /// Fixed name for programs: `verdict.kind` in JSON.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::ConstantInput | Self::NoRelay { .. } | Self::FewSwitches { .. } => "no_relay",
            Self::ConstantOutput => "no_response",
            Self::Units => "unusable_units",
            Self::TooShort { .. } | Self::TooCoarse { .. } => "too_short",
            Self::NotSteady { .. } => "not_steady",
            Self::Saturated { .. } => "saturated",
            Self::NotThisProcess { .. } | Self::NoFit => "not_this_process",
            Self::Unknown { .. } => "unknown",
            Self::TooUncertain => "too_uncertain",
            Self::EdgeOfDomain(_) => "edge_of_domain",
            Self::NoController(_) => "no_controller",
        }
    }
}

impl std::error::Error for Verdict {}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ConstantInput => f.write_str("no relay in the input: it never changes"),
            Self::ConstantOutput => f.write_str("no response: the output never changes"),
            Self::Units => f.write_str("the values are too large or too small to compute with"),
            Self::NoRelay { .. } | Self::FewSwitches { .. } => self.write_input(f),
            Self::TooShort { .. }
            | Self::TooCoarse { .. }
            | Self::NotSteady { .. }
            | Self::Saturated { .. } => self.write_oscillation(f),
            Self::NotThisProcess { .. }
            | Self::Unknown { .. }
            | Self::TooUncertain
            | Self::EdgeOfDomain(_)
            | Self::NoFit
            | Self::NoController(_) => self.write_model(f),
        }
    }
}

/// The clauses, by what they are about.
impl Verdict {
    fn write_input(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewSwitches { switches } => {
                let times = if *switches == 1 { "time" } else { "times" };
                write!(
                    f,
                    "no relay in the input: it switches {switches} {times} and then stays at one value"
                )
            }
            Self::NoRelay {
                output_is_relay: true,
            } => f.write_str(
                "no relay in the input: it does not switch between two levels, but the output does",
            ),
            _ => f.write_str("no relay in the input: it does not switch between two levels"),
        }
    }

    fn write_oscillation(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort { cycles: 0 } => f.write_str(
                "too short: the relay has no complete cycle, from one switch to the next but one",
            ),
            Self::TooShort { cycles: 1 } => {
                f.write_str("too short: one complete cycle of the relay, and gaps in the recording")
            }
            Self::TooShort { cycles } => write!(
                f,
                "too short: {cycles} complete cycles of the relay, which are not alike"
            ),
            Self::TooCoarse { points } => write!(
                f,
                "too short: the cycles hold {points} samples, and at least 16 are needed"
            ),
            Self::NotSteady {
                cycles,
                alike,
                needed,
            } => write!(
                f,
                "no steady oscillation: of {cycles} cycles at most {alike} in a row are alike, and {needed} are needed"
            ),
            Self::Saturated { part } => write!(
                f,
                "saturated: the output stays at one exact limit for {:.0} % of the time",
                100.0 * part
            ),
            _ => f.write_str(self.kind()),
        }
    }

    fn write_model(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotThisProcess { misfit } => write!(
                f,
                "not this kind of process: the best fit leaves {:.1} % of the oscillation unexplained, far above the \
                 noise",
                100.0 * misfit
            ),
            Self::Unknown { score: Some(score) } => write!(
                f,
                "unknown: no process of the pack's family explains the last cycle (misfit score {score:.1}, limit 1)"
            ),
            Self::Unknown { score: None } => {
                f.write_str("unknown: the pack cannot read the last cycle")
            }
            Self::TooUncertain => f.write_str(
                "too uncertain: the intervals hold processes on which the controller is unstable",
            ),
            Self::EdgeOfDomain(edge) => write!(
                f,
                "at the edge of the domain: the best fit has {}",
                match edge {
                    DomainEdge::SlowLags => "lags as slow as the oscillation allows",
                    DomainEdge::FastLag => "an actuator lag too fast to be seen",
                    DomainEdge::LongDelay => "a delay as long as the oscillation allows",
                }
            ),
            Self::NoFit => {
                f.write_str("not this kind of process: the output does not follow the input")
            }
            Self::NoController(error) => write!(f, "no controller: {error}"),
            _ => f.write_str(self.kind()),
        }
    }
}
