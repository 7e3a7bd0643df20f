//! Which estimator a recording takes.
//!
//! ```text
//! a steady relay oscillation                     that of the board (relay); a short fit by the general one checks it
//! the same, but with an error of the model,      both; the general one replaces it if its innovations owe nothing to the input and no
//! with a stretch refused, or contradicted        controller is lost
//! by the check
//! anything else                                  the general one (innovations)
//! ```

use onecycle_design::{Model, Parameter, Structure, margins};
use onecycle_onboard::pack::Pack;

use crate::amplitude::{self, Parts};
use crate::checks;
use crate::innovations::{self, Hold};
use crate::outcome::{Identification, Identified};
use crate::relay;
use crate::remark::Remark;
use crate::settings::{Method, Options, Road};
use crate::signals::{Signals, range};
use crate::verdict::Verdict;

/// F statistic of the past input in the innovations up to which a fit owes nothing to the input: chance exceeds it once in a
/// hundred records.
const MOST_INPUT_F: f64 = 1.88;
/// Misfit of a fit that leaves nothing worth mentioning.
const EXACT: f64 = 0.003;
/// Distance (rad) of a phase margin from its interval beyond which the general estimator has found another process. In
/// 34 recordings of relay tests without disturbances the distance is zero.
const ANOTHER_MARGIN_RAD: f64 = 0.0175;

pub(crate) fn identify(
    signals: &Signals<'_>,
    options: &Options,
    pack: Option<&Pack<'_>>,
) -> Identification {
    let earlier = (options.input_late_s)
        .filter(|late_s| *late_s != 0.0)
        .map(|late_s| signals.input_earlier(late_s));
    let corrected = Signals {
        input: earlier.as_deref().unwrap_or(signals.input),
        ..*signals
    };
    let is_whole = options.span_s == (None, None);
    match amplitude::parts(corrected.input).filter(|_| is_whole) {
        Some(parts) => at_two_amplitudes(&corrected, options, pack, &parts),
        None => checked(&corrected, options, pack),
    }
}

/// Least sample period (s): the clocks of a record are compared to the nanosecond.
const LEAST_SAMPLE_S: f64 = 1e-9;

fn checked(signals: &Signals<'_>, options: &Options, pack: Option<&Pack<'_>>) -> Identification {
    if signals.sample_period_s < LEAST_SAMPLE_S {
        return Identification {
            excitation: None,
            outcome: Err(Verdict::Units),
            refused: None,
            switching: None,
            amplitudes: None,
            remarks: vec![],
        };
    }
    let mut found = by_road(signals, options, pack);
    checks::check(signals, options, pack, &mut found);
    found
}

/// The process that the first amplitude shows, compared with that of the second one; or that of the part that shows one.
fn at_two_amplitudes(
    signals: &Signals<'_>,
    options: &Options,
    pack: Option<&Pack<'_>>,
    parts: &Parts,
) -> Identification {
    let mut breaks = [vec![], vec![]];
    let [early, late] = &mut breaks;
    let first = checked(&signals.part(0..parts.second, early), options, pack);
    let second = checked(
        &signals.part(parts.second..signals.input.len(), late),
        options,
        pack,
    );
    let (mut kept, other) = if first.outcome.is_ok() || second.outcome.is_err() {
        (first, second)
    } else {
        (second, first)
    };
    match (&kept.outcome, &other.outcome) {
        (Ok(one), Ok(another)) => {
            let compared = amplitude::compare(parts.amplitudes, one, another);
            kept.amplitudes = compared;
            if let Some(compared) = compared {
                kept.remarks
                    .retain(|remark| *remark != Remark::OneAmplitude);
                if compared.is_alike {
                    kept.remarks.push(Remark::JumpsOnly);
                } else {
                    kept.refuse(Verdict::AmplitudeDependent(compared));
                }
            }
        }
        (Ok(_), Err(verdict)) => {
            let verdict = Box::new(verdict.clone());
            kept.remarks.push(Remark::OtherAmplitudeRefused(verdict));
        }
        _ => {}
    }
    kept
}

fn by_road(signals: &Signals<'_>, options: &Options, pack: Option<&Pack<'_>>) -> Identification {
    match road(options) {
        Road::Relay => relay::identify(signals, options, pack),
        Road::General => innovations::identify(signals, options),
        Road::Automatic => automatic(signals, options, pack),
    }
}

/// The road that `options` leave: the relay's estimator knows one structure and the whole recording, and the methods
/// without a fit or without a pack are its own.
fn road(options: &Options) -> Road {
    let is_relays = matches!(options.structure, None | Some(Structure::Soiptd))
        && options.span_s == (None, None)
        && options.hold != Some(Hold::Interpolated)
        && options.input_before.is_none();
    match options.road {
        Road::Automatic if !is_relays => Road::General,
        Road::Automatic if options.method != Method::Map => Road::Relay,
        road => road,
    }
}

