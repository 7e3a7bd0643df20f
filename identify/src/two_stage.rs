//! The part of a closed loop's input that its set-point caused.
//!
//! Under feedback the input follows the noise of the output, and a fit of the output to the input can find the controller
//! instead of the process, or a mixture. The part of the input that is a linear function of the set-point, now and before,
//! is free of that noise. A fit to this part finds the process, whatever the controller and the noise are. Reference: P. M.
//! J. Van den Hof, R. J. P. Schrama, "An indirect method for transfer function estimation from closed loop data",
//! Automatica 29 (1993).

use crate::innovations::Orthogonal;
use crate::signals::Signals;

/// Lags of the set-point that have an unknown each; longer lags share one.
const SINGLE: usize = 12;
/// Ratio of the lengths of neighbouring groups of longer lags.
const GROWTH: f64 = 1.25;
/// Longest lag as a share of the record, and in seconds: a control loop of a vehicle has forgotten its set-point by then.
const LONGEST: (f64, f64) = (0.05, 2.0);
/// Most samples that determine the unknowns.
const MOST_ROWS: usize = 40_000;

/// Part of an input that a set-point caused.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Caused {
    /// The part, in the unit of the input; its mean is that of the input.
    pub input: Vec<f64>,
    /// Its share of the variance of the input.
    pub share: f64,
    /// Share of the variance of the output that the set-point explains in the same way.
    pub output_share: f64,
    /// Steady output for a unit set-point, of the same explanation: about 1 where the output follows the set-point. It is
    /// about 0 where the set-point follows the output, as that of a rate loop does inside an attitude loop in calm flight.
    pub output_gain: f64,
}

/// The part of the input that the set-point caused. `None` if the set-point is constant, or the record has too few samples.
///
/// `set_point` has one value for each point of `signals`.
#[must_use]
pub fn caused_by_set_point(signals: &Signals<'_>, set_point: &[f64]) -> Option<Caused> {
    let count = signals.input.len();
    let longest_s = (LONGEST.0 * count as f64 * signals.sample_period_s).min(LONGEST.1);
    let groups = groups((longest_s / signals.sample_period_s) as usize);
    if set_point.len() != count || count < 10 * groups.len() {
        return None;
    }
    let rows = count.min(MOST_ROWS);
    let first = (count - rows) / 2;
    let centred = |mut column: Vec<f64>| {
        let used = &column[first..first + rows];
        let mean = used.iter().sum::<f64>() / rows as f64;
        column.iter_mut().for_each(|value| *value -= mean);
        column
    };
    let sums = sums(set_point);
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for (from, to) in groups {
        columns.push(centred(lagged(&sums, from, to)));
    }
    let part = |column: &Vec<f64>| column[first..first + rows].to_vec();
    let mut used: Vec<Vec<f64>> = columns.iter().map(part).collect();
    let orthogonal = loop {
        if used.is_empty() {
            return None;
        }
        match Orthogonal::new(&used) {
            Some(found) => break found,
            // The longest lags of a slow set-point repeat the others.
            None => used.pop(),
        };
    };
    let mean = signals.input.iter().sum::<f64>() / count as f64;
    let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
    let explained = |of: &[f64]| {
        let column = part(&centred(of.to_vec()));
        let (rest, weights) = orthogonal.solve(&column);
        (1.0 - square(&rest) / square(&column), weights)
    };
    let (share, weights) = explained(signals.input);
    let (output_share, of_output) = explained(signals.output);
    let mut input = vec![mean; count];
    for (weight, column) in weights.iter().zip(&columns) {
        for (value, own) in input.iter_mut().zip(column) {
            *value += weight * own;
        }
    }
    (share.is_finite() && output_share.is_finite()).then_some(Caused {
        input,
        share,
        output_share,
        output_gain: of_output.iter().sum(),
    })
}

/// First and last lag of each group, up to `longest`.
fn groups(longest: usize) -> Vec<(usize, usize)> {
    let mut groups: Vec<(usize, usize)> = (0..SINGLE).map(|lag| (lag, lag)).collect();
    let mut from = SINGLE;
    while from < longest {
        let to = ((from as f64 * GROWTH) as usize).max(from);
        groups.push((from, to));
        from = to + 1;
    }
    groups
}

/// Sums of the values before each sample; before the first one its own value.
fn sums(values: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    for value in values {
        sums.push(sums[sums.len() - 1] + value);
    }
    sums
}

/// Mean of the values `from` to `to` samples before each sample.
fn lagged(sums: &[f64], from: usize, to: usize) -> Vec<f64> {
    let before = |at: usize, lag: usize| {
        let end = at + 1;
        if lag <= end {
            sums[end - lag]
        } else {
            sums[1] * (end as f64 - lag as f64)
        }
    };
    (0..sums.len() - 1)
        .map(|at| (before(at, from) - before(at, to + 1)) / (to + 1 - from) as f64)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    // An input of the set-point two and three samples before, and noise of a sixth of its variance that the set-point does
    // not cause: the share is 6/7, and the part is that without noise up to the error of some thirty weights over 4,000 rows.
    #[test]
    fn the_part_without_noise_comes_back() {
        let mut state = 1_u64;
        let mut white = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24) - 0.5
        };
        let set_point: Vec<f64> = (0..4000).map(|_| white()).collect();
        let clean: Vec<f64> = (0..4000)
            .map(|k| {
                let at = |lag: usize| set_point[usize::max(k, lag) - lag];
                2.0 * at(2) - at(3)
            })
            .collect();
        let size = (5.0_f64 / 6.0).sqrt();
        let input: Vec<f64> = clean.iter().map(|u| u + size * white() + 7.0).collect();
        let time_s: Vec<f64> = (0..4000).map(|k| 0.01 * f64::from(k)).collect();
        let signals = Signals {
            time_s: &time_s,
            input: &input,
            output: &input,
            samples_per_point: 1,
            sample_period_s: 0.01,
            breaks: &[],
        };
        let found = caused_by_set_point(&signals, &set_point).unwrap();
        assert!((found.share - 6.0 / 7.0).abs() < 0.02, "{}", found.share);
        let mean = input.iter().sum::<f64>() / 4000.0;
        let error: f64 = (found.input.iter().zip(&clean).skip(300))
            .map(|(a, b)| (a - mean - b).powi(2))
            .sum();
        let variance: f64 = clean.iter().map(|b| b * b).sum();
        assert!(error / variance < 0.01, "{}", error / variance);
        assert_eq!(caused_by_set_point(&signals, &vec![1.0; 4000]), None);
    }
}
