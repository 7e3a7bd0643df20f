//! The whole report of a design, as text and as a page.

use onecycle::{DesignReport, step_response};

use super::{answer, page as pages, text as texts};

/// The page, with designs over limits of `Ms` where the process is known.
pub fn page(of: DesignReport) -> String {
    let answer = of.answer();
    let choice = match of.oscillation.is_none() {
        true => of.choice.with_trade_off(&of.model),
        false => of.choice,
    };
    let response = step_response(&of.model, &of.best.controller).ok();
    let designed = (&choice, &of.best, &answer);
    pages::design(
        &of.model,
        designed,
        response.as_ref(),
        of.oscillation.as_ref(),
    )
}

/// The answer, and all else.
pub fn text(of: &DesignReport) -> String {
    let title = match of.oscillation {
        Some(_) => "Gains for all processes that agree with an oscillation".to_owned(),
        None => format!("Gains for {}", of.model.structure().transfer_function()),
    };
    let card = answer::card((&title, None), &of.answer(), None, None);
    let details = texts::design(&of.model, &of.choice, &of.best, of.oscillation.as_ref());
    format!("{card}\n{details}")
}
