//! Detection of a two-level relay in a recorded input.
//!
//! The levels may drift (a trim of the relay), the recording may begin and end without the relay, and the input may
//! carry some noise. The criterion is that the input hardly moves between its jumps: the distance of the two levels is
//! large compared with the spread about them.

use std::ops::Range;

use crate::signals::Signals;
use crate::verdict::Verdict;

/// Least distance between the two levels, in standard deviations of the input about its nearer level. A sine has 4.1, a
/// triangle 3.5, Gaussian noise 2.7, a relay far more.
const LEAST_SEPARATION: f64 = 5.0;
/// Least jump at which the relay's part of the recording begins and ends, as a fraction of the range of the input.
const LARGE_JUMP: f64 = 0.4;
/// Half width of the hysteresis band about the middle of the levels, as a fraction of their distance.
const HYSTERESIS: f64 = 0.2;
/// Least number of equal consecutive points that make a level. Fewer are a spike of the log.
const HELD: usize = 3;
/// Range of the largest magnitude of a signal. Within it squares and sums of squares stay far from the limits of f64.
const MAGNITUDES: Range<f64> = 1e-100..1e100;

/// Relay of a recording.
///
/// # Errors
/// The verdict on a recording without a relay in its input, with a constant output, or with unusable magnitudes.
pub(super) fn find_relay(signals: &Signals<'_>) -> Result<RelayInput, Verdict> {
    for signal in [signals.input, signals.output] {
        let most = (signal.iter()).fold(0.0_f64, |most, value| most.max(value.abs()));
        if most != 0.0 && !MAGNITUDES.contains(&most) {
            return Err(Verdict::Units);
        }
    }
    match find(signals.input) {
        InputKind::Relay(_) if signals.output.windows(2).all(|pair| pair[0] == pair[1]) => {
            Err(Verdict::ConstantOutput)
        }
        InputKind::Relay(relay) => Ok(relay),
        InputKind::Constant => Err(Verdict::ConstantInput),
        InputKind::FewSwitches { switches } => Err(Verdict::FewSwitches { switches }),
        InputKind::NotTwoLevels => Err(Verdict::NoRelay {
            output_is_relay: is_relay_alone(signals.output),
        }),
    }
}

/// Whether a signal does nothing but switch between two levels. One jump of an output on a coarse display looks like a relay of two
/// samples, but the output moves before and after it.
fn is_relay_alone(signal: &[f64]) -> bool {
    let is_held = |part: &[f64]| part.windows(2).all(|pair| pair[0] == pair[1]);
    match find(signal) {
        InputKind::Relay(RelayInput { span, .. }) => {
            is_held(&signal[..=span.start]) && is_held(&signal[span.end..])
        }
        _ => false,
    }
}

/// Kind of a signal.
#[derive(Clone, Debug, PartialEq)]
enum InputKind {
    /// It never changes.
    Constant,
    /// It changes its level a few times, then stays at one value.
    FewSwitches {
        /// Number of changes between levels that are held.
        switches: usize,
    },
    /// It changes, but not between two levels.
    NotTwoLevels,
    /// It switches between two levels.
    Relay(RelayInput),
}

/// Two-level relay in a recorded input.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RelayInput {
    /// Points from just before the first large jump to the end of the level after the last one.
    pub(super) span: Range<usize>,
    /// Mean of the low level (input unit).
    low: f64,
    /// Mean of the high level (input unit).
    high: f64,
}

impl RelayInput {
    /// Means of the low and the high level over a part of the input (input unit).
    pub(super) fn means(&self, input: &[f64]) -> (f64, f64) {
        let mut sums = [(0.0, 0.0); 2];
        for (&u, high) in input.iter().zip(self.levels(input)) {
            let (sum, count) = &mut sums[usize::from(high)];
            *sum += u;
            *count += 1.0;
        }
        let [low, high] = sums.map(|(sum, count)| sum / f64::max(count, 1.0));
        (low, high)
    }

    /// Whether the relay is high, for each point of a part of the input. Uses hysteresis about the middle of the
    /// levels.
    pub(super) fn levels<'a>(&self, input: &'a [f64]) -> impl Iterator<Item = bool> + use<'a> {
        let middle = 0.5 * (self.low + self.high);
        let band = HYSTERESIS * (self.high - self.low);
        let mut is_high = input.first().is_some_and(|&u| u > middle);
        input.iter().map(move |&u| {
            if u > middle + band {
                is_high = true;
            } else if u < middle - band {
                is_high = false;
            }
            is_high
        })
    }
}

