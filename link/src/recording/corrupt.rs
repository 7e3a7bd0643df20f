//! Corrupt cells: single samples that the signal cannot have.
//!
//! ```text
//! input   switches between two levels, and a sample is at neither
//!         between two samples of one level    replaced by the sample before
//!         beside a switch, or several         dropped: during a gap the input is unknown
//! output  a peak of one sample, ten times    replaced by the line between its
//!         the peaks of the noise              neighbours
//! ```
//!
//! The input of a chirp or of a controller may jump for one sample; it is only noted.

use std::ops::Range;

/// Share of the values at each end that do not count for the range of a signal.
const ASIDE: f64 = 0.01;
/// Maximum share of samples that are corrupt: what occurs more often belongs to the signal.
const MOST_CORRUPT: f64 = 0.005;
/// Distance from a level that no sample of it has, as a fraction of the range.
const OFF_LEVEL: f64 = 0.2;
/// Neighbours closer than this fraction of the range are at one level.
const ONE_LEVEL: f64 = 0.1;
/// Least jump between the levels of the relay, as a fraction of the range.
const LARGE_JUMP: f64 = 0.4;
/// Fewest jumps of a relay.
const FEWEST_JUMPS: usize = 3;
/// Maximum share of samples between the two levels while the relay runs.
const MOST_BETWEEN: f64 = 0.01;
/// Distance beyond the range of all other values at which a single value of any input is noted, in ranges.
const FAR: f64 = 0.5;
/// Least peak of a corrupt output, as a multiple of the peak that 1 % of the samples exceed: for Gaussian noise 26
/// standard deviations.
const TALL: f64 = 10.0;
/// Least peak of a corrupt output, as a fraction of the range.
const LEAST_PEAK: f64 = 0.1;

/// A corrupt sample of the input.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Fault {
    /// It takes this value: the samples on both sides have one level.
    Replace(f64),
    /// Its level is unknown.
    Drop,
    /// It lies alone outside the range of all other values. It may be true.
    Doubt(Range<f64>),
}

/// Corrupt samples of an input, by index.
pub(super) fn of_input(input: &[f64]) -> Vec<(usize, Fault)> {
    let Some((low, high)) = trimmed_range(input) else {
        return Vec::new();
    };
    let range = high - low;
    let single = |i: usize| {
        i > 0
            && i + 1 < input.len()
            && (input[i - 1] - input[i + 1]).abs() <= ONE_LEVEL * range
            && (input[i] - input[i - 1]).abs() > OFF_LEVEL * range
    };
    let outside = |u: f64| u < low - OFF_LEVEL * range || u > high + OFF_LEVEL * range;
    let between = |u: f64| u > low + OFF_LEVEL * range && u < high - OFF_LEVEL * range;
    if !is_relay(input, range, |i| single(i) || outside(input[i]), between) {
        return doubtful(input, low, high);
    }
    let mut faults = Vec::new();
    for (i, &u) in input.iter().enumerate() {
        if single(i) && (outside(u) || between(u)) {
            faults.push((i, Fault::Replace(input[i - 1])));
        } else if outside(u) {
            faults.push((i, Fault::Drop));
        }
    }
    if faults.len() as f64 > (MOST_CORRUPT * input.len() as f64).max(1.0) {
        faults.clear();
    }
    faults
}

/// Whether the input without odd samples switches between two levels: hardly a sample lies between them from the first
/// large jump to the last.
fn is_relay(
    input: &[f64],
    range: f64,
    is_odd: impl Fn(usize) -> bool,
    between: impl Fn(f64) -> bool,
) -> bool {
    let mut jumps = 0;
    let mut before: Option<f64> = None;
    let (mut passed, mut inside) = (0_usize, 0_usize);
    // Counts up to the last large jump.
    let mut relay = (0_usize, 0_usize);
    for (i, &u) in input.iter().enumerate() {
        if is_odd(i) {
            continue;
        }
        if before.is_some_and(|before| (u - before).abs() >= LARGE_JUMP * range) {
            jumps += 1;
            relay = (passed, inside);
        }
        if jumps > 0 {
            passed += 1;
            inside += usize::from(between(u));
        }
        before = Some(u);
    }
    let (passed, inside) = relay;
    jumps >= FEWEST_JUMPS && inside as f64 <= MOST_BETWEEN * passed as f64
}

