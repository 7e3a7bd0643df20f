//! Summary of a dataset: its experiments, its files and the time taken.

use std::path::Path;

use onecycle_cli::report::json::to_text;
use onecycle_cli::report::number::significant;
use onecycle_lab::experiments::{Family, Recipe};
use serde::Serialize;

use crate::results::dataset::DatasetRun;

/// Version of the JSON; raised with every change that a reader could notice.
const SCHEMA: &str = "onecycle.dataset.summary/1";

#[derive(Serialize)]
struct Summary<'a> {
    schema: &'static str,
    recipe: &'a Recipe,
    /// Experiments of the dataset.
    experiments: u64,
    /// Experiments with a steady oscillation.
    examples: usize,
    without_oscillation: u64,
    files: usize,
    files_kept: usize,
    /// Experiments of this run.
    experiments_made: u64,
    seconds: f64,
    experiments_per_s: Option<f64>,
}

impl<'a> Summary<'a> {
    fn of(run: &'a DatasetRun) -> Self {
        let (experiments, examples) = (run.manifest.examples, run.manifest.rows());
        let seconds = run.took.as_secs_f64();
        Self {
            schema: SCHEMA,
            recipe: &run.manifest.recipe,
            experiments,
            examples,
            without_oscillation: experiments.saturating_sub(examples as u64),
            files: run.manifest.shards.len(),
            files_kept: run.files_kept,
            experiments_made: run.experiments_made,
            seconds,
            experiments_per_s: (run.experiments_made > 0)
                .then(|| run.experiments_made as f64 / seconds),
        }
    }
}

pub(crate) fn json(run: &DatasetRun) -> String {
    to_text(&Summary::of(run))
}

pub(crate) fn text(run: &DatasetRun, folder: &Path) -> String {
    let summary = Summary::of(run);
    let mut text = String::new();
    for (index, family) in summary.recipe.families.iter().enumerate() {
        text += &format!("Family {}   {}\n", index + 1, of_family(family));
    }
    let (experiments, examples) = (summary.experiments, summary.examples);
    let speed = match summary.experiments_per_s {
        Some(speed) => format!(
            "{} experiments in {} s, {} per second",
            summary.experiments_made,
            significant(summary.seconds),
            significant(speed)
        ),
        None => "nothing: all files exist".to_owned(),
    };
    text + &format!(
        "Examples   {examples} of {experiments} experiments, {} without a steady oscillation\n\
         Files      {} in {}, {} of them from earlier runs\n\
         Made now   {speed}\n",
        summary.without_oscillation,
        summary.files,
        folder.display(),
        summary.files_kept,
    )
}

fn of_family(family: &Family) -> String {
    let [prop, body, tau] = family.space.ranges_s();
    let (least, most) = family.samples_per_period;
    format!(
        "weight {}: T_prop {} .. {} s, T_body {} .. {} s, tau {} .. {} s,\n           \
         {least} .. {most} samples per period",
        family.weight, prop.0, prop.1, body.0, body.1, tau.0, tau.1
    )
}
