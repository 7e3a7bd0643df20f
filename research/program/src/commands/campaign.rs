//! `onecycle-lab campaign`: many random experiments and a table of their outcomes.

pub(crate) mod plan;

use std::process::ExitCode;

use onecycle_cli::failure::{Failure, exit};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::journal::Journal;
use crate::output::{print, write_text};
use crate::workers::Workers;
use crate::{args, settings};

pub(crate) fn run(arguments: &args::Campaign) -> Result<ExitCode, Failure> {
    let (table, journal) = plan::of(arguments)?.run(arguments)?;
    if let Some(out) = &arguments.out {
        write_text(out, &table)?;
    }
    print(&table)?;
    journal.map_or(Ok(()), Journal::remove)?;
    Ok(ExitCode::from(exit::DONE))
}

/// The table of a campaign, and the journal to remove once it is written.
type Table = (String, Option<Journal>);

/// Cases of each thread between two writes to the journal: a few seconds of work.
const LOT: usize = 64;

/// Outcomes of all cases, in order for any number of threads. With an output file, finished cases are kept in its
/// journal.
fn finished<T: Send + Serialize + DeserializeOwned>(
    arguments: &args::Campaign,
    settings: &Value,
    count: u64,
    case: impl Fn(u64) -> Result<T, Failure> + Send + Sync,
) -> Result<(Vec<T>, Option<Journal>), Failure> {
    let mut done: Vec<T> = Vec::new();
    let mut journal = match &arguments.out {
        None => None,
        Some(out) => {
            let take = |lot: Vec<T>| {
                done.extend(lot);
                Ok(())
            };
            let folder = Journal::folder_of(out);
            Some(Journal::open(
                &folder,
                "campaign",
                settings,
                arguments.restart,
                take,
            )?)
        }
    };
    if !done.is_empty()
        && let Some(journal) = &journal
    {
        journal.tell_resumed(&format!("{} of {count} cases", done.len()));
    }
    let workers = Workers::new(None)?;
    let count = count as usize;
    workers.expect(count, done.len());
    while done.len() < count {
        let first = done.len();
        let lot = (LOT * workers.threads()).min(count - first);
        let lot = workers.run(lot, |k| case((first + k) as u64));
        let lot: Vec<T> = lot.into_iter().collect::<Result<_, Failure>>()?;
        if let Some(journal) = &mut journal {
            journal.add(&lot)?;
        }
        done.extend(lot);
    }
    workers.finish();
    Ok((done, journal))
}

/// Everything that decides the outcomes: the file and the arguments that change it.
pub(crate) fn settings(arguments: &args::Campaign) -> Result<Value, Failure> {
    let file: toml::Table = settings::read(&arguments.file)?;
    let method = arguments.method.map(|method| format!("{method:?}"));
    Ok(json!({
        "file": file,
        "cases": arguments.cases,
        "cycles": arguments.cycles,
        "method": method,
        "sigma": arguments.sigma,
        "time_scale": arguments.time_scale,
    }))
}
