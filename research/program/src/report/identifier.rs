//! Result of training an identifier.

use std::path::Path;

use onecycle_cli::report::json::to_text;
use onecycle_lab::learn::identifier::IdentifierRecipe;
use onecycle_onboard::pack::{CONTROLLER_FORM, EXCITATION, STRUCTURE};
use serde_json::{Value, json};

use crate::results::identifier::{FamilyScores, IdentifierRun};

/// Version of the JSON; raised with every change that a reader could notice.
const SCHEMA: &str = "onecycle.identifier/1";

/// The card of the pack.
pub(crate) fn card(recipe: &IdentifierRecipe, run: &IdentifierRun) -> Value {
    json!({
        "program": concat!("onecycle ", env!("CARGO_PKG_VERSION")),
        "structure": STRUCTURE,
        "excitation": EXCITATION,
        "controller": { "form": CONTROLLER_FORM },
        "recipe": recipe,
        "training": {
            "examples": run.examples,
            "outcome": run.outcome,
            "epochs": run.epochs,
            "best_epoch": run.best_epoch,
        },
        "scores": run.scores,
    })
}

pub(crate) fn json(recipe: &IdentifierRecipe, run: &IdentifierRun) -> String {
    let [simulated_s, learnt_s] = run.seconds;
    to_text(&json!({
        "schema": SCHEMA,
        "card": card(recipe, run),
        "weights": run.weights,
        "bytes": {
            "weights": run.sizes.weights,
            "table": run.sizes.table,
            "card": run.sizes.card,
            "total": run.sizes.total,
        },
        "quantisation_rms": run.quantisation.rms,
        "seconds": { "experiments": simulated_s, "training": learnt_s },
    }))
}

pub(crate) fn text(run: &IdentifierRun, out: &Path) -> String {
    let [simulated_s, learnt_s] = run.seconds;
    let sizes = &run.sizes;
    let mut text = format!(
        "Identifier  {}\n  \
         {} examples in {simulated_s:.0} s, {} epochs in {learnt_s:.0} s ({}), best epoch {}\n  \
         {} weights, {} bytes; table {} bytes, card {} bytes, total {} bytes\n  \
         8-bit weights change the outputs by {:.1e}, of {:.1} (root mean squares)\n\n\
         Scores on single cycles of unseen processes, computed as on board\n",
        out.display(),
        run.examples,
        run.epochs,
        run.outcome.replace('_', " "),
        run.best_epoch,
        run.weights,
        sizes.weights,
        sizes.table,
        sizes.card,
        sizes.total,
        run.quantisation.rms,
        run.quantisation.size,
    );
    for scored in &run.scores {
        text += &row(scored);
    }
    if !run.is_useful() {
        text += "\nOf little use: a useful pack has a median |J| up to 10 %, an answer to half of the cycles and at most \
                 1 % unstable loops. Raise learning and epochs in the recipe.\n";
    }
    text
}

fn row(scored: &FamilyScores) -> String {
    let scores = &scored.scores;
    let name = scored.family.map_or("all families".to_owned(), |family| {
        format!("family {family}")
    });
    let percent = |value: f64| format!("{:.2}", 100.0 * value);
    let reliability: Vec<String> = scores
        .reliability
        .iter()
        .map(|level| format!("{:.0}: {:.1}", 100.0 * level.stated, 100.0 * level.held))
        .collect();
    format!(
        "{name}\n  \
         {} cycles, {} unknown ({:.1} %), {} unstable\n  \
         |J| (%)  mean {}, median {}, 99 % {}, worst {}; smallest phase margin {:.1} deg\n  \
         intervals hold the truth (nominal %: actual %)  {}; squared distance {:.2}\n",
        scores.cycles,
        scores.unknown,
        100.0 * scores.unknown as f64 / scores.cycles.max(1) as f64,
        scores.unstable,
        percent(scores.mean),
        percent(scores.median),
        percent(scores.percentile_99),
        percent(scores.worst),
        scores.least_margin_deg,
        reliability.join(", "),
        scores.mahalanobis,
    )
}
