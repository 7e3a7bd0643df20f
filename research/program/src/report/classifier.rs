//! Scores of trained classifiers: one table for each set of experiments, one row for each loss and rule.

use std::fmt::Write;

use onecycle_cli::report::json::to_text;
use onecycle_cli::report::number::significant;
use onecycle_lab::learn::train::Loss;
use onecycle_lab::paper::classifier::{INPUTS, PickRule, Protocol, Score};
use serde::Serialize;

use crate::results::classifier::{ClassifierRun, ScoredSet, SetKind, TrainedNetwork};

/// Version of the JSON; raised with every change that a reader could notice.
const SCHEMA: &str = "onecycle.train.classifier/2";

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    #[serde(flatten)]
    run: &'a ClassifierRun<'a>,
}

/// The scores as JSON.
pub(crate) fn json(run: &ClassifierRun<'_>) -> String {
    to_text(&Report {
        schema: SCHEMA,
        run,
    })
}

/// The name of a loss in the table.
pub(crate) fn name(loss: &Loss) -> &'static str {
    match loss {
        Loss::CrossEntropy => "conventional softmax",
        Loss::ModifiedSoftmax { .. } => "modified softmax as printed",
        Loss::ShiftedSoftmax { .. } => "modified softmax, shifted",
        Loss::CostAugmented { .. } => "cost-augmented softmax",
        Loss::ExpectedCost { .. } => "expected cost",
        Loss::SquaredError { .. } => "regression",
        Loss::Gaussian { .. } | Loss::CostAwareGaussian { .. } => "density",
    }
}

/// The scores as text.
pub(crate) fn text(run: &ClassifierRun<'_>) -> String {
    let recipe = run.recipe;
    let mut text = String::new();
    let widths: Vec<String> = [INPUTS / recipe.every]
        .into_iter()
        .chain(recipe.hidden.iter().copied())
        .chain([run.classes])
        .map(|width| width.to_string())
        .collect();
    let _ = writeln!(
        text,
        "Network   {}, {} weights\n\
         Classes   {}, neighbours {} % apart\n\
         Training  {} experiments, {}, bias up to {} h, noise up to {} of the amplitude\n\
         Time      {} s",
        widths.join("-"),
        run.weights,
        run.classes,
        significant(100.0 * recipe.deterioration),
        run.examples,
        described(recipe.protocol),
        recipe.bias,
        recipe.sigma,
        significant(run.seconds),
    );
    for (number, set) in run.sets.iter().enumerate() {
        table(&mut text, set, number, &run.networks);
    }
    let best = &run.networks[run.best];
    let _ = writeln!(
        text,
        "\nBest on the classes: {}, after epoch {} of {}.",
        name(&best.loss),
        best.history
            .iter()
            .rfind(|epoch| epoch.is_best)
            .map_or(0, |epoch| epoch.number),
        best.history.len(),
    );
    for trained in run.networks.iter().filter(|one| one.outcome == "diverged") {
        let _ = writeln!(text, "Diverged: {}.", name(&trained.loss));
    }
    text
}

fn table(text: &mut String, set: &ScoredSet, number: usize, networks: &[TrainedNetwork]) {
    let of = match set.kind {
        SetKind::Verification => "of the classes",
        SetKind::Test => "of random processes",
    };
    let _ = writeln!(
        text,
        "\n{} experiments {of}, {}; {} more without a steady oscillation\n\
         {:28} {:15} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}",
        set.examples,
        described(set.protocol),
        set.unsteady,
        "loss",
        "pick",
        "accuracy",
        "mean |J|",
        "99 %",
        "worst",
        "unstable",
        "margin",
        "training",
    );
    for trained in networks {
        for (rule, score) in PickRule::ALL.into_iter().zip(&trained.scores[number]) {
            let pick = match rule {
                PickRule::MostLikely => "most likely",
                PickRule::LeastExpectedCost => "least cost",
            };
            let seconds = format!("{} s", significant(trained.seconds));
            line(text, (name(&trained.loss), pick), score, &seconds);
        }
    }
    let [harmonics, amplitude] = &set.best;
    line(text, ("best possible class", ""), harmonics, "");
    line(text, ("the same, gain by amplitude", ""), amplitude, "");
}

fn line(text: &mut String, (loss, pick): (&str, &str), score: &Score, seconds: &str) {
    let percent = |part: Option<f64>| {
        part.map_or("unstable".to_owned(), |part| {
            format!("{:.2} %", 100.0 * part)
        })
    };
    let margin = score.least_margin_rad;
    let row = format!(
        "{loss:28} {pick:15} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {seconds:>8}",
        percent(Some(score.accuracy)),
        percent(score.mean),
        percent(score.percentile_99),
        percent(score.worst),
        score.unstable,
        margin.map_or("-".to_owned(), |rad| format!("{:.1} deg", rad.to_degrees())),
    );
    let _ = writeln!(text, "{}", row.trim_end());
}

fn described(protocol: Protocol) -> &'static str {
    match protocol {
        Protocol::Trimmed => "trim on",
        Protocol::Untrimmed => "bias left in",
        Protocol::Both => "trim on and bias left in, alternating",
    }
}
