//! The control loops of a flight, as text.

use std::fmt::Write;

use super::answer;
use super::number::short;
use super::wrap::wrapped;
use crate::results::answer::Advice;
use crate::results::flight::{FlightLoop, Judged, Refusal, Survey};
use crate::style::headed;
use crate::words::answer as answers;
use crate::words::controllers;
use crate::words::flight as words;
use crate::words::sentence;
use crate::words::verdict::advice;

/// The card of a flight, with details all that its parts tell.
pub fn text(of: &Survey, has_details: bool) -> String {
    let mut text = card(of, has_details);
    if !has_details {
        return text;
    }
    text.push_str(&headed(&format!(
        "\nFlight {}         parts  gain (90 %)                    delay  your margins\n",
        of.number
    )));
    for one in &of.loops {
        row(&mut text, one);
    }
    for one in &of.loops {
        parts(&mut text, one);
    }
    text.push('\n');
    if of.loops.iter().any(|one| one.best().is_some()) {
        wrapped(&mut text, "", &words::next(&of.file));
    }
    text
}

/// What to do about every loop: at most 40 lines.
fn card(of: &Survey, has_details: bool) -> String {
    let title = format!("{}  {}, flight {}", of.file, of.firmware, of.number);
    let mut text = answer::heading(&title);
    if of.loops.is_empty() {
        wrapped(&mut text, "", words::NOTHING_LOGGED);
        return text;
    }
    let mut has_titles = false;
    for one in &of.loops {
        let name = format!("{:<15} ", one.control_loop.to_string());
        answer::verdict(&mut text, &name, one.answer.verdict, &one.answer.reason);
        if one.best().is_some() && one.answer.verdict != Advice::Keep {
            answer::gains_and_margins(&mut text, &one.answer, !has_titles);
            has_titles = true;
        }
        if let Some((gain, delay)) = process(one) {
            let words = format!("{gain}, delay {delay}");
            wrapped(&mut text, &format!("  {:<20} ", "process"), &words);
        }
        if let Some(Err(reason)) = &one.to_write {
            wrapped(&mut text, "  not written: ", reason);
        }
    }
    answer::line(&mut text, "Next", &next(of));
    if !has_details {
        answer::line(&mut text, "", words::MORE);
    }
    text
}

/// What to do next.
pub(super) fn next(of: &Survey) -> String {
    let is_told = of.loops.iter().any(|one| one.best().is_some());
    match (&of.files, step(of)) {
        (Some(files), _) => answers::written(files),
        _ if !is_told => words::no_loop(of.lost.as_deref()),
        (None, Some(step)) => answers::write(&of.file, "", (of.ending, step)),
        (None, None) => refused(of).unwrap_or_else(|| answers::NOTHING.to_owned()),
    }
}

/// What to do about the first loop whose process is known and whose gains are not to be touched.
fn refused(of: &Survey) -> Option<String> {
    let is_refused =
        |one: &&FlightLoop| one.best().is_some() && one.answer.verdict == Advice::NotYet;
    let one = of.loops.iter().find(is_refused)?;
    Some(format!("{}: {}", one.control_loop, one.answer.next))
}

/// Share of the way to the proposed gains that is written. `None` if every loop is kept.
fn step(of: &Survey) -> Option<f64> {
    let answers = of.loops.iter().map(|one| &one.answer);
    let mut changes = answers.filter(|answer| answer.verdict == Advice::Change);
    changes.next()?.step
}

/// The line of a loop: what all its parts tell.
fn row(text: &mut String, one: &FlightLoop) {
    let used = one.told().len();
    let name = one.control_loop.to_string();
    let _ = write!(text, "  {name:<14}  {used} of {:<2}", one.parts.len());
    let Some((gain, delay)) = process(one) else {
        let _ = writeln!(text, "  not identified");
        return;
    };
    let margins = one
        .in_force()
        .map_or("-".to_owned(), |judged| margins(&judged));
    let _ = writeln!(text, "  {gain:<29} {delay:>6}  {margins}");
}

/// Gain of a loop with its interval, and delay.
fn process(one: &FlightLoop) -> Option<(String, String)> {
    let gain = with_ends(one.gain()?);
    let delay_s = one.told().first()?.delay_s;
    let unit = words::gain_unit(one.units);
    let gain = format!("{gain} {unit}").trim_end().to_owned();
    Some((gain, format!("{:.0} ms", 1e3 * delay_s)))
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
