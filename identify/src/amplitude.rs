//! A relay test at two amplitudes, one after the other: it shows whether the gain depends on the size of the input.
//!
//! Under a relay of one amplitude a dead zone, a saturation or a backlash of the actuator acts as another gain, and no fit
//! can tell. Each part is identified on its own, and their frequency responses are compared at the crossover of the
//! controller.

use onecycle_design::Model;

use crate::outcome::Identified;
use crate::signals::{Signals, range};
use crate::two_amplitudes::TwoAmplitudes;

/// Fewest switches of the relay at each amplitude: two cycles and the transient between the parts.
const FEWEST_SWITCHES: usize = 6;
/// Most switches of a test: every one is tried as the change, so the work grows with their square.
const MOST_SWITCHES: usize = 2000;
/// Least ratio of the amplitudes.
const LEAST_RATIO: f64 = 1.2;
/// Distance of a jump from the median of its part, as a share, and least share of the jumps that are as near. The others
/// are those of a trim that still moves.
const MOST_SPREAD: f64 = 0.05;
const LEAST_EVEN: f64 = 0.6;
/// Jumps below this share of the range of the input are trims of the relay.
const JUMP: f64 = 0.3;
/// Difference of the responses (share of the magnitude; rad) that does not matter to a controller.
const ALIKE: (f64, f64) = (0.03, 0.035);
/// Draws of each posterior.
const DRAWS: usize = 100;

/// The two parts of a recording with two amplitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Parts {
    /// Index of the first point of the second part.
    pub(crate) second: usize,
    pub(crate) amplitudes: [f64; 2],
}

/// Where the amplitude of the relay changes. `None` if it does not, or if the input is no relay.
pub(crate) fn parts(input: &[f64]) -> Option<Parts> {
    let (low, high) = range(input);
    let jumps: Vec<(usize, f64)> = (input.windows(2).enumerate())
        .map(|(index, pair)| (index + 1, (pair[1] - pair[0]).abs()))
        .filter(|(_, size)| *size > JUMP * (high - low))
        .collect();
    if jumps.len() > MOST_SWITCHES {
        return None;
    }
    let sizes: Vec<f64> = jumps.iter().map(|(_, size)| *size).collect();
    let last = sizes.len().checked_sub(FEWEST_SWITCHES)?;
    // Between the parts one jump goes from a level of one to a level of the other.
    let candidates = (FEWEST_SWITCHES + 1..=last).filter_map(|split| {
        let (first, even) = median(&sizes[..split - 1]);
        let (second, too) = median(&sizes[split..]);
        let is_even = even >= LEAST_EVEN * (split - 1) as f64
            && too >= LEAST_EVEN * (sizes.len() - split) as f64;
        let ratio = (first / second).max(second / first);
        (is_even && ratio > LEAST_RATIO).then(|| {
            let parts = Parts {
                second: jumps[split - 1].0,
                amplitudes: [0.5 * first, 0.5 * second],
            };
            (even + too, parts)
        })
    });
    let best = candidates.max_by(|(a, _), (b, _)| a.total_cmp(b));
    best.map(|(_, parts)| parts)
}

/// Median of the jumps, and how many are near it.
fn median(sizes: &[f64]) -> (f64, f64) {
    let mut sorted = sizes.to_vec();
    let (_, &mut median, _) = sorted.select_nth_unstable_by(sizes.len() / 2, f64::total_cmp);
    let is_near = |size: &&f64| (*size / median - 1.0).abs() < MOST_SPREAD;
    (median, sizes.iter().filter(is_near).count() as f64)
}

/// Compares what the parts show. `None` if one of them has no process, or the first one no controller.
pub(crate) fn compare(
    amplitudes: [f64; 2],
    first: &Identified,
    second: &Identified,
) -> Option<TwoAmplitudes> {
    let omega = first.design?.margins.gain_crossover_rad_per_s;
    let responses = |of: &Identified| {
        let models = of.posterior.models(DRAWS);
        let at = |model: &Model| model.frequency_response(omega);
        let best = at(&of.model);
        let relative: Vec<_> = models.iter().map(|model| at(model) / best).collect();
        let spread = |value: fn(&num_complex::Complex64) -> f64| {
            let mut values: Vec<f64> = relative.iter().map(|r| value(r).abs()).collect();
            values.sort_by(f64::total_cmp);
            values
                .get(values.len() * 9 / 10)
                .copied()
                .unwrap_or(f64::INFINITY)
        };
        (best, spread(|r| r.norm().ln()), spread(|r| r.arg()))
    };
    let [(large, gain_a, phase_a), (small, gain_b, phase_b)] = if amplitudes[0] > amplitudes[1] {
        [responses(first), responses(second)]
    } else {
        [responses(second), responses(first)]
    };
    let (gain_ratio, phase_rad) = ((small / large).norm(), (small / large).arg());
    Some(TwoAmplitudes {
        amplitudes,
        gain_ratio,
        phase_rad,
        is_alike: gain_ratio.ln().abs() < ALIKE.0 + gain_a.hypot(gain_b)
            && phase_rad.abs() < ALIKE.1 + phase_a.hypot(phase_b),
    })
}

impl Signals<'_> {
    /// The points of a range. `breaks` is filled with the indices of its gaps.
    pub(crate) fn part<'a>(
        &'a self,
        range: std::ops::Range<usize>,
        breaks: &'a mut Vec<usize>,
    ) -> Signals<'a> {
        let inside = self
            .breaks
            .iter()
            .filter(|at| **at > range.start && **at < range.end);
        breaks.extend(inside.map(|at| at - range.start));
        Signals {
            time_s: &self.time_s[range.clone()],
            input: &self.input[range.clone()],
            output: &self.output[range],
            breaks,
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn relay(amplitude: f64, centre: f64, half_periods: usize) -> impl Iterator<Item = f64> {
        (0..half_periods).flat_map(move |half| {
            let level = if half % 2 == 0 { amplitude } else { -amplitude };
            std::iter::repeat_n(centre + level, 20)
        })
    }

    // Ten half periods of 1, then ten of 0.6, about a trim of 0.2. A single amplitude, and one that grows all the time, are
    // not two.
    #[test]
    fn the_change_of_the_amplitude_is_found() {
        let input: Vec<f64> = relay(1.0, 0.2, 10).chain(relay(0.6, 0.2, 10)).collect();
        let found = parts(&input).unwrap();
        assert_eq!(found.second, 200);
        assert!((found.amplitudes[0] - 1.0).abs() < 1e-12);
        assert!((found.amplitudes[1] - 0.6).abs() < 1e-12);
        let input: Vec<f64> = relay(1.0, 0.2, 20).collect();
        assert_eq!(parts(&input), None);
        let input: Vec<f64> = (0..20)
            .flat_map(|k| relay(1.15_f64.powi(k), 0.0, 2))
            .collect();
        assert_eq!(parts(&input), None);
        assert_eq!(parts(&[0.0; 100]), None);
    }
}
