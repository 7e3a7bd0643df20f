//! Training of the paper's classifier with every loss of a recipe, scored on the same experiments.

use std::ops::Range;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use onecycle_cli::failure::{Failure, exit};
use onecycle_lab::learn::onnx;
use onecycle_lab::learn::train::{Dataset, Loss, Network, Trainer};
use onecycle_lab::paper::classifier::{
    Classes, ClassifierError, ClassifierRecipe, Examples, Gain, Keep, PickRule, Score, Standard,
    Standardised, picks,
};
use onecycle_lab::paper::network::{Card, FORMAT};

use super::Kept;
use crate::args;
use crate::journal::Journal;
use crate::output::{ProgressBar, print, progress_bar, write_file, write_text};
use crate::report::classifier as report;
use crate::results::classifier::{ClassifierRun, Counted, ScoredSet, SetKind, TrainedNetwork};
use crate::workers::{Quiet, Workers};

/// Processes of the paper's testing set.
const FIFTY: usize = 50;

/// Data that all losses share.
struct Lesson<'a> {
    recipe: &'a ClassifierRecipe,
    classes: Classes,
    training: Examples,
    standard: Standard,
    /// The first set is the verification set.
    sets: Vec<Examples>,
    workers: &'a Workers,
}

/// Result of a recipe.
pub(crate) struct Learnt<'a> {
    pub(crate) run: ClassifierRun<'a>,
    /// The best network.
    network: Network,
    card: Card,
}

pub(super) fn run(arguments: &args::Train, recipe: &ClassifierRecipe) -> Result<ExitCode, Failure> {
    let failed = |error| Failure::unreadable(&arguments.recipe, error);
    recipe.validate().map_err(failed)?;
    let workers = Workers::new(arguments.threads)?;
    let learnt = match &arguments.out {
        Some(out) => make(recipe, out, arguments.restart, &workers, failed)?,
        None => learn(recipe, None, &workers, failed)?,
    };
    if let Some(path) = &arguments.json {
        let text = report::json(&learnt.run);
        write_text(path, &text)?;
    }
    print(&report::text(&learnt.run))?;
    Ok(ExitCode::from(exit::DONE))
}

/// Trains a valid recipe and writes the best network to this ONNX file. An interrupted run is resumed. `failed` makes errors
/// of the recipe.
pub(crate) fn make<'a>(
    recipe: &'a ClassifierRecipe,
    out: &Path,
    restart: bool,
    workers: &'a Workers,
    failed: impl Fn(ClassifierError) -> Failure,
) -> Result<Learnt<'a>, Failure> {
    let journal = super::journal(out, recipe, restart)?;
    let learnt = learn(recipe, Some(&journal), workers, failed)?;
    write(out, &learnt.network, &learnt.card)?;
    journal.remove()?;
    Ok(learnt)
}

/// Trains one network for each loss of a valid recipe and scores them. `failed` makes errors of the recipe.
pub(crate) fn learn<'a>(
    recipe: &'a ClassifierRecipe,
    journal: Option<&Journal>,
    workers: &'a Workers,
    failed: impl Fn(ClassifierError) -> Failure,
) -> Result<Learnt<'a>, Failure> {
    let begin = Instant::now();
    let lesson = Lesson::prepare(recipe, workers).map_err(failed)?;
    let bar = progress_bar(recipe.losses.len() as u64 * recipe.epochs);
    let mut networks = Vec::new();
    let mut best: Option<((usize, f64), usize, Network)> = None;
    for number in 0..recipe.losses.len() {
        bar.set_position(number as u64 * recipe.epochs);
        let (trained, network) = lesson.learn(number, journal, &bar)?;
        let key = standing(&trained.scores[0]);
        if best.as_ref().is_none_or(|(least, ..)| key < *least) {
            best = Some((key, number, network));
        }
        networks.push(trained);
    }
    bar.finish_and_clear();
    let (_, best, network) = best.ok_or_else(|| Failure::usage("the recipe names no loss"))?;
    let card = lesson.card(best, better_rule(&networks[best].scores[0]));
    let weights = network.folded().weights();
    Ok(Learnt {
        run: lesson.run(networks, (best, weights), begin.elapsed()),
        network,
        card,
    })
}

/// Removes the networks of a recipe from a journal that is kept.
pub(crate) fn forget(journal: &Journal, recipe: &ClassifierRecipe) -> Result<(), Failure> {
    for number in 1..=recipe.losses.len() {
        journal.remove_piece(&Kept { journal, number }.name())?;
    }
    Ok(())
}

/// Rank of a network, smaller is better: unstable picks, then the mean cost, by the better rule.
fn standing(scores: &[Score; 2]) -> (usize, f64) {
    let score = &scores[better_rule(scores) as usize];
    (score.unstable, score.mean.unwrap_or(f64::INFINITY))
}

fn better_rule(scores: &[Score; 2]) -> PickRule {
    let key = |score: &Score| (score.unstable, score.mean.unwrap_or(f64::INFINITY));
    let [most_likely, least_expected] = PickRule::ALL;
    if key(&scores[1]) < key(&scores[0]) {
        least_expected
    } else {
        most_likely
    }
}

fn write(path: &Path, network: &Network, card: &Card) -> Result<(), Failure> {
    let card = serde_json::to_string(card).map_err(Failure::usage)?;
    let bytes = onnx::export(network, None, &[(FORMAT, card)]).map_err(Failure::usage)?;
    write_file(path, |file| file.write_all(&bytes))
}

