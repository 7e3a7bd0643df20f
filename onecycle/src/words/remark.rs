//! What a remark means.

use crate::{About, DesignError, Identification, Interval, Parameter, Remark, Structure};
use onecycle_identify::Nonlinear;

use super::{caution, controllers, listed};
use crate::words::number::{bounded, percent, seconds, significant};

/// Heading of the remarks that are reasons to suspect the result.
pub const REASONS: &str = "Remarks";

/// Remarks on a result that are reasons to suspect it, each with one or two sentences, with the options of this program.
pub fn reasons(found: &Identification) -> Vec<(&Remark, String)> {
    told(found, |about| about == About::Recording)
}

/// All other remarks, in the same form.
pub fn details(found: &Identification) -> Vec<(&Remark, String)> {
    told(found, |about| about != About::Recording)
}

fn told(found: &Identification, is_wanted: impl Fn(About) -> bool) -> Vec<(&Remark, String)> {
    let of = Of {
        // One cycle of an input that switches may be a step test.
        is_relay: (found.oscillation()).is_some_and(|oscillation| oscillation.cycles_steady > 1),
        structure: (found.outcome.as_ref().ok()).map(|identified| identified.model.structure()),
    };
    let wanted = (found.remarks.iter()).filter(|remark| is_wanted(remark.about()));
    let told = wanted.map(|remark| (remark, sentence(remark, of)));
    told.collect()
}

/// What a remark is on.
#[derive(Clone, Copy)]
struct Of {
    /// Whether the cycles of a relay oscillation were found.
    is_relay: bool,
    structure: Option<Structure>,
}

/// Sentences of all remarks, with a heading for each thing that they are about.
pub fn grouped(found: &Identification) -> Vec<(&'static str, Vec<String>)> {
    let group = |about: About| {
        let of_group = told(found, |other| other == about).into_iter();
        let sentences: Vec<String> = of_group.map(|(_, sentence)| sentence).collect();
        let heading = match about {
            About::Result => "How this was found, and how well",
            About::Test => "What this test does not show",
            About::Controller => "What the controller asks for",
            _ => REASONS,
        };
        (!sentences.is_empty()).then_some((heading, sentences))
    };
    About::ALL.into_iter().filter_map(group).collect()
}

/// One or two sentences.
fn sentence(remark: &Remark, of: Of) -> String {
    of_recording(remark)
        .or_else(|| of_record(remark))
        .or_else(|| of_estimator(remark))
        .or_else(|| of_interval(remark, of))
        .or_else(|| of_result(remark))
        .or_else(|| caution::sentence(remark))
        .unwrap_or_else(|| format!("{}.", remark.kind()))
}

