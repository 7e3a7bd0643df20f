//! The relay in a recorded input: is it one, and when is it high?
//!
//! The levels may move (a trim), the record may begin and end with something else, and the input
//! may carry a little noise. What makes it a relay is that between its jumps it hardly moves.

use std::ops::Range;

/// Distance of the two levels' means in units of the spread about them. A relay is far above; a
/// sine has 4.1, a triangle 3.5, noise 2.7.
const LEAST_SEPARATION: f64 = 5.0;
/// Jumps of this part of the range mark where the relay begins and ends.
const LARGE_JUMP: f64 = 0.4;
/// Half the width of the band around the middle that holds the level, as a part of the levels'
/// distance.
const HYSTERESIS: f64 = 0.2;

/// What a recorded input is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum InputKind {
    /// It never changes.
    Constant,
    /// It changes its level a few times, then stays where it is.
    FewSwitches {
        /// Number of changes between levels that are held.
        switches: usize,
    },
    /// It changes, but not between two levels.
    NotTwoLevels,
    /// A relay.
    Relay(RelayInput),
}

/// A relay found in an input.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RelayInput {
    /// Points from the first large jump to the last.
    pub(super) span: Range<usize>,
    /// Mean of the low level and of the high one (input unit).
    pub(super) low: f64,
    pub(super) high: f64,
}

impl RelayInput {
    /// Means of the low and of the high level over a part of the input (input unit).
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

    /// Whether the relay is high at each point, with hysteresis about the middle of the levels.
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

/// Looks for a relay in `input`.
pub(super) fn find(input: &[f64]) -> InputKind {
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
    // The level after the last jump belongs to the relay too, for as long as it is held.
    let held = input[last..]
        .iter()
        .take_while(|&&u| u == input[last])
        .count();
    let span = first - 1..last + held;
    let mut sorted = input[span.clone()].to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    // One switch may leave a single sample on its level: spikes are put aside second.
    match two_levels(&sorted).or_else(|| two_levels(without_spikes(&sorted))) {
        Some((low, high)) => InputKind::Relay(RelayInput { span, low, high }),
        None => InputKind::NotTwoLevels,
    }
}

/// Points in a row at one value that make a level; fewer are a spike of the log.
const HELD: usize = 3;

/// Number of changes between values that are held.
fn held_switches(input: &[f64]) -> usize {
    let held = input
        .chunk_by(|a, b| a == b)
        .filter(|run| run.len() >= HELD);
    let levels: Vec<f64> = held.map(|run| run[0]).collect();
    levels.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

/// All but the outermost per cent at either end, which may be spikes of the log.
fn without_spikes(sorted: &[f64]) -> &[f64] {
    let aside = sorted.len() / 100;
    &sorted[aside..sorted.len() - aside]
}

/// Means of the two groups that differ most from each other (Otsu 1979), if they are levels; of
/// values in ascending order.
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
        // The rise out of the pause, and the nineteen edges inside the wave.
        assert_eq!(switches.windows(2).filter(|w| w[0] != w[1]).count(), 20);
    }

    // A relay that was switched on, reached its upper level and then stayed at zero: two changes in a hundredth of the
    // recording. A spike of two samples is no change of level.
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
