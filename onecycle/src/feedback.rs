//! Recordings of a closed loop with their set-point: from the input as it is, or from the part of it that the set-point
//! caused.

use onecycle_identify::progress::part;
use onecycle_identify::{
    Caused, Evidence, Excitation, Identification, Identified, Innovations, Options, Remark,
    Signals, Verdict, caused_by_set_point, contradicts_set_point, identify_by,
    identify_by_set_point,
};
use onecycle_link::Recording;
use onecycle_onboard::pack::Pack;

/// Share of the time of the fit to the input as it is.
const DIRECT: f64 = 0.5;
/// Standard deviation of the output below which a flight is calm: rate (3 deg/s), angle (1 deg), climb rate.
const CALM: [(&str, f64); 3] = [("rad/s", 0.05), ("rad", 0.0175), ("m/s", 0.05)];
/// Share of the output's variance that the set-point has to cause for a fit to the part of the input that it caused. In calm
/// flight it is a few hundredths.
const LEAST_SHARE: f64 = 0.3;
/// Share of the output's variance that the set-point has to cause for a fit to the response to it. A set-point of an outer loop
/// follows what else moves the output, so it is no instrument unless it causes nearly everything: in three flights with
/// manoeuvres it caused 93 to 100 %.
const LEAST_OF_RESPONSE: f64 = 0.8;
/// Largest autocorrelation of the innovations, and share of them that the past input explains, up to which the fit to the
/// input as it is stands.
const CLEAN: (f64, f64) = (0.1, 0.02);
/// F statistic of the past input in the innovations that chance exceeds once in a hundred recordings.
const CHANCE_F: f64 = 1.88;
/// Steady output for a unit set-point from which the output follows the set-point.
const LEAST_GAIN: f64 = 0.5;
/// Explained share of the prediction below which the fit to that part is refused, unless the fit to the input as it is
/// confirms it.
const LEAST_PREDICTED: f64 = 0.7;
/// Relative difference of their responses up to which one fit confirms the other. Feedback of noise draws a fit to the input
/// towards `-1/C`, with opposite sign, and not one to the part that the set-point caused.
const CONFIRMED: f64 = 0.1;
/// Explained share of the prediction from which a fit to the input as it is stands in any case.
const BEYOND_DOUBT: f64 = 0.98;

/// Verdict on a flight that was too calm for any conclusion: so small movements pass friction, dead zones and the steps of
/// the actuator, which larger ones do not notice. A flight log states its units; other recordings are not judged.
pub(crate) fn calm(recording: &Recording, signals: &Signals<'_>) -> Option<Verdict> {
    if !recording.is_of_a_flight_log() {
        return None;
    }
    let unit = recording.columns().output.unit.as_deref();
    let least = CALM.iter().find(|(own, _)| Some(*own) == unit)?.1;
    let count = signals.output.len() as f64;
    let mean = signals.output.iter().sum::<f64>() / count;
    let square: f64 = signals.output.iter().map(|y| (y - mean).powi(2)).sum();
    let deviation = (square / count).sqrt();
    (deviation < least).then_some(Verdict::Calm { deviation, least })
}

