//! Tables II and III by the paper's own recipe, and what each step from it to ours is worth.
//!
//! Picks are counted with gains found in each way of [`Gain::ALL`]. `matched` is how the authors' published code counts: both
//! processes have the same gain at the phase of the relay.

use onecycle_cli::failure::Failure;
use onecycle_cli::report::number::{degrees, percent};
use onecycle_lab::learn::train::Loss;
use onecycle_lab::paper::classifier::{Choice, ClassifierRecipe, Gain, PickRule, Score};
use serde::{Deserialize, Serialize};

use super::Kept;
use super::network::RecipeName;
use super::sheet::typed;
use crate::commands::train::classifier::{forget, learn};
use crate::results::reproduction::{Numbers, Row, or_dash};
use crate::workers::Workers;

/// A recipe, trained with each loss from each seed.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LiteralSettings {
    /// A recipe of `research/program/reproduction`.
    recipe: RecipeName,
    /// Fields that replace those of the recipe.
    #[serde(default)]
    change: toml::Table,
    /// Two columns each: gain matched, and gain by the describing function.
    columns: Vec<Column>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Column {
    loss: Loss,
    /// Seeds of experiments and training, one network each.
    seeds: Vec<u64>,
}

/// One recipe and changes of it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AblationSettings {
    /// A recipe of `research/program/reproduction`.
    recipe: RecipeName,
    /// Fields that replace those of the recipe in every row.
    common: toml::Table,
    /// One row each.
    steps: Vec<Step>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    /// Name of the row.
    name: String,
    /// Fields that replace those of the rows before.
    #[serde(default)]
    change: toml::Table,
    /// Whether the change stays for the rows that follow.
    #[serde(default)]
    stays: bool,
}

/// Scores of a network's most likely classes, in each way of [`Gain::ALL`].
#[derive(Serialize, Deserialize)]
struct Found {
    outcome: String,
    verification: [Score; 4],
    random: [Score; 4],
    /// The random processes in sets of fifty.
    fifties: Vec<[Score; 4]>,
}

/// How the columns of Tables II and III count.
const COUNTED: [Gain; 2] = [Gain::Matched, Gain::DescribingFunction];

/// Tables II and III, and the predictions of the first network counted in each way.
pub(super) fn find(
    settings: &LiteralSettings,
    kept: &Kept<'_>,
    workers: &Workers,
) -> Result<Numbers, Failure> {
    let mut columns = Vec::new();
    let mut number = 0;
    for &Column { loss, ref seeds } in &settings.columns {
        let mut found = Vec::new();
        for &seed in seeds {
            number += 1;
            let recipe = ClassifierRecipe {
                seed,
                losses: vec![Choice { loss, rate: None }],
                ..typed(&settings.recipe.with(&settings.change)?)?
            };
            found.push(trained(&recipe, &kept.step(number), workers)?);
        }
        columns.push(found);
    }
    let verification = table(&columns, true, |found| vec![&found.verification]);
    let testing = table(&columns, false, |found| found.fifties.iter().collect());
    let first = columns.first().and_then(|column| column.first());
    Ok(Numbers {
        tables: vec![
            verification,
            testing,
            first.map(counted).unwrap_or_default(),
        ],
        figures: vec![],
    })
}

/// Trains a recipe with its one loss, or takes what an earlier run has found.
fn trained(
    recipe: &ClassifierRecipe,
    kept: &Kept<'_>,
    workers: &Workers,
) -> Result<Found, Failure> {
    recipe.validate().map_err(Failure::usage)?;
    kept.result(recipe, |journal| {
        let mut learnt = learn(recipe, Some(journal), workers, Failure::usage)?;
        let network = learnt.run.networks.pop();
        let network = network.ok_or_else(|| Failure::usage("the recipe names no loss"))?;
        let of = |number: usize| match network.counted.get(number) {
            Some(counted) => counted.whole,
            // A regression has the gain from harmonics alone.
            None => [network.scores[number][PickRule::MostLikely as usize]; 4],
        };
        let fifties = network.counted.get(1).map(|set| set.fifties.clone());
        let found = Found {
            outcome: network.outcome.to_owned(),
            verification: of(0),
            random: of(1),
            fifties: fifties.unwrap_or_default(),
        };
        forget(journal, recipe)?;
        Ok(found)
    })
}

/// Scores of some sets of a network, each in every way of counting.
type Sets = fn(&Found) -> Vec<&[Score; 4]>;

