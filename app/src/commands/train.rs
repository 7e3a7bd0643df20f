//! `onecycle train`: networks from nothing, as a recipe says.

pub(crate) mod classifier;
pub(crate) mod identifier;
mod part;

use std::process::ExitCode;

use onecycle_lab::train::Outcome;
use serde::Deserialize;

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

fn described(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Finished => "finished",
        Outcome::StoppedEarly => "stopped_early",
        Outcome::Paused => "paused",
        Outcome::Diverged => "diverged",
    }
}
