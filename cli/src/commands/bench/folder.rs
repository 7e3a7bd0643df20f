//! The folder of a benchmark: its files, and reading them.
//!
//! ```text
//! benchmark.json             format version, number of experiments, seed, format of the recordings
//! recordings/0001.csv ..     or recordings.parquet
//! truth.csv                  true process, bias and noise of each, for scoring only
//! README.md                  the rules
//! ```

use std::path::{Path, PathBuf};

use onecycle_lab::experiments::Truth;
use onecycle_lab::judge::evaluate::files::read_truth;
use serde::Deserialize;

use crate::failure::Failure;
use crate::reading::{MOST_OF_A_TABLE, MOST_OF_SETTINGS, text_at_most};
use crate::results::bench::{BenchManifest, FORMAT};

pub(super) const MANIFEST: &str = "benchmark.json";
pub(super) const TRUTH: &str = "truth.csv";
pub(super) const RULES: &str = "README.md";
pub(super) const RECORDINGS: &str = "recordings";
#[cfg(feature = "parquet")]
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

/// Writes a new or empty folder, whole or not at all: `fill` writes to a temporary folder beside it.
pub(super) fn write_whole(
    out: &Path,
    fill: impl FnOnce(&Path) -> Result<(), Failure>,
) -> Result<(), Failure> {
    refuse_filled(out)?;
    let failed = |error| Failure::output(out, error);
    let parent = out.parent().filter(|parent| !parent.as_os_str().is_empty());
    let staged = tempfile::Builder::new()
        .prefix(".onecycle-bench-")
        .tempdir_in(parent.unwrap_or(Path::new(".")))
        .map_err(failed)?;
    fill(staged.path())?;
    set_usual_permissions(staged.path()).map_err(failed)?;
    if out.exists() {
        std::fs::remove_dir(out).map_err(failed)?;
    }
    std::fs::rename(staged.path(), out).map_err(failed)?;
    // The temporary folder is moved; there is nothing to remove.
    let _ = staged.keep();
    Ok(())
}

/// Temporary folders are private; an output folder is readable like any other.
#[cfg(unix)]
fn set_usual_permissions(folder: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755))
}

#[cfg(not(unix))]
fn set_usual_permissions(_: &Path) -> std::io::Result<()> {
    Ok(())
}

/// Reads the manifest and the true processes of a folder.
pub(super) fn read(folder: &Path) -> Result<(BenchManifest, Vec<Truth>), Failure> {
    let path = folder.join(MANIFEST);
    if !path.is_file() {
        let reason = "there is no such file: name a folder written by onecycle bench make";
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