/// One column for each loss and way of counting: the median over seeds and sets, and the range.
fn table(columns: &[Vec<Found>], has_accuracy: bool, sets: Sets) -> Vec<Row> {
    let scores = |found: &[Found], gain: Gain| -> Vec<Score> {
        let sets = found.iter().flat_map(sets);
        sets.map(|scores| scores[gain as usize]).collect()
    };
    let row = |name: &str, cell: &dyn Fn(&[Score]) -> String| {
        let cells = columns
            .iter()
            .flat_map(|found| COUNTED.map(|gain| cell(&scores(found, gain))));
        Row::new(name, cells)
    };
    let spread = |of: fn(&Score) -> Option<f64>, text: fn(f64) -> String| {
        move |scores: &[Score]| spread(scores.iter().filter_map(of).collect(), text)
    };
    let accuracy = row("accuracy", &spread(|score| Some(score.accuracy), percent));
    let rows = [
        row(
            "mean J, with its sign",
            &spread(|score| score.mean_signed, percent),
        ),
        row(
            "mean of max(J, 0)",
            &spread(|score| score.mean_positive, percent),
        ),
        row("largest J", &spread(|score| score.largest, percent)),
        row(
            "least phase margin",
            &spread(|score| score.least_margin_rad, degrees),
        ),
        row("unstable", &|scores: &[Score]| {
            let count = |of: fn(&Score) -> usize| scores.iter().map(of).sum::<usize>();
            format!(
                "{} of {}",
                count(|score| score.unstable),
                count(|score| score.examples)
            )
        }),
    ];
    let accuracy = has_accuracy.then_some(accuracy);
    accuracy.into_iter().chain(rows).collect()
}

/// Median and range; a dash for no value.
fn spread(mut values: Vec<f64>, text: fn(f64) -> String) -> String {
    values.sort_unstable_by(f64::total_cmp);
    match values[..] {
        [] => "-".to_owned(),
        [one] => text(one),
        [least, .., most] => {
            let count = values.len();
            let median = 0.5 * (values[(count - 1) / 2] + values[count / 2]);
            format!("{} ({} to {})", text(median), text(least), text(most))
        }
    }
}

/// The same predictions on random processes, counted with the gain found in each way.
fn counted(found: &Found) -> Vec<Row> {
    let row = |(name, gain): (&str, Gain)| {
        let score = &found.random[gain as usize];
        let cells = [
            or_dash(score.mean_signed, percent),
            or_dash(score.mean_positive, percent),
            or_dash(score.mean, percent),
            or_dash(score.largest, percent),
            score.unstable.to_string(),
            margin(score),
        ];
        Row::new(name, cells)
    };
    let ways = [
        ("matched at the phase of the relay", Gain::Matched),
        (
            "from the amplitude, by the describing function",
            Gain::DescribingFunction,
        ),
        ("from the amplitude of the class", Gain::Amplitude),
        ("from the harmonics of both signals", Gain::Harmonics),
    ];
    ways.into_iter().map(row).collect()
}

fn margin(score: &Score) -> String {
    or_dash(score.least_margin_rad, degrees)
}

/// One network for each step. Each is kept by itself.
pub(super) fn ablation(
    settings: &AblationSettings,
    kept: &Kept<'_>,
    workers: &Workers,
) -> Result<Numbers, Failure> {
    let mut base = settings.recipe.with(&settings.common)?;
    let mut rows = Vec::with_capacity(settings.steps.len());
    for (number, step) in (1..).zip(&settings.steps) {
        let mut fields = base.clone();
        fields.extend(step.change.clone());
        let found = trained(&typed(&fields)?, &kept.step(number), workers)?;
        rows.push(Row::new(&step.name, cells(&found)));
        if step.stays {
            base = fields;
        }
    }
    Ok(Numbers {
        tables: vec![rows],
        figures: vec![],
    })
}

/// The verification set, then random processes: gain matched, by the describing function, from the harmonics.
fn cells(found: &Found) -> Vec<String> {
    let largest = |score: &Score| match score.unstable {
        0 => or_dash(score.largest, percent),
        unstable => format!("{unstable} of {} unstable", score.examples),
    };
    let [harmonics, _, describing, matched] = &found.random;
    let classes = &found.verification[Gain::Matched as usize];
    let mut cells = vec![
        percent(classes.accuracy),
        or_dash(classes.mean_positive, percent),
        largest(classes),
        or_dash(matched.mean_signed, percent),
        or_dash(matched.mean_positive, percent),
        largest(matched),
        margin(matched),
        or_dash(describing.mean_positive, percent),
        largest(describing),
        or_dash(harmonics.mean, percent),
        largest(harmonics),
    ];
    if found.outcome == "diverged" {
        cells.fill("diverged".to_owned());
    } else if found.fifties.is_empty() {
        // A regression is no class, and has no such gains.
        cells[..9].fill("-".to_owned());
    }
    cells
}
