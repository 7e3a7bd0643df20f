//! The whole report of a design, as text and as a page.

use onecycle::{DesignReport, step_response};

use super::{page as pages, text as texts};

/// The page, with designs over limits of `Ms` where the process is known.
pub fn page(of: DesignReport) -> String {
    let choice = match of.oscillation.is_none() {
        true => of.choice.with_trade_off(&of.model),
        false => of.choice,
    };
    let response = step_response(&of.model, &of.best.controller).ok();
    let designed = (&choice, &of.best);
    pages::design(
        &of.model,
        designed,
        response.as_ref(),
        of.oscillation.as_ref(),
    )
}

/// The text.
pub fn text(of: &DesignReport) -> String {
    texts::design(&of.model, &of.choice, &of.best, of.oscillation.as_ref())
}
