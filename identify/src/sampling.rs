//! Samples that were not taken at the times of their stamps.
//!
//! A sample that is taken `e` sample periods `Ts` late shows `e Ts y'` more of an output with the slope `y'`. So the noise
//! grows with the slope, as white noise does not:
//!
//! ```text
//! D4 y = y[k-2] - 4 y[k-1] + 6 y[k] - 4 y[k+1] + y[k+2],   E (D4 y)^2 = 70 (sigma^2 + e^2 (Ts y')^2)
//! ```
//!
//! `70 = 1 + 16 + 36 + 16 + 1` for independent times. Where they drift, as those of a loop that sleeps too long in each
//! round, the factor of `e^2` is 20 (`1 + 9 + 9 + 1`), and the estimate is half of the jitter of the period. Both variances
//! are compared by medians, over the third of the samples with the largest slopes and the third with the smallest ones. Of a
//! sine, `D4 y` is largest where the slope is smallest, so a smooth output does not pass for jitter.
//!
//! Rounding to steps of `q` does: its error is white with the variance `q^2/12` where the output passes many steps, and
//! repeats where it hardly moves. So that variance is added to the one of the smallest slopes.

use crate::signals::{Signals, rounding_deviation};

/// Half width of the difference that shows the slope, as a share of the period; in samples at least that of `D4`.
const HALF_WIDTH: f64 = 1.0 / 14.0;
const LEAST_HALF_WIDTH: usize = 3;
/// Fewest samples of a third, and most of a recording.
const FEWEST: usize = 60;
const MOST: usize = 1_000_000;
/// Squares of the weights of `D4`, and the median of a squared normal number.
const SQUARES: f64 = 70.0;
const MEDIAN: f64 = 0.455;
/// Excess of the ratio of both variances above one, times the root of the number of samples in a third: four standard
/// deviations, since the median of n squares has a relative deviation of 2.3 over the root of n, and `D4` at neighbours is
/// correlated (a third of n are independent).
const SIGNIFICANT: f64 = 16.0;
/// Least jitter, in sample periods. Below it the higher harmonics of an output with few samples in a period may pass for
/// jitter, and the phase that the jitter costs is that of a thirtieth of a sample.
const LEAST: f64 = 0.03;
/// Share of repeated values above which the output is held or coarse.
const MOST_REPEATED: f64 = 0.2;

