//! `onecycle-lab bench run`: run every method on every recording and score the answers.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::ExitCode;

use onecycle::with_signals;
use onecycle_cli::failure::{Failure, exit};
use onecycle_cli::report::json::to_text;
use onecycle_lab::experiments::Truth;
use onecycle_lab::judge::evaluate::files::{read_answers, results_csv};
use onecycle_lab::judge::evaluate::{Contender, EvaluationError, Judge, Record, records};
use onecycle_lab::paper::network::PaperNetwork;
use serde_json::{Value, json};

use super::folder::{self, TRUTH, read_text};
use super::recordings::Recordings;
use super::traces;
use crate::args::{self, CLASSIFIER, RunBench};
use crate::commands::classify;
use crate::commands::clock::thread_seconds;
use crate::journal::Journal;
use crate::output::{print, with_ending, write_file};
use crate::report;
use crate::results::bench::BenchResults;
use crate::workers::Workers;

pub(super) fn run(arguments: &RunBench) -> Result<ExitCode, Failure> {
    let (manifest, truths) = folder::read(&arguments.folder)?;
    let methods = arguments.methods.clone().unwrap_or_default().0;
    let foreign = foreign(&arguments.answers, &truths)?;
    let workers = Workers::new(arguments.threads)?;
    let network = arguments.network.as_deref().map(classify::network);
    let network = network.transpose()?;
    let computes = !methods.is_empty() || network.is_some();
    let recordings = computes.then(|| Recordings::open(&arguments.folder, &manifest));
    let recordings = recordings.transpose()?;
    if let Some(folder) = &arguments.traces {
        traces::check(folder, &methods)?;
    }
    let out = arguments.out.as_deref();
    let mut done = BTreeMap::new();
    let mut journal = match out.filter(|_| computes) {
        Some(out) => {
            let names: Vec<_> = methods.iter().map(|method| method.name()).collect();
            let mut settings = json!({ "benchmark": manifest, "methods": names });
            if let Some(network) = &network {
                settings["network"] = json!(network.card);
            }
            Some(opened(out, &settings, arguments.restart, &mut done)?)
        }
        None => None,
    };
    if !done.is_empty()
        && let Some(journal) = &journal
    {
        let (kept, all) = (done.len(), truths.len());
        journal.tell_resumed(&format!("{kept} of {all} experiments"));
    }
    let mut records = foreign;
    if let Some(recordings) = &recordings {
        let ours = answered(
            recordings,
            (&methods, network.as_ref()),
            &truths,
            (journal.as_mut(), done),
            &workers,
            &arguments.folder.join(TRUTH),
        )?;
        records.splice(0..0, ours);
    }
    let results = BenchResults::of(&manifest, &records);
    let text = report::bench::leaderboard(&results);
    let json = to_text(&results);
    if let Some(out) = out {
        let csv = results_csv(&records).map_err(Failure::usage)?;
        for (ending, bytes) in [
            ("csv", csv.as_slice()),
            ("json", json.as_bytes()),
            ("md", text.as_bytes()),
        ] {
            write_file(&with_ending(out, ending), |file| file.write_all(bytes))?;
        }
    }
    if let Some(folder) = &arguments.traces {
        traces::write(folder, &methods, &truths, &workers)?;
    }
    if let Some(journal) = journal {
        journal.remove()?;
    }
    print(if arguments.json { &json } else { &text })?;
    Ok(ExitCode::from(exit::DONE))
}

/// Opens the journal beside the output; adds the records found in it to `done`, by experiment.
fn opened(
    out: &Path,
    settings: &Value,
    restart: bool,
    done: &mut BTreeMap<u64, Vec<Record>>,
) -> Result<Journal, Failure> {
    let take = |records: Vec<Record>| {
        let experiment = records.first().map(|record| record.experiment);
        done.extend(experiment.map(|experiment| (experiment, records)));
        Ok(())
    };
    Journal::open(
        &Journal::folder_of(out),
        "bench run",
        settings,
        restart,
        take,
    )
}

/// Experiments of each thread between two writes to the journal: few, because a killed run loses them.
const LOT: usize = 4;

/// Records of all methods, in the order of the experiments: finished ones and those computed now. `truth` is the file of
/// the true processes, for errors.
fn answered(
    recordings: &Recordings,
    (methods, network): (&[Contender], Option<&PaperNetwork>),
    truths: &[Truth],
    (mut journal, mut done): (Option<&mut Journal>, BTreeMap<u64, Vec<Record>>),
    workers: &Workers,
    truth: &Path,
) -> Result<Vec<Record>, Failure> {
    let open: Vec<&Truth> = truths
        .iter()
        .filter(|truth| !done.contains_key(&truth.number))
        .collect();
    workers.expect(truths.len(), truths.len() - open.len());
    for lot in open.chunks(LOT * workers.threads()) {
        let numbers: Vec<u64> = lot.iter().map(|truth| truth.number).collect();
        let read = recordings.read(&numbers, workers)?;
        let made = workers.run(lot.len(), |index| {
            let records = with_signals(&read[index], |signals| {
                let truth = lot[index];
                let mut all = records(truth, signals, methods, &thread_seconds)?;
                if let Some(network) = network {
                    let answer = || network.answer(signals).map_err(|error| error.to_string());
                    let judge = Judge::new(&truth.process)?;
                    all.push(judge.timed(truth.number, CLASSIFIER, answer, &thread_seconds));
                }
                Ok::<_, EvaluationError>(all)
            });
            records.map_err(|error| {
                Failure::unreadable(truth, format!("experiment {}: {error}", numbers[index]))
            })
        });
        for (truth, made) in lot.iter().zip(made) {
            let made = made?;
            if let Some(journal) = journal.as_deref_mut() {
                journal.add(&made)?;
            }
            done.insert(truth.number, made);
        }
    }
    workers.finish();
    Ok(done.into_values().flatten().collect())
}

/// Records of the answers of other programs.
fn foreign(all: &[args::Answers], truths: &[Truth]) -> Result<Vec<Record>, Failure> {
    let experiments: BTreeSet<u64> = truths.iter().map(|truth| truth.number).collect();
    let mut records = Vec::new();
    for (index, answers) in all.iter().enumerate() {
        if all[..index]
            .iter()
            .any(|before| before.name == answers.name)
        {
            return Err(Failure::usage(format!(
                "two files of answers are named '{}'",
                answers.name
            )));
        }
        let text = read_text(&answers.file)?;
        let mut found = read_answers(&text, &experiments)
            .map_err(|error| Failure::unreadable(&answers.file, error))?;
        for truth in truths {
            let judge = Judge::new(&truth.process).map_err(Failure::usage)?;
            let (answer, seconds) = match found.remove(&truth.number) {
                Some(foreign) => (foreign.answer, foreign.seconds),
                None => (Err("the file has no row for it".to_owned()), None),
            };
            records.push(Record {
                seconds,
                ..judge.record(truth.number, &answers.name, answer)
            });
        }
    }
    Ok(records)
}
