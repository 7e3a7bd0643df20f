//! What an interrupted run has done: JSON lines, the first what it is of, then one an experiment.
//!
//! Lines are only ever added. The last one may have been cut short; it is dropped.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::path::PathBuf;

use onecycle_lab::judge::evaluate::Record;
use serde::{Deserialize, Serialize};

use super::folder::{read_text, unreadable};
use crate::failure::Failure;
use crate::output::append_line;
use crate::results::bench::BenchManifest;

/// Whose results they are.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Head {
    pub(super) program: String,
    pub(super) benchmark: BenchManifest,
    pub(super) methods: Vec<String>,
}

/// The file, open for more.
pub(super) struct Part {
    path: PathBuf,
    file: File,
}

impl Part {
    /// Goes on with the file, or begins it; what is done, by experiment.
    pub(super) fn open(
        path: PathBuf,
        head: &Head,
        resume: bool,
    ) -> Result<(Self, BTreeMap<u64, Vec<Record>>), Failure> {
        let mut done = BTreeMap::new();
        let mut whole = String::new();
        if resume && path.exists() {
            let text = read_text(&path)?;
            let length = text.rfind('\n').map_or(0, |last| last + 1);
            text[..length].clone_into(&mut whole);
            done = read(&whole, head).map_err(|reason| {
                unreadable(&path, format!("{reason}: leave out --resume to begin anew"))
            })?;
        }
        let failed = |error| Failure::output(&path, error);
        let file = OpenOptions::new()
            .append(true)
            .create(true)
            .open(&path)
            .map_err(failed)?;
        file.set_len(whole.len() as u64).map_err(failed)?;
        let mut part = Self { path, file };
        if whole.is_empty() {
            append_line(&mut part.file, &part.path, head)?;
        }
        Ok((part, done))
    }

    /// The records of an experiment; a whole line reaches the system at a time.
    pub(super) fn keep(&mut self, records: &Vec<Record>) -> Result<(), Failure> {
        append_line(&mut self.file, &self.path, records)
    }

    /// Removes the file: all is written.
    pub(super) fn remove(self) -> Result<(), Failure> {
        std::fs::remove_file(&self.path).map_err(|error| Failure::output(&self.path, error))
    }
}

fn read(text: &str, head: &Head) -> Result<BTreeMap<u64, Vec<Record>>, String> {
    let mut done = BTreeMap::new();
    for (number, line) in (1..).zip(text.lines()) {
        let damaged = |_| format!("line {number} is damaged");
        if number == 1 {
            let found: Head = serde_json::from_str(line).map_err(damaged)?;
            if found != *head {
                return Err(
                    "what is done is of other methods, another benchmark or another version \
                            of the program"
                        .to_owned(),
                );
            }
            continue;
        }
        let records: Vec<Record> = serde_json::from_str(line).map_err(damaged)?;
        let experiment = records.first().map(|record| record.experiment);
        done.extend(experiment.map(|experiment| (experiment, records)));
    }
    Ok(done)
}
