//! Training of an identifier: simulate experiments, train, calibrate, score, write the pack.

use std::process::ExitCode;
use std::time::Instant;

use onecycle_cli::failure::{Failure, exit};
use onecycle_lab::learn::dataset::shards::ExampleRecord;
use onecycle_lab::learn::identifier::{
    Calibrated, IdentifierError, IdentifierRecipe, calibrated, rows, scores,
};
use onecycle_lab::learn::pack::{PackContents, Quantisation, quantisation};
use onecycle_lab::learn::train::{Epoch, Network, Outcome, Trainer};
use onecycle_onboard::pack::{Pack, Sizes};

use super::Kept;
use crate::args;
use crate::commands::dataset::filled;
use crate::journal::Journal;
use crate::output::{Waiting, print, progress_bar, with_ending, write_file, write_text};
use crate::report::identifier as report;
use crate::results::identifier::{FamilyScores, IdentifierRun};
use crate::workers::Workers;

pub(super) fn run(arguments: &args::Train, recipe: &IdentifierRecipe) -> Result<ExitCode, Failure> {
    recipe
        .validate()
        .map_err(|error| Failure::unreadable(&arguments.recipe, error))?;
    let out = arguments.out.as_deref().ok_or_else(|| {
        Failure::usage("an identifier is written as a pack: name the file with --out")
    })?;
    let workers = Workers::new(arguments.threads)?;
    let begin = Instant::now();
    let dataset = arguments.dataset.clone();
    let path = dataset.unwrap_or_else(|| with_ending(out, "dataset"));
    let experiments = recipe.experiments.clone();
    // --restart keeps a dataset that the user has named.
    let restart = arguments.restart && arguments.dataset.is_none();
    let wanted = (experiments, recipe.experiments());
    let (folder, ..) = filled(&path, wanted, restart, &workers)?;
    workers.finish();
    let waiting = Waiting::on("reading the experiments");
    let records = folder.records()?;
    drop(waiting);
    let simulated_s = begin.elapsed().as_secs_f64();

    let [learning, choosing, scoring] = recipe.numbers().map(|numbers| {
        let from = records.partition_point(|record| record.number < numbers.start);
        let to = records.partition_point(|record| record.number < numbers.end);
        &records[from..to]
    });
    let journal = super::journal(out, recipe, arguments.restart)?;
    let (trainer, outcome) = learn(recipe, [learning, choosing], &journal, &workers)?;
    let waiting = Waiting::on("calibrating");
    let (pack, quantisation) = pack(recipe, trainer.best(), [learning, choosing])?;
    let mut trained = IdentifierRun {
        examples: records.len(),
        weights: trainer.best().weights(),
        outcome: super::described(outcome),
        epochs: trainer.history().len() as u64,
        best_epoch: best_epoch(trainer.history()),
        scores: vec![],
        quantisation,
        sizes: Sizes::default(),
        seconds: [simulated_s, 0.0],
    };
    waiting.goes_on("scoring");
    let bytes = finish(pack, recipe, scoring, &mut trained).map_err(Failure::usage)?;
    drop(waiting);
    write_file(out, |file| file.write_all(&bytes))?;
    trained.seconds[1] = begin.elapsed().as_secs_f64() - simulated_s;
    if let Some(path) = &arguments.json {
        let text = report::json(recipe, &trained);
        write_text(path, &text)?;
    }
    print(&report::text(&trained, out))?;
    journal.remove()?;
    if arguments.dataset.is_none() {
        folder.remove()?;
    }
    Ok(ExitCode::from(if trained.is_useful() {
        exit::DONE
    } else {
        exit::NO_PROCESS
    }))
}

fn learn(
    recipe: &IdentifierRecipe,
    [learning, choosing]: [&[ExampleRecord]; 2],
    journal: &Journal,
    workers: &Workers,
) -> Result<(Trainer, Outcome), Failure> {
    let kept = Kept { journal, number: 1 };
    let mut trainer = super::begun(Some(&kept), || {
        recipe
            .network()
            .and_then(|network| Trainer::new(recipe.settings(), network))
    })?;
    let bar = progress_bar(recipe.epochs);
    let (training, validation) = (rows(learning), rows(choosing));
    let outcome = super::train(
        &mut trainer,
        [&training, &validation],
        workers,
        Some(&kept),
        |epoch| {
            bar.set_position(epoch.number);
            bar.set_message(format!(
                "loss {:.4}, of unseen cycles {:.4}",
                epoch.training_loss, epoch.validation_loss
            ));
        },
    )?;
    bar.finish_and_clear();
    Ok((trainer, outcome))
}

fn best_epoch(history: &[Epoch]) -> u64 {
    history
        .iter()
        .rfind(|epoch| epoch.is_best)
        .map_or(0, |epoch| epoch.number)
}

/// The calibrated pack, without its card, and the effect of storing weights as bytes.
fn pack(
    recipe: &IdentifierRecipe,
    network: &Network,
    [learning, choosing]: [&[ExampleRecord]; 2],
) -> Result<(PackContents, Quantisation), Failure> {
    let made = || -> Result<_, IdentifierError> {
        let first = recipe.pack(network, learning, &Calibrated::not_yet())?;
        let bytes = first.to_bytes()?;
        let pack =
            Pack::read(&bytes).map_err(onecycle_lab::learn::pack::PackContentsError::from)?;
        let calibrated = calibrated(recipe, &pack, choosing)?;
        let signatures: Vec<_> = choosing
            .iter()
            .map(|record| record.example.signature.values)
            .collect();
        let quantisation = quantisation(&pack, network, &signatures)?;
        Ok((recipe.pack(network, learning, &calibrated)?, quantisation))
    };
    made().map_err(Failure::usage)
}

/// Scores the pack, writes the scores to its card, and returns its bytes.
fn finish(
    mut pack: PackContents,
    recipe: &IdentifierRecipe,
    scoring: &[ExampleRecord],
    trained: &mut IdentifierRun,
) -> Result<Vec<u8>, IdentifierError> {
    let bytes = pack.to_bytes()?;
    let read = Pack::read(&bytes).map_err(onecycle_lab::learn::pack::PackContentsError::from)?;
    let families = recipe.experiments.families.len();
    let of = |family: Option<usize>| {
        let cycles: Vec<&ExampleRecord> = scoring
            .iter()
            .filter(|record| family.is_none_or(|family| record.example.family + 1 == family))
            .collect();
        FamilyScores {
            family,
            scores: scores(&read, &cycles),
        }
    };
    trained.scores = std::iter::once(None)
        .chain((1..=families).map(Some).filter(|_| families > 1))
        .map(of)
        .collect();
    pack.card = report::card(recipe, trained);
    let bytes = pack.to_bytes()?;
    let read = Pack::read(&bytes).map_err(onecycle_lab::learn::pack::PackContentsError::from)?;
    trained.sizes = read.sizes();
    Ok(bytes)
}