/// Identifies the process from a closed loop with its set-point.
///
/// Where the set-point explains little of the output, noise went round the loop, and the recording tells of the controller
/// rather than of the process: it is refused, unless a fit predicts nearly everything, as with a test signal that is added
/// to the input. Else the fit to the input as it is stands if its innovations are white and owe nothing to the past input.
/// Otherwise noise came back through the controller, and the part of the input that the set-point caused takes its place.
/// If that has no fit either, or one whose innovations are not clean or that the response to the set-point contradicts,
/// the response itself is fitted.
pub(crate) fn identify(
    signals: &Signals<'_>,
    set_point: &[f64],
    (options, pack): (&Options, Option<&Pack<'_>>),
) -> Identification {
    let options = &options.under_feedback();
    let mut direct = part(0.0..DIRECT, || identify_by(signals, options, pack));
    let caused = caused_by_set_point(signals, set_point);
    let share = share_of(caused.as_ref());
    let Some(caused) = caused.filter(|_| share >= LEAST_SHARE) else {
        if direct.outcome.is_ok() && explained(&direct) < BEYOND_DOUBT {
            direct.outcome = Err(Verdict::NotExcited { share });
        }
        return direct;
    };
    let is_contradicted = |found: &Identification| {
        let model = found
            .outcome
            .as_ref()
            .ok()
            .map(|identified| identified.model);
        let contradicts =
            model.and_then(|model| contradicts_set_point(signals, set_point, options, &model));
        contradicts == Some(true)
    };
    let recorded = match &direct.excitation {
        Some(Excitation::Recorded(recorded)) => Some(*recorded),
        _ => None,
    };
    let found = in_two_stages(signals, &caused, direct, (options, pack));
    let stands = found.outcome.is_ok() && !is_contradicted(&found);
    if share < LEAST_OF_RESPONSE || stands && is_clean(&found) {
        return found;
    }
    let by_spectra = identify_by_set_point(signals, set_point, options, recorded);
    match (&found.outcome, &by_spectra.outcome) {
        // What the response lacks is the better advice.
        (Err(_), Err(Verdict::NoInformation { .. } | Verdict::TooUncertain)) => by_spectra,
        (Err(_), Err(_)) => found,
        (Ok(_), Err(_)) if stands => found,
        (Ok(one), Ok(other)) if stands && agree(one, other) => found,
        _ => by_spectra,
    }
}

/// Identifies the process from the response to the set-point alone. `None` if the set-point is no instrument.
pub(crate) fn identify_response(
    signals: &Signals<'_>,
    set_point: &[f64],
    options: &Options,
) -> Option<Identification> {
    let share = share_of(caused_by_set_point(signals, set_point).as_ref());
    let options = &options.under_feedback();
    let found = || identify_by_set_point(signals, set_point, options, None);
    (share >= LEAST_OF_RESPONSE).then(found)
}

/// Share of the output's variance that the set-point causes, if the output follows it.
fn share_of(caused: Option<&Caused>) -> f64 {
    let following = caused.filter(|caused| caused.output_gain >= LEAST_GAIN);
    following.map_or(0.0, |caused| caused.output_share)
}

/// The fit to the input as it is, `direct`, or to the part of it that the set-point caused.
fn in_two_stages(
    signals: &Signals<'_>,
    caused: &Caused,
    direct: Identification,
    (options, pack): (&Options, Option<&Pack<'_>>),
) -> Identification {
    if is_clean(&direct) {
        return direct;
    }
    let projected = Signals {
        input: &caused.input,
        ..*signals
    };
    let mut found = part(DIRECT..1.0, || identify_by(&projected, options, pack));
    if found.outcome.is_err() && explained(&direct) > BEYOND_DOUBT {
        return direct;
    }
    // Noise that came back is part of what disturbs the process now: a fit that predicts little of the rest found nothing.
    // A record whose end is calm gives little to predict, so it is not refused if both fits found the same process.
    let weak = evidence(&found)
        .and_then(|evidence| evidence.prediction.as_ref())
        .filter(|prediction| prediction.explained < LEAST_PREDICTED && !confirm(&direct, &found))
        .map(|prediction| Verdict::NoPrediction {
            explained: prediction.explained,
            horizon_s: prediction.horizon_s,
        });
    if let Some(verdict) = weak {
        found.outcome = Err(verdict);
    }
    let share = caused.share;
    found.remarks.insert(0, Remark::TwoStage { share });
    found
}

/// Whether the intervals of both gains overlap.
fn agree(one: &Identified, other: &Identified) -> bool {
    let gains = one.effectiveness().zip(other.effectiveness());
    gains.is_some_and(|(one, other)| one[0] <= other[2] && other[0] <= one[2])
}

/// Whether both found the same response in the middle of the frequencies that tell the second its gain.
fn confirm(one: &Identification, other: &Identification) -> bool {
    let (Ok(one), Ok(model), Some(Excitation::Recorded(recorded))) =
        (&one.outcome, &other.outcome, &other.excitation)
    else {
        return false;
    };
    let Some((low, high)) = recorded.informative_rad_per_s else {
        return false;
    };
    let middle_rad_per_s = (low * high).sqrt();
    let [one, other] = [one, model].map(|found| found.model.frequency_response(middle_rad_per_s));
    (one - other).norm() < CONFIRMED * other.norm()
}

fn evidence(found: &Identification) -> Option<&Innovations> {
    match &found.outcome.as_ref().ok()?.fit.evidence {
        Evidence::Innovations(innovations) => Some(innovations),
        _ => None,
    }
}

fn is_clean(found: &Identification) -> bool {
    evidence(found).is_some_and(|evidence| {
        let tests = &evidence.whiteness;
        let chance = 3.5 / (tests.rows as f64).sqrt();
        tests.autocorrelation < CLEAN.0.max(chance)
            && (tests.input_share < CLEAN.1 || tests.input_f < CHANCE_F)
    })
}

/// Share of the variance of the last third that a fit to the first two predicts.
fn explained(found: &Identification) -> f64 {
    let prediction = evidence(found).and_then(|evidence| evidence.prediction.as_ref());
    prediction.map_or(0.0, |prediction| prediction.explained)
}
