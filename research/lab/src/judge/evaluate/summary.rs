//! Summaries: many records of a method in a row of numbers.

use serde::Serialize;

use super::{JUDGED, PHASE_MARGIN_DEG, Record};
use onecycle_design::soiptd_pd::deterioration::Deterioration;

/// Costs of controllers over many experiments. See the [module](super) for unstable loops, missing
/// answers and negative `J`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Costs {
    /// Number of experiments, answered or not.
    pub experiments: usize,
    /// Mean of `min(|J|, 1)` over all experiments, with 1 for unstable loops and missing answers; zero
    /// without experiments.
    pub score: f64,
    /// Mean of `|J|` over the stable loops; a negative `J` at the full margin counts as zero.
    pub mean: Option<f64>,
    /// Median of `|J|`.
    pub median: Option<f64>,
    /// 95th percentile of `|J|`.
    pub percentile_95: Option<f64>,
    /// 99th percentile of `|J|`.
    pub percentile_99: Option<f64>,
    /// Largest `|J|`.
    pub worst: Option<f64>,
    /// Number of unstable loops.
    pub unstable: usize,
    /// Number of experiments without an answer.
    pub no_answer: usize,
    /// Least phase margin of the stable loops (degrees).
    pub least_phase_margin_deg: Option<f64>,
}

impl Costs {
    /// Summarises experiments; `None` stands for a missing answer.
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

/// A margin that is smaller than the full one by at most this counts as the full one (degrees):
/// rounding.
const MARGIN_ROUNDING_DEG: f64 = 1e-6;

/// `|J|`, but zero for a negative `J` at the full margin, which costs no margin.
fn priced(relative: f64, phase_margin_rad: f64) -> f64 {
    let is_full = phase_margin_rad.to_degrees() >= PHASE_MARGIN_DEG - MARGIN_ROUNDING_DEG;
    if is_full {
        relative.max(0.0)
    } else {
        relative.abs()
    }
}

/// Summary of a method: a row of the leaderboard.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the method.
    pub method: String,
    /// Costs of the controllers.
    #[serde(flatten)]
    pub costs: Costs,
    /// Median size of the error of `K/T_body` over the true value, over the answers with a process.
    pub median_k_over_t_body_error: Option<f64>,
    /// Median size of the error of `T_prop` over the true value.
    pub median_t_prop_error: Option<f64>,
    /// Median size of the error of `tau` (s).
    pub median_tau_error_s: Option<f64>,
    /// Share of the 90 % intervals of [`JUDGED`] that hold the true value, of a method with intervals.
    pub coverage: Option<f64>,
    /// Median time (s) of the records that have one.
    pub median_seconds: Option<f64>,
}

impl Summary {
    /// Summary of the records of one method.
    #[must_use]
    pub fn of(method: &str, records: &[&Record]) -> Self {
        let median = |value: fn(&Record) -> Option<f64>| {
            let mut values: Vec<f64> = records.iter().filter_map(|r| value(r)).collect();
            values.iter_mut().for_each(|value| *value = value.abs());
            quantile(&mut values, 0.5)
        };
        let held: Vec<u8> = records.iter().filter_map(|r| r.intervals_held).collect();
        let intervals = held.len() * JUDGED.len();
        let holding: f64 = held.iter().map(|&count| f64::from(count)).sum();
        Self {
            method: method.to_owned(),
            costs: Costs::of(records.iter().map(|record| record.judged())),
            median_k_over_t_body_error: median(|record| record.k_over_t_body_error),
            median_t_prop_error: median(|record| record.t_prop_error),
            median_tau_error_s: median(|record| record.tau_error_s),
            coverage: (intervals > 0).then(|| holding / intervals as f64),
            median_seconds: median(|record| record.seconds),
        }
    }

    /// Summaries of all methods in these records, the best score first, then by name.
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

/// The quantile `q` of the values (nearest rank), which are sorted in place. `None` without values.
pub fn quantile(values: &mut [f64], q: f64) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let index = (values.len().saturating_sub(1) as f64 * q).round() as usize;
    values.get(index).copied()
}
