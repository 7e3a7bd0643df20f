//! From the outputs of a network to a class, and the costs of its controllers.
//!
//! | rule                | the class picked                                           |
//! |---------------------|------------------------------------------------------------|
//! | most likely         | the one with the largest output: the paper's               |
//! | least expected cost | `min_i sum_k p_k min(J_ik, 1)`, `p` the softmax of the outputs |

use std::ops::Range;

use super::ClassifierError;
use super::classes::{Classes, Gain};
use super::examples::Examples;
use crate::learn::train::{Batch, Dataset, Matrix, Network};
use crate::workers::Workers;
use onecycle_design::soiptd_pd::deterioration::Deterioration;

/// How a class is picked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PickRule {
    /// The class with the largest output.
    MostLikely,
    /// The class with the least expected cost.
    LeastExpectedCost,
}

impl PickRule {
    /// Both rules.
    pub const ALL: [Self; 2] = [Self::MostLikely, Self::LeastExpectedCost];
}

/// Cost of an unstable loop in an expectation: twice the optimum.
const UNSTABLE: f64 = 1.0;

/// Probabilities below this part of the highest do not count in an expectation.
const UNLIKELY: f64 = 1e-6;

/// Examples evaluated at a time: some tens of MB.
const BATCH: usize = 512;

/// Scores of picked classes; costs are fractions.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Score {
    /// Number of examples.
    pub examples: usize,
    /// Fraction of examples whose pick is the best class.
    pub accuracy: f64,
    /// Mean of `|J|` over the stable loops.
    pub mean: Option<f64>,
    /// 99th percentile of `|J|`; null if that loop is unstable.
    pub percentile_99: Option<f64>,
    /// Largest `|J|` of the stable loops.
    pub worst: Option<f64>,
    /// Mean of `J` with its sign over the stable loops; a negative `J` is bought with margin.
    pub mean_signed: Option<f64>,
    /// Mean of `max(J, 0)` over the stable loops.
    pub mean_positive: Option<f64>,
    /// Largest `J` with its sign of the stable loops.
    pub largest: Option<f64>,
    /// Number of unstable loops.
    pub unstable: usize,
    /// Least phase margin of the stable loops (rad).
    pub least_margin_rad: Option<f64>,
}

impl Score {
    /// Score of picks on examples.
    #[must_use]
    pub fn of_picks(picks: &[usize], examples: &Examples, classes: &Classes) -> Self {
        let all = 0..picks.len();
        Self::of_some(picks, all, (examples, classes), examples.gain())
    }

    /// Score of the picks of these examples, at gains found in this way; panics if there are no such examples.
    #[must_use]
    pub fn of_some(
        picks: &[usize],
        some: Range<usize>,
        (examples, classes): (&Examples, &Classes),
        gain: Gain,
    ) -> Self {
        let judged = (some.clone())
            .map(|i| {
                let class = picks[i];
                (class, examples.judge(i, classes.class(class), gain))
            })
            .collect();
        Self::of(judged, &examples.labels()[some])
    }

    /// Score of a regression on examples: of the processes at the outputs of the network. Its accuracy is zero.
    ///
    /// # Errors
    /// [`ClassifierError`]: the network has other inputs or outputs than the examples.
    pub fn of_regression(
        network: &Network,
        examples: &Examples,
        classes: &Classes,
        workers: &dyn Workers,
    ) -> Result<Self, ClassifierError> {
        let mut judged = Vec::with_capacity(examples.len());
        outputs(network, examples, workers, |i, row| {
            judged.push((usize::MAX, examples.judge_regressed(i, classes, row)));
        })?;
        Ok(Self::of(judged, examples.labels()))
    }

    /// Score of the best possible picks, with gains found in this way.
    #[must_use]
    pub fn of_best(examples: &Examples, classes: &Classes, gain: Gain) -> Self {
        Self::of(examples.best(classes, gain), examples.labels())
    }

