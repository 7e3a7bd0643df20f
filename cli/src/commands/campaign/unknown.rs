//! What is made of processes out of the family: a row for each kind of them.

use std::fmt::Write;
use std::path::Path;

use onecycle_lab::experiments::{Campaign, DefectKind, ExperimentError};
use onecycle_lab::judge::out_of_family::{CYCLES, CycleClassifier, Evaluated, evaluate};
use onecycle_onboard::classify::{Calibration, ClassifyError, Familiarity};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::signature::Signature;
use rayon::prelude::*;

use crate::failure::Failure;
use crate::output::progress_bar;
use crate::settings;

/// Cases of the family for one of each kind out of it: what is rare there counts most.
const IN_FAMILY: u64 = 5;

/// The cases' outcomes as a table.
pub(super) fn table(file: &Path, campaign: &Campaign) -> Result<String, Failure> {
    let recipe = campaign.recipe();
    recipe
        .validate()
        .map_err(|error| settings::out_of_range(file, error))?;
    let pack = Pack::embedded().map_err(Failure::usage)?;
    let network = |signature: &Signature| pack.outputs(&signature.values);
    let classifier = CycleClassifier {
        network: &network,
        calibration: Calibration::of_pack(&pack)
            .ok_or_else(|| Failure::usage(ClassifyError::Pack))?,
    };
    let kinds = || std::iter::once(DefectKind::InFamily).chain(DefectKind::OUTSIDE);
    let cases = |kind| match kind {
        DefectKind::InFamily => IN_FAMILY * campaign.cases,
        _ => campaign.cases,
    };
    let bar = progress_bar(kinds().map(cases).sum());
    let mut rows = Vec::new();
    for kind in kinds() {
        let outcomes: Vec<Option<Evaluated>> = (0..cases(kind))
            .into_par_iter()
            .map(|n| {
                let outcome = evaluate(&recipe, kind, n, Some(&classifier));
                bar.inc(1);
                outcome
            })
            .collect::<Result<_, ExperimentError>>()
            .map_err(Failure::usage)?;
        rows.push((kind, outcomes.into_iter().flatten().collect::<Vec<_>>()));
    }
    bar.finish_and_clear();
    Ok(text(campaign, &rows))
}

fn text(campaign: &Campaign, rows: &[(DefectKind, Vec<Evaluated>)]) -> String {
    let mut text = format!(
        "{} random processes with each defect, bias up to {} h, noise up to {} of the amplitude, trim {}\n\
         refused, and accepted although the controller costs over 10 % more than promised, of {} \
         cycles; silent: of these last, those whose last cycle is not called unknown either\n",
        campaign.cases,
        campaign.bias,
        campaign.sigma,
        if campaign.trim { "on" } else { "off" },
        CYCLES.map(|cycles| cycles.to_string()).join(", "),
    );
    let of_cycles: String = CYCLES
        .map(|cycles| format!("  refused {cycles} harmful {cycles}"))
        .concat();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{:<13} cases unsteady  harmful unknown  harmless unknown{of_cycles} silent",
        "kind"
    );
    for (kind, outcomes) in rows {
        let unsteady = outcomes.iter().filter(|outcome| !outcome.is_steady).count();
        let _ = write!(
            text,
            "{:<13} {:5} {unsteady:8}",
            kind.name(),
            outcomes.len()
        );
        for harmful in [true, false] {
            let [all, unknown] = by_score(outcomes, harmful);
            let _ = write!(text, "  {all:8} {unknown:7}");
        }
        for k in 0..CYCLES.len() {
            let [refused, harmful] = by_identification(outcomes, k);
            let _ = write!(text, "  {refused:9} {harmful:9}");
        }
        let _ = writeln!(text, " {:6}", silent(outcomes));
    }
    text
}

/// Cases with a score that are harmful or not: all, and those called unknown.
fn by_score(outcomes: &[Evaluated], harmful: bool) -> [usize; 2] {
    let scored = || {
        (outcomes.iter())
            .filter_map(|outcome| outcome.scored)
            .filter(move |scored| scored.harm.is_harmful() == harmful)
    };
    let unknown = scored().filter(|scored| scored.verdict == Familiarity::Unknown);
    [scored().count(), unknown.count()]
}

/// Refused by the identification of so many cycles, and accepted but harmful.
fn by_identification(outcomes: &[Evaluated], k: usize) -> [usize; 2] {
    let accepted = || {
        outcomes
            .iter()
            .filter_map(move |outcome| outcome.identified[k])
    };
    let harmful = accepted().filter(|harm| harm.is_harmful());
    [outcomes.len() - accepted().count(), harmful.count()]
}

/// Harmful, accepted from the most cycles, and without a word on the last of them.
fn silent(outcomes: &[Evaluated]) -> usize {
    (outcomes.iter())
        .filter(|outcome| {
            let is_accepted = (outcome.identified.last().copied().flatten())
                .is_some_and(|harm| harm.is_harmful());
            let is_known =
                (outcome.scored).is_none_or(|scored| scored.verdict == Familiarity::Known);
            is_accepted && is_known
        })
        .count()
}
