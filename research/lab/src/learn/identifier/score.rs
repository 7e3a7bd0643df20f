//! Scores of a pack on experiments that it has not learnt from, computed as on board: with its network,
//! its score and its table.

use onecycle_onboard::classify::{Classification, Familiarity, classify_by};
use onecycle_onboard::gains::LeadTable;
use onecycle_onboard::pack::Pack;

use crate::judge::evaluate::Costs;
use crate::learn::dataset::VALUES;
use crate::learn::dataset::shards::ExampleRecord;
use onecycle_design::soiptd_pd::deterioration::{Deterioration, deterioration};
use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;

/// Scores over cycles; costs are without the cycles that were called unknown.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Scores {
    /// Number of cycles.
    pub cycles: usize,
    /// Number of cycles that were called unknown.
    pub unknown: usize,
    /// Number of controllers that are unstable on the true process.
    pub unstable: usize,
    /// Mean of `|J|` (fraction).
    pub mean: f64,
    /// Median of `|J|`.
    pub median: f64,
    /// 99th percentile of `|J|`.
    pub percentile_99: f64,
    /// Largest `|J|`.
    pub worst: f64,
    /// Least phase margin on the true process (degrees).
    pub least_margin_deg: f64,
    /// Mean square of the Mahalanobis distance of the truth, over four; one if the posterior is right.
    pub mahalanobis: f64,
    /// How often regions of the posterior contain the truth.
    pub reliability: [Reliability; LEVELS.len()],
}

/// A region of the posterior.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Reliability {
    /// Stated probability of the region.
    pub stated: f64,
    /// Fraction of cycles whose truth lies in the region.
    pub held: f64,
}

/// Probabilities, and the quantiles of chi-squared with four degrees of freedom (Abramowitz and Stegun,
/// table 26.8).
const LEVELS: [(f64, f64); 5] = [
    (0.5, 3.35669),
    (0.8, 5.98862),
    (0.9, 7.77944),
    (0.95, 9.48773),
    (0.99, 13.27670),
];

/// Result for a cycle.
struct Outcome {
    deterioration: Deterioration,
    mahalanobis: f64,
}

/// Scores of a pack on these records.
#[must_use]
pub fn scores(pack: &Pack<'_>, records: &[&ExampleRecord]) -> Scores {
    let mut scores = Scores {
        cycles: records.len(),
        ..Scores::default()
    };
    let outcomes: Vec<Outcome> = records
        .iter()
        .filter_map(|record| outcome(pack, record))
        .collect();
    scores.unknown = records.len() - outcomes.len();
    let costs = Costs::of(outcomes.iter().map(|outcome| Some(outcome.deterioration)));
    scores.unstable = costs.unstable;
    [
        scores.mean,
        scores.median,
        scores.percentile_99,
        scores.worst,
    ] = [costs.mean, costs.median, costs.percentile_99, costs.worst].map(Option::unwrap_or_default);
    scores.least_margin_deg = costs.least_phase_margin_deg.unwrap_or(f64::INFINITY);
    let count = outcomes.len().max(1) as f64;
    let squares = || outcomes.iter().map(|outcome| outcome.mahalanobis);
    scores.mahalanobis = squares().sum::<f64>() / (count * VALUES as f64);
    scores.reliability = LEVELS.map(|(stated, quantile)| Reliability {
        stated,
        held: squares().filter(|&square| square < quantile).count() as f64 / count,
    });
    scores
}

/// Result for a cycle; `None` if it is called unknown.
fn outcome(pack: &Pack<'_>, record: &ExampleRecord) -> Option<Outcome> {
    let found = classified(pack, record).filter(|found| found.familiarity == Familiarity::Known)?;
    let truth = &record.example.process;
    let margin_rad = f64::from(pack.domain().phase_margin_rad);
    let best = pd_at_phase_margin(truth, margin_rad).ok()?;
    let pd = LeadTable::from_bytes(pack.lead_table().bytes)
        .ok()?
        .pd_at_phase_margin(&found.candidates[0].process)
        .ok()?;
    Some(Outcome {
        deterioration: deterioration(pd, truth, &best),
        mahalanobis: mahalanobis(&found, &record.values),
    })
}

fn classified(pack: &Pack<'_>, record: &ExampleRecord) -> Option<Classification> {
    let example = &record.example;
    let noise_sigma = example.sigma * example.signature.amplitude;
    classify_by(pack, &example.signature, example.period_s, noise_sigma).ok()
}

/// Squared distance of the truth from the mean: `|root^-1 (values - mean)|^2`.
fn mahalanobis(found: &Classification, values: &[f64; VALUES]) -> f64 {
    let posterior = &found.posterior;
    let mut whitened = [0.0; VALUES];
    for i in (0..VALUES).rev() {
        let known: f64 = (i + 1..VALUES)
            .map(|k| posterior.root[i][k] * whitened[k])
            .sum();
        whitened[i] = (values[i] - posterior.mean[i] - known) / posterior.root[i][i];
    }
    whitened.iter().map(|value| value * value).sum()
}
