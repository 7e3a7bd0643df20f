//! The control loops of a flight, as text and as JSON.

use std::fmt::Write;

use serde::Serialize;

use super::json::controllers::{NotKept, not_kept};
use super::json::to_text;
use super::number::short;
use super::wrap::wrapped;
use crate::results::flight::{FlightLoop, Judged, Part, Refusal};
use crate::style::{HEADING, headed, painted};
use crate::words::controllers;
use crate::words::flight as words;
use crate::words::sentence;
use crate::words::verdict::advice;

/// Version of the JSON; raised with every change that a reader could notice, added keys excepted.
const SCHEMA: &str = "onecycle.flight/1";

/// The report for people.
pub(crate) fn text(file: &str, flight: usize, loops: &[FlightLoop]) -> String {
    let mut text = format!("{}\n", painted(HEADING, file));
    text.push_str(&headed(&format!(
        "\nFlight {flight}         parts  gain (90 %)                        delay  your margins        P, I, D proposed\n"
    )));
    for one in loops {
        row(&mut text, one);
    }
    if loops.is_empty() {
        wrapped(&mut text, "  ", words::NOTHING_LOGGED);
        return text;
    }
    for one in loops {
        parts(&mut text, one);
    }
    text.push('\n');
    if loops.iter().any(|one| one.best().is_some()) {
        wrapped(&mut text, "", &words::next(file));
    }
    text
}

/// The line of a loop: what all its parts tell.
fn row(text: &mut String, one: &FlightLoop) {
    let told = one.told();
    let used = told.len();
    let name = one.control_loop.to_string();
    let _ = write!(text, "  {name:<14}  {used} of {:<2}", one.parts.len());
    let (Some(gain), Some(first)) = (one.gain(), told.first()) else {
        let _ = writeln!(text, "  not identified");
        return;
    };
    let unit = words::gain_unit(one.units);
    let delay = format!("{:.0} ms", 1e3 * first.delay_s);
    let margins = one
        .in_force()
        .map_or("-".to_owned(), |judged| margins(&judged));
    let gains = one.proposed().map_or("none".to_owned(), |judged| {
        let pid = judged.pid;
        [pid.kp, pid.ki, pid.kd].map(short).join(", ")
    });
    let gain = format!("{} {unit}", with_ends(gain));
    let _ = writeln!(text, "  {gain:<33} {delay:>6}  {margins:<18}  {gains}");
}

/// An estimate with its interval.
fn with_ends([low, estimate, high]: [f64; 3]) -> String {
    let high = match high.is_finite() {
        true => short(high),
        false => "unbounded".to_owned(),
    };
    format!("{} ({} .. {high})", short(estimate), short(low))
}

fn margins(judged: &Judged) -> String {
    judged
        .figures
        .as_ref()
        .map_or("UNSTABLE".to_owned(), |figures| {
            let degrees = figures.margins.phase_margin_rad.to_degrees();
            format!("{degrees:.0} deg, Ms {:.2}", figures.ms)
        })
}

/// What each part of the flight tells of a loop.
fn parts(text: &mut String, one: &FlightLoop) {
    text.push_str(&headed(&format!("\n{}\n", words::title(one.control_loop))));
    if one.parts.is_empty() {
        wrapped(text, "  ", words::NO_PART);
    }
    let mut told: Vec<String> = Vec::new();
    for part in &one.parts {
        let span = format!("{:.1} to {:.1} s", part.span.from_s, part.span.to_s);
        match &part.outcome {
            Ok(found) => {
                let _ = writeln!(
                    text,
                    "  {span:<20} {:<15} {}, delay {:.0} ms",
                    found.structure.name(),
                    with_ends(found.gain),
                    1e3 * found.delay_s
                );
            }
            Err(Refusal::Implausible { gain, expected }) => {
                wrapped(
                    text,
                    &format!("  {span:<20} "),
                    &words::implausible(*gain, *expected),
                );
            }
            Err(Refusal::Verdict(verdict)) => {
                let clause = sentence(&verdict.to_string());
                wrapped(text, &format!("  {span:<20} "), &clause);
                let advice = advice(verdict).into_owned();
                if !told.contains(&advice) {
                    told.push(advice);
                }
            }
        }
    }
    if one.best().is_none() {
        for advice in told {
            wrapped(text, "  ", &advice);
        }
    } else if one.parts_disagree() {
        wrapped(text, "  ", words::DISAGREE);
    }
    for sentence in one.choice.iter().flat_map(controllers::not_kept) {
        wrapped(text, "  ", &sentence);
    }
}

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    file: &'a str,
    flight: usize,
    loops: Vec<Loop>,
}

#[derive(Serialize)]
struct Loop {
    name: String,
    gain: Option<[f64; 3]>,
    gain_unit: Option<String>,
    delay_s: Option<f64>,
    parts_disagree: bool,
    in_force: Option<Gains>,
    proposed: Option<Gains>,
    limits_not_kept: Vec<NotKept>,
    parts: Vec<PartReport>,
}

#[derive(Serialize)]
struct Gains {
    kp: f64,
    ki: f64,
    kd: f64,
    phase_margin_deg: Option<f64>,
    gain_margin: Option<f64>,
    ms: Option<f64>,
}

#[derive(Serialize)]
struct PartReport {
    from_s: f64,
    to_s: f64,
    verdict: &'static str,
    structure: Option<&'static str>,
    gain: Option<[f64; 3]>,
    delay_s: Option<f64>,
}

fn gains(judged: &Judged) -> Gains {
    let figures = judged.figures.as_ref();
    Gains {
        kp: judged.pid.kp,
        ki: judged.pid.ki,
        kd: judged.pid.kd,
        phase_margin_deg: figures.map(|of| of.margins.phase_margin_rad.to_degrees()),
        gain_margin: figures.and_then(|of| of.margins.gain_margin),
        ms: figures.map(|of| of.ms),
    }
}

/// The report for programs.
pub(crate) fn json(file: &str, flight: usize, loops: &[FlightLoop]) -> String {
    let part = |part: &Part| {
        let found = part.outcome.as_ref().ok();
        PartReport {
            from_s: part.span.from_s,
            to_s: part.span.to_s,
            verdict: match &part.outcome {
                Ok(_) => "identified",
                Err(refusal) => refusal.kind(),
            },
            structure: found.map(|found| found.structure.name()),
            gain: found.map(|found| found.gain),
            delay_s: found.map(|found| found.delay_s),
        }
    };
    let one = |one: &FlightLoop| {
        let told = one.told();
        let first = told.first();
        Loop {
            name: one.control_loop.to_string(),
            gain: one.gain(),
            gain_unit: first.map(|_| words::gain_unit(one.units)),
            delay_s: first.map(|found| found.delay_s),
            parts_disagree: one.parts_disagree(),
            in_force: one.in_force().as_ref().map(gains),
            proposed: one.proposed().as_ref().map(gains),
            limits_not_kept: one.choice.as_ref().map(not_kept).unwrap_or_default(),
            parts: one.parts.iter().map(part).collect(),
        }
    };
    to_text(&Report {
        schema: SCHEMA,
        file,
        flight,
        loops: loops.iter().map(one).collect(),
    })
}
