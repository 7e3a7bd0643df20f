//! Verdicts: why no process was identified.

use std::fmt;

use onecycle_design::{DesignError, Parameter};
use onecycle_onboard::refine::DomainEdge;

use crate::two_amplitudes::TwoAmplitudes;

/// Reason why no process was identified.
///
/// `Display` writes one clause that says what is wrong, without a capital and without a full stop. Advice is left to
/// the program that shows it. Programs compare [`Verdict::kind`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Verdict {
    /// The input never changes.
    ConstantInput,
    /// The output never changes.
    ConstantOutput,
    /// The largest magnitude of the input or the output is outside 1e-100 to 1e100, where squares overflow or vanish, or the
    /// sample period is below a nanosecond, to which times are compared.
    Units,
    /// The input changes, but not between two levels.
    NoRelay {
        /// Whether the output switches between two levels: the columns are probably swapped.
        output_is_relay: bool,
    },
    /// The input changes its level a few times, then stays at one value.
    FewSwitches {
        /// Number of changes between levels that are held.
        switches: usize,
    },
    /// Too few usable cycles: none, a single one in a recording with gaps, or two or three that are not alike.
    TooShort {
        /// Number of complete cycles.
        cycles: usize,
    },
    /// The oscillation is not steady: the cycles differ too much from each other.
    NotSteady {
        /// Number of complete cycles.
        cycles: usize,
        /// Length of the longest run of cycles that are alike.
        alike: usize,
        /// Length that such a run must have.
        needed: usize,
    },
    /// The cycles have too few samples.
    TooCoarse {
        /// Number of samples in the cycles.
        points: usize,
    },
    /// The output is clipped.
    Saturated {
        /// Share of the time that the output spends at its limit.
        part: f64,
    },
    /// The best fit leaves too much of the oscillation unexplained.
    NotThisProcess {
        /// Root mean square of the residual in excess of the noise, divided by that of the oscillation.
        misfit: f64,
    },
    /// No process of the pack's family explains the last cycle.
    Unknown {
        /// Misfit score, whose limit is 1. `None` without a pack, or if the pack returns no estimate.
        score: Option<f64>,
    },
    /// The controller is unstable on some processes within the intervals.
    TooUncertain,
    /// The best fit lies on a limit of the search domain of the estimator.
    EdgeOfDomain(DomainEdge),
    /// The output does not follow the input.
    NoFit,
    /// The record has too few rows for the unknowns of the structure.
    TooFewRows {
        /// Number of rows: samples, or sums of samples.
        rows: usize,
        /// Number needed.
        needed: usize,
    },
    /// The input did not excite the process enough to tell a parameter.
    NoInformation {
        /// The parameter that the record does not tell.
        parameter: Parameter,
        /// Its relative standard deviation. `None` if it is not finite.
        deviation: Option<f64>,
        /// Band of frequencies (rad/s) with the central 90 % of the information on the gain.
        informative_rad_per_s: Option<(f64, f64)>,
        /// Frequency (rad/s) up to which an excitation would tell the lags and the dead time.
        needed_rad_per_s: f64,
    },
    /// Of two dead times half a period apart, with gains of opposite signs, neither is told from the other.
    SignNotTold,
    /// The best fit lies on a bound of this parameter.
    AtBound(Parameter),
    /// The model does not predict data that it was not fitted to.
    NoPrediction {
        /// Share of the variance explained.
        explained: f64,
        /// Time ahead (s).
        horizon_s: f64,
    },
    /// The past input explains much of what the model did not predict: the process is of another kind.
    InputLeft {
        /// Share of the innovations' variance.
        share: f64,
    },
    /// Later inputs explain much of what the model did not predict: the input was logged late.
    OutputLeads {
        /// Share of the innovations' variance.
        share: f64,
    },
    /// The input follows the output within a sample: what the recording tells is the controller.
    OfController,
    /// Only a process that oscillates by itself explains the recording, whose input has hardly more than one frequency: it may not
    /// drive the oscillation.
    NotDriven,
    /// The model calls the loop unstable under the gains that were in force while it was recorded.
    UnstableInForce,
    /// The process is unstable without the controller that ran. [`Options::unstable`](crate::Options::unstable) fits it.
    UnstableProcess {
        /// Rate (1/s) at which the output grows by itself.
        growth_per_s: f64,
    },
    /// An unstable process was asked for, and no output grows by itself.
    NothingGrows,
    /// The input follows the output: noise came back through the controller, and the set-point hardly moved the input.
    NotExcited {
        /// Share of the output's variance that the set-point explains.
        share: f64,
    },
    /// No structure explains the response of the output to the set-point of a closed loop.
    SetPointLeft {
        /// Mean square of its errors over what noise explains.
        ratio: f64,
    },
    /// The output moved too little for any conclusion, as in calm flight.
    Calm {
        /// Standard deviation of the output (output unit).
        deviation: f64,
        /// The least that is accepted (output unit).
        least: f64,
    },
    /// The relay did not switch as one of its `beta` does: input and output are not on one clock, or the relay is another.
    ClockOffset {
        /// Ratio at which the relay switches in the recording.
        seen: f64,
        /// `beta` of the relay.
        beta: f64,
        /// Time by which the input was logged late (s), negative if it was logged early. `None` if no offset explains the
        /// switches.
        late_s: Option<f64>,
    },
    /// At another amplitude of the relay the process is another.
    AmplitudeDependent(TwoAmplitudes),
    /// A process was identified, but no controller meets the specification.
    NoController(DesignError),
}

