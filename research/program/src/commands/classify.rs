//! `onecycle-lab classify`: the paper's classifier on recordings of relay tests.

use std::path::Path;
use std::process::ExitCode;

use onecycle::with_signals;
use onecycle_cli::failure::{Failure, exit};
use onecycle_lab::paper::network::PaperNetwork;
use onecycle_link::{CsvOptions, Recording};

use crate::args::Classify;
use crate::output::print;
use crate::reading::{MOST_OF_A_TABLE, bytes_at_most};
use crate::report::classify::{json, text};
use crate::results::classify::Classified;

pub(crate) fn run(arguments: &Classify) -> Result<ExitCode, Failure> {
    let network = network(&arguments.network)?;
    let files = arguments.files.iter();
    let found = files.map(|file| {
        Ok(Classified {
            name: file.display().to_string(),
            pick: with_signals(&recording(file)?, |signals| network.answer_to_any(signals)),
        })
    });
    let found: Vec<Classified> = found.collect::<Result<_, Failure>>()?;
    let classes = network.card.classes_s.len();
    print(&match arguments.json {
        true => json(classes, &found),
        false => text(classes, &found),
    })?;
    let all = found.iter().all(|one| one.pick.is_ok());
    Ok(ExitCode::from(if all {
        exit::DONE
    } else {
        exit::NO_PROCESS
    }))
}

/// The classifier in this file.
pub(crate) fn network(path: &Path) -> Result<PaperNetwork, Failure> {
    let bytes = bytes_at_most(path, MOST_OF_A_TABLE)?;
    PaperNetwork::read(&bytes).map_err(|error| Failure::unreadable(path, error))
}

/// The recording in this file.
pub(crate) fn recording(path: &Path) -> Result<Recording, Failure> {
    onecycle_link::read(path, &CsvOptions::default()).map_err(|reason| {
        Failure::from(onecycle::Error::Recording {
            name: path.display().to_string(),
            reason: Box::new(reason),
        })
    })
}