fn of_recording(remark: &Remark) -> Option<String> {
    Some(match *remark {
        Remark::Jitter(share) => format!(
            "The samples were not taken at the times of their stamps: the output scatters more where it is steep, as if \
             they jittered by {:.0} % of the sample period. Log the time of each sample.",
            100.0 * share
        ),
        Remark::Disturbed(part) => format!(
            "With more cycles {:.1} % of the oscillation stays unexplained, as after a gust or a changing bias: only \
             the cycles named above were fitted.",
            100.0 * part
        ),
        Remark::Unknown(score) => format!(
            "The last cycle does not look like a process of the pack's family (misfit score {score:.2}, limit 1). \
             Possible causes: another beta of the relay, a resonance, friction, a wrong sensor, a disturbance. The \
             fit was made without the pack; trust it less."
        ),
        Remark::Unread => "The pack cannot read the last cycle: it was made for another relay or for processes of \
                           other shapes, or the cycle has too few samples. The fit was made without the pack."
            .to_owned(),
        Remark::OneCycle { is_known } => {
            let rest = if is_known {
                "The pack knows it as a cycle of a steady oscillation, so the input a period earlier is taken to be \
                 the same."
            } else {
                "Record two cycles that are alike."
            };
            format!(
                "The recording holds one complete cycle: nothing in it confirms that the oscillation is steady. \
                 {rest}"
            )
        }
        Remark::OutputFilter { delay_s } => format!(
            "The output passed a known low-pass filter. The fit took it out; its delay of {} is part of tau.",
            seconds(delay_s)
        ),
        Remark::TwoStage { share } => format!(
            "Noise came back through the controller. The fit used the part of the input that the set-point caused \
             ({:.0} % of its variance); the noise below includes the effect of the rest.",
            100.0 * share
        ),
        Remark::BySetPoint {
            segments,
            band_rad_per_s: (low, high),
        } => format!(
            "No fit to the input explained the recording. The process was found from what its input and output have in \
             common with the set-point, from {} to {} Hz, over {segments} short segments.",
            significant(low / std::f64::consts::TAU),
            significant(high / std::f64::consts::TAU)
        ),
        Remark::FewCycles { used } => format!(
            "Only {used} steady cycles could be used; more cycles would narrow the intervals."
        ),
        Remark::Noisy(part) => format!(
            "The noise is {:.0} % of the amplitude; a larger relay amplitude would help.",
            100.0 * part
        ),
        Remark::Biased(part) => format!(
            "The relay works against a bias of {:.0} % of its amplitude. Trim the bias away or raise the amplitude: \
             at 100 % the relay cannot turn the output round.",
            100.0 * part
        ),
        Remark::Coarse(samples) => {
            format!("There are only {samples:.0} samples a cycle; record at a higher rate if you can.")
        }
        _ => return None,
    })
}

/// Remarks of the likelihood on the data.
fn of_record(remark: &Remark) -> Option<String> {
    Some(match *remark {
        Remark::Absent(part) => format!(
            "{} of the outputs were left out: lost, stale or outliers.",
            percent(part)
        ),
        Remark::PartUsed(part) => format!(
            "Only the longest part without a gap was used, {:.0} % of the recording. Choose another part with `from` \
             and `to`.",
            100.0 * part
        ),
        Remark::Interpolated(difference) => format!(
            "The input runs in straight lines between the samples, which explains the recording better than a held \
             input (log-likelihood higher by {difference:.1}). If the recording has every sample of the loop, use `hold=held`: the dead time changes by up to half a sample period."
        ),
        Remark::WeakPrediction {
            explained,
            horizon_s,
        } => format!(
            "A model of the first two thirds predicts {:.0} % of the variance of the last third, {horizon_s:.3} s ahead. \
             Possible causes: strong disturbances, a process that changes, a saturated actuator.",
            100.0 * explained.max(0.0)
        ),
        Remark::DriftOrGain => "Slow drift and gain cannot be told apart: a fit without drift explains more of the \
             recording than drift that has nothing to do with the input can hide. Gain and lags are those of that fit, and the \
             intervals hold both. A recording with several levels of the input, each held until the output settles, \
             tells them apart."
            .to_owned(),
        Remark::AssumedRest => "The input never changes. The fit assumes that it was 0 before the first row, with the process \
             at rest: state another value with `input_before`."
            .to_owned(),
        Remark::RestBeforeStep => "The few rows before the step do not tell whether the process was at rest, which is assumed: \
             record longer before a step."
            .to_owned(),
        Remark::Coloured(autocorrelation) => format!(
            "What the model did not predict is not white noise (largest autocorrelation {autocorrelation:.2}): the \
             intervals are widened for it."
        ),
        Remark::ModelError(share) => format!(
            "The process does more than a model of low order: none explains the recording to its noise. Gain and lags are \
             those of the fit that comes nearest where errors of {:.0} % of the movement of the output count as noise.",
            100.0 * share
        ),
        Remark::InputLeft(share) => format!(
            "The past input explains {:.1} % of what the model did not predict: the process has more than the model, \
             such as a resonance, friction or a saturation. Try another structure with `structure`.",
            100.0 * share
        ),
        _ => return None,
    })
}

