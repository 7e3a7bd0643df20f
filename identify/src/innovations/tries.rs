//! Fits of one record, one after the other, until one can be believed.

use std::cell::LazyCell;
use std::f64::consts::FRAC_PI_2;

use super::before_fit::{first_answer_s, mirrored_s, moves_before_answer};
use super::identify_to;
use super::prepare::FLOOR;
use crate::excitation::Excitation;
use crate::outcome::{Identification, Identified, Refused};
use crate::remark::Remark;
use crate::settings::Options;
use crate::signals::{Signals, begins_with_a_step};
use crate::thresholds::BELIEVED_LESS;
use crate::verdict::Verdict;

/// Why a first fit is not believed.
#[derive(Clone, Copy, PartialEq)]
enum Doubt {
    /// It is refused for what it leaves, does not predict or does not tell.
    Fit,
    /// The feedback of a relay tells the other sign of the gain.
    Sign,
    /// The output answers the first change of the input before its dead time is over.
    Start,
    /// Its dead time is not told from a shorter one with the other sign of the gain.
    DeadTime,
}

/// Identifies the process from a record of any input: as near to its samples as their noise allows, or as near as a model of low order
/// comes; with the shorter of two dead times that explain it, or with that of the `sign` of the gain which the feedback of a relay tells:
/// zero if it hardly does, `None` without a relay.
pub(crate) fn identify(
    signals: &Signals<'_>,
    options: &Options,
    sign: Option<f64>,
) -> Identification {
    let mut found = identify_to(FLOOR, f64::INFINITY, signals, options);
    if found.outcome.is_err() && !options.is_under_way && options.input_before.is_none() {
        found = from_rest(signals, options).unwrap_or(found);
    }
    let answer_s = LazyCell::new(|| first_answer_s(signals, options).unwrap_or(f64::INFINITY));
    let has_sign = |of: &Identified| sign.is_none_or(|sign| sign * of.model.linear().gain() >= 0.0);
    let is_longer = |of: &Identified, tau_s: f64| of.model.linear().tau_s() > tau_s;
    let doubt = match &found.outcome {
        // The parts of a flight log are many, and another one may be better.
        _ if options.is_under_way => return found,
        Err(verdict) if verdict.is_of_fit() => Doubt::Fit,
        Ok(of) if !has_sign(of) => Doubt::Sign,
        Ok(of) if sign.is_none() && is_longer(of, *answer_s) => Doubt::Start,
        Ok(of) if sign.is_none() && is_longer(of, told_tau_s(&found)) => Doubt::DeadTime,
        _ => return found,
    };
    let longest_tau_s = told_tau_s(&found).min(*answer_s);
    let tries: &[f64] = match doubt {
        Doubt::Fit => &[BELIEVED_LESS],
        _ => &[FLOOR, BELIEVED_LESS],
    };
    for &believed in tries {
        let mut other = identify_to(believed, longest_tau_s, signals, options);
        let is_nearly = believed > FLOOR;
        let is_enough = doubt == Doubt::Start && !is_nearly || is_beyond_doubt(&other);
        if is_enough && other.outcome.as_ref().is_ok_and(has_sign) {
            if is_nearly {
                other.remarks.push(Remark::ModelError(believed));
            }
            return other;
        }
    }
    let has_two = |of: &Identified| {
        mirrored_s(signals, options).is_some_and(|half_s| is_longer(of, half_s - lags_s(of)))
    };
    match doubt == Doubt::Sign || found.outcome.as_ref().is_ok_and(has_two) {
        true => without_sign(found),
        false => found,
    }
}

/// Fit to a record that begins with a step, from rest: from another state at the start the step may explain nothing, but who records one
/// waits for rest. `None` if the output moves before it answers, or if the fit does not predict well.
fn from_rest(signals: &Signals<'_>, options: &Options) -> Option<Identification> {
    let mut breaks = vec![];
    let used = signals.within(options.span_s, &mut breaks);
    if !begins_with_a_step(used.input) || moves_before_answer(&used, 0.0) {
        return None;
    }
    let at_rest = options.input_before(Some(used.input[0]));
    let mut found = identify_to(FLOOR, f64::INFINITY, signals, &at_rest);
    let moves = |of: &Identified| moves_before_answer(&used, of.model.linear().tau_s());
    if !is_beyond_doubt(&found) || found.outcome.as_ref().is_ok_and(moves) {
        return None;
    }
    found.remarks.push(Remark::RestBeforeStep);
    Some(found)
}

/// Lags (s) of a process. A dead time that is too short by less than them explains nearly as much.
fn lags_s(found: &Identified) -> f64 {
    let process = found.model.linear();
    let body_s = match process.pole_per_s() {
        pole_per_s if pole_per_s > 0.0 => 1.0 / pole_per_s,
        _ => 0.0,
    };
    process.lags_s().iter().sum::<f64>() + body_s
}

/// The refusal of a result whose gain may have the other sign.
fn without_sign(mut found: Identification) -> Identification {
    found.outcome = found.outcome.and_then(|identified| {
        let Identified { model, fit, .. } = identified;
        found.refused = Some(Refused { model, fit });
        Err(Verdict::SignNotTold)
    });
    found
}

/// Longest dead time that is told from a shorter one (s): a quarter of the longest period. In an input of one period, half a period of
/// dead time is the other sign of the gain.
fn told_tau_s(found: &Identification) -> f64 {
    let band = match found.excitation {
        Some(Excitation::Recorded(of)) => of.informative_rad_per_s,
        _ => None,
    };
    band.map_or(f64::INFINITY, |(lowest_rad_per_s, _)| {
        FRAC_PI_2 / lowest_rad_per_s
    })
}

/// Whether the model of another try predicts well, with a dead time that is told.
fn is_beyond_doubt(found: &Identification) -> bool {
    found.outcome.as_ref().is_ok_and(|identified| {
        let prediction = (identified.fit.innovations()).and_then(|fit| fit.prediction);
        prediction.is_some_and(|prediction| prediction.is_good())
            && identified.model.linear().tau_s() <= told_tau_s(found)
    })
}