fn automatic(signals: &Signals<'_>, options: &Options, pack: Option<&Pack<'_>>) -> Identification {
    let steady = relay::identify(signals, options, pack);
    match &steady.outcome {
        Ok(found) => match doubt(signals, options, &steady, found) {
            Some(doubt) => settle(steady, innovations::identify(signals, options), doubt),
            None => steady,
        },
        Err(verdict) if is_final(verdict, signals) => steady,
        Err(verdict) => {
            let mut general = innovations::identify(signals, options);
            let is_oscillation = steady.excitation.is_some() && !settles(signals);
            let tells_more = match (verdict, &general.outcome) {
                (
                    Verdict::ConstantInput | Verdict::NotSteady { .. } | Verdict::Saturated { .. },
                    Err(_),
                ) => true,
                // Complex poles explain a limit cycle that the input does not drive.
                (Verdict::NotSteady { .. }, Ok(found)) => {
                    is_oscillating(&found.model) && !owes_nothing(&general)
                }
                _ => false,
            };
            if tells_more || is_oscillation && !explains_a_relay(&general) {
                return steady;
            }
            if general.outcome.is_ok() && verdict.kind() != "no_relay" {
                let verdict = Box::new(verdict.clone());
                general.remarks.push(Remark::NotASteadyOscillation(verdict));
            }
            general
        }
    }
}

/// Whether no estimator can do better: the request cannot be met, the columns are swapped, or the output is clipped.
fn is_final(verdict: &Verdict, signals: &Signals<'_>) -> bool {
    match verdict {
        Verdict::NoController(_) | Verdict::Units | Verdict::ConstantOutput => true,
        Verdict::NoRelay { output_is_relay } => *output_is_relay && is_held(signals.output),
        Verdict::Saturated { .. } => !settles(signals),
        _ => false,
    }
}

/// Whether the output has settled where the input changes its level, as in a square wave of steps: it hardly moves there, and it
/// came to rest slowly, in three of four waves. That of a relay's oscillation moves at its fastest, and a clipped one stops at once.
fn settles(signals: &Signals<'_>) -> bool {
    const PART: f64 = 1.0 / 15.0;
    const AT_REST: f64 = 0.03;
    const SLOW: f64 = 0.25;
    let changes: Vec<usize> = (1..signals.input.len())
        .filter(|k| signals.input[*k] != signals.input[*k - 1])
        .collect();
    let settled = |pair: &[usize]| {
        let half = &signals.output[pair[0]..pair[1]];
        let part = (PART * half.len() as f64) as usize;
        let (low, high) = range(half);
        let means: Vec<f64> = half
            .chunks_exact(part.max(1))
            .map(|of| of.iter().sum::<f64>() / of.len() as f64)
            .collect();
        let steps: Vec<f64> = means
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).abs())
            .collect();
        let band = AT_REST * (high - low);
        let moving = steps.iter().rposition(|step| *step >= band)?;
        let fastest = range(&steps).1;
        let is_settled = moving + 1 < steps.len() && steps[moving] < SLOW * fastest;
        (part > 0).then_some(is_settled)
    };
    let settled: Vec<bool> = changes.windows(2).filter_map(settled).collect();
    4 * settled.iter().filter(|settled| **settled).count() > 3 * settled.len()
}

/// Whether a signal mostly repeats its value exactly, as a command does that is held and a measurement does not.
fn is_held(signal: &[f64]) -> bool {
    let repeated = signal.windows(2).filter(|pair| pair[0] == pair[1]).count();
    2 * repeated > signal.len()
}

/// A reason to try the general estimator although that of steady oscillations accepts a recording.
#[derive(Clone, Copy)]
enum Doubt {
    /// A stretch with this misfit was refused, and another one used.
    Disturbed(f64),
    /// Some of the oscillation is left unexplained.
    Misfit,
    /// A process that comes to rest by itself explains the whole recording better.
    Structure,
    /// The same structure, fitted to the whole recording, leaves the controller this phase margin (rad; `None` if
    /// unstable), which is not the one expected.
    Margin(Option<f64>),
    /// The whole recording asks for a nonlinear force, in whose place the steady cycles show a linear damping, and with it the
    /// controller has another phase margin.
    Nonlinear,
}

fn doubt(
    signals: &Signals<'_>,
    options: &Options,
    steady: &Identification,
    found: &Identified,
) -> Option<Doubt> {
    let unexplained = steady.remarks.iter().find_map(|remark| match remark {
        Remark::Disturbed(misfit) => Some(Doubt::Disturbed(*misfit)),
        Remark::Misfit(_) => Some(Doubt::Misfit),
        _ => None,
    });
    if unexplained.is_some() {
        return unexplained;
    }
    let period_s = steady.oscillation()?.period_s;
    let whole = innovations::check(signals, options, &found.model.linear(), period_s)?;
    if whole.is_another {
        return Some(Doubt::Structure);
    }
    let controller = found.design?.controller;
    let expected = found.phase_margin_rad?;
    let margin_of = |model| margins(model, &controller).map(|margins| margins.phase_margin_rad);
    let is_expected = |margin: Option<f64>| {
        margin.is_some_and(|margin| {
            margin > expected.low.unwrap_or(f64::NEG_INFINITY) - ANOTHER_MARGIN_RAD
                && margin < expected.high.unwrap_or(f64::INFINITY) + ANOTHER_MARGIN_RAD
        })
    };
    let margin = margin_of(&whole.model);
    if !is_expected(margin) {
        return Some(Doubt::Margin(margin));
    }
    let with_forces = whole.with_forces?;
    (!is_expected(margin_of(&with_forces))).then_some(Doubt::Nonlinear)
}

