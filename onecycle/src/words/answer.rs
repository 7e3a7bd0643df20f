//! Sentences of the answer.

use crate::{Comparison, Effect, Felt, Identified, Parameter};
use onecycle_design::Limit;

use crate::results::answer::Advice;
use crate::results::controllers::{Against, Controllers, Source};
use crate::results::log_gains::NamedFiles;
use crate::words::number::{seconds, short};

use super::log_gains::CONTRADICTED;
use super::verdict::advice;
use super::{controllers, sentence};

/// The verdict.
pub fn verdict(of: Advice) -> &'static str {
    match of {
        Advice::Change => "CHANGE",
        Advice::Keep => "KEEP YOURS",
        Advice::FirstGains => "FIRST GAINS",
        Advice::NotYet => "NOT YET",
    }
}

/// The verdict with its reason.
pub fn headline(of: Advice, reason: &str) -> String {
    format!("{}: {}.", verdict(of), reason.trim_end_matches('.'))
}

/// Why gains are changed or kept.
pub fn compared(choice: &Controllers, of: &Comparison) -> String {
    let now = choice.against.as_ref();
    let figures = now.and_then(|now| now.figures);
    match (of.pays(), of.gain(), of.loss()) {
        (true, gain, loss) if of.is_now_fragile => {
            let gain = gain.filter(|_| figures.is_some());
            joined(fragile(now), [gain, loss])
        }
        (true, Some(gain), loss) => match loss {
            Some(loss) => format!("{}, at the price of {}", effect(gain), effect(loss)),
            None => effect(gain),
        },
        (_, Some(gain), Some(loss)) => format!(
            "the proposed gains would bring {}, but {}",
            effect(gain),
            effect(loss)
        ),
        (_, _, Some(loss)) => format!(
            "the proposed gains would bring {} and make nothing better",
            effect(loss)
        ),
        _ => "you would feel no difference with the proposed gains".to_owned(),
    }
}

/// Why gains in force are not to be kept.
fn fragile(now: Option<&Against>) -> String {
    let Some(figures) = now.and_then(|now| now.figures) else {
        return "yours make the loop unstable".to_owned();
    };
    let stable = now.and_then(|now| now.least).map(|least| least.stable);
    match stable.filter(|share| *share < 1.0) {
        Some(share) => format!(
            "yours are stable on {:.0} % of the likely processes only",
            100.0 * share
        ),
        None => format!("yours have little margin, Ms {:.2}", figures.ms),
    }
}

fn joined(first: String, effects: [Option<&Effect>; 2]) -> String {
    let effects = effects.into_iter().flatten().map(effect);
    (std::iter::once(first).chain(effects))
        .collect::<Vec<_>>()
        .join("; ")
}

/// What one would feel.
fn effect(of: &Effect) -> String {
    felt(of.figure, 1.0 / of.better[1])
}

/// The change of `figure` in words; `times` is its new value over the old one.
fn felt(figure: Felt, times: f64) -> String {
    let error = |of: &str| changed(times, &format!("error after {of}"));
    match figure {
        Felt::LoadError if times < LEAST_TIMES => "no steady error under a load".to_owned(),
        Felt::LoadError if times > MOST_TIMES => "a steady error under a load".to_owned(),
        Felt::LoadError => error("a load or gust"),
        Felt::SetPointError => error("a set-point step"),
        Felt::Noise => changed(times, "noise at the actuator"),
        Felt::Overshoot => height(times, "peak after a set-point step"),
        _ => height(times, "Ms"),
    }
}

/// Below this ratio of new to old value a figure counts as zero, above the other one as infinite.
const LEAST_TIMES: f64 = 0.002;
const MOST_TIMES: f64 = 500.0;

/// The change of a quantity of which there is more or less: `2.6 times the noise`, `45 % less error`. `times` is new over old.
fn changed(times: f64, figure: &str) -> String {
    match times {
        _ if times < LEAST_TIMES => format!("no {figure}"),
        _ if times > MOST_TIMES => format!("{figure} without end"),
        _ if times < 0.995 => format!("{:.0} % less {figure}", 100.0 * (1.0 - times)),
        _ if times < 1.995 => format!("{:.0} % more {figure}", 100.0 * (times - 1.0)),
        _ => format!("{times:.1} times the {figure}"),
    }
}

