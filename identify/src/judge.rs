//! What is made of a recording.
//!
//! ```text
//! cycles or a method without them asked for      the estimator of the board: the last cycles of a steady relay oscillation
//! anything else                                  one objective: the likelihood of all samples (innovations)
//! ```
//!
//! A relay's oscillation has hardly more than one frequency, at which much explains what the input does not drive, so the
//! likelihood is believed there only if it leaves nothing to the input, predicts, and has no complex poles.

use onecycle_design::{Model, Parameter};
use onecycle_onboard::pack::Pack;

use crate::amplitude::{self, Parts};
use crate::checks;
use crate::innovations;
use crate::outcome::Identification;
use crate::relay;
use crate::remark::Remark;
use crate::settings::Options;
use crate::signals::{Signals, is_constant, range};
use crate::thresholds::{LEAST_SAMPLE_S, MOST_INPUT_F};
use crate::verdict::Verdict;

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

fn checked(signals: &Signals<'_>, options: &Options, pack: Option<&Pack<'_>>) -> Identification {
    if signals.sample_period_s < LEAST_SAMPLE_S {
        return Identification::refused(Verdict::Units);
    }
    let mut found = estimated(signals, options, pack);
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

fn estimated(signals: &Signals<'_>, options: &Options, pack: Option<&Pack<'_>>) -> Identification {
    match options.of_cycles() {
        Some(cycles) => relay::identify(signals, (options, cycles), pack),
        None => judged(&shown(signals, &mut vec![]), options),
    }
}

/// The rows without a last one in which an input changes that never did before: no output shows what comes of it.
fn shown<'a>(signals: &'a Signals<'_>, breaks: &'a mut Vec<usize>) -> Signals<'a> {
    let all = signals.input.len();
    let last = all.saturating_sub(1);
    let is_first_change = is_constant(&signals.input[..last]) && !is_constant(signals.input);
    signals.part(0..if is_first_change { last } else { all }, breaks)
}

/// The fit of the likelihood, as far as it can be believed.
fn judged(signals: &Signals<'_>, options: &Options) -> Identification {
    let mut breaks = vec![];
    let used = signals.within(options.span_s, &mut breaks);
    // A flight log is no relay test, whatever its input looks like.
    let steady = match options.is_under_way {
        true => None,
        false => Some(relay::steady(&used)),
    };
    // Nor is a test signal of two levels, whose waves may all be different.
    let steady = steady.filter(|found| match found {
        Err(verdict) if is_of_oscillation(verdict) => innovations::input_follows(signals, options),
        _ => true,
    });
    let final_verdict = match &steady {
        Some(Err(verdict)) if is_final(verdict, &used) => Some(verdict.clone()),
        _ => None,
    };
    if let Some(verdict) = final_verdict {
        return Identification::refused(verdict);
    }
    let is_relay = steady.as_ref().is_some_and(|found| match found {
        Ok(_) => !settles(&used),
        Err(verdict) => is_of_oscillation(verdict),
    });
    let sign = is_relay.then(|| relay::sign_of_gain(&used));
    let mut found = innovations::identify(signals, options, sign);
    // Who states that the process is unstable knows that a controller holds it, which may be a relay.
    match steady.filter(|_| !options.is_unstable) {
        Some(Ok(oscillation)) if is_relay => {
            found.steady = Some(oscillation);
            // Who states the structure knows the process: the remarks say what it leaves.
            let doubted = options.structure.is_none().then(|| unexplained(&found));
            if let Some(verdict) = doubted.flatten() {
                found.refuse(verdict);
            }
        }
        // An input is no relay, but changes, if one row is at another level, or all are at another than before the first.
        Some(Err(Verdict::ConstantInput)) if !options.assumes_rest(used.input) => {}
        Some(Err(
            verdict @ (Verdict::ConstantInput
            | Verdict::NotSteady { .. }
            | Verdict::Saturated { .. }),
        )) if found.outcome.is_err() => found.outcome = Err(verdict),
        // Complex poles explain a limit cycle that the input does not drive.
        Some(Err(verdict @ Verdict::NotSteady { .. }))
            if is_oscillating(&found) && !owes_nothing(&found) =>
        {
            found.refuse(verdict);
        }
        _ => {}
    }
    found
}

/// Whether a relay oscillates, though not so that its cycles are alike and whole.
fn is_of_oscillation(verdict: &Verdict) -> bool {
    matches!(
        verdict,
        Verdict::NotSteady { .. } | Verdict::Saturated { .. }
    )
}

/// Whether no estimator can do better: the columns are swapped, or the output is clipped.
fn is_final(verdict: &Verdict, signals: &Signals<'_>) -> bool {
    match verdict {
        Verdict::Units | Verdict::ConstantOutput => true,
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

/// Why a fit does not explain a steady oscillation. At hardly more than one frequency a pair of complex poles explains a limit
/// cycle that the input does not even drive; so does a disturbance, which predicts nothing.
fn unexplained(found: &Identification) -> Option<Verdict> {
    let innovations = found.outcome.as_ref().ok()?.fit.innovations()?;
    let unpredicted = (innovations.prediction.as_ref()).filter(|of| of.explained <= 0.0);
    if !owes_nothing(found) {
        return Some(Verdict::InputLeft {
            share: innovations.whiteness.input_share,
        });
    }
    match unpredicted {
        Some(of) => Some(Verdict::NoPrediction {
            explained: of.explained,
            horizon_s: of.horizon_s,
        }),
        None if is_oscillating(found) => Some(Verdict::NotDriven),
        None => None,
    }
}

/// Whether the past input explains nothing of what a model leaves. Of 270 relay recordings of 47 kinds, this tells those of a
/// wrong kind from right ones with an area under the ROC curve of 0.97; whiteness and prediction do with 0.45 to 0.6. What it
/// explains hardly beyond chance is no reason to doubt a prediction that is as good as the disturbances allow.
fn owes_nothing(found: &Identification) -> bool {
    let Ok(found) = &found.outcome else {
        return false;
    };
    found.fit.innovations().is_some_and(|found| {
        let prediction = found.prediction.as_ref();
        let is_well_predicted = prediction.is_some_and(innovations::is_as_expected);
        let tests = &found.whiteness;
        // In more rows an error is certain that no controller feels.
        let share = (innovations::ROWS as f64 / tests.rows as f64).min(1.0);
        share * tests.input_f < MOST_INPUT_F
            || is_well_predicted && !innovations::is_left_to_the_input(tests)
    })
}

/// Whether the process has complex poles.
fn is_oscillating(found: &Identification) -> bool {
    let zeta = |model: &Model| model.parameter(Parameter::Zeta);
    (found.outcome.as_ref().ok())
        .and_then(|found| zeta(&found.model))
        .is_some_and(|zeta| zeta < 1.0)
}
