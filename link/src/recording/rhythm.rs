//! Sample period, jitter and gaps of a recording.
//!
//! The median increment of time is robust against gaps, but it is one of the increments that occur
//! (2 ms or 3 ms for 400 Hz in whole milliseconds). It therefore serves only to detect gaps. The
//! period is the mean of all increments that are not gaps, the jitter their standard deviation.

use super::GAP_PERIODS;

/// Times that a series of increments would be drawn before the longest of one of them passes for a gap by chance.
const DRAWS: f64 = 200.0;

/// Increments that are not gaps, gathered one by one.
#[derive(Debug, Clone)]
pub(super) struct Rhythm {
    median_s: f64,
    /// Longer increments are gaps.
    longest_s: f64,
    count: f64,
    /// Sum of `increment / median - 1`.
    sum: f64,
    sum_of_squares: f64,
}

impl Rhythm {
    /// Starts without increments; the median is that of `increments_s`.
    ///
    /// Where the increments differ, as in a log that stores changes, a long one is no gap: those above the median are taken
    /// as exponential, and then `P(increment > median + scale x) = exp(-x) / 2`. The longest quarter begins `ln 2` scales
    /// above the median, the longest tenth `ln 5`. The smaller of the two scales counts: in a log of even rows with
    /// pauses, which are gaps, one of them is zero.
    pub(super) fn around_median(mut increments_s: Vec<f64>) -> Self {
        let count = increments_s.len();
        let mut with_longer = |longer: usize| match count.saturating_sub(1 + longer) {
            _ if count == 0 => 1.0,
            index => *increments_s.select_nth_unstable_by(index, f64::total_cmp).1,
        };
        let median_s = with_longer(count.div_ceil(2).saturating_sub(1));
        let scale_s =
            |part: usize| (with_longer(count.div_ceil(part)) - median_s) / (0.5 * part as f64).ln();
        let scale_s = [4, 10]
            .map(scale_s)
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        let by_chance_s = scale_s.max(0.0) * (0.5 * DRAWS * count.max(1) as f64).ln();
        Self {
            median_s,
            longest_s: (GAP_PERIODS * median_s).max(median_s + by_chance_s),
            count: 0.0,
            sum: 0.0,
            sum_of_squares: 0.0,
        }
    }

    /// Whether the increment is a gap; if not, adds it to mean and standard deviation.
    pub(super) fn is_gap(&mut self, increment_s: f64) -> bool {
        if increment_s > self.longest_s {
            return true;
        }
        let ratio = increment_s / self.median_s;
        self.count += 1.0;
        self.sum += ratio - 1.0;
        self.sum_of_squares += (ratio - 1.0) * (ratio - 1.0);
        false
    }

    /// Median increment in seconds.
    pub(super) fn median_s(&self) -> f64 {
        self.median_s
    }

    /// Mean of the gathered increments in seconds.
    pub(super) fn period_s(&self) -> f64 {
        self.median_s * (1.0 + self.mean())
    }

    /// Standard deviation of the gathered increments over their mean.
    pub(super) fn jitter(&self) -> f64 {
        let variance = self.sum_of_squares / self.count.max(1.0) - self.mean() * self.mean();
        variance.max(0.0).sqrt() / (1.0 + self.mean())
    }

    fn mean(&self) -> f64 {
        self.sum / self.count.max(1.0)
    }
}

/// Increments of time that differ by more than this factor are those of compressed data.
const COMPRESSED: f64 = 3.0;
/// Fewest samples that show it.
const FEWEST: usize = 20;

/// The 5th and the 95th percentile of the increments of time, if they differ as much as those of compressed data.
pub(super) fn spread_s(times_s: &[f64]) -> Option<(f64, f64)> {
    let mut increments_s: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    increments_s.sort_by(f64::total_cmp);
    let at = |share: f64| increments_s[(share * (increments_s.len() - 1) as f64) as usize];
    if increments_s.len() < FEWEST {
        return None;
    }
    let (least_s, most_s) = (at(0.05), at(0.95));
    (most_s > COMPRESSED * least_s).then_some((least_s, most_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_milliseconds_of_400_hz() {
        // Increments 2, 3, 2, 3 ms: mean 2.5 ms, standard deviation 0.5 ms, jitter 0.2.
        let increments: Vec<f64> = (0..1000).map(|i| [0.002, 0.003][i % 2]).collect();
        let mut rhythm = Rhythm::around_median(increments.clone());
        assert!(
            increments
                .iter()
                .all(|&increment| !rhythm.is_gap(increment))
        );
        assert!((rhythm.period_s() - 0.0025).abs() < 1e-15);
        assert!((rhythm.jitter() - 0.2).abs() < 1e-12);
    }

    #[test]
    fn increments_of_chance_are_no_gaps() {
        // Quantiles of the exponential law of mean 1: the longest of 1,000 is 7.6 (11 medians). Gaps of 100 among them are
        // found.
        let drawn = (0..1000).map(|i| -((f64::from(i) + 0.5) / 1000.0).ln());
        let increments: Vec<f64> = drawn.chain([100.0; 20]).collect();
        let mut rhythm = Rhythm::around_median(increments.clone());
        let gaps = increments.iter().filter(|&&one| rhythm.is_gap(one)).count();
        assert_eq!(gaps, 20);
    }

    #[test]
    fn gaps_do_not_count() {
        let mut rhythm = Rhythm::around_median(vec![1.0, 1.0, 100.0, 1.0]);
        assert!(rhythm.is_gap(100.0));
        assert!(rhythm.is_gap(5.000_001));
        assert!(!rhythm.is_gap(1.0));
        assert_eq!(rhythm.period_s(), 1.0);
        assert_eq!(rhythm.jitter(), 0.0);
    }
}
