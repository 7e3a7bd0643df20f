//! `onecycle tune`: a process in, its controller out.

use std::process::ExitCode;

use onecycle::{Design, Model, Specification, step_response};

use super::controllers;
use crate::args::Tune;
use crate::failure::{Failure, exit};
use crate::output::{print, write_text};
use crate::report::{json, page, text};
use crate::results::controllers::Controllers;
use crate::words::controllers::refusal;

/// The report of the command as JSON, for programs.
pub(crate) fn json(arguments: &Tune) -> Result<String, Failure> {
    let (model, choice, best) = choose(arguments)?;
    Ok(json::design(&model, &choice, &best))
}

/// The process of the arguments, the controllers to choose from and the chosen one.
fn choose(arguments: &Tune) -> Result<(Model, Controllers, Design), Failure> {
    let model = arguments.process.model()?;
    let asked: Specification = (arguments.noise).complete(arguments.design.specification()?)?;
    let choice = controllers::of_model(&model, &asked, arguments.design.against())
        .in_plant(arguments.design.plant());
    let chosen = choice.chosen().map(|row| row.proposal.outcome);
    match chosen {
        Some(Ok(design)) => Ok((model, choice, design)),
        Some(Err(error)) => Err(Failure::usage(refusal(&error))),
        None => Err(Failure::usage("there is no such controller")),
    }
}

pub(crate) fn run(arguments: &Tune) -> Result<ExitCode, Failure> {
    let (model, mut choice, best) = choose(arguments)?;
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