/// The general result if its innovations are white, or if a stretch was refused, and no controller is lost; else that of
/// the steady oscillation.
fn settle(mut steady: Identification, mut general: Identification, doubt: Doubt) -> Identification {
    let is_better = match doubt {
        Doubt::Nonlinear => is_nonlinear(&general),
        Doubt::Structure => explains_a_relay(&general) && !is_of_the_family(&general),
        Doubt::Disturbed(_) | Doubt::Misfit | Doubt::Margin(_) => explains_a_relay(&general),
    };
    let is_replaced = is_better && has_controller(&general) >= has_controller(&steady);
    let remark = match doubt {
        Doubt::Misfit | Doubt::Disturbed(_) | Doubt::Nonlinear | Doubt::Structure
            if !is_replaced =>
        {
            return steady;
        }
        Doubt::Disturbed(misfit) => {
            Remark::NotASteadyOscillation(Box::new(Verdict::NotThisProcess { misfit }))
        }
        Doubt::Misfit | Doubt::Nonlinear | Doubt::Structure => {
            let found = steady.outcome.as_ref();
            Remark::RelayReplaced(found.map_or(0.0, |found| found.fit.misfit))
        }
        Doubt::Margin(phase_margin_rad) => Remark::GeneralDisagrees {
            phase_margin_rad,
            is_replaced,
        },
    };
    let kept = if is_replaced {
        &mut general
    } else {
        &mut steady
    };
    kept.remarks.push(remark);
    if is_replaced { general } else { steady }
}

/// Whether the general estimator explains a steady oscillation: its innovations owe nothing to the input, it predicts better than
/// the mean of the output does, and its process does not oscillate on its own. At hardly more than one frequency a pair of complex
/// poles explains a limit cycle that the input does not even drive; so does a disturbance, which predicts nothing.
fn explains_a_relay(general: &Identification) -> bool {
    let model = general.outcome.as_ref().ok().map(|found| &found.model);
    owes_nothing(general) && predicts(general) && !model.is_some_and(is_oscillating)
}

fn predicts(general: &Identification) -> bool {
    let found = general.outcome.as_ref().ok();
    let innovations = found.and_then(|found| found.fit.innovations());
    let prediction = innovations.and_then(|of| of.prediction.as_ref());
    prediction.is_none_or(|prediction| prediction.explained > 0.0)
}

/// Whether the past input explains nothing of what a model leaves. Of 270 relay recordings of 47 kinds, this tells those of a
/// wrong kind from right ones with an area under the ROC curve of 0.97; whiteness and prediction do with 0.45 to 0.6. What it
/// explains hardly beyond chance is no reason to doubt a prediction that is as good as the disturbances allow.
fn owes_nothing(general: &Identification) -> bool {
    let Ok(found) = &general.outcome else {
        return false;
    };
    // Without noise nothing is white: what is left are the digits of the file.
    let is_exact = found.fit.misfit < EXACT;
    let innovations = found.fit.innovations();
    is_exact
        || innovations.is_some_and(|found| {
            let prediction = found.prediction.as_ref();
            let is_well_predicted = prediction.is_some_and(innovations::is_as_expected);
            let tests = &found.whiteness;
            tests.input_f < MOST_INPUT_F
                || is_well_predicted && !innovations::is_left_to_the_input(tests)
        })
}

/// Whether the process has complex poles.
fn is_oscillating(model: &Model) -> bool {
    let zeta = model.parameter(Parameter::Zeta);
    zeta.is_some_and(|zeta| zeta < 1.0)
}

/// Whether the structure is that of the relay's estimator or a limit of it.
fn is_of_the_family(general: &Identification) -> bool {
    let structure = (general.outcome.as_ref().ok()).map(|found| found.model.structure());
    structure.is_some_and(|structure| structure.stages().integrators > 0)
}

/// Whether the model has a nonlinear force.
fn is_nonlinear(found: &Identification) -> bool {
    let is_force = |remark: &Remark| matches!(remark, Remark::Nonlinear(_));
    found.outcome.is_ok() && found.remarks.iter().any(is_force)
}

fn has_controller(found: &Identification) -> bool {
    (found.outcome.as_ref()).is_ok_and(|identified| identified.design.is_some())
}