    fn of(judged: Vec<(usize, Deterioration)>, labels: &[usize]) -> Self {
        let examples = judged.len();
        let right = (judged.iter().zip(labels)).filter(|((class, _), label)| class == *label);
        let accuracy = right.count() as f64 / examples.max(1) as f64;
        let (mut costs, mut margins_rad) = (Vec::new(), Vec::new());
        for (_, outcome) in judged {
            if let Deterioration::Stable {
                relative,
                phase_margin_rad,
            } = outcome
            {
                costs.push(relative);
                margins_rad.push(phase_margin_rad);
            }
        }
        let mean = |values: &[f64]| {
            let count = values.len() as f64;
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / count)
        };
        let mean_signed = mean(&costs);
        let largest = costs.iter().copied().reduce(f64::max);
        let positive: Vec<f64> = costs.iter().map(|cost| cost.max(0.0)).collect();
        for cost in &mut costs {
            *cost = cost.abs();
        }
        costs.sort_unstable_by(f64::total_cmp);
        // Unstable loops rank last.
        let rank = (0.99 * examples.saturating_sub(1) as f64).round() as usize;
        Self {
            examples,
            accuracy,
            mean: mean(&costs),
            percentile_99: costs.get(rank).copied(),
            worst: costs.last().copied(),
            mean_signed,
            mean_positive: mean(&positive),
            largest,
            unstable: examples - costs.len(),
            least_margin_rad: margins_rad.into_iter().reduce(f64::min),
        }
    }
}

/// The classes that a network picks for every example, by each of [`PickRule::ALL`].
///
/// # Errors
/// [`ClassifierError`]: the network has other inputs or outputs than the examples.
pub fn picks(
    network: &Network,
    examples: &Examples,
    classes: &Classes,
    workers: &dyn Workers,
) -> Result<[Vec<usize>; 2], ClassifierError> {
    let mut picks = [const { Vec::new() }; 2];
    outputs(network, examples, workers, |_, row| {
        picks[0].push(most_likely(row));
        picks[1].push(least_expected_cost(row, classes.matrix()));
    })?;
    Ok(picks)
}

/// Hands each example's number and outputs to `take`, in order.
fn outputs(
    network: &Network,
    examples: &Examples,
    workers: &dyn Workers,
    mut take: impl FnMut(usize, &[f32]),
) -> Result<(), ClassifierError> {
    let mut batch = Batch::default();
    let order: Vec<usize> = (0..examples.len()).collect();
    for some in order.chunks(BATCH) {
        examples.fill(some, &mut batch);
        let outputs = network.evaluate(&batch.inputs, workers)?;
        for (&i, row) in some.iter().zip(outputs.iter_rows()) {
            take(i, row);
        }
    }
    Ok(())
}

/// The class with the largest output, the first of equals.
#[must_use]
pub fn most_likely(outputs: &[f32]) -> usize {
    let mut best = 0;
    for (k, value) in outputs.iter().enumerate() {
        if *value > outputs[best] {
            best = k;
        }
    }
    best
}

/// The class with the least expected cost under the softmax of the outputs; row `i`, column `k` of
/// `costs` is the cost of class `i` on `k`.
#[must_use]
pub fn least_expected_cost(outputs: &[f32], costs: &Matrix) -> usize {
    let highest = outputs.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let likely: Vec<(usize, f64)> = (outputs.iter().enumerate())
        .map(|(k, value)| (k, f64::from(value - highest).exp()))
        .filter(|&(_, weight)| weight >= UNLIKELY)
        .collect();
    let mut best = (0, f64::INFINITY);
    for (i, row) in costs.iter_rows().enumerate() {
        let cost = |&(k, weight): &(usize, f64)| weight * f64::from(row[k]).min(UNSTABLE);
        let expected: f64 = likely.iter().map(cost).sum();
        if expected < best.1 {
            best = (i, expected);
        }
    }
    best.0
}