/// Determines whether `input` switches between two levels.
fn find(input: &[f64]) -> InputKind {
    let mut sorted = input.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let [least, .., most] = *without_spikes(&sorted) else {
        return InputKind::Constant;
    };
    let range = most - least;
    if range <= 1e-12 * least.abs().max(most.abs()) {
        return match held_switches(input) {
            0 => InputKind::Constant,
            switches => InputKind::FewSwitches { switches },
        };
    }
    let large = |pair: &[f64]| (pair[1] - pair[0]).abs() >= LARGE_JUMP * range;
    let mut jumps = input
        .windows(2)
        .enumerate()
        .filter(|(_, pair)| large(pair))
        .map(|(i, _)| i + 1);
    let Some(first) = jumps.next() else {
        return InputKind::NotTwoLevels;
    };
    let last = jumps.next_back().unwrap_or(first);
    // The level after the last jump belongs to the relay as long as the input keeps its value.
    let held = input[last..]
        .iter()
        .take_while(|&&u| u == input[last])
        .count();
    let span = first - 1..last + held;
    let mut sorted = input[span.clone()].to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    // First without discarding spikes: an input that switches once may have a single sample on one level.
    match two_levels(&sorted).or_else(|| two_levels(without_spikes(&sorted))) {
        Some((low, high)) => InputKind::Relay(RelayInput { span, low, high }),
        None => InputKind::NotTwoLevels,
    }
}

/// Number of changes between levels that are held.
fn held_switches(input: &[f64]) -> usize {
    let held = input
        .chunk_by(|a, b| a == b)
        .filter(|run| run.len() >= HELD);
    let levels: Vec<f64> = held.map(|run| run[0]).collect();
    levels.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

/// Values in ascending order without the lowest and the highest per cent, which may be spikes of the log.
fn without_spikes(sorted: &[f64]) -> &[f64] {
    let aside = sorted.len() / 100;
    &sorted[aside..sorted.len() - aside]
}

/// Means of the low and the high level of values in ascending order. `None` if the values are not two levels.
///
/// The values are split where the variance between the two groups is largest. Reference: N. Otsu, "A threshold
/// selection method from gray-level histograms", IEEE Trans. Syst. Man Cybern. 9 (1979).
fn two_levels(sorted: &[f64]) -> Option<(f64, f64)> {
    let count = sorted.len() as f64;
    let total: f64 = sorted.iter().sum();
    let mut below = 0.0;
    let mut best = (0.0, 0.0, 0.0);
    for (i, value) in sorted[..sorted.len() - 1].iter().enumerate() {
        below += value;
        let under = (i + 1) as f64;
        let (low, high) = (below / under, (total - below) / (count - under));
        let between = under * (count - under) * (high - low) * (high - low);
        if between > best.0 {
            best = (between, low, high);
        }
    }
    let (_, low, high) = best;
    let middle = 0.5 * (low + high);
    let within: f64 = sorted
        .iter()
        .map(|&u| if u < middle { u - low } else { u - high })
        .map(|deviation| deviation * deviation)
        .sum();
    let spread = (within / count).sqrt();
    (high - low > LEAST_SEPARATION * spread).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(shape: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..1000)
            .map(|i| shape(f64::from(i) / 100.0 % 1.0))
            .collect()
    }

    #[test]
    fn a_relay_is_found_with_trim_pauses_and_spikes() {
        let mut input = wave(|x| if x < 0.5 { 1.0 } else { -1.0 });
        for (i, u) in input.iter_mut().enumerate() {
            *u += 0.4 * (1.0 - (-(i as f64) / 300.0).exp());
        }
        input.splice(0..0, [0.0; 200]);
        input.extend([0.0; 200]);
        input[700] = 30.0;
        let InputKind::Relay(relay) = find(&input) else {
            panic!("no relay")
        };
        assert!(relay.span.start >= 199 && relay.span.end <= 1202);
        let switches = relay.levels(&input[relay.span.clone()]).collect::<Vec<_>>();
        // One rise after the pause, and 19 edges inside the ten periods of the wave.
        assert_eq!(switches.windows(2).filter(|w| w[0] != w[1]).count(), 20);
    }

    // A relay that was switched on, reached its upper level and then stayed at zero: two changes within 1 % of the
    // recording. In a constant input a spike of two samples is not a change of level.
    #[test]
    fn a_test_that_failed_is_not_constant() {
        let mut input = vec![0.0; 5000];
        input[..5].fill(127.0);
        input[5..36].fill(254.0);
        assert_eq!(find(&input), InputKind::FewSwitches { switches: 2 });
        let mut constant = vec![2.5; 5000];
        constant[700..702].fill(30.0);
        assert_eq!(find(&constant), InputKind::Constant);
    }

    // The speed of a motor in steps of 20: it rises within a sample, then follows an input of many levels.
    #[test]
    fn one_jump_of_a_coarse_output_is_no_relay() {
        let wave = wave(|x| 20.0 * (35.0 + 5.0 * (x * std::f64::consts::TAU).sin()).round());
        let output = [&[0.0], &wave[..]].concat();
        assert!(matches!(find(&output), InputKind::Relay(_)));
        assert!(!is_relay_alone(&output));
        let step = [vec![0.0; 300], vec![1.0; 700]].concat();
        assert!(is_relay_alone(&step));
    }

    #[test]
    fn other_signals_are_none() {
        assert_eq!(find(&[2.5; 100]), InputKind::Constant);
        let sine = wave(|x| (x * std::f64::consts::TAU).sin());
        assert_eq!(find(&sine), InputKind::NotTwoLevels);
        assert_eq!(
            find(&wave(|x| (2.0 * x - 1.0).abs())),
            InputKind::NotTwoLevels
        );
        let three = wave(|x| (3.0 * x).floor() - 1.0);
        assert_eq!(find(&three), InputKind::NotTwoLevels);
    }
}
