//! Result of `onecycle-lab bench`: the description of a benchmark folder, and the scores of a run.

use onecycle_lab::experiments::Benchmark;
use onecycle_lab::judge::evaluate::{Record, Summary};
use serde::{Deserialize, Serialize};

/// Version of the folder. A change of it keeps results from being compared across versions.
pub(crate) const FORMAT: &str = "onecycle.benchmark/1";
/// Version of the results as JSON.
const SCHEMA: &str = "onecycle.benchmark.results/1";

/// How a folder stores its recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum RecordingFormat {
    /// One file for each experiment.
    Csv,
    /// One file for all experiments.
    Parquet,
}

/// `benchmark.json`: what a folder holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct BenchManifest {
    pub(crate) format: String,
    #[serde(flatten)]
    pub(crate) benchmark: Benchmark,
    pub(crate) recordings: RecordingFormat,
}

/// Scores of all methods and the answers they are computed from.
#[derive(Serialize)]
pub(crate) struct BenchResults<'a> {
    schema: &'static str,
    pub(crate) benchmark: &'a BenchManifest,
    /// Best score first.
    pub(crate) leaderboard: Vec<Summary>,
    results: &'a [Record],
}

impl<'a> BenchResults<'a> {
    pub(crate) fn of(benchmark: &'a BenchManifest, records: &'a [Record]) -> Self {
        Self {
            schema: SCHEMA,
            benchmark,
            leaderboard: Summary::of_all(records),
            results: records,
        }
    }
}