/// Values far outside the range of all others, if there are one or two of them.
fn doubtful(input: &[f64], low: f64, high: f64) -> Vec<(usize, Fault)> {
    let far = FAR * (high - low);
    let found: Vec<usize> = (0..input.len())
        .filter(|&i| input[i] < low - far || input[i] > high + far)
        .collect();
    if found.len() > 2 {
        return Vec::new();
    }
    let others = input.iter().enumerate().filter(|(i, _)| !found.contains(i));
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let (least, most) = others.fold(start, |(least, most), (_, u)| (least.min(*u), most.max(*u)));
    let far = FAR * (most - least);
    let is_far = |i: &usize| input[*i] < least - far || input[*i] > most + far;
    let found = found.into_iter().filter(is_far);
    found.map(|i| (i, Fault::Doubt(least..most))).collect()
}

/// Corrupt samples of an output with the value between their neighbours, by index; `is_joined(i)` tells whether sample
/// `i` follows the one before without a gap.
pub(super) fn of_output(
    time_s: &[f64],
    output: &[f64],
    is_joined: impl Fn(usize) -> bool,
) -> Vec<(usize, f64)> {
    let Some((low, high)) = trimmed_range(output) else {
        return Vec::new();
    };
    let line = |i: usize| {
        let part = (time_s[i] - time_s[i - 1]) / (time_s[i + 1] - time_s[i - 1]);
        output[i - 1] + part * (output[i + 1] - output[i - 1])
    };
    let mut peaks = vec![0.0; output.len()];
    for i in 1..output.len() - 1 {
        if is_joined(i) && is_joined(i + 1) {
            peaks[i] = output[i] - line(i);
        }
    }
    let mut sizes: Vec<f64> = peaks.iter().map(|peak| peak.abs()).collect();
    let rank = ((1.0 - ASIDE) * sizes.len() as f64) as usize;
    let (_, usual, _) = sizes.select_nth_unstable_by(rank.min(output.len() - 1), f64::total_cmp);
    let least = (TALL * *usual).max(LEAST_PEAK * (high - low));
    // One wrong sample gives peaks of -1/2, 1, -1/2; a corner or a step of the signal does not.
    let opposite = |near: f64, peak: f64| -near / peak > 0.25;
    let is_corrupt = |i: &usize| {
        let peak = peaks[*i];
        peak.abs() > least && opposite(peaks[i - 1], peak) && opposite(peaks[i + 1], peak)
    };
    let found: Vec<usize> = (1..output.len() - 1).filter(is_corrupt).collect();
    let apart = found.windows(2).all(|pair| pair[1] > pair[0] + 1);
    if !apart || found.len() as f64 > (MOST_CORRUPT * output.len() as f64).max(1.0) {
        return Vec::new();
    }
    found.into_iter().map(|i| (i, line(i))).collect()
}

