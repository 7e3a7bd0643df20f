//! Many verdicts in a row of numbers.

use serde::Serialize;

use super::{PHASE_MARGIN_DEG, Record};
use onecycle_design::soiptd_pd::deterioration::Deterioration;

/// What controllers cost, over many experiments. See the [module](super) for how unstable loops, missing
/// answers and `J` below zero enter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Costs {
    /// Experiments, answered or not.
    pub experiments: usize,
    /// Mean over all of them of `min(|J|, 1)`, unstable and missing being 1; zero of none.
    pub score: f64,
    /// Mean of `|J|` over the stable loops, zero for what is won at the full margin.
    pub mean: Option<f64>,
    /// Its median.
    pub median: Option<f64>,
    /// Its 95th percentile.
    pub percentile_95: Option<f64>,
    /// Its 99th percentile.
    pub percentile_99: Option<f64>,
    /// The largest.
    pub worst: Option<f64>,
    /// Unstable loops.
    pub unstable: usize,
    /// Experiments without an answer.
    pub no_answer: usize,
    /// Least phase margin of the stable loops (degrees).
    pub least_phase_margin_deg: Option<f64>,
}

impl Costs {
    /// Of experiments, `None` for one without an answer.
    #[must_use]
    pub fn of(judged: impl IntoIterator<Item = Option<Deterioration>>) -> Self {
        let (mut costs, mut least_rad) = (Vec::new(), None);
        let (mut unstable, mut no_answer) = (0, 0);
        for outcome in judged {
            match outcome {
                Some(Deterioration::Stable {
                    relative,
                    phase_margin_rad,
                }) => {
                    costs.push(priced(relative, phase_margin_rad));
                    least_rad = Some(
                        least_rad
                            .map_or(phase_margin_rad, |least: f64| least.min(phase_margin_rad)),
                    );
                }
                Some(Deterioration::Unstable) => unstable += 1,
                None => no_answer += 1,
            }
        }
        costs.sort_unstable_by(f64::total_cmp);
        let experiments = costs.len() + unstable + no_answer;
        let capped: f64 = costs.iter().map(|cost| cost.min(1.0)).sum();
        let lost = (unstable + no_answer) as f64;
        let sum: f64 = costs.iter().sum();
        Self {
            experiments,
            score: (capped + lost) / experiments.max(1) as f64,
            mean: (!costs.is_empty()).then(|| sum / costs.len() as f64),
            median: quantile(&mut costs, 0.5),
            percentile_95: quantile(&mut costs, 0.95),
            percentile_99: quantile(&mut costs, 0.99),
            worst: costs.last().copied(),
            unstable,
            no_answer,
            least_phase_margin_deg: least_rad.map(f64::to_degrees),
        }
    }
}

/// A margin that is short of the full one by this much is rounded (degrees).
const MARGIN_ROUNDING_DEG: f64 = 1e-6;

/// `|J|`, but zero for a `J` below zero with the full margin: that is bought with nothing.
fn priced(relative: f64, phase_margin_rad: f64) -> f64 {
    let is_full = phase_margin_rad.to_degrees() >= PHASE_MARGIN_DEG - MARGIN_ROUNDING_DEG;
    if is_full {
        relative.max(0.0)
    } else {
        relative.abs()
    }
}

/// A method over all its experiments: a row of the leaderboard.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the method.
    pub method: String,
    /// What its controllers cost.
    #[serde(flatten)]
    pub costs: Costs,
    /// Median size of the error of `K/T_body`, over the true value, of those that gave a process.
    pub median_k_over_t_body_error: Option<f64>,
    /// The same of `T_prop`.
    pub median_t_prop_error: Option<f64>,
    /// Median size of the error of `tau` (s).
    pub median_tau_error_s: Option<f64>,
    /// Median time (s) of those that were timed.
    pub median_seconds: Option<f64>,
}

impl Summary {
    /// Of the records of one method.
    #[must_use]
    pub fn of(method: &str, records: &[&Record]) -> Self {
        let median = |value: fn(&Record) -> Option<f64>| {
            let mut values: Vec<f64> = records.iter().filter_map(|r| value(r)).collect();
            values.iter_mut().for_each(|value| *value = value.abs());
            quantile(&mut values, 0.5)
        };
        Self {
            method: method.to_owned(),
            costs: Costs::of(records.iter().map(|record| record.judged())),
            median_k_over_t_body_error: median(|record| record.k_over_t_body_error),
            median_t_prop_error: median(|record| record.t_prop_error),
            median_tau_error_s: median(|record| record.tau_error_s),
            median_seconds: median(|record| record.seconds),
        }
    }

    /// Of every method in these records, the least score first, then by name.
    #[must_use]
    pub fn of_all(records: &[Record]) -> Vec<Self> {
        let mut by_method = std::collections::BTreeMap::<&str, Vec<&Record>>::new();
        for record in records {
            by_method.entry(&record.method).or_default().push(record);
        }
        let mut summaries: Vec<Self> = (by_method.iter())
            .map(|(method, records)| Self::of(method, records))
            .collect();
        summaries.sort_by(|a, b| a.costs.score.total_cmp(&b.costs.score));
        summaries
    }
}

/// The value below which a part `q` of the values lie, the nearest one; they are sorted. `None` of none.
pub fn quantile(values: &mut [f64], q: f64) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let index = (values.len().saturating_sub(1) as f64 * q).round() as usize;
    values.get(index).copied()
}
