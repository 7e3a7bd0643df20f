//! `onecycle tune`: a process in, its controller out; or what an oscillation tells of it.

use std::process::ExitCode;

use onecycle::{Design, Model, Specification, step_response};

use super::controllers;
use super::in_force::InForce;
use crate::args::Tune;
use crate::failure::{Failure, exit};
use crate::output::{print, write_text};
use crate::report::{json, page, text};
use crate::results::controllers::{Controllers, Source};
use crate::results::family::{Known, OfOscillation};
use crate::words::controllers::refusal;
use crate::words::oscillation::{none_agrees, refusal_of_family};

/// A process with its controllers.
struct Tuned {
    model: Model,
    choice: Controllers,
    best: Design,
    /// What is known of the process, if its parameters are not.
    oscillation: Option<OfOscillation>,
}

/// The report of the command as JSON, for programs.
pub(crate) fn json(arguments: &Tune) -> Result<String, Failure> {
    Ok(as_json(&tuned(arguments)?))
}

fn as_json(of: &Tuned) -> String {
    json::design(&of.model, &of.choice, &of.best, of.oscillation.as_ref())
}

/// The process of the arguments, the controllers to choose from and the chosen one.
fn tuned(arguments: &Tune) -> Result<Tuned, Failure> {
    let in_force = InForce::of(&arguments.design, None)?;
    let against = in_force.against;
    let asked = in_force.law(arguments.design.specification()?);
    let asked: Specification = (arguments.noise).complete(asked)?;
    if let Some(known) = arguments.oscillation.known(against.as_ref())? {
        return of_oscillation(in_force, known, &asked);
    }
    let model = arguments.process.model()?;
    let choice = controllers::of_model(&model, &asked, against).in_plant(in_force.plant);
    Ok(Tuned {
        best: chosen(&choice)?,
        model,
        choice,
        oscillation: None,
    })
}

/// The processes that agree with an oscillation, and controllers that keep their limits on all of them.
fn of_oscillation(
    in_force: InForce,
    known: Known,
    asked: &Specification,
) -> Result<Tuned, Failure> {
    let family = (known.oscillation)
        .family(known.dead_time_share)
        .ok_or_else(|| Failure::usage(none_agrees(&known)))?;
    let choice = controllers::of_family(&family, asked, in_force.against).in_plant(in_force.plant);
    let best = chosen(&choice)?;
    Ok(Tuned {
        model: family.middle,
        oscillation: Some(OfOscillation {
            margins: family.margins(&best.controller),
            known,
            family,
        }),
        choice,
        best,
    })
}

fn chosen(choice: &Controllers) -> Result<Design, Failure> {
    match choice.chosen().map(|row| row.proposal.outcome) {
        Some(Ok(design)) => Ok(design),
        Some(Err(error)) if choice.source == Source::Oscillation => {
            Err(Failure::usage(refusal_of_family(&error)))
        }
        Some(Err(error)) => Err(Failure::usage(refusal(&error))),
        None => Err(Failure::usage("there is no such controller")),
    }
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
    print(&if arguments.json {
        as_json(&of)
    } else {
        text::design(&of.model, &of.choice, &of.best, of.oscillation.as_ref())
    })?;
    Ok(ExitCode::from(exit::DONE))
}
