//! Tables II and III: the paper's network with both softmax functions.

use onecycle_lab::paper::classifier::{Choice, ClassifierRecipe, PickRule, Score, Test};
use serde::Deserialize;

use crate::commands::train::classifier::{forget, learn};
use crate::commands::workers::Workers;
use crate::failure::Failure;
use crate::journal::Journal;
use crate::report::number::{degrees, percent};
use crate::results::classifier::{SetKind, TrainedNetwork};
use crate::results::reproduction::{Numbers, Row};

/// The recipe, and the fields that replace its own.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NetworkSettings {
    /// A recipe of `cli/reproduction`.
    recipe: RecipeName,
    /// Losses, one for each column.
    losses: Vec<Choice>,
    /// Test processes of Table III.
    test: Test,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum RecipeName {
    PaperNetwork,
    PaperNetworkSmall,
}

impl NetworkSettings {
    fn recipe(&self) -> Result<ClassifierRecipe, Failure> {
        let text = match self.recipe {
            RecipeName::PaperNetwork => include_str!("../../../reproduction/paper_network.toml"),
            RecipeName::PaperNetworkSmall => {
                include_str!("../../../reproduction/paper_network_small.toml")
            }
        };
        let recipe: ClassifierRecipe = toml::from_str(text).map_err(Failure::usage)?;
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
