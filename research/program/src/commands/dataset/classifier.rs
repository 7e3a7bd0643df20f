//! The sets of the paper's classifier as files for NumPy and PyTorch.
//!
//! ```text
//! training.npz  verification.npz  test_1.npz ..   inputs  f4, experiments x inputs, less the mean of the training set
//!                                                         and, if the recipe standardises, over the deviation
//!                                                 labels  u8, the true class of each experiment
//!                                                 costs   f4, experiments x classes; infinite if unstable
//! recipe.json                                     the recipe
//! ```

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use onecycle_cli::failure::{Failure, exit};
use onecycle_cli::report::json::to_text;
use onecycle_lab::learn::npz::{self, Column, Numbers};
use onecycle_lab::learn::train::Dataset;
use onecycle_lab::paper::classifier::{Classes, ClassifierRecipe};
use onecycle_lab::workers;

use crate::args;
use crate::output::{print, write_file, write_text};
use crate::settings;
use crate::workers::Workers;

/// Whether a file is a recipe of the paper's classifier.
pub(crate) fn is_recipe(path: &Path) -> Result<bool, Failure> {
    let table: toml::Table = settings::read(path)?;
    Ok(table.get("network").and_then(toml::Value::as_str) == Some("classifier"))
}

/// A recipe with its classes, of which others may make the examples.
pub(crate) struct Sets {
    path: PathBuf,
    recipe: ClassifierRecipe,
    classes: Classes,
}

/// Examples of the paper's classifier, one after the other.
#[derive(Default)]
pub struct Rows {
    /// Inputs as they were measured.
    pub inputs: Vec<f32>,
    /// True classes.
    pub labels: Vec<u64>,
    /// Costs of all classes.
    pub costs: Vec<f32>,
}

impl Sets {
    pub(crate) fn read(path: &Path, workers: &dyn workers::Workers) -> Result<Self, Failure> {
        let recipe: ClassifierRecipe = settings::read(path)?;
        let failed = |error| Failure::unreadable(path, error);
        recipe.validate().map_err(failed)?;
        let classes = recipe.classes(workers).map_err(failed)?;
        let path = path.to_owned();
        Ok(Self {
            path,
            recipe,
            classes,
        })
    }

    /// Names of the sets, with their numbers of experiments.
    pub(crate) fn sizes(&self) -> Vec<(String, u64)> {
        self.recipe.sets(&self.classes)
    }

    /// The experiments of these numbers of a set. One that does not come to a steady oscillation gives no row.
    pub(crate) fn part(
        &self,
        set: usize,
        numbers: Range<u64>,
        workers: &dyn workers::Workers,
    ) -> Result<Rows, Failure> {
        let examples = self.recipe.part(set, numbers, &self.classes, workers);
        let examples = examples.map_err(|error| Failure::unreadable(&self.path, error))?;
        let mut rows = Rows {
            labels: examples
                .labels()
                .iter()
                .map(|&class| class as u64)
                .collect(),
            ..Rows::default()
        };
        examples.rows().for_each(|row| rows.inputs.extend(row));
        (0..examples.len()).for_each(|i| rows.costs.extend(examples.costs(i)));
        Ok(rows)
    }

    /// Writes all sets into a folder. Returns a line for each.
    pub(crate) fn write(&self, folder: &Path, sets: Vec<Rows>) -> Result<Vec<String>, Failure> {
        let inputs = self.recipe.inputs();
        let training = sets.first().map_or(&[][..], |rows| &rows.inputs);
        let standard = (self.recipe).scaled_rows(inputs, training.chunks(inputs));
        std::fs::create_dir_all(folder).map_err(|error| Failure::output(folder, error))?;
        write_text(&folder.join("recipe.json"), &to_text(&self.recipe))?;
        let classes = self.classes.len();
        let mut lines = Vec::new();
        for ((name, _), mut rows) in self.sizes().iter().zip(sets) {
            (rows.inputs.chunks_mut(inputs)).for_each(|row| standard.apply(row));
            let file = folder.join(format!("{name}.npz"));
            lines.push(format!(
                "{}  {} experiments, {classes} classes\n",
                file.display(),
                rows.labels.len(),
            ));
            let bytes = npz::write(&columns(rows, inputs, classes));
            write_file(&file, |to| to.write_all(&bytes))?;
        }
        Ok(lines)
    }
}

pub(super) fn write(arguments: &args::Dataset, path: &Path) -> Result<ExitCode, Failure> {
    if arguments.examples.is_some() || arguments.parquet.is_some() {
        return Err(Failure::usage(
            "--examples and --parquet are for identifiers: a classifier's recipe says how many experiments there are",
        ));
    }
    let workers = Workers::new(arguments.threads)?;
    let sets = Sets::read(path, &workers)?;
    let rows = (sets.sizes().iter().enumerate())
        .map(|(set, (_, size))| sets.part(set, 0..*size, &workers))
        .collect::<Result<_, _>>()?;
    workers.finish();
    for line in sets.write(&arguments.into, rows)? {
        print(&line)?;
    }
    Ok(ExitCode::from(exit::DONE))
}

fn columns(rows: Rows, inputs: usize, classes: usize) -> [Column; 3] {
    let column = |name, width, numbers| Column {
        name,
        width,
        numbers,
    };
    [
        column("inputs", Some(inputs), Numbers::F32(rows.inputs)),
        column("labels", None, Numbers::U64(rows.labels)),
        column("costs", Some(classes), Numbers::F32(rows.costs)),
    ]
}
