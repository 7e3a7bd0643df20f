//! The sets of the paper's classifier as files for NumPy and PyTorch.
//!
//! ```text
//! training.npz  verification.npz  test_1.npz ..   inputs  f4, experiments x inputs, less the mean of the training set
//!                                                         and, if the recipe standardises, over the deviation
//!                                                 labels  u8, the true class of each experiment
//!                                                 costs   f4, experiments x classes; infinite if unstable
//! recipe.json                                     the recipe
//! ```

use std::path::Path;
use std::process::ExitCode;

use onecycle_cli::failure::{Failure, exit};
use onecycle_cli::report::json::to_text;
use onecycle_lab::learn::npz::{self, Column, Numbers};
use onecycle_lab::learn::train::{Batch, Dataset, Matrix};
use onecycle_lab::paper::classifier::{ClassifierRecipe, Examples, Standard, Standardised};

use crate::args;
use crate::output::{print, write_file, write_text};
use crate::settings;
use crate::workers::Workers;

/// Whether a file is a recipe of the paper's classifier.
pub(super) fn is_recipe(path: &Path) -> Result<bool, Failure> {
    let table: toml::Table = settings::read(path)?;
    Ok(table.get("network").and_then(toml::Value::as_str) == Some("classifier"))
}

pub(super) fn write(arguments: &args::Dataset, path: &Path) -> Result<ExitCode, Failure> {
    if arguments.examples.is_some() || arguments.parquet.is_some() {
        return Err(Failure::usage(
            "--examples and --parquet are for identifiers: a classifier's recipe says how many experiments there are",
        ));
    }
    let recipe: ClassifierRecipe = settings::read(path)?;
    let failed = |error| Failure::unreadable(path, error);
    recipe.validate().map_err(failed)?;
    let workers = Workers::new(arguments.threads)?;
    let classes = recipe.classes(&workers).map_err(failed)?;
    let training = recipe.training(&classes, &workers).map_err(failed)?;
    let standard = recipe.scaled(&training);
    let verification = recipe.verification(&classes, &workers).map_err(failed)?;
    let mut sets = vec![
        ("training".to_owned(), training),
        ("verification".to_owned(), verification),
    ];
    for (number, test) in (1..).zip(&recipe.tests) {
        let examples = recipe.test(test, &classes, &workers).map_err(failed)?;
        sets.push((format!("test_{number}"), examples));
    }
    workers.finish();
    let folder = &arguments.into;
    std::fs::create_dir_all(folder).map_err(|error| Failure::output(folder, error))?;
    write_text(&folder.join("recipe.json"), &to_text(&recipe))?;
    for (name, examples) in &sets {
        let file = folder.join(format!("{name}.npz"));
        let bytes = npz::write(&columns(examples, &standard));
        write_file(&file, |to| to.write_all(&bytes))?;
        print(&format!(
            "{}  {} experiments, {} classes\n",
            file.display(),
            examples.len(),
            classes.len()
        ))?;
    }
    Ok(ExitCode::from(exit::DONE))
}

fn columns(examples: &Examples, standard: &Standard) -> [Column; 3] {
    let mut batch = Batch::default();
    let all: Vec<usize> = (0..examples.len()).collect();
    Standardised { examples, standard }.fill(&all, &mut batch);
    let matrix = |name, of: &Matrix| Column {
        name,
        width: Some(of.columns()),
        numbers: Numbers::F32(of.values().to_vec()),
    };
    let labels = batch.classes.iter().map(|&class| class as u64);
    [
        matrix("inputs", &batch.inputs),
        Column {
            name: "labels",
            width: None,
            numbers: Numbers::U64(labels.collect()),
        },
        matrix("costs", &batch.costs),
    ]
}
