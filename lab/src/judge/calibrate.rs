//! The calibration of a network: where its cycles of the family end.
//!
//! How wide its posteriors usually are is a least-squares fit to cycles of the family; the limit of
//! the score is what a given part of the same cycles exceeds, and the most noise is theirs. The cycles
//! must be others than those it was trained with.

use std::ops::Range;

use onecycle_onboard::classify::{Calibration, OUTPUTS};

use super::outsiders::{Classifier, Seen};
use crate::experiments::Recipe;
use crate::experiments::outsiders::{Kind, case};
use crate::learn::dataset::ExampleError;

/// Noise that is taken for known, over the most that was seen: the meter itself errs by as much on a
/// hundred samples.
const NOISE_ROOM: f64 = 1.1;

/// The calibration of a network from the cycles of these numbers of a recipe, so that `unknown` of them
/// (0 to 1) are called unknown; scale and temperatures are those of `start`.
///
/// # Errors
/// See [`ExampleError`].
pub fn calibrate(
    recipe: &Recipe,
    numbers: Range<u64>,
    network: Classifier<'_>,
    start: &Calibration,
    unknown: f64,
) -> Result<Calibration, ExampleError> {
    let mut seen = Vec::new();
    for number in numbers {
        if let Some(case) = case(recipe, Kind::InFamily, number)? {
            let cycle = Seen::of(&case, &case.run()?);
            seen.extend(cycle.map(|cycle| (cycle, network(&cycle.signature))));
        }
    }
    let mut calibration = Calibration {
        // So that the scores below are the sums.
        limit: 1.0,
        ..*start
    };
    let widths: Vec<([f64; 3], f64)> = seen
        .iter()
        .map(|(cycle, outputs)| (terms(cycle), Calibration::width_of(outputs)))
        .collect();
    if let Some((width, sigma)) = least_squares(&widths) {
        calibration.width = width;
        calibration.width_sigma = sigma;
    }
    let most_noise = seen
        .iter()
        .map(|(cycle, _)| cycle.noise())
        .fold(0.0, f64::max);
    if most_noise > 0.0 {
        calibration.most_noise = NOISE_ROOM * most_noise;
    }
    let mut scores: Vec<f64> = seen
        .iter()
        .filter_map(|(cycle, outputs): &(Seen, [f32; OUTPUTS])| {
            Some(cycle.classify(outputs, &calibration)?.score)
        })
        .collect();
    scores.sort_unstable_by(f64::total_cmp);
    let index = ((1.0 - unknown.clamp(0.0, 1.0)) * scores.len() as f64) as usize;
    let last = scores.len().saturating_sub(1);
    calibration.limit =
        (scores.get(index.min(last)).copied()).unwrap_or(Calibration::UNTRAINED.limit);
    Ok(calibration)
}

fn terms(cycle: &Seen) -> [f64; 3] {
    let [.., ln_samples] = cycle.signature.values;
    Calibration::width_terms(cycle.noise(), f64::from(ln_samples).exp())
}

/// Coefficients of three columns and what they leave (root mean square), by the normal equations;
/// `None` where the columns do not determine them.
fn least_squares(rows: &[([f64; 3], f64)]) -> Option<([f64; 3], f64)> {
    let mut matrix = [[0.0; 4]; 3];
    for (terms, value) in rows {
        for i in 0..3 {
            for j in 0..3 {
                matrix[i][j] += terms[i] * terms[j];
            }
            matrix[i][3] += terms[i] * value;
        }
    }
    // Gauss and Jordan; the matrix is positive definite, so that no pivot has to be looked for.
    for pivot in 0..3 {
        let scale = matrix[pivot][pivot];
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let row = matrix[pivot].map(|value| value / scale);
        for (k, other) in matrix.iter_mut().enumerate() {
            let factor = other[pivot];
            if k == pivot {
                *other = row;
            } else {
                (other.iter_mut().zip(row)).for_each(|(value, pivot)| *value -= factor * pivot);
            }
        }
    }
    let found = matrix.map(|row| row[3]);
    let squares: f64 = rows
        .iter()
        .map(|(terms, value)| {
            let fitted: f64 = terms.iter().zip(found).map(|(term, w)| w * term).sum();
            (value - fitted) * (value - fitted)
        })
        .sum();
    let sigma = (squares / rows.len() as f64).sqrt();
    (sigma > 0.0 && sigma.is_finite()).then_some((found, sigma))
}

#[cfg(test)]
mod tests {
    use super::*;

    // 2 - 3 x + 0.5 x^2 at five points, and one unit to either side of it at x = 0: the rest is zero
    // there and the root mean square sqrt(2/6).
    #[test]
    fn a_parabola_by_hand() {
        let at = |x: f64, off: f64| ([1.0, x, x * x], 2.0 - 3.0 * x + 0.5 * x * x + off);
        let rows = [
            at(0.0, 1.0),
            at(0.0, -1.0),
            at(1.0, 0.0),
            at(-1.0, 0.0),
            at(2.0, 0.0),
            at(-2.0, 0.0),
        ];
        let (found, sigma) = least_squares(&rows).unwrap();
        for (found, expected) in found.iter().zip([2.0, -3.0, 0.5]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert!((sigma - (2.0_f64 / 6.0).sqrt()).abs() < 1e-12, "{sigma}");
        assert_eq!(least_squares(&rows[..1]), None);
    }
}
