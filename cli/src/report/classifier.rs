//! What classifiers have learnt: a table a set of experiments, a row a loss and rule.

use std::fmt::Write;

use onecycle_lab::learn::train::Loss;
use onecycle_lab::paper::classifier::{INPUTS, PickRule, Protocol, Score};
use serde::Serialize;

use super::json::to_text;
use super::number::significant;
use crate::commands::train::classifier::{Done, Kind, Set, Trained};

/// Changes with every change that a reader of the table could notice.
const SCHEMA: &str = "onecycle.train.classifier/1";

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    #[serde(flatten)]
    done: &'a Done<'a>,
}

/// The table for programs.
pub(crate) fn json(done: &Done<'_>) -> String {
    to_text(&Report {
        schema: SCHEMA,
        done,
    })
}

/// A loss as the table calls it.
pub(crate) fn name(loss: &Loss) -> &'static str {
    match loss {
        Loss::CrossEntropy => "conventional softmax",
        Loss::ModifiedSoftmax { .. } => "modified softmax as printed",
        Loss::ShiftedSoftmax { .. } => "modified softmax, shifted",
        Loss::CostAugmented { .. } => "cost-augmented softmax",
        Loss::ExpectedCost { .. } => "expected cost",
        Loss::Gaussian { .. } | Loss::CostAwareGaussian { .. } => "density",
    }
}

/// The table for people.
pub(crate) fn text(done: &Done<'_>) -> String {
    let recipe = done.recipe;
    let mut text = String::new();
    let widths: Vec<String> = [INPUTS]
        .into_iter()
        .chain(recipe.hidden.iter().copied())
        .chain([done.classes])
        .map(|width| width.to_string())
        .collect();
    let _ = writeln!(
        text,
        "Network   {}, {} weights\n\
         Classes   {}, neighbours {} % apart\n\
         Learnt    from {} experiments, {}, bias up to {} h, noise up to {} of the amplitude\n\
         Time      {} s",
        widths.join("-"),
        done.weights,
        done.classes,
        significant(100.0 * recipe.deterioration),
        done.examples,
        described(recipe.protocol),
        recipe.bias,
        recipe.sigma,
        significant(done.seconds),
    );
    for (number, set) in done.sets.iter().enumerate() {
        table(&mut text, set, number, &done.networks);
    }
    let best = &done.networks[done.best];
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
    for trained in done.networks.iter().filter(|one| one.outcome == "diverged") {
        let _ = writeln!(text, "Diverged: {}.", name(&trained.loss));
    }
    text
}

fn table(text: &mut String, set: &Set, number: usize, networks: &[Trained]) {
    let of = match set.kind {
        Kind::Verification => "of the classes",
        Kind::Test => "of random processes",
    };
    let _ = writeln!(
        text,
        "\n{} experiments {of}, {}; {} more were not steady\n\
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
    line(text, ("best class there is", ""), harmonics, "");
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
        Protocol::Both => "trim on and bias left in by turns",
    }
}
