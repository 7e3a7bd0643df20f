//! `onecycle tune`: a process in, its controller out.

use std::process::ExitCode;

use onecycle::{Specification, step_response};

use super::controllers;
use crate::args::Tune;
use crate::failure::{Failure, exit};
use crate::output::{print, write_text};
use crate::report::{json, page, text};
use crate::words::controllers::refusal;

pub(crate) fn run(arguments: &Tune) -> Result<ExitCode, Failure> {
    let model = arguments.process.model()?;
    let asked: Specification = (arguments.noise).complete(arguments.design.specification()?)?;
    let mut choice = controllers::of_model(&model, &asked, arguments.design.against())
        .in_plant(arguments.design.plant());
    let chosen = choice.chosen().map(|row| row.proposal.outcome);
    let best = match chosen {
        Some(Ok(design)) => design,
        Some(Err(error)) => return Err(Failure::usage(refusal(&error))),
        None => return Err(Failure::usage("there is no such controller")),
    };
    if let Some(path) = &arguments.report {
        choice = choice.with_trade_off(&model);
        let response = step_response(&model, &best.controller).ok();
        write_text(
            path,
            &page::design(&model, &choice, &best, response.as_ref()),
        )?;
    }
    print(&if arguments.json {
        json::design(&model, &choice, &best)
    } else {
        text::design(&model, &choice, &best)
    })?;
    Ok(ExitCode::from(exit::DONE))
}
