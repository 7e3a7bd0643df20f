//! Reasons of a refusal.

use core::fmt;

use crate::refine::DomainEdge;

/// Why a cycle led to no controller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Refusal {
    /// The last cycle has no signature: the output is constant or samples are missing.
    NoSignature,
    /// No process of the pack's family explains the last cycle: its misfit score (limit 1).
    Unknown(f64),
    /// No process fits the window.
    NoFit,
    /// The fit leaves this part of the oscillation unexplained.
    Misfit(f64),
    /// The best fit lies on a limit of the domain.
    Edge(DomainEdge),
    /// The pack has no lead table, or its table has no gains for the process.
    NoGains,
    /// The phase margin is too uncertain: margin and standard deviation (rad).
    TooUncertain(f64, f64),
    /// The process depends on the amplitude of the relay: its gain at the smaller amplitude over that at the larger one.
    AmplitudeDependent(f64),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSignature => write!(f, "the last cycle is constant or lacks samples"),
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
            Self::Edge(_) => write!(f, "the best fit lies on a limit of the domain"),
            Self::NoGains => write!(f, "the lead table has no gains for the process"),
            Self::TooUncertain(margin, sigma) => write!(
                f,
                "the phase margin is too uncertain: {:.0} degrees with a standard deviation of {:.0}",
                margin.to_degrees(),
                sigma.to_degrees()
            ),
            Self::AmplitudeDependent(ratio) => write!(
                f,
                "the gain at the smaller amplitude is {ratio:.2} times that at the larger one"
            ),
        }
    }
}
