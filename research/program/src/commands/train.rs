//! `onecycle-lab train`: train the networks of a recipe.

pub(crate) mod classifier;
pub(crate) mod identifier;

use std::fmt::Display;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use onecycle_cli::failure::Failure;
use onecycle_lab::learn::train::{Dataset, Epoch, Outcome, Trainer};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use crate::journal::Journal;
use crate::workers::{Quiet, Workers};
use crate::{args, settings};

/// The field that every recipe has; the other fields depend on it.
#[derive(Deserialize)]
struct Head {
    network: Network,
}

/// The kind of network of a recipe.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Network {
    /// The paper's classifier.
    Classifier,
    /// An identifier.
    Density,
}

pub(crate) fn run(arguments: &args::Train) -> Result<ExitCode, Failure> {
    let head: Head = settings::read(&arguments.recipe)?;
    match head.network {
        Network::Classifier => classifier::run(arguments, &settings::read(&arguments.recipe)?),
        Network::Density => identifier::run(arguments, &settings::read(&arguments.recipe)?),
    }
}

/// The journal of a training with this recipe beside its output.
fn journal(out: &Path, recipe: &impl Serialize, restart: bool) -> Result<Journal, Failure> {
    // Trainings are kept as pieces; the journal has no lines.
    let no_line = |_: IgnoredAny| Err("is unknown".to_owned());
    Journal::open(&Journal::folder_of(out), "train", recipe, restart, no_line)
}

/// The place of a network in training, which is kept after each epoch.
struct Kept<'a> {
    journal: &'a Journal,
    /// Number of the network, from 1.
    number: usize,
}

impl Kept<'_> {
    fn name(&self) -> String {
        format!("network_{}.part", self.number)
    }

    /// The training of an interrupted run, if there is one.
    fn read(&self) -> Result<Option<Trainer>, Failure> {
        let name = self.name();
        let Some(bytes) = self.journal.piece(&name)? else {
            return Ok(None);
        };
        let trainer = Trainer::resume(&bytes)
            .map_err(|error| self.journal.refused_piece(&name, &error.to_string()))?;
        let (epochs, number) = (trainer.history().len(), self.number);
        self.journal
            .tell_resumed(&format!("epoch {epochs} of network {number}"));
        Ok(Some(trainer))
    }

    fn write(&self, trainer: &Trainer) -> Result<(), Failure> {
        let bytes = trainer.save().map_err(Failure::usage)?;
        self.journal.keep_piece(&self.name(), &bytes)
    }
}

/// The training that an interrupted run has left, or a new one.
fn begun<E: Display>(
    kept: Option<&Kept<'_>>,
    anew: impl FnOnce() -> Result<Trainer, E>,
) -> Result<Trainer, Failure> {
    let left = kept.map(Kept::read).transpose()?.flatten();
    left.map_or_else(|| anew().map_err(Failure::usage), Ok)
}

/// Time between two copies of a training: a copy of the paper's network is 260 MB.
const BETWEEN_COPIES: Duration = Duration::from_secs(30);

/// Trains to the end. After each epoch it calls `told`; it keeps the training from time to time and at the end.
fn train(
    trainer: &mut Trainer,
    [training, validation]: [&dyn Dataset; 2],
    workers: &Workers,
    kept: Option<&Kept<'_>>,
    told: impl Fn(&Epoch),
) -> Result<Outcome, Failure> {
    let mut copied = Instant::now();
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
            let is_due = outcome != Outcome::Paused || copied.elapsed() > BETWEEN_COPIES;
            if let Some(kept) = kept.filter(|_| is_due) {
                kept.write(trainer)?;
                copied = Instant::now();
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