/// Standard deviation of the times of the samples about their stamps, in sample periods. `None` if the samples show none:
/// the noise of the output is larger, or they are too few, held, coarse, or not on an even grid. `period_s`: of the highest
/// frequency in the output (s).
pub(crate) fn jitter(signals: &Signals<'_>, period_s: f64) -> Option<f64> {
    let y = signals.output;
    let half = ((HALF_WIDTH * period_s / signals.sample_period_s) as usize).max(LEAST_HALF_WIDTH);
    if signals.samples_per_point > 1 || !signals.breaks.is_empty() || y.len() > MOST {
        return None;
    }
    let repeated = y.windows(2).filter(|pair| pair[0] == pair[1]).count();
    if repeated as f64 > MOST_REPEATED * y.len() as f64 || is_uneven(signals) {
        return None;
    }
    let last = y.len().checked_sub(half)?;
    // Change of the output in a sample period, and the square of the fourth difference.
    let mut pairs: Vec<(f64, f64)> = (half..last)
        .map(|k| {
            let slope = (y[k + half] - y[k - half]) / (2 * half) as f64;
            let fourth = y[k - 2] - 4.0 * y[k - 1] + 6.0 * y[k] - 4.0 * y[k + 1] + y[k + 2];
            (slope.abs(), fourth * fourth)
        })
        .collect();
    let third = pairs.len() / 3;
    if third < FEWEST {
        return None;
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let variance = |part: &[(f64, f64)]| {
        let mut squares: Vec<f64> = part.iter().map(|pair| pair.1).collect();
        let middle = squares.len() / 2;
        let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
        *median / (MEDIAN * SQUARES)
    };
    let slope_sq = |part: &[(f64, f64)]| part.iter().map(|pair| pair.0 * pair.0).sum::<f64>();
    let (flat, steep) = (&pairs[..third], &pairs[pairs.len() - third..]);
    let rounding = rounding_deviation(y).powi(2);
    let (few, many) = (variance(flat) + rounding, variance(steep));
    let slopes = (slope_sq(steep) - slope_sq(flat)) / third as f64;
    let found = ((many - few) / slopes).max(0.0).sqrt();
    let is_significant = many > few * (1.0 + SIGNIFICANT / (third as f64).sqrt());
    (is_significant && found > LEAST && found.is_finite()).then_some(found)
}

/// Whether the stamps show the jitter themselves.
fn is_uneven(signals: &Signals<'_>) -> bool {
    let period_s = signals.sample_period_s;
    let is_off = |pair: &[f64]| ((pair[1] - pair[0]) / period_s - 1.0).abs() > LEAST;
    signals.time_s.windows(2).any(is_off)
}

#[cfg(test)]
mod tests {
    use onecycle_plant::{Noise, NoiseSource};

    use super::*;

    /// Jitter found in a sine of amplitude 1 with 100 samples in each of 20 periods, which the sensor shows as `shown`.
    fn found(
        sigma: f64,
        mut late: impl FnMut(f64) -> f64,
        shown: impl Fn(f64) -> f64,
    ) -> Option<f64> {
        let mut noise = Noise::from_seed(7);
        let time_s: Vec<f64> = (0..2000).map(f64::from).collect();
        let output: Vec<f64> = (time_s.iter())
            .map(|t| {
                let at = t + late(noise.standard_normal());
                let sine = (0.01 * std::f64::consts::TAU * at).sin();
                shown(sine + sigma * noise.standard_normal())
            })
            .collect();
        let signals = Signals {
            time_s: &time_s,
            input: &time_s,
            output: &output,
            samples_per_point: 1,
            sample_period_s: 1.0,
            breaks: &[],
        };
        jitter(&signals, 100.0)
    }

    // Independent times with a deviation of 0.2 are found to 10 %, also below noise as large as they make; of a drift of 0.2 in
    // each sample the root of 20/70 is found, 0.107.
    #[test]
    fn the_jitter_is_found() {
        for sigma in [0.0, 0.006] {
            let value = found(sigma, |z| 0.2 * z, |y| y).unwrap();
            assert!((value / 0.2 - 1.0).abs() < 0.2, "{sigma}: {value}");
        }
        let mut drift = 0.0;
        let drifting = |z| {
            drift += 0.2 * z;
            drift
        };
        let value = found(0.0, drifting, |y| y);
        let value = value.unwrap();
        assert!((value / 0.107 - 1.0).abs() < 0.2, "{value}");
    }

    // A sensor of 100 to 400 steps. Where it hardly moves its error repeats, so its noise depends on the slope.
    #[test]
    fn rounding_is_no_jitter() {
        for quantum in [0.005, 0.01, 0.02] {
            let shown = |value: f64| (value / quantum).round() * quantum;
            for sigma in [0.0, 0.1 * quantum, 0.3 * quantum] {
                assert_eq!(found(sigma, |_| 0.0, shown), None, "{quantum} {sigma}");
            }
            let value = found(0.0, |z| 0.5 * z, shown).unwrap();
            assert!((value / 0.5 - 1.0).abs() < 0.2, "{quantum}: {value}");
        }
    }

    // Noise that does not depend on the slope, and no noise at all, are no jitter.
    #[test]
    fn white_noise_is_no_jitter() {
        for sigma in [0.0, 1e-3, 0.01, 0.1] {
            assert_eq!(found(sigma, |_| 0.0, |y| y), None, "{sigma}");
        }
        // The jitter of 0.02 sample periods moves the output by 0.0013 at most, a tenth of the noise.
        assert_eq!(found(0.013, |z| 0.02 * z, |y| y), None);
    }
}
