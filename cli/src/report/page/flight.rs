//! A flight as a page: one card of all loops, and a tab for each.

use super::{Subject, card, made_by};
use crate::pages::page::{self, Tab};
use crate::report::flight::next;
use crate::results::answer::{Advice, Answer};
use crate::results::flight::{FlightLoop, Survey};
use crate::words::answer as answers;
use crate::words::flight as words;

/// The page of all loops of a flight.
pub(crate) fn flight(of: &Survey) -> String {
    let title = format!("{}  {}, flight {}", of.file, of.firmware, of.number);
    let told: Vec<(&FlightLoop, Answer)> = of.loops.iter().map(|one| (one, answer(one))).collect();
    let mut overview = match told.is_empty() {
        true => page::paragraph("note", words::NOTHING_LOGGED),
        false => page::facts(&[("next", next(of))]),
    };
    let all: Vec<&Answer> = told.iter().map(|(_, answer)| answer).collect();
    overview += &card::copy(&all);
    let cards = told
        .iter()
        .map(|(one, answer)| brief(&id(one), one, answer));
    overview += &page::cards(&cards.collect::<Vec<_>>());
    let first = Tab {
        id: "flight".to_owned(),
        title: "All loops".to_owned(),
        body: overview,
    };
    let rest = told.iter().map(|(one, answer)| tab(one, answer));
    let tabs: Vec<Tab> = std::iter::once(first).chain(rest).collect();
    page::whole(
        &title,
        &(page::tabs("Loops of the flight", &tabs) + &made_by("identify")),
    )
}

/// A loop on the card of its flight. `id`: where all else is told of it.
fn brief(id: &str, one: &FlightLoop, answer: &Answer) -> String {
    let is_good = answer.verdict != Advice::NotYet;
    let verdict = answers::headline(answer.verdict, &answer.reason);
    let mut text =
        page::heading_to(id, &words::title(one.control_loop)) + &page::verdict(is_good, &verdict);
    if matches!(answer.verdict, Advice::Change | Advice::FirstGains) {
        text += &card::gains(answer);
    }
    text
}

fn tab(one: &FlightLoop, answer: &Answer) -> Tab {
    let id = id(one);
    let body = match &one.shown {
        None => card::card(answer, None),
        Some(shown) => Subject {
            recording: &shown.recording,
            found: &shown.identification,
            choice: one.choice.as_ref(),
            answer,
            gains: shown.gains.as_ref(),
        }
        .body(&format!("{id}-")),
    };
    Tab {
        title: words::title(one.control_loop),
        body,
        id,
    }
}

fn id(one: &FlightLoop) -> String {
    one.control_loop.to_string().replace(' ', "-")
}

/// The answer of a loop, with all that is known of why no part of the flight tells anything about it.
fn answer(one: &FlightLoop) -> Answer {
    let answer = one.answer.clone();
    match one.refusal() {
        Some(verdict) => Answer {
            reason: answers::refused(verdict).0,
            ..answer
        },
        None => answer,
    }
}
