//! The answer, on the first screen of the page: verdict, gains, what they change, how sure it is, and what comes next.

use crate::pages::page;
use crate::pages::plot::Figure;
use crate::report::answer::{LOAD, cells, rows};
use crate::results::answer::{Advice, Answer, Gain};
use crate::words::answer as words;

/// The card, with the responses beside it.
pub(super) fn card(answer: &Answer, figure: Option<&Figure>) -> String {
    let is_good = answer.verdict != Advice::NotYet;
    let verdict = words::headline(answer.verdict, &answer.reason);
    let next = ("next", answer.next.clone());
    let others = [
        answer.sure.clone().map(|sure| ("sure?", sure)),
        answer.watch.clone().map(|watch| ("watch", watch)),
        (!answer.next.is_empty()).then_some(next),
    ];
    let facts: Vec<(&str, String)> = others.into_iter().flatten().collect();
    let text =
        page::verdict(is_good, &verdict) + &gains(answer) + &copy(&[answer]) + &page::facts(&facts);
    match figure {
        Some(figure) => page::beside(&text, &page::figure(figure)),
        None => text,
    }
}

/// A button that copies the gains to type in: this share of the step where some are in force.
pub(super) fn copy(answers: &[&Answer]) -> String {
    let to_change =
        |answer: &&&Answer| matches!(answer.verdict, Advice::Change | Advice::FirstGains);
    let to_change: Vec<&&Answer> = answers.iter().filter(to_change).collect();
    let line = |gain: &Gain| {
        let [_, half, full] = cells(gain);
        let value = if gain.half.is_some() { half } else { full };
        format!("{} {value} {}", gain.name, gain.unit)
            .trim_end()
            .to_owned()
    };
    let gains = to_change.iter().flat_map(|answer| &answer.gains);
    let text: Vec<String> = gains.map(line).collect();
    let part = to_change.iter().find(|answer| answer.has_now());
    let label = match part.and_then(|answer| answer.step) {
        Some(share) => format!("Copy the gains, {} of the step", words::part(share)),
        None => "Copy the gains".to_owned(),
    };
    match text.is_empty() {
        true => String::new(),
        false => page::copy(&label, &text.join("\n")),
    }
}

pub(super) fn gains(answer: &Answer) -> String {
    let Some(figures) = &answer.figures else {
        return String::new();
    };
    let gains = answer.gains.iter().map(|gain| {
        let name = match gain.unit.as_str() {
            "" => gain.name.clone(),
            unit => format!("{} ({unit})", gain.name),
        };
        (name, cells(gain))
    });
    let has_now = answer.has_now();
    let figures = rows(figures).into_iter();
    let figures = figures.filter(|(name, _)| has_now || *name != LOAD);
    // A sign of per cent stays with its number.
    let together = |values: [String; 3]| values.map(|value| value.replace(" %", "\u{a0}%"));
    let figures = figures.map(|(name, values)| (name.to_owned(), together(values)));
    let all = gains.chain(figures);
    if has_now {
        let part = answer.step.map_or(String::new(), words::part);
        return page::plain_table("", &["", "now", &part, "proposed"], all);
    }
    page::plain_table(
        "",
        &["", "proposed"],
        all.map(|(name, [.., full])| (name, [full])),
    )
}
