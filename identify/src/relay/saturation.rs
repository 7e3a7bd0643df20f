//! Detection of a clipped output: a sensor or a signal at its limit stays at one exact value.

use crate::signals::smallest_step;

/// Largest share of the time that an output that is not clipped spends at its exact maximum or minimum. A sine whose
/// amplitude is 100 quanta of the sensor spends 4.5 % of the time within one quantum of its maximum.
const MOST_FLAT: f64 = 0.06;
/// Least number of equal consecutive samples that count as flat. Fewer occur by chance.
const FEWEST_EQUAL: usize = 4;

/// Share of the time that the output spends in flat stretches at its exact maximum or minimum, over `cycles` cycles.
/// `None` if the output is not clipped: the share is no larger than a quantised sensor explains.
pub(super) fn flat_part(output: &[f64], cycles: usize) -> Option<f64> {
    let most = output.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = output.iter().copied().fold(f64::INFINITY, f64::min);
    let quantum = smallest_step(output);
    // Share of the time that a sine of this amplitude spends within one quantum of its maximum.
    let quantised = (1.0 - quantum / (0.5 * (most - least)))
        .clamp(-1.0, 1.0)
        .acos()
        / std::f64::consts::PI;
    [most, least].into_iter().find_map(|extreme| {
        let flat: usize = output
            .chunk_by(|a, b| a == b)
            .filter(|stretch| stretch[0] == extreme && stretch.len() >= FEWEST_EQUAL)
            .map(<[f64]>::len)
            .sum();
        let part = flat as f64 / output.len() as f64;
        let stretches = flat >= FEWEST_EQUAL * cycles;
        (stretches && part > MOST_FLAT && part > 2.0 * quantised).then_some(part)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(map: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..2000)
            .map(|i| map((f64::from(i) * std::f64::consts::TAU / 500.0).sin()))
            .collect()
    }

    #[test]
    fn clipping_is_seen_and_quantisation_is_not() {
        assert_eq!(flat_part(&sine(|y| y), 4), None);
        assert_eq!(flat_part(&sine(|y| (y / 0.05).round() * 0.05), 4), None);
        // A sine clipped at 0.8 spends acos(0.8)/pi = 20.5 % of the time at the limit.
        let part = flat_part(&sine(|y| y.min(0.8)), 4).unwrap();
        assert!((part - 0.205).abs() < 0.005, "{part}");
    }
}
