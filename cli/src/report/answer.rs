//! The answer as text: a card of at most 24 lines of 80 columns, for any terminal of 60 columns or more.

use std::borrow::Cow;
use std::fmt::Write;

use onecycle::{Estimate, Identified, Interval, Parameter};

use super::number::{apart, seconds, short};
use super::units::Units;
use super::wrap::{TOGETHER, width, wrapped};
use crate::results::answer::{Advice, Answer, Columns, Figures, Gain};
use crate::style::{HEADING, HOLDS, REFUSAL, REMARK, painted};
use crate::words::answer as words;

/// Columns of names, in the narrowest terminal one less, and of values, with a blank before each.
const NAME: usize = 20;
const VALUE: usize = 12;

/// The card of a recording. `read`: what was taken for what. `more`: how many remarks are not on it; `None`: all that is
/// known follows.
pub(super) fn card(
    (title, read): (&str, Option<&str>),
    answer: &Answer,
    process: Option<(&Identified, &Units)>,
    more: Option<usize>,
) -> String {
    let mut text = heading(title);
    verdict(&mut text, "", answer.verdict, &answer.reason);
    if !answer.gains.is_empty() {
        text.push('\n');
        table(&mut text, answer);
        text.push('\n');
    }
    if let Some(read) = read {
        line(&mut text, "Read", read);
    }
    if let Some((identified, units)) = process {
        let formula = identified.model.structure().transfer_function();
        line(&mut text, "Process", formula);
        line(&mut text, "", &parameters(&identified.estimate, units));
    }
    if let Some(sure) = &answer.sure {
        line(&mut text, "Sure?", sure);
    }
    if let Some(watch) = &answer.watch {
        let mut lines = String::new();
        line(&mut lines, "Watch", watch);
        text.push_str(&painted(REMARK, &lines));
    }
    line(&mut text, "Next", &answer.next);
    if let Some(more) = more {
        line(&mut text, "", &words::more(answer.verdict, more));
    }
    text
}

/// The name of a file and what it is, on two lines where they do not fit on one.
pub(super) fn heading(title: &str) -> String {
    let is_wide = title.chars().count() > width();
    let title = if is_wide {
        Cow::Owned(title.replacen("  ", "\n  ", 1))
    } else {
        Cow::Borrowed(title)
    };
    format!("{}\n", painted(HEADING, &title))
}

/// The verdict and its reason, wrapped.
pub(super) fn verdict(text: &mut String, lead: &str, of: Advice, reason: &str) {
    let style = match of {
        Advice::NotYet => REFUSAL,
        _ => HOLDS,
    };
    let mut lines = String::new();
    wrapped(&mut lines, lead, &words::headline(of, reason));
    let (before, rest) = lines.split_at(lead.len());
    let (name, after) = rest.split_at(words::verdict(of).len());
    let _ = write!(text, "{before}{}{after}", painted(style, name));
}

pub(super) fn line(text: &mut String, name: &str, words: &str) {
    wrapped(text, &format!("{name:<9}"), words);
}

/// Gains and figures, in columns if gains are in force.
fn table(text: &mut String, answer: &Answer) {
    gains(text, answer, true);
    let rows = answer.figures.as_ref().map(rows).unwrap_or_default();
    if answer.has_now() {
        for (name, values) in rows {
            row(text, name, values.into_iter(), "");
        }
        return;
    }
    let of_load = |row: &&(&str, [String; 3])| row.0 != LOAD;
    let facts = rows.iter().filter(of_load).flat_map(|(names, [.., full])| {
        let pairs = names.split(", ").zip(full.split(", "));
        pairs.map(|(name, value)| format!("{name} {value}").replace(' ', TOGETHER))
    });
    line(text, "  Loop", &facts.collect::<Vec<_>>().join(", "));
}

/// Gains and margins of a loop among others.
pub(super) fn gains_and_margins(text: &mut String, answer: &Answer, has_titles: bool) {
    gains(text, answer, has_titles);
    let margins = answer.figures.iter().flat_map(rows).next();
    if let Some((name, values)) = margins {
        row(text, name, shown(answer.has_now(), values), "");
    }
}

/// A line for each gain, below the titles of the columns.
fn gains(text: &mut String, answer: &Answer, has_titles: bool) {
    if has_titles && answer.has_now() {
        let part = answer.step.map_or(String::new(), words::part);
        let titles = ["now".to_owned(), part, "full".to_owned()];
        row(text, "", titles.into_iter(), "");
    }
    for gain in &answer.gains {
        let values = shown(answer.has_now(), cells(gain));
        row(text, &gain.name, values, &gain.unit);
    }
}

