//! The whole report of an identification, as text and as a page.

use onecycle::Report;

use super::{log_gains, page as pages, text as texts};

/// The page, for which designs over limits of `Ms` are made on first use.
pub fn page(found: &mut Report) -> String {
    found.make_trade_off();
    pages::identification(
        &found.title(),
        &found.recording,
        &found.identification,
        (found.choice.as_ref(), &found.answer),
        found.gains.as_ref(),
    )
}

/// The answer, and with details all else.
pub fn text(report: &Report, has_details: bool) -> String {
    let (recording, found) = (&report.recording, &report.identification);
    let card = texts::card(
        &report.title(),
        recording,
        found,
        &report.answer,
        has_details,
    );
    if !has_details {
        return card;
    }
    let details = texts::identification(&report.name, recording, found, report.choice.as_ref());
    let gains = report.gains.as_ref().map(log_gains::text);
    format!("{card}\n{details}{}", gains.unwrap_or_default())
}
