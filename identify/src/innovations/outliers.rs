//! Outliers of the output: found first by their neighbours, then by the innovations of a fit.
//!
//! A sample that is far from the polynomial through its six neighbours is an outlier whatever the process is. What is
//! left is compared with the prediction of a Kalman filter that skips the samples it rejects.

use super::likelihood::{Memory, evaluate};
use super::prediction::{Filtering, predict};
use super::record::{Blocks, Record};
use super::theta::Theta;

/// Interpolation of the fifth degree at the middle of six neighbours.
const WEIGHTS: [f64; 6] = [1.0, -6.0, 15.0, 15.0, -6.0, 1.0];
const WEIGHT_SUM: f64 = 20.0;
/// Distance from the neighbours in robust standard deviations, and in parts of the output's deviation: a corner of a
/// record without noise is no outlier.
const FAR: f64 = 6.0;
const VISIBLE: f64 = 0.03;
/// Increments to both neighbours in robust deviations of all increments.
const SPIKE: f64 = 2.0;
const ROUNDS: usize = 5;
/// Largest share of outliers; more are no outliers but a coarse or discontinuous signal.
const MOST: f64 = 0.1;
/// Innovation in robust standard deviations beyond which a sample is rejected,
const UNLIKELY: f64 = 4.5;
/// and the larger one that at least three innovations must exceed: otherwise there are heavy tails, but no outliers.
const GROSS: f64 = 8.0;
const LEAST_GROSS: usize = 3;
/// Ten innovations in a row that are too large are a disturbance, not outliers.
const RUN: usize = 10;
/// Robust standard deviation over the median magnitude of Gaussian values.
const OF_MEDIAN: f64 = 1.4826;

/// Marks samples far from their neighbours as absent, and returns their number.
pub(super) fn mark_far(record: &mut Record) -> usize {
    let before = record.present.clone();
    let visible = VISIBLE * record.output_deviation();
    let mut found = 0;
    for _ in 0..ROUNDS {
        let distances = distances(record);
        let limit = (FAR * robust(&distances)).max(visible);
        let steps = record.output.windows(2).map(|pair| Some(pair[1] - pair[0]));
        let least = (0.5 * limit).max(SPIKE * robust(&steps.collect::<Vec<_>>()));
        let mut marked = 0;
        for k in 3..record.len().saturating_sub(3) {
            let size = |i: usize| distances[i].map_or(0.0, f64::abs);
            // The neighbours of an outlier are far from it too: only the farthest of them is one.
            let is_peak = (k - 3..=k + 3).all(|i| size(i) <= size(k));
            if size(k) > limit && is_peak && is_spike(record, k, least) {
                record.present[k] = false;
                marked += 1;
            }
        }
        found += marked;
        if marked == 0 {
            break;
        }
    }
    if found as f64 > MOST * record.len() as f64 {
        record.present = before;
        return 0;
    }
    found
}

/// Whether a sample stands out from both neighbours to the same side by more than `least`. A step, a lost update and the
/// corner of a triangle wave do not.
fn is_spike(record: &Record, k: usize, least: f64) -> bool {
    let before = record.output[k] - record.output[k - 1];
    let after = record.output[k] - record.output[k + 1];
    before.abs().min(after.abs()) > least && before * after > 0.0
}

/// Distance of each sample from the polynomial through its neighbours. `None` where one of these is absent.
fn distances(record: &Record) -> Vec<Option<f64>> {
    let at = |k: usize| {
        let around = [
            k.wrapping_sub(3),
            k.wrapping_sub(2),
            k.wrapping_sub(1),
            k + 1,
            k + 2,
            k + 3,
        ];
        let usable = |i: &usize| *i < record.len() && record.present[*i];
        if !(record.present[k] && around.iter().all(usable)) {
            return None;
        }
        let sum: f64 = around
            .iter()
            .zip(WEIGHTS)
            .map(|(i, w)| w * record.output[*i])
            .sum();
        Some(record.output[k] - sum / WEIGHT_SUM)
    };
    (0..record.len()).map(at).collect()
}

fn robust(values: &[Option<f64>]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().flatten().map(|v| v.abs()).collect();
    if sizes.is_empty() {
        return f64::INFINITY;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    OF_MEDIAN * *median
}

/// Marks samples that the fit at `theta` predicts badly as absent, and returns their number. `skip_s`: time at the start
/// whose outputs are not used.
pub(super) fn mark_unlikely(record: &mut Record, theta: &Theta, skip_s: f64) -> usize {
    let unlikely = {
        let blocks = Blocks::new(record, 1, skip_s);
        let Some(at) = evaluate(&blocks, theta, &mut Memory::default()) else {
            return 0;
        };
        let sizes: Vec<Option<f64>> = at.innovations().into_iter().map(Some).collect();
        let sigma = robust(&sizes);
        let gross = sizes
            .iter()
            .flatten()
            .filter(|e| e.abs() > GROSS * sigma)
            .count();
        if gross < LEAST_GROSS {
            return 0;
        }
        // Innovations are in units of the deviation of the white noise at the least.
        let visible = VISIBLE * blocks.scale / at.variance.sqrt();
        let limit = (UNLIKELY * sigma).max(visible);
        let first = blocks.first;
        let filtering = Filtering {
            reject: Some((limit, RUN)),
            ..Filtering::default()
        };
        let found = predict(&blocks, theta, &at, filtering);
        found.map_or(vec![], |found| {
            found
                .rejected
                .iter()
                .map(|row| row + first)
                .collect::<Vec<_>>()
        })
    };
    if unlikely.len() as f64 > MOST * record.len() as f64 {
        return 0;
    }
    for sample in &unlikely {
        record.present[*sample] = false;
    }
    unlikely.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    // A smooth wave with small noise and 20 outliers of 30 noise deviations: all are found, and nothing else.
    #[test]
    fn outliers_are_found_by_their_neighbours() {
        let wave = |k: usize| (k as f64 * 0.02).sin() + 0.003 * ((k * k) as f64 * 0.7).sin();
        let mut output: Vec<f64> = (0..2000).map(wave).collect();
        let places: Vec<usize> = (0..20).map(|i| 50 + 97 * i).collect();
        for (i, k) in places.iter().enumerate() {
            output[*k] += if i % 2 == 0 { 0.1 } else { -0.1 };
        }
        let mut record = Record::even(0.01, vec![0.0; 2000], output);
        assert_eq!(mark_far(&mut record), 20);
        assert!(places.iter().all(|k| !record.present[*k]));
    }

    // A triangle wave without noise has corners, which are not outliers.
    #[test]
    fn corners_are_no_outliers() {
        let output = (0..1000)
            .map(|k| f64::from((k % 100 - 50_i32).abs()))
            .collect();
        let mut record = Record::even(0.01, vec![0.0; 1000], output);
        assert_eq!(mark_far(&mut record), 0);
    }
}