/// The change of a peak, which is higher or lower: `a 20 % higher peak`. `times` is new over old.
fn height(times: f64, peak: &str) -> String {
    match times {
        _ if times > MOST_TIMES => format!("a {peak} without end"),
        _ if times < 1.0 => format!("a {:.0} % lower {peak}", 100.0 * (1.0 - times)),
        _ if times < 1.995 => format!("a {:.0} % higher {peak}", 100.0 * (times - 1.0)),
        _ => format!("{times:.1} times the {peak}"),
    }
}

/// The first limit that the proposal does not keep, and what helps.
pub fn not_kept(choice: &Controllers) -> Option<String> {
    let missed = choice.missed.first()?;
    match (missed.limit, choice.reference_filter_s) {
        (Limit::Overshoot, Some(time_s)) => Some(format!(
            "A step of the set-point overshoots by {:.0} %. A first-order filter of the set-point, {}, keeps {:.0} %.",
            100.0 * missed.reached,
            seconds(controllers::up(time_s)),
            100.0 * missed.asked
        )),
        _ => controllers::not_kept(choice).into_iter().next(),
    }
}

/// Why first gains may be used.
pub fn first(choice: &Controllers) -> String {
    let robustness = choice.design().and_then(|(design, _)| design.robustness);
    robustness.map_or("no gains in force are known".to_owned(), |robustness| {
        let which = match choice.source {
            Source::Oscillation => "processes that agree",
            _ => "likely processes",
        };
        format!(
            "the limits hold on {:.0} % of the {which}",
            100.0 * robustness.coverage
        )
    })
}

/// Ratio of two widths from which each is said, and the width (percent) up to which the larger alone is.
const ALIKE: f64 = 1.5;
const NARROW: f64 = 5.0;

/// How well the gain is known: at rest, or of an integrator its steady rate, and the slope with which a step of the input begins.
fn gain_known(identified: &Identified) -> String {
    let percent = |[low, estimate, high]: [f64; 3]| {
        let width = (high - low) / (2.0 * estimate.abs());
        width.is_finite().then(|| (100.0 * width).ceil().max(1.0))
    };
    let of = |parameter| {
        let of = identified.estimate.get(parameter)?;
        Some([of.low?, of.estimate?, of.high.unwrap_or(f64::INFINITY)])
    };
    let slope = of(Parameter::KOverTBody).or_else(|| identified.effectiveness());
    let (slope, end) = (slope.and_then(percent), of(Parameter::K).and_then(percent));
    let is_integrating = identified.model.structure().stages().integrators > 0;
    let name = if is_integrating {
        "steady rate"
    } else {
        "gain at rest"
    };
    match (slope, end) {
        (Some(slope), Some(end)) if slope.max(end) > NARROW.max(ALIKE * slope.min(end)) => {
            format!("{name} known to {end} %, first slope to {slope} %")
        }
        (Some(slope), None) if of(Parameter::KOverTBody).is_some() => {
            format!("first slope known to {slope} %, {name} not")
        }
        (Some(known), Some(other)) => format!("gain known to {} %", known.max(other)),
        (Some(known), None) | (None, Some(known)) => format!("gain known to {known} %"),
        (None, None) => "the gain has no upper end".to_owned(),
    }
}

/// How well the process is known. `explained`: share of the logged output that the loop with the model explains.
pub fn sure(identified: &Identified, explained: Option<f64>) -> String {
    let gain = gain_known(identified);
    let prediction = (identified.fit.innovations()).and_then(|of| of.prediction.as_ref());
    let misfit = short(100.0 * identified.fit.misfit);
    let model = match (explained, prediction) {
        (Some(share), _) => format!("the model explains {:.0} % of the flight", 100.0 * share),
        (_, Some(of)) if of.explained < 0.0 => {
            "it does not predict the last third of the recording".to_owned()
        }
        (_, Some(of)) => {
            let rest = match !of.is_good() && of.is_as_good_as_disturbances_allow() {
                true => ", the rest is disturbances and noise",
                false => "",
            };
            format!(
                "it predicts {:.0} % of the last third{rest}",
                100.0 * of.explained
            )
        }
        _ if identified.fit.misfit < 5e-4 => "no misfit beyond the noise".to_owned(),
        _ => format!("{misfit} % of the output is left unexplained"),
    };
    sentence(&format!("{gain}; {model}"))
}