/// Remarks on the choice of the structure.
fn of_estimator(remark: &Remark) -> Option<String> {
    Some(match remark {
        Remark::Nonlinear(forces) => nonlinear(forces),
        Remark::OtherStructures(structures) => {
            let names: Vec<&str> = structures
                .iter()
                .map(|structure| structure.name())
                .collect();
            let (noun, verb) = match names.len() {
                1 => ("structure", "explains"),
                _ => ("structures", "explain"),
            };
            format!(
                "The {noun} {} {verb} the recording nearly as well. An input with more frequencies would tell; \
                 `structure` fixes the choice.",
                listed(&names)
            )
        }
        Remark::PriorDropped(distance) => format!(
            "The recording contradicts the prior of the pack, which would move the fit by {:.1} standard deviations of \
             the residual: the fit was made without it. Choose a pack for processes of this kind with `pack`.",
            distance.max(0.0).sqrt()
        ),
        Remark::NoController(error) => without_controller(error),
        _ => return None,
    })
}

/// Nonlinear forces: what they mean for the controller.
fn nonlinear(forces: &Nonlinear) -> String {
    let drag = forces.drag.map(|c| {
        let c = significant(c);
        format!("a drag of {c} times the square of the rate")
    });
    let friction = forces.friction.map(|c| {
        let c = significant(c);
        format!("a dry friction that takes an input of {c} to overcome")
    });
    let thrust = forces.thrust.map(|c| {
        let (c, middle) = (significant(c), significant(forces.middle));
        format!("a thrust of {c} times the square of the lagged input less its mean, {middle}")
    });
    let found: Vec<String> = [drag, friction, thrust].into_iter().flatten().collect();
    let advice = if forces.friction.is_some() {
        "Friction may keep the loop from settling: an integral term then hunts."
    } else {
        "They hold for small movements. Repeat the test at another amplitude to confirm this."
    };
    format!(
        "Beside its linear parts the process has {}. The controller is designed for the linear parts. {advice}",
        found.join(" and ")
    )
}

fn without_controller(error: &DesignError) -> String {
    let advice = controllers::advice(error);
    format!(
        "No controller was designed: {error}. The model and its intervals are valid. {}",
        super::sentence(&advice)
    )
}

/// Remarks on intervals, with the way to narrower ones.
fn of_interval(remark: &Remark, of: Of) -> Option<String> {
    let (longer, more) = if of.is_relay {
        (
            "use more cycles",
            "use more cycles or a larger relay amplitude",
        )
    } else {
        ("record longer", "record longer or excite the process more")
    };
    let name = |parameter: Parameter| match of.structure {
        Some(structure) => parameter.symbol_in(structure),
        None => parameter.symbol(),
    };
    Some(match *remark {
        Remark::Weak {
            parameter: Parameter::TBody,
            relative_half_width,
        } => format!(
            "{} is known to about {:.0} % only. The controller depends on {}, which is known better.",
            name(Parameter::TBody),
            100.0 * relative_half_width,
            name(Parameter::KOverTBody)
        ),
        Remark::Weak {
            parameter,
            relative_half_width,
        } => format!(
            "{} is known to about {:.0} % only; {more}.",
            name(parameter),
            100.0 * relative_half_width
        ),
        Remark::MarginMayBeLess(margin_rad) => format!(
            "Within the intervals the phase margin may be as low as {:.1} deg; {}, or ask for a larger margin with \
             `phase_margin` or `style=calm`.",
            margin_rad.to_degrees(),
            longer
        ),
        _ => return None,
    })
}

