//! The answer, on the first screen of the page: verdict, gains, what they change, how sure it is, and what comes next.

use crate::pages::page;
use crate::pages::plot::Figure;
use crate::report::answer::{LOAD, cells, rows};
use crate::results::answer::{Advice, Answer};
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
    let text = page::verdict(is_good, &verdict) + &gains(answer) + &page::facts(&facts);
    match figure {
        Some(figure) => page::beside(&text, &page::figure(figure)),
        None => text,
    }
}

fn gains(answer: &Answer) -> String {
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
    let all = gains.chain(figures.map(|(name, values)| (name.to_owned(), values)));
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