/// Why there is nothing to type in, and what to do.
pub fn refused(of: &crate::Verdict) -> (String, String) {
    let reason = of.to_string();
    let reason = reason.strip_prefix("no information: ").unwrap_or(&reason);
    (reason.to_owned(), advice(of).into_owned())
}

/// Why nothing is proposed where the signals contradict the gains of the log, and what to do.
pub fn contradicted() -> (String, String) {
    let (reason, next) = CONTRADICTED.split_once(". ").unwrap_or((CONTRADICTED, ""));
    (reason.to_owned(), next.to_owned())
}

pub const NONE_ASKED: &str = "the process is identified, and controllers were not asked for";
pub const ASK_FOR_CONTROLLERS: &str = "leave out `design=false` for controllers";
pub const NO_DESIGN: &str = "a process was found, and no controller keeps the limits on it";
pub const COMPARE: &str =
    "Type these gains in and watch a step of the set-point. Gains in force: `against=KP,KI,KD`.";
pub const NOTHING: &str = "Leave the gains as they are.";

/// Where all else stands. `remarks`: how many are not on the card.
pub fn more(of: Advice, remarks: usize) -> String {
    match (of, remarks) {
        (Advice::NotYet, _) => "All that is known: `details`".to_owned(),
        (_, 0) => "All figures, other controllers: `details`".to_owned(),
        (_, 1) => "All figures, other controllers, and one more remark: `details`".to_owned(),
        (_, count) => {
            format!("All figures, other controllers, and {count} more remarks: `details`")
        }
    }
}

/// Where the parameters went.
pub fn written(files: &NamedFiles) -> String {
    format!(
        "{} is written; {} restores the old values. Fly and log again before the next step.",
        files.path.display(),
        files.restore.display()
    )
}

/// How to write parameters into a file with the ending that the firmware's tools look for.
pub fn write(file: &str, options: &str, (ending, share): (Option<&str>, f64)) -> String {
    format!(
        "`identify {file}`{options} `write=tune.{}` writes {} of the step, and a file that restores yours.",
        ending.unwrap_or("txt"),
        part(share)
    )
}

/// What to type in.
pub fn type_in(share: f64) -> String {
    format!(
        "Type in {} of the step, record again, and go on from there.",
        part(share)
    )
}

/// A share of the way to the proposed gains.
pub fn part(share: f64) -> String {
    match share {
        0.5 => "half".to_owned(),
        1.0 => "all".to_owned(),
        share => format!("{:.0} %", 100.0 * share),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // A figure is 1 / better times the old one: 0.54 times is 46 % less.
    #[test]
    fn effects_read_as_people_say_them() {
        for (figure, times, text) in [
            (Felt::LoadError, 0.0, "no steady error under a load"),
            (Felt::LoadError, 1e4, "a steady error under a load"),
            (
                Felt::LoadError,
                0.54,
                "46 % less error after a load or gust",
            ),
            (
                Felt::SetPointError,
                2.63,
                "2.6 times the error after a set-point step",
            ),
            (
                Felt::SetPointError,
                1.25,
                "25 % more error after a set-point step",
            ),
            (Felt::Noise, 0.0, "no noise at the actuator"),
            (Felt::Noise, 1e9, "noise at the actuator without end"),
            (
                Felt::Overshoot,
                1.2,
                "a 20 % higher peak after a set-point step",
            ),
            (Felt::Ms, 0.77, "a 23 % lower Ms"),
            (Felt::Ms, 3.0, "3.0 times the Ms"),
        ] {
            assert_eq!(felt(figure, times), text);
        }
    }
}
