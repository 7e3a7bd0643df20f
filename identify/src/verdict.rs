//! Why there is no process: each reason with a sentence of advice.

use std::fmt;

use onecycle_onboard::refine::DomainEdge;

/// A refusal. Displays as what was seen; [`Verdict::advice`] says what to do.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The input is the same throughout.
    ConstantInput,
    /// The output is the same throughout.
    ConstantOutput,
    /// Values so large or small that their squares cannot be computed.
    Units,
    /// The input changes, but not between two levels.
    NoRelay {
        /// Whether the output does: the columns are swapped.
        output_is_relay: bool,
    },
    /// No complete cycle, one among gaps, or two or three that are not all alike.
    TooShort {
        /// Complete cycles that there are.
        cycles: usize,
    },
    /// The cycles differ too much from each other.
    NotSteady {
        /// Complete cycles that there are.
        cycles: usize,
        /// Most consecutive ones that are alike.
        alike: usize,
        /// So many that are alike it takes.
        needed: usize,
    },
    /// Too few samples in the cycles.
    TooCoarse {
        /// Samples that there are.
        points: usize,
    },
    /// The output is clipped.
    Saturated {
        /// Part of the time it is at its limit.
        part: f64,
    },
    /// The fit leaves too much unexplained.
    NotThisProcess {
        /// What it leaves, over the oscillation (root mean squares).
        misfit: f64,
    },
    /// No process of the pack's family explains the last cycle.
    Unknown {
        /// Its score, one being the limit; `None` where the pack has no answer at all.
        score: Option<f64>,
    },
    /// The intervals hold processes on which the controller would be unstable.
    TooUncertain,
    /// The best fit lies on a limit of the domain.
    EdgeOfDomain(DomainEdge),
    /// The output does not follow the input.
    NoFit,
    /// The process was found, but no controller exists for it: why.
    NoController(String),
}

impl Verdict {
    /// A fixed name for programs: the JSON report's `verdict.kind`.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::ConstantInput | Self::NoRelay { .. } => "no_relay",
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

    /// What to do about it, in one sentence.
    #[must_use]
    pub fn advice(&self) -> &'static str {
        match self {
            Self::ConstantInput => {
                "Choose the column that holds the relay's output with --input, or record a relay \
                 test."
            }
            Self::ConstantOutput => {
                "Choose the column that holds the measurement with --output, or check the sensor."
            }
            Self::Units => "Write the recording in other units.",
            Self::NoRelay {
                output_is_relay: true,
            } => {
                "Swap the columns: give the relay's column with --input and the measurement with \
                 --output."
            }
            Self::NoRelay {
                output_is_relay: false,
            } => {
                "Record the relay's own output, before any filter or rate limit, and choose it \
                 with --input."
            }
            Self::TooShort { .. } => "Record at least four cycles of steady oscillation.",
            Self::NotSteady { .. } => {
                "Let the oscillation settle, keep gusts and set-point changes out of the test, or \
                 raise the relay's amplitude above the noise."
            }
            Self::TooCoarse { .. } => {
                "Record at a higher rate: 16 samples a cycle at the least, 50 or more are better."
            }
            Self::Saturated { .. } => {
                "Lower the relay's amplitude or widen the sensor's range, and repeat the test."
            }
            Self::NotThisProcess { .. } => {
                "Look for a resonance, friction, wind or another loop at work: the process is not \
                 an integrator with two lags and a delay."
            }
            Self::Unknown { .. } => {
                "Leave out --method classify, take a pack of this family with --pack, or look for a \
                 resonance, friction or a wrong sensor."
            }
            Self::TooUncertain => {
                "Use more cycles or a larger relay amplitude: too little is known for a controller \
                 that is sure to be stable."
            }
            Self::EdgeOfDomain(DomainEdge::SlowLags) => {
                "Check that the output is a position and not its rate: both lags seem longer than \
                 the period."
            }
            Self::EdgeOfDomain(DomainEdge::FastLag) => {
                "Check that the output is a position and not its rate, and that it is recorded \
                 fast enough: no actuator lag is seen."
            }
            Self::EdgeOfDomain(DomainEdge::LongDelay) => {
                "Check that input and output share one clock: the delay seems longer than half a \
                 period."
            }
            Self::NoFit => "Check the column choice: the output does not follow the input.",
            Self::NoController(_) => "Choose a smaller phase margin with --phase-margin.",
        }
    }
}

/// So few cycles in words.
fn few(cycles: usize) -> String {
    match cycles {
        0 => "no complete cycle of the relay, from one switch to the next but one".to_owned(),
        1 => "a single complete cycle of the relay, the others have gaps".to_owned(),
        _ => format!("{cycles} complete cycles of the relay that are not alike"),
    }
}

impl std::error::Error for Verdict {}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ConstantInput => write!(f, "no relay in the input: it never changes"),
            Self::ConstantOutput => write!(f, "no response: the output never changes"),
            Self::Units => write!(f, "the values are too large or too small to compute with"),
            Self::NoRelay { output_is_relay } => {
                write!(
                    f,
                    "no relay in the input: it does not switch between two levels"
                )?;
                if *output_is_relay {
                    write!(f, ", but the output does")
                } else {
                    Ok(())
                }
            }
            Self::TooShort { cycles } => write!(f, "too short: {}", few(*cycles)),
            Self::NotSteady {
                cycles,
                alike,
                needed,
            } => write!(
                f,
                "no steady oscillation: of {cycles} cycles at most {alike} in a row are alike, where {needed} are \
                 needed"
            ),
            Self::TooCoarse { points } => {
                write!(
                    f,
                    "too short: the cycles hold {points} samples, at least 16 are needed"
                )
            }
            Self::Saturated { part } => write!(
                f,
                "saturated: the output stays at one exact limit for {:.0} % of the time",
                100.0 * part
            ),
            Self::NotThisProcess { misfit } => write!(
                f,
                "not this kind of process: the best fit leaves {:.1} % of the oscillation \
                 unexplained, far above the noise",
                100.0 * misfit
            ),
            Self::Unknown { score: Some(score) } => write!(
                f,
                "unknown: no process of the pack's family explains the last cycle (score {score:.1}, \
                 the limit is 1)"
            ),
            Self::Unknown { score: None } => {
                write!(f, "unknown: there is no pack that reads the last cycle")
            }
            Self::TooUncertain => write!(
                f,
                "too uncertain: the intervals hold processes on which the controller is unstable"
            ),
            Self::EdgeOfDomain(edge) => {
                let what = match edge {
                    DomainEdge::SlowLags => "lags as slow as the oscillation allows",
                    DomainEdge::FastLag => "an actuator lag too fast to be seen",
                    DomainEdge::LongDelay => "a delay as long as the oscillation allows",
                };
                write!(f, "at the edge of the domain: the best fit has {what}")
            }
            Self::NoFit => write!(f, "not this kind of process: no fit at all"),
            Self::NoController(why) => write!(f, "no controller: {why}"),
        }
    }
}