impl Verdict {
    /// Name for programs: `verdict.kind` in JSON. Related variants share a name.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::ConstantInput | Self::NoRelay { .. } | Self::FewSwitches { .. } => "no_relay",
            Self::ConstantOutput => "no_response",
            Self::Units => "unusable_units",
            Self::TooShort { .. } | Self::TooCoarse { .. } | Self::TooFewRows { .. } => "too_short",
            Self::NoInformation { .. } | Self::SignNotTold => "no_information",
            Self::NotSteady { .. } => "not_steady",
            Self::Saturated { .. } => "saturated",
            Self::NotThisProcess { .. }
            | Self::NoFit
            | Self::NoPrediction { .. }
            | Self::InputLeft { .. }
            | Self::SetPointLeft { .. }
            | Self::NotDriven
            | Self::UnstableInForce
            | Self::UnstableProcess { .. }
            | Self::NothingGrows => "not_this_process",
            Self::NotExcited { .. } | Self::Calm { .. } | Self::OfController => "not_excited",
            Self::Unknown { .. } => "unknown",
            Self::TooUncertain => "too_uncertain",
            Self::EdgeOfDomain(_) | Self::AtBound(_) => "edge_of_domain",
            Self::ClockOffset { .. } | Self::OutputLeads { .. } => "clock_offset",
            Self::AmplitudeDependent(_) => "amplitude_dependent",
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
            Self::Units => f.write_str(
                "unusable units: a largest magnitude outside 1e-100 to 1e100, or a sample period below 1 ns",
            ),
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
            | Self::ClockOffset { .. }
            | Self::AmplitudeDependent(_)
            | Self::NoController(_) => self.write_model(f),
            Self::TooFewRows { .. }
            | Self::NoInformation { .. }
            | Self::SignNotTold
            | Self::AtBound(_)
            | Self::NoPrediction { .. }
            | Self::SetPointLeft { .. }
            | Self::NotDriven
            | Self::UnstableInForce
            | Self::UnstableProcess { .. }
            | Self::NothingGrows
            | Self::InputLeft { .. } => self.write_record(f),
            Self::NotExcited { .. }
            | Self::Calm { .. }
            | Self::OutputLeads { .. }
            | Self::OfController => self.write_excitation(f),
        }
    }
}

impl Verdict {
    /// Whether a fit that comes less near to the noise of the recording may be believed.
    pub(crate) fn is_of_fit(&self) -> bool {
        matches!(
            self,
            Self::NoInformation { .. }
                | Self::AtBound(_)
                | Self::NoPrediction { .. }
                | Self::InputLeft { .. }
        )
    }

    /// Clause of a verdict on the input.
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

