//! `onecycle train`: networks from nothing, as a recipe says.

pub(crate) mod classifier;
pub(crate) mod identifier;
mod part;

use std::fmt::Display;
use std::ops::ControlFlow;
use std::process::ExitCode;

use onecycle_lab::learn::train::{Dataset, Epoch, Outcome, Trainer};
use serde::Deserialize;

use self::part::Part;
use crate::commands::workers::{Quiet, Workers};
use crate::failure::Failure;
use crate::{args, settings};

/// What every recipe begins with; the rest is read when it is known what of it is.
#[derive(Deserialize)]
struct Head {
    network: Network,
}

/// What a recipe is of.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Network {
    /// The paper's classifier.
    Classifier,
    /// The shipped identifier, or one of a user's own.
    Density,
}

pub(crate) fn run(arguments: &args::Train) -> Result<ExitCode, Failure> {
    let head: Head = settings::read(&arguments.recipe)?;
    match head.network {
        Network::Classifier => classifier::run(arguments, &settings::read(&arguments.recipe)?),
        Network::Density => identifier::run(arguments, &settings::read(&arguments.recipe)?),
    }
}

/// The training that an interrupted run has left, where that is asked for and there is one, or a new one.
fn begun<E: Display>(
    part: Option<&Part>,
    resume: bool,
    anew: impl FnOnce() -> Result<Trainer, E>,
) -> Result<Trainer, Failure> {
    let left = match part {
        Some(part) if resume => part.read()?,
        _ => None,
    };
    left.map_or_else(|| anew().map_err(Failure::usage), Ok)
}

/// Trains to the end, an epoch at a time: after each it is told and kept.
fn train(
    trainer: &mut Trainer,
    [training, validation]: [&dyn Dataset; 2],
    workers: &Workers,
    part: Option<&Part>,
    told: impl Fn(&Epoch),
) -> Result<Outcome, Failure> {
    loop {
        let mut last = None;
        let outcome = trainer
            .run(training, validation, &Quiet(workers), &mut |epoch| {
                last = Some(*epoch);
                ControlFlow::Break(())
            })
            .map_err(Failure::usage)?;
        if let Some(epoch) = last {
            told(&epoch);
            if let Some(part) = part {
                part.write(trainer)?;
            }
        }
        if outcome != Outcome::Paused {
            return Ok(outcome);
        }
    }
}

fn described(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Finished => "finished",
        Outcome::StoppedEarly => "stopped_early",
        Outcome::Paused => "paused",
        Outcome::Diverged => "diverged",
    }
}