impl<'a> Lesson<'a> {
    fn prepare(
        recipe: &'a ClassifierRecipe,
        workers: &'a Workers,
    ) -> Result<Self, ClassifierError> {
        let classes = recipe.classes(workers)?;
        let mut sets = recipe.all_sets(&classes, workers)?;
        let training = sets.remove(0);
        workers.finish();
        Ok(Self {
            recipe,
            classes,
            standard: recipe.scaled(&training),
            training,
            sets,
            workers,
        })
    }

    /// Trains with one loss; returns the scores and the best network.
    fn learn(
        &self,
        number: usize,
        journal: Option<&Journal>,
        bar: &ProgressBar,
    ) -> Result<(TrainedNetwork, Network), Failure> {
        let begin = Instant::now();
        let kept = journal.map(|journal| Kept {
            journal,
            number: number + 1,
        });
        let mut trainer = super::begun(kept.as_ref(), || {
            let network = self.recipe.network(number, self.classes.len())?;
            Ok::<_, ClassifierError>(Trainer::new(self.recipe.settings(number), network)?)
        })?;
        let loss = trainer.settings().loss;
        let [training, verification] =
            [&self.training, &self.sets[0]].map(|examples| Standardised {
                examples,
                standard: &self.standard,
            });
        let name = report::name(&loss);
        let outcome = super::train(
            &mut trainer,
            [&training, &verification],
            self.workers,
            kept.as_ref(),
            |epoch| {
                bar.set_position(number as u64 * self.recipe.epochs + epoch.number);
                bar.set_message(format!(
                    "{name}, epoch {}: loss {:.4}, verification {:.4}",
                    epoch.number, epoch.training_loss, epoch.validation_loss
                ));
            },
        )?;
        let kept = match self.recipe.keep {
            Keep::Best => trainer.best(),
            Keep::Last => trainer.network(),
        };
        let network = self.standard.before(kept).map_err(Failure::usage)?;
        let trained = TrainedNetwork {
            loss,
            outcome: super::described(outcome),
            history: trainer.history().to_vec(),
            seconds: begin.elapsed().as_secs_f64(),
            scores: self.scores(&network, loss).map_err(Failure::usage)?,
            counted: self.counted(&network, loss).map_err(Failure::usage)?,
        };
        Ok((trained, network))
    }

    fn scores(&self, network: &Network, loss: Loss) -> Result<Vec<[Score; 2]>, ClassifierError> {
        let network = network.folded();
        let workers = Quiet(self.workers);
        let scores = self.sets.iter().map(|examples| {
            if loss.outputs().is_some() {
                let score = Score::of_regression(&network, examples, &self.classes, &workers)?;
                return Ok([score; 2]);
            }
            let picks = picks(&network, examples, &self.classes, &workers)?;
            Ok(picks.map(|picks| Score::of_picks(&picks, examples, &self.classes)))
        });
        scores.collect()
    }

    /// The most likely classes of every set, counted in each way; empty for a regression.
    fn counted(&self, network: &Network, loss: Loss) -> Result<Vec<Counted>, ClassifierError> {
        if loss.outputs().is_some() {
            return Ok(vec![]);
        }
        let (network, workers) = (network.folded(), Quiet(self.workers));
        let counted = self.sets.iter().map(|examples| {
            let [picks, _] = picks(&network, examples, &self.classes, &workers)?;
            let score = |some: Range<usize>| {
                let of = (examples, &self.classes);
                Gain::ALL.map(|gain| Score::of_some(&picks, some.clone(), of, gain))
            };
            let fifties = (0..picks.len() / FIFTY).map(|k| score(k * FIFTY..(k + 1) * FIFTY));
            Ok(Counted {
                whole: score(0..picks.len()),
                fifties: fifties.collect(),
            })
        });
        counted.collect()
    }

    fn card(&self, best: usize, rule: PickRule) -> Card {
        let classes = 0..self.classes.len();
        Card {
            recipe: self.recipe.clone(),
            loss: self.recipe.losses[best].loss,
            rule,
            classes_s: classes.map(|class| self.classes.times_s(class)).collect(),
        }
    }

    fn run(
        &self,
        networks: Vec<TrainedNetwork>,
        (best, weights): (usize, usize),
        took: Duration,
    ) -> ClassifierRun<'a> {
        let verification = (SetKind::Verification, self.recipe.protocol);
        let tests = self
            .recipe
            .tests
            .iter()
            .map(|test| (SetKind::Test, test.protocol));
        let sets = [verification].into_iter().chain(tests).zip(&self.sets);
        let gains = [Gain::Harmonics, Gain::Amplitude];
        ClassifierRun {
            recipe: self.recipe,
            classes: self.classes.len(),
            weights,
            examples: self.training.len(),
            unsteady: self.training.unsteady(),
            sets: sets
                .map(|((kind, protocol), examples)| ScoredSet {
                    kind,
                    protocol,
                    examples: examples.len(),
                    unsteady: examples.unsteady(),
                    best: gains.map(|gain| Score::of_best(examples, &self.classes, gain)),
                })
                .collect(),
            networks,
            best,
            seconds: took.as_secs_f64(),
        }
    }
}
