//! `onecycle-lab dataset`: simulate experiments to train on, one file at a time on all threads.

pub(crate) mod classifier;
pub(crate) mod folder;

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use onecycle_cli::failure::{Failure, exit};
use onecycle_lab::experiments::Recipe;
use onecycle_lab::learn::identifier::IdentifierRecipe;

use self::folder::Folder;
use crate::args;
use crate::output::{Waiting, print, tell};
use crate::results::dataset::DatasetRun;
use crate::workers::{Lot, Workers};
use crate::{report, settings};

pub(crate) fn run(arguments: &args::Dataset) -> Result<ExitCode, Failure> {
    if let Some(path) = &arguments.recipe
        && classifier::is_recipe(path)?
    {
        return classifier::write(arguments, path);
    }
    let examples = number(arguments)?;
    let recipe = recipe(arguments.recipe.as_deref())?;
    let workers = Workers::new(arguments.threads)?;
    let begin = Instant::now();
    let (folder, files_kept, experiments_made) = filled(
        &arguments.into,
        (recipe, examples),
        arguments.restart,
        &workers,
    )?;
    workers.finish();
    if let Some(path) = &arguments.parquet {
        let _waiting = Waiting::on(format!("writing {}", path.display()));
        folder.write_parquet(path)?;
    }
    let run = DatasetRun {
        manifest: folder.into_manifest(),
        files_kept,
        experiments_made,
        took: begin.elapsed(),
    };
    print(&if arguments.json {
        report::dataset::json(&run)
    } else {
        report::dataset::text(&run, &arguments.into)
    })?;
    Ok(ExitCode::from(exit::DONE))
}

/// The number of experiments of an identifier's dataset.
pub(crate) fn number(arguments: &args::Dataset) -> Result<u64, Failure> {
    (arguments.examples)
        .ok_or_else(|| Failure::usage("give the number of experiments: --examples N"))
}

/// Completes the folder of a recipe with this number of experiments. Returns it with the number of files that were there
/// before and the number of experiments made now.
pub(super) fn filled(
    path: &Path,
    (recipe, examples): (Recipe, u64),
    restart: bool,
    workers: &Workers,
) -> Result<(Folder, usize, u64), Failure> {
    let mut folder = opened(path, (recipe, examples), restart)?;
    let missing = folder.missing();
    let kept = folder.manifest().shards.len() - missing.len();
    if kept > 0 && !missing.is_empty() {
        tell(&format!(
            "resuming after {kept} of {} files of {} (use --restart to start over)",
            folder.manifest().shards.len(),
            path.display()
        ));
    }
    let made = make(&mut folder, &missing, workers)?;
    Ok((folder, kept, made))
}

/// Opens or begins the folder of a recipe, without the files that are missing or damaged.
pub(crate) fn opened(
    path: &Path,
    (recipe, examples): (Recipe, u64),
    restart: bool,
) -> Result<Folder, Failure> {
    let waiting = Waiting::on(format!("checking {}", path.display()));
    let mut folder = Folder::open(path, recipe, examples, restart)?;
    let damaged = folder.drop_damaged();
    drop(waiting);
    if !damaged.is_empty() {
        tell(&format!(
            "made again because they are missing or damaged: {}",
            damaged.join(", ")
        ));
    }
    Ok(folder)
}

pub(crate) fn recipe(path: Option<&Path>) -> Result<Recipe, Failure> {
    let Some(path) = path else {
        return Ok(Recipe::default());
    };
    // The recipe of an identifier has that of its experiments in a table.
    let table: toml::Table = settings::read(path)?;
    let recipe = if table.contains_key("experiments") {
        settings::read::<IdentifierRecipe>(path)?.experiments
    } else {
        settings::read::<Recipe>(path)?
    };
    recipe
        .validate()
        .map_err(|error| Failure::unreadable(path, error))?;
    Ok(recipe)
}

/// Makes the missing files; returns the number of experiments simulated.
fn make(folder: &mut Folder, missing: &[usize], workers: &Workers) -> Result<u64, Failure> {
    let examples = |shard: usize| folder.manifest().numbers(shard).count() as u64;
    let made: u64 = missing.iter().map(|&shard| examples(shard)).sum();
    let all = folder.manifest().examples;
    workers.expect(all as usize, (all - made) as usize);
    for &shard in missing {
        let file = folder.manifest().make(shard, &Lot(workers));
        let (bytes, entry) = file.map_err(Failure::usage)?;
        folder.keep(shard, &bytes, entry)?;
    }
    Ok(made)
}