    /// Clause of a verdict on the oscillation.
    fn write_oscillation(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort { cycles: 0 } => f.write_str(
                "too short: no complete cycle of the relay, from a rise to the next rise or from a fall to the next \
                 fall",
            ),
            Self::TooShort { cycles: 1 } => {
                f.write_str("too short: one complete cycle of the relay in a recording with gaps")
            }
            Self::TooShort { cycles } => write!(
                f,
                "too short: {cycles} complete cycles of the relay, which differ in period or amplitude"
            ),
            // The least number is that of the estimator.
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
                "no steady oscillation: at most {alike} of {cycles} cycles in a row are alike, and {needed} are needed"
            ),
            Self::Saturated { part } => write!(
                f,
                "saturated: the output stays at one exact limit for {:.0} % of the time",
                100.0 * part
            ),
            _ => f.write_str(self.kind()),
        }
    }

    /// Clause of a verdict of the likelihood.
    fn write_record(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewRows { rows, needed } => write!(
                f,
                "too short: {rows} samples can be used, and at least {needed} are needed"
            ),
            Self::NoInformation {
                parameter,
                deviation: Some(deviation),
                ..
            } if *deviation < 1.0 => write!(
                f,
                "no information: the standard deviation of {} is {:.0} % of its value",
                gain_or(*parameter),
                100.0 * deviation
            ),
            Self::NoInformation { parameter, .. } => write!(
                f,
                "no information: the recording does not tell {}",
                gain_or(*parameter)
            ),
            Self::SignNotTold => f.write_str(
                "no information: the gain may have either sign, with half a period of the input more or less dead time",
            ),
            Self::AtBound(parameter) => write!(
                f,
                "at the edge of the domain: the best fit has {} at a bound of the search",
                parameter.symbol()
            ),
            Self::NoPrediction {
                explained,
                horizon_s,
            } => write!(
                f,
                "not this kind of process: a model of the first two thirds predicts {:.0} % of the variance of the \
                 last third, {horizon_s:.3} s ahead",
                100.0 * explained.max(0.0)
            ),
            Self::NotDriven => f.write_str(
                "not this kind of process: only a process that oscillates by itself explains the recording, and a relay does not \
                 tell such a one from a limit cycle that it does not drive",
            ),
            Self::UnstableInForce => f.write_str(
                "not this kind of process: with this model the gains that were in force would have been unstable",
            ),
            Self::UnstableProcess { growth_per_s } => write!(
                f,
                "unstable without its controller: the output grows by itself with a time constant of {:.3} s",
                1.0 / growth_per_s
            ),
            Self::NothingGrows => f.write_str(
                "not this kind of process: nothing in the recording grows by itself, as an unstable process does",
            ),
            Self::SetPointLeft { ratio } => write!(
                f,
                "not this kind of process: no structure explains how the output follows the set-point; the mean square \
                 of the errors is {ratio:.1} times that of the noise"
            ),
            Self::InputLeft { share } => write!(
                f,
                "not this kind of process: more than chance would, the past input explains {:.2} % of what the model did \
                 not predict",
                100.0 * share
            ),
            _ => f.write_str(self.kind()),
        }
    }

    /// Clause of a verdict on what moved the input.
    fn write_excitation(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutputLeads { share } => write!(
                f,
                "the output moves before the input: later inputs explain {:.0} % of what the model did not predict",
                100.0 * share
            ),
            Self::OfController => f.write_str(
                "not excited: the input follows the output within a sample, so the recording tells the controller and not the process",
            ),
            Self::Calm { deviation, least } => write!(
                f,
                "not excited: the standard deviation of the output is {deviation:.3}, and less than {least} tells nothing"
            ),
            Self::NotExcited { share } => write!(
                f,
                "not excited: the set-point explains {:.0} % of the output, and the input follows the rest through the \
                 controller",
                100.0 * share
            ),
            _ => f.write_str(self.kind()),
        }
    }

    /// Clause of a verdict on the fit or the controller.
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
                f.write_str("unknown: there is no estimate from the last cycle")
            }
            Self::TooUncertain => f.write_str(
                "too uncertain: the controller is unstable on some processes within the intervals",
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
            Self::ClockOffset { seen, beta, late_s } => {
                write!(
                    f,
                    "not on one clock: a relay with beta {beta:.2} made this recording, but it switches as one with beta \
                     {seen:.2}"
                )?;
                let Some(late_s) = late_s else {
                    return Ok(());
                };
                let column = if *late_s >= 0.0 { "input" } else { "output" };
                let (late, unit) = match late_s.abs() {
                    late_s @ 1.0.. => (late_s, "s"),
                    late_s => (1e3 * late_s, "ms"),
                };
                write!(
                    f,
                    ", as if the {column} had been logged {late:.1} {unit} late"
                )
            }
            Self::AmplitudeDependent(found) => write!(
                f,
                "the gain depends on the amplitude: between relay amplitudes of {:.3} and {:.3} it changes by {:.0} %, and \
                 the phase by {:.0} deg",
                found.amplitudes[0],
                found.amplitudes[1],
                100.0 * (found.gain_ratio - 1.0).abs(),
                found.phase_rad.to_degrees().abs()
            ),
            Self::NoController(error) => write!(f, "no controller: {error}"),
            _ => f.write_str(self.kind()),
        }
    }
}

/// A gain is called that: whether it is `K` or `K/T` depends on the structure.
fn gain_or(parameter: Parameter) -> &'static str {
    match parameter {
        Parameter::K | Parameter::KOverTBody => "the gain",
        other => other.symbol(),
    }
}