/// The values of a gain.
pub(super) fn cells(gain: &Gain) -> [String; 3] {
    let of = |value: Option<f64>, without: &str| value.map_or(without.to_owned(), number);
    let full = of(gain.full, "out of range");
    [of(gain.now, "-"), of(gain.half, "-"), full]
}

/// All three columns, or the last alone.
fn shown<T>(has_now: bool, values: [T; 3]) -> impl Iterator<Item = T> {
    values.into_iter().skip(if has_now { 0 } else { 2 })
}

fn row(text: &mut String, name: &str, values: impl Iterator<Item = String>, unit: &str) {
    let values: Vec<String> = values.collect();
    // Two blanks between columns where there is room.
    let has_room = values.len() > 1 && width() > NAME + 3 * (VALUE + 2) + 2;
    let (of_value, of_name) = match has_room {
        true => (VALUE + 1, NAME),
        false => (VALUE, NAME.min(width() - 3 * (VALUE + 1) - 2)),
    };
    let values: String = (values.iter())
        .map(|value| format!(" {value:>of_value$}"))
        .collect();
    let line = |name: &str, unit: &str| {
        let line = format!("  {name:<of_name$}{values}  {unit}");
        line.trim_end().to_owned()
    };
    let mut shown = line(name, unit);
    if shown.chars().count() > width() {
        shown = line(&format!("{name} ({unit})"), "");
    }
    let _ = writeln!(text, "{shown}");
}

/// A gain: integers of a firmware as they are.
fn number(value: f64) -> String {
    match value.fract() == 0.0 && value.abs() < 1e4 {
        true => format!("{value:.0}"),
        false => short(value),
    }
}

/// Name of the row that compares the errors after a step of the load.
pub(super) const LOAD: &str = "load error";

/// Rows of figures, those that there are. The load error is given as a multiple of that in the first column that has one.
pub(super) fn rows(of: &Columns) -> Vec<(&'static str, [String; 3])> {
    let all = of.all();
    let base = all.iter().flatten().find_map(|of| of.load_iae);
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let margins = |of: &Figures| Some(format!("{:.0} deg, {:.2}", of.phase_margin_deg, of.ms));
    let load = |of: &Figures| {
        let ratio = of.load_iae.map(|iae| iae / base.unwrap_or(iae));
        Some(ratio.map_or("offset".to_owned(), |ratio| format!("{ratio:.2} x")))
    };
    let step = |of: &Figures| {
        let (settling_s, overshoot) = of.settling_time_s.zip(of.overshoot)?;
        Some(format!("{}, {}", seconds(settling_s), percent(overshoot)))
    };
    let noise = |of: &Figures| of.noise_share.map(percent);
    let row = |name, value: &dyn Fn(&Figures) -> Option<String>| {
        let cell = |of: Option<&Figures>| of.map_or(Some("unstable".to_owned()), value);
        let values = all.map(cell);
        let is_shown = values[2].is_some();
        is_shown.then(|| (name, values.map(|value| value.unwrap_or("-".to_owned()))))
    };
    let rows = [
        row("phase margin, Ms", &margins),
        row(LOAD, &load).filter(|_| base.is_some()),
        row("settling, overshoot", &step),
        row("noise at actuator", &noise),
    ];
    rows.into_iter().flatten().collect()
}

/// `K 122 (109 .. 140) rad/s, tau below 8.0 ms`.
fn parameters(estimate: &Estimate, units: &Units) -> String {
    let structure = estimate.structure();
    let one = |(parameter, of): (Parameter, Interval)| {
        let (name, unit) = (
            parameter.symbol_in(structure),
            units.parameter(structure, parameter),
        );
        let end = |value: Option<f64>| value.map_or("unbounded".to_owned(), short);
        let value = match estimate.is_below(parameter) {
            true => format!("below {}", end(of.high)),
            false => match (of.estimate, of.low, of.high) {
                (Some(estimate), Some(low), Some(high)) => {
                    let [estimate, low, high] = apart([estimate, low, high]);
                    format!("{estimate} ({low} .. {high})")
                }
                (estimate, low, high) => {
                    let estimate = estimate.map_or("infinite".to_owned(), short);
                    format!("{estimate} ({} .. {})", end(low), end(high))
                }
            },
        };
        // What belongs together stays on a line.
        let value = format!("{name} {value} {unit}").trim_end().to_owned();
        value.replace(' ', TOGETHER)
    };
    let is_process = |of: &(Parameter, Interval)| of.0 != Parameter::InputBias;
    let all: Vec<String> = estimate.iter().filter(is_process).map(one).collect();
    all.join(", ")
}