fn of_result(remark: &Remark) -> Option<String> {
    Some(match *remark {
        Remark::NegativeGain => {
            "The gain is negative: the output falls when the input rises. The controller's gains \
                                 have the same sign."
                .to_owned()
        }
        Remark::DampingNotSeen(above_s) => {
            let bound = above_s.map_or("T_body has no bound".to_owned(), |above_s| {
                format!("T_body is above {above_s:.2} s and has no upper bound")
            });
            format!(
                "The damping is hardly visible: {bound}, and so K has no upper bound. The controller depends on \
                 K/T_body, which is known."
            )
        }
        Remark::Unstable(growth_s) => format!(
            "Without its controller the output grows by itself, by a factor of 2.7 in {}: the time constant of such a pole is \
             written as a negative one. Do not switch the controller off, and change its gains in small steps.",
            seconds(growth_s)
        ),
        Remark::EqualLags { ref lags, mean_s } => equal_lags(lags, mean_s),
        Remark::WeakDelay { low_s, high_s } if low_s <= 0.0 => {
            format!("The delay is only known to be below {}.", seconds(high_s))
        }
        Remark::WeakDelay { low_s, high_s } => format!(
            "The delay is only known to lie between {} and {}.",
            seconds(low_s),
            seconds(high_s)
        ),
        Remark::Misfit(part) => format!(
            "The model leaves {:.1} % of the oscillation unexplained beyond the noise; the intervals are widened for \
             it.",
            100.0 * part
        ),
        _ => return None,
    })
}

fn equal_lags(lags: &[Parameter], mean_s: Interval) -> String {
    let (number, many) = match lags.len() {
        2 => ("Two", "double"),
        _ => ("Three", "triple"),
    };
    format!(
        "{number} lags cannot be told from one {many} lag of {} s ({} .. {}).",
        mean_s.estimate.map_or("infinite".to_owned(), significant),
        bounded(mean_s.low),
        bounded(mean_s.high)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on(is_relay: bool) -> Of {
        Of {
            is_relay,
            structure: Some(Structure::Soptd),
        }
    }

    // The text of the reports is checked as a whole for relay tests; here what the likelihood adds.
    #[test]
    fn every_remark_on_a_record_has_a_sentence() {
        let remarks = [
            Remark::OtherStructures(vec![Structure::Soptd, Structure::ResonantLag]),
            Remark::Coloured(0.31),
            Remark::InputLeft(0.024),
            Remark::ModelError(0.01),
            Remark::WeakPrediction {
                explained: -0.2,
                horizon_s: 0.5,
            },
            Remark::DriftOrGain,
            Remark::AssumedRest,
            Remark::RestBeforeStep,
            Remark::Absent(0.013),
            Remark::PartUsed(0.61),
            Remark::Interpolated(12.0),
            Remark::PriorDropped(25.0),
            Remark::NoController(DesignError::Structure(Structure::Foptd)),
        ];
        let all = remarks.map(|remark| (sentence(&remark, on(false)), remark.kind()));
        for (sentence, kind) in &all {
            assert!(sentence.ends_with('.') && sentence.len() > 40, "{sentence}");
            assert!(!sentence.starts_with(kind), "{sentence}");
        }
        let with = |words: &str| all.iter().any(|(sentence, _)| sentence.contains(words));
        assert!(with("structures soptd and resonant_lag explain"));
        // Squared distance 25: 5 standard deviations.
        assert!(with("by 5.0 standard deviations"));
        // Worse than the mean predicts nothing.
        assert!(with(
            "predicts 0 % of the variance of the last third, 0.500 s ahead"
        ));
    }

    // A chirp has no cycles to add.
    #[test]
    fn the_way_to_narrower_intervals_is_that_of_the_recording() {
        let weak = Remark::Weak {
            parameter: Parameter::TProp,
            relative_half_width: 0.5,
        };
        assert!(
            sentence(&weak, on(true)).ends_with("use more cycles or a larger relay amplitude.")
        );
        assert!(sentence(&weak, on(false)).ends_with("record longer or excite the process more."));
        // As the table of parameters calls it.
        assert!(sentence(&weak, on(false)).starts_with("T2 is known to about 50 %"));
        let margin = Remark::MarginMayBeLess(0.1);
        assert!(sentence(&margin, on(true)).contains("; use more cycles, or ask"));
        assert!(sentence(&margin, on(false)).contains("; record longer, or ask"));
    }
}
