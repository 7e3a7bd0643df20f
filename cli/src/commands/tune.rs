//! `onecycle tune`: a process in, its controller out; or what an oscillation tells of it.

use std::process::ExitCode;

use onecycle::{DesignReport, step_response};

use crate::args::Tune;
use crate::failure::{Failure, exit};
use crate::output::{print, write_text};
use crate::report::json::to_text;
use crate::report::{page, text};

/// The process of the arguments with its controllers.
pub(crate) fn tuned(arguments: &Tune) -> Result<DesignReport, Failure> {
    let request = arguments.noise.request(arguments.design.requirements());
    request.specification()?;
    let known = (arguments.oscillation).known(request.requirements.against.as_ref())?;
    Ok(match known {
        Some(known) => request.design_for_all(known)?,
        None => request.design(arguments.process.model()?)?,
    })
}

pub(crate) fn run(arguments: &Tune) -> Result<ExitCode, Failure> {
    let mut of = tuned(arguments)?;
    if let Some(path) = &arguments.report {
        if of.oscillation.is_none() {
            of.choice = of.choice.with_trade_off(&of.model);
        }
        let response = step_response(&of.model, &of.best.controller).ok();
        let (model, oscillation) = (&of.model, of.oscillation.as_ref());
        write_text(
            path,
            &page::design(
                model,
                (&of.choice, &of.best),
                response.as_ref(),
                oscillation,
            ),
        )?;
    }
    print(&match arguments.json {
        true => to_text(&of),
        false => text::design(&of.model, &of.choice, &of.best, of.oscillation.as_ref()),
    })?;
    Ok(ExitCode::from(exit::DONE))
}
