//! Result of `onecycle-lab dataset`: the manifest of the folder and what this run added.

use std::time::Duration;

use onecycle_lab::learn::dataset::shards::Manifest;

/// A complete dataset.
pub(crate) struct DatasetRun {
    pub(crate) manifest: Manifest,
    /// Files that an earlier run had made.
    pub(crate) files_kept: usize,
    /// Experiments of this run, with and without an oscillation.
    pub(crate) experiments_made: u64,
    pub(crate) took: Duration,
}