/// Range of a signal without the lowest and the highest per cent of its values; `None` for a short or constant signal.
fn trimmed_range(values: &[f64]) -> Option<(f64, f64)> {
    let aside = (ASIDE * values.len() as f64) as usize;
    if aside == 0 {
        return None;
    }
    let mut values = values.to_vec();
    let last = values.len() - 1 - aside;
    let (_, low, _) = values.select_nth_unstable_by(aside, f64::total_cmp);
    let low = *low;
    let (_, high, _) = values.select_nth_unstable_by(last, f64::total_cmp);
    let high = *high;
    (high > low).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A relay between -1 and 1 that switches every 50 samples, after 100 samples at rest.
    fn relay() -> Vec<f64> {
        let level = |i: usize| {
            if (i / 50).is_multiple_of(2) {
                1.0
            } else {
                -1.0
            }
        };
        [0.0; 100].into_iter().chain((0..900).map(level)).collect()
    }

    #[test]
    fn single_cells_that_a_relay_cannot_have() {
        for value in [-9.0, -3.0, 0.3, 3.0, 1e9] {
            // At rest (0.3 is within a fifth of the range), within a level, and beside both edges of a switch at 550.
            for (at, fault) in [
                (40, Fault::Replace(0.0)),
                (120, Fault::Replace(1.0)),
                (520, Fault::Replace(1.0)),
                (549, Fault::Drop),
                (550, Fault::Drop),
            ] {
                let mut input = relay();
                input[at] = value;
                let is_possible = value == 0.3 && (at == 40 || fault == Fault::Drop);
                let expected = if is_possible {
                    vec![]
                } else {
                    vec![(at, fault)]
                };
                assert_eq!(of_input(&input), expected, "{value} at {at}");
            }
        }
    }

    #[test]
    fn levels_and_pulses_of_the_relay_are_kept() {
        assert_eq!(of_input(&relay()), []);
        // A pulse to the other level, a third level, a trim.
        let mut input = relay();
        input[520] = -1.0;
        input[300..306].fill(3.0);
        for (i, u) in input.iter_mut().enumerate() {
            *u += 0.3 * (i as f64 / 1000.0);
        }
        assert_eq!(of_input(&input), []);
        // Two to five of a thousand samples are not a level.
        let mut input = relay();
        input[320..325].fill(-9.0);
        let expected: Vec<_> = (320..325).map(|i| (i, Fault::Drop)).collect();
        assert_eq!(of_input(&input), expected);
        // A sine with noise-free steps, a ramp, a constant.
        let sine: Vec<f64> = (0..1000).map(|i| (f64::from(i) / 10.0).sin()).collect();
        assert_eq!(of_input(&sine), []);
        assert_eq!(of_input(&[1.0; 1000]), []);
        assert_eq!(of_input(&[1.0, 9.0, 1.0]), []);
    }

    #[test]
    fn a_spike_of_another_input_is_in_doubt() {
        let mut sine: Vec<f64> = (0..1000).map(|i| (f64::from(i) / 10.0).sin()).collect();
        sine[500] = -9.0;
        let [(500, Fault::Doubt(others))] = &of_input(&sine)[..] else {
            panic!("{:?}", of_input(&sine));
        };
        assert!((others.end - others.start - 2.0).abs() < 0.01, "{others:?}");
    }

    #[test]
    fn peaks_of_one_sample_in_the_output() {
        let time_s: Vec<f64> = (0..1000).map(|i| f64::from(i) / 100.0).collect();
        let triangle = |t: f64| (t % 2.0 - 1.0).abs();
        let plain: Vec<f64> = time_s.iter().map(|&t| triangle(t)).collect();
        let joined = |_| true;
        // Neither corners nor a step nor quanta are corrupt.
        assert_eq!(of_output(&time_s, &plain, joined), []);
        let step: Vec<f64> = (time_s.iter()).map(|t| f64::from(*t > 5.0)).collect();
        assert_eq!(of_output(&time_s, &step, joined), []);
        let coarse: Vec<f64> = plain.iter().map(|y| (20.0 * y).round() / 20.0).collect();
        assert_eq!(of_output(&time_s, &coarse, joined), []);

        let mut spiked = plain.clone();
        spiked[321] = 7.0;
        let found = of_output(&time_s, &spiked, joined);
        let [(321, value)] = found[..] else {
            panic!("{found:?}");
        };
        assert!((value - plain[321]).abs() < 1e-12);
        // Beside a gap there is no line through both neighbours.
        assert_eq!(of_output(&time_s, &spiked, |i| i != 322), []);
    }
}
