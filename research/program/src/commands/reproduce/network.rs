//! Tables II and III: our network of the paper's size with both softmax functions, and what its figures depend on.

use onecycle_cli::failure::Failure;
use onecycle_cli::report::number::{degrees, percent};
use onecycle_lab::paper::classifier::{Choice, ClassifierRecipe, PickRule, Score, Test};
use serde::Deserialize;

use super::Kept;
use super::sheet::typed;
use crate::commands::train::classifier::{forget, learn};
use crate::journal::Journal;
use crate::results::classifier::{SetKind, TrainedNetwork};
use crate::results::reproduction::{Numbers, Row};
use crate::workers::Workers;

/// The recipe, and the fields that replace its own.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NetworkSettings {
    /// A recipe of `research/program/reproduction`.
    recipe: RecipeName,
    /// Losses, one for each column.
    losses: Vec<Choice>,
    /// Test processes of Table III.
    test: Test,
}

/// A recipe of `research/program/reproduction`.
#[derive(Clone, Copy, Deserialize)]
pub(super) enum RecipeName {
    /// The bias is trimmed away.
    #[serde(rename = "paper_network")]
    Trimmed,
    /// Seconds of training.
    #[serde(rename = "paper_network_small")]
    Small,
    /// The bias is left in, as in the paper.
    #[serde(rename = "paper_network_untrimmed")]
    Untrimmed,
}

impl RecipeName {
    /// The fields of the recipe.
    pub(super) fn table(self) -> Result<toml::Table, Failure> {
        let text = match self {
            Self::Trimmed => include_str!("../../../reproduction/paper_network.toml"),
            Self::Small => {
                include_str!("../../../reproduction/paper_network_small.toml")
            }
            Self::Untrimmed => {
                include_str!("../../../reproduction/paper_network_untrimmed.toml")
            }
        };
        toml::from_str(text).map_err(Failure::usage)
    }
}

impl NetworkSettings {
    fn recipe(&self) -> Result<ClassifierRecipe, Failure> {
        let recipe: ClassifierRecipe = typed(&self.recipe.table()?)?;
        Ok(ClassifierRecipe {
            losses: self.losses.clone(),
            tests: vec![self.test],
            ..recipe
        })
    }
}

pub(super) fn find(
    settings: &NetworkSettings,
    journal: &Journal,
    workers: &Workers,
) -> Result<Numbers, Failure> {
    let recipe = settings.recipe()?;
    recipe.validate().map_err(Failure::usage)?;
    let learnt = learn(&recipe, Some(journal), workers, Failure::usage)?;
    let sets = learnt.run.sets.iter().enumerate();
    let tables = sets.map(|(number, set)| {
        let of = |trained: &TrainedNetwork| trained.scores[number][PickRule::MostLikely as usize];
        let scores = learnt.run.networks.iter().map(of);
        let [best, _] = set.best;
        table(&scores.chain([best]).collect::<Vec<_>>(), set.kind)
    });
    let found = Numbers {
        tables: tables.collect(),
        figures: vec![],
    };
    forget(journal, &recipe)?;
    Ok(found)
}

fn table(scores: &[Score], kind: SetKind) -> Vec<Row> {
    let row = |name: &str, cell: fn(&Score) -> String| Row::new(name, scores.iter().map(cell));
    let cost = |cost: Option<f64>| cost.map_or("-".to_owned(), percent);
    let accuracy = row("accuracy", |score| percent(score.accuracy));
    let costs = [
        row("mean |J|", |score| {
            score.mean.map_or("-".to_owned(), percent)
        }),
        Row::new("largest |J|", scores.iter().map(|score| cost(score.worst))),
        row("least phase margin", |score| {
            score.least_margin_rad.map_or("-".to_owned(), degrees)
        }),
        row("unstable", |score| score.unstable.to_string()),
        row("experiments", |score| score.examples.to_string()),
    ];
    let accuracy = (kind == SetKind::Verification).then_some(accuracy);
    accuracy.into_iter().chain(costs).collect()
}

/// One recipe and several changes of it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VariantSettings {
    /// A recipe of `research/program/reproduction`.
    recipe: RecipeName,
    /// Fields that replace those of the recipe in every variant.
    common: toml::Table,
    /// One row each.
    variants: Vec<Variant>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Variant {
    /// Name of the row.
    name: String,
    /// Fields that replace those of the recipe.
    #[serde(default)]
    change: toml::Table,
}

/// One network for each variant, with the first of its losses. Each is kept by itself.
pub(super) fn variants(
    settings: &VariantSettings,
    kept: &Kept<'_>,
    workers: &Workers,
) -> Result<Numbers, Failure> {
    let mut rows = Vec::with_capacity(settings.variants.len());
    for (number, variant) in (1..).zip(&settings.variants) {
        let mut fields = settings.recipe.table()?;
        fields.extend(settings.common.clone());
        fields.extend(variant.change.clone());
        let recipe: ClassifierRecipe = typed(&fields)?;
        recipe.validate().map_err(Failure::usage)?;
        let cells = kept.step(number).result(&recipe, |journal| {
            let learnt = learn(&recipe, Some(journal), workers, Failure::usage)?;
            let cells = learnt.run.networks.first().map(|trained| {
                let sets = learnt.run.sets.iter().map(|set| set.best[0]);
                cells(trained, &sets.collect::<Vec<_>>())
            });
            forget(journal, &recipe)?;
            Ok(cells.unwrap_or_default())
        })?;
        rows.push(Row::new(&variant.name, cells));
    }
    Ok(Numbers {
        tables: vec![rows],
        figures: vec![],
    })
}

/// The verification set on the true process and by the best class, then as the paper counts; then random processes, by the
/// network and by the best class.
fn cells(trained: &TrainedNetwork, best: &[Score]) -> Vec<String> {
    let cost = |cost: Option<f64>| cost.map_or("-".to_owned(), percent);
    let of = |number: usize| trained.scores[number][PickRule::MostLikely as usize];
    let worst = |score: &Score| match score.unstable {
        0 => cost(score.worst),
        unstable => format!("{unstable} unstable"),
    };
    let between = trained.between.as_ref();
    let or_none = |cell: Option<String>| cell.unwrap_or("-".to_owned());
    let (verification, random) = (of(0), of(1));
    vec![
        cost(verification.mean),
        worst(&verification),
        cost(best[0].mean),
        or_none(between.map(|score| percent(score.accuracy))),
        or_none(between.map(|score| cost(score.mean))),
        or_none(between.map(worst)),
        cost(random.mean),
        worst(&random),
    ]
}
