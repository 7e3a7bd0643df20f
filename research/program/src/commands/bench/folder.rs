//! The folder of a benchmark: its files, and reading them.
//!
//! ```text
//! benchmark.json             format version, number of experiments, seed, largest noise, format of the recordings
//! recordings/0001.csv ..     or recordings.parquet
//! truth.csv                  true process, bias and noise of each, for scoring only
//! README.md                  the rules
//! ```

use std::path::{Path, PathBuf};

use onecycle_cli::failure::Failure;
use onecycle_lab::experiments::Truth;
use onecycle_lab::judge::evaluate::files::read_truth;
use serde::Deserialize;

use crate::output::{tell, with_ending, write_text};
use crate::reading::{MOST_OF_A_TABLE, MOST_OF_SETTINGS, text_at_most};
use crate::results::bench::{BenchManifest, FORMAT};

pub(super) const MANIFEST: &str = "benchmark.json";
pub(super) const TRUTH: &str = "truth.csv";
pub(super) const RULES: &str = "README.md";
pub(super) const RECORDINGS: &str = "recordings";
pub(super) const PARQUET: &str = "recordings.parquet";

/// The file of an experiment.
pub(super) fn recording(folder: &Path, number: u64) -> PathBuf {
    folder.join(RECORDINGS).join(numbered(number))
}

/// The file name of an experiment.
pub(super) fn numbered(number: u64) -> String {
    format!("{number:04}.csv")
}

/// Refuses a folder that is not empty.
pub(super) fn refuse_filled(out: &Path) -> Result<(), Failure> {
    if !out.exists() {
        return Ok(());
    }
    let mut entries = std::fs::read_dir(out).map_err(|error| Failure::output(out, error))?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(Failure::usage(format!(
            "the folder {} is not empty: name a new folder",
            out.display()
        ))),
    }
}

/// Marks the work folder of a run that has not ended.
const UNFINISHED: &str = "UNFINISHED";

/// Writes a new or empty folder, whole or not at all: `fill` writes to the folder `OUT.part`, which an interrupted run
/// leaves and the next one replaces.
pub(super) fn write_whole(
    out: &Path,
    fill: impl FnOnce(&Path) -> Result<(), Failure>,
) -> Result<(), Failure> {
    refuse_filled(out)?;
    let failed = |error| Failure::output(out, error);
    let staged = with_ending(out, "part");
    let mark = staged.join(UNFINISHED);
    if mark.is_file() {
        let folder = staged.display();
        tell(&format!(
            "starting over: {folder} is of a run that was interrupted, and is replaced"
        ));
        std::fs::remove_dir_all(&staged).map_err(failed)?;
    }
    std::fs::create_dir(&staged).map_err(|error| Failure::output(&staged, error))?;
    let filled = write_text(
        &mark,
        "Run the same command again: it replaces this folder.\n",
    )
    .and_then(|()| fill(&staged));
    if filled.is_err() {
        // The first error is the one to report.
        let _ = std::fs::remove_dir_all(&staged);
        return filled;
    }
    std::fs::remove_file(&mark).map_err(failed)?;
    if out.exists() {
        std::fs::remove_dir(out).map_err(failed)?;
    }
    std::fs::rename(&staged, out).map_err(failed)
}

/// Reads the manifest and the true processes of a folder.
pub(super) fn read(folder: &Path) -> Result<(BenchManifest, Vec<Truth>), Failure> {
    let path = folder.join(MANIFEST);
    if !path.is_file() {
        let reason = "there is no such file: name a folder written by onecycle-lab bench make";
        return Err(Failure::unreadable(&path, reason));
    }
    let text = text_at_most(&path, MOST_OF_SETTINGS)?;
    #[derive(Deserialize)]
    struct Version {
        format: String,
    }
    let malformed = |error: serde_json::Error| Failure::unreadable(&path, error);
    let found: Version = serde_json::from_str(&text).map_err(malformed)?;
    if found.format != FORMAT {
        return Err(Failure::unreadable(
            &path,
            format!(
                "the folder has format version '{}', but this program scores '{FORMAT}': make the folder again",
                found.format
            ),
        ));
    }
    let manifest: BenchManifest = serde_json::from_str(&text).map_err(malformed)?;
    let path = folder.join(TRUTH);
    let truths =
        read_truth(&read_text(&path)?).map_err(|error| Failure::unreadable(&path, error))?;
    if truths.len() as u64 != manifest.benchmark.experiments {
        return Err(Failure::unreadable(
            &path,
            format!(
                "the file has {} experiments, but {MANIFEST} says {}",
                truths.len(),
                manifest.benchmark.experiments
            ),
        ));
    }
    Ok((manifest, truths))
}

/// The text of a file.
pub(super) fn read_text(path: &Path) -> Result<String, Failure> {
    text_at_most(path, MOST_OF_A_TABLE)
}
