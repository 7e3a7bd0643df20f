//! Calibration of a network's score on cycles of the family.
//!
//! The usual width of the posterior is a least-squares fit to cycles of the family. The limit of the score
//! is the value that a given part of the same cycles exceeds, and the largest noise is theirs. The network
//! must not have been trained with these cycles.

use std::ops::Range;

use onecycle_onboard::classify::{Calibration, OUTPUTS};

use super::out_of_family::{NetworkFn, PERIODS, classification, relative_noise};
use crate::experiments::{DefectKind, ExperimentError, Recipe, SteadyCycle};

/// Largest noise that counts as known, over the largest noise seen: the noise measured in a hundred
/// samples errs by as much.
const NOISE_ROOM: f64 = 1.1;

/// Calibrates a network on the experiments of a recipe with these numbers, so that the fraction `unknown`
/// (0 to 1) of their cycles is called unknown; scale and temperatures are those of `start`.
///
/// # Errors
/// [`ExperimentError`]: a field of the recipe is out of its range.
pub fn calibrate(
    recipe: &Recipe,
    numbers: Range<u64>,
    network: NetworkFn<'_>,
    start: &Calibration,
    unknown: f64,
) -> Result<Calibration, ExperimentError> {
    let mut seen = Vec::new();
    for number in numbers {
        if let Some(experiment) = recipe.experiment_with_defect(DefectKind::InFamily, number)? {
            let (trace, _) = experiment.run(PERIODS)?;
            let cycle = SteadyCycle::last_of(&trace, experiment.sample_s);
            seen.extend(cycle.map(|cycle| (cycle, network(&cycle.signature))));
        }
    }
    let mut calibration = Calibration {
        // With a limit of one the scores below are the bare sums.
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
        .map(|(cycle, _)| relative_noise(cycle))
        .fold(0.0, f64::max);
    if most_noise > 0.0 {
        calibration.most_noise = NOISE_ROOM * most_noise;
    }
    let mut scores: Vec<f64> = seen
        .iter()
        .filter_map(|(cycle, outputs): &(SteadyCycle, [f32; OUTPUTS])| {
            Some(classification(cycle, outputs, &calibration)?.score)
        })
        .collect();
    scores.sort_unstable_by(f64::total_cmp);
    let index = ((1.0 - unknown.clamp(0.0, 1.0)) * scores.len() as f64) as usize;
    let last = scores.len().saturating_sub(1);
    calibration.limit =
        (scores.get(index.min(last)).copied()).unwrap_or(Calibration::UNTRAINED.limit);
    Ok(calibration)
}

fn terms(cycle: &SteadyCycle) -> [f64; 3] {
    let [.., ln_samples] = cycle.signature.values;
    Calibration::width_terms(relative_noise(cycle), f64::from(ln_samples).exp())
}

/// Least-squares coefficients of three columns and the root mean square of the residual, by the normal
/// equations; `None` if the columns do not determine the coefficients.
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
    // Gauss-Jordan elimination; the matrix is positive definite, so no pivoting is needed.
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
