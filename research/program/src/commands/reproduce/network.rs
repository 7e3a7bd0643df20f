//! Our network of the paper's size with both softmax functions; the recipes of all networks.

use onecycle_cli::failure::Failure;
use onecycle_cli::report::number::{degrees, percent};
use onecycle_lab::paper::classifier::{Choice, ClassifierRecipe, PickRule, Score, Test};
use serde::Deserialize;

use super::sheet::typed;
use crate::commands::train::classifier::{forget, learn};
use crate::journal::Journal;
use crate::results::classifier::{SetKind, TrainedNetwork};
use crate::results::reproduction::{Numbers, Row, or_dash};
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
    /// The paper's, with what its authors' published code says.
    #[serde(rename = "literal")]
    Literal,
    /// The same on a small space, for seconds of training.
    #[serde(rename = "literal_small")]
    LiteralSmall,
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
    /// The fields of the recipe, some of them replaced.
    pub(super) fn with(self, change: &toml::Table) -> Result<toml::Table, Failure> {
        let mut fields = self.table()?;
        fields.extend(change.clone());
        Ok(fields)
    }

    /// The fields of the recipe.
    pub(super) fn table(self) -> Result<toml::Table, Failure> {
        let text = match self {
            Self::Literal => include_str!("../../../reproduction/literal.toml"),
            Self::LiteralSmall => include_str!("../../../reproduction/literal_small.toml"),
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
    let accuracy = row("accuracy", |score| percent(score.accuracy));
    let costs = [
        row("mean |J|", |score| or_dash(score.mean, percent)),
        row("largest |J|", |score| or_dash(score.worst, percent)),
        row("least phase margin", |score| {
            or_dash(score.least_margin_rad, degrees)
        }),
        row("unstable", |score| score.unstable.to_string()),
        row("experiments", |score| score.examples.to_string()),
    ];
    let accuracy = (kind == SetKind::Verification).then_some(accuracy);
    accuracy.into_iter().chain(costs).collect()
}
