//! Cycle detection: from the relay's level and the measured output to complete cycles, and whether they are
//! steady.
//!
//! A cycle runs from one rise of the relay to the next. Times are in seconds, outputs in output units, the duty
//! is the part of the period with the relay high. A level that does not last (a switch that the relay reversed,
//! a glitch in a recording) starts no cycle.

/// A level counts when it has lasted this part of the last half period. The dwell of the relay is longer; levels
/// that the relay reverses are shorter.
const LASTING: f64 = 0.25;
/// Time without a switch, in last half periods, from which these no longer measure the oscillation: a large bias makes the
/// first one up to six times as long as the others, which would then all be too short to count.
const OUTDATED: f64 = 4.0;

/// One complete cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Time of the rise at its beginning (s).
    pub start_s: f64,
    /// Duration (s).
    pub period_s: f64,
    /// Part of the period with the relay high.
    pub duty: f64,
    /// Half the peak-to-peak output (output unit).
    pub amplitude: f64,
    /// Mean of the highest and lowest output (output unit).
    pub centre: f64,
}

/// Finds cycles in a stream of samples.
#[derive(Clone, Debug, Default)]
pub struct CycleDetector {
    /// The level that counts and its beginning (s), once there is one.
    level: Option<(bool, f64)>,
    /// A new level that has not lasted yet, and its beginning (s).
    candidate: Option<(bool, f64)>,
    half_s: f64,
    /// Rise at the beginning of the running cycle (s), and its fall.
    rise_s: Option<f64>,
    fall_s: f64,
    lowest: f64,
    highest: f64,
}

impl CycleDetector {
    /// A detector that has seen no samples.
    #[must_use]
    pub fn new() -> Self {
        Self {
            lowest: f64::INFINITY,
            highest: f64::NEG_INFINITY,
            ..Self::default()
        }
    }

    /// Takes a sample: its time (s), whether the relay is high from then on, and the output. Returns the cycle
    /// that is now known to be complete; it ended a little earlier.
    pub fn push(&mut self, time_s: f64, high: bool, output: f64) -> Option<Cycle> {
        self.lowest = self.lowest.min(output);
        self.highest = self.highest.max(output);
        let Some((level, since_s)) = self.level else {
            self.level = Some((high, time_s));
            return None;
        };
        if high == level {
            self.candidate = None;
            return None;
        }
        let (_, began_s) = *self.candidate.get_or_insert((high, time_s));
        let old_s = began_s - since_s;
        let is_outdated = self.half_s > 0.0 && old_s > OUTDATED * self.half_s;
        let lasting_s = if is_outdated {
            LASTING * self.half_s * (OUTDATED * self.half_s / old_s)
        } else {
            LASTING * self.half_s
        };
        if time_s - began_s < lasting_s {
            return None;
        }
        self.candidate = None;
        self.half_s = if is_outdated { lasting_s } else { old_s };
        self.level = Some((high, began_s));
        self.turn(began_s, high)
    }

    /// Ends the stream: a level that has begun counts although it has not lasted yet. Returns the cycle that
    /// this completes.
    #[must_use]
    pub fn finish(mut self) -> Option<Cycle> {
        let (high, began_s) = self.candidate?;
        self.turn(began_s, high)
    }

    fn turn(&mut self, time_s: f64, high: bool) -> Option<Cycle> {
        if !high {
            self.fall_s = time_s;
            return None;
        }
        let cycle = self.rise_s.map(|start_s| {
            let period_s = time_s - start_s;
            Cycle {
                start_s,
                period_s,
                duty: (self.fall_s - start_s) / period_s,
                amplitude: 0.5 * (self.highest - self.lowest),
                centre: 0.5 * (self.highest + self.lowest),
            }
        });
        self.rise_s = Some(time_s);
        (self.lowest, self.highest) = (f64::INFINITY, f64::NEG_INFINITY);
        cycle
    }
}

/// Tolerance for period and amplitude of a cycle against the mean of its run. Noise of 5 % of the amplitude
/// moves them by up to 15 % under this relay and by up to 30 % under a relay without noise protection. A relay
/// that has not settled, or a gust, moves them more.
const ALIKE: f64 = 0.3;

/// Run of consecutive cycles that are alike: decides whether the oscillation is steady.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SteadyRun {
    /// Number of cycles in the run.
    pub cycles: u32,
    /// Mean period (s).
    pub period_s: f64,
    /// Mean amplitude (output unit).
    pub amplitude: f64,
    /// Start of the first cycle (s).
    pub start_s: f64,
    /// End of the last cycle (s).
    pub end_s: f64,
}

impl SteadyRun {
    /// Adds the next cycle. A cycle unlike the run begins a new run. Returns whether the run continued.
    pub fn push(&mut self, cycle: &Cycle) -> bool {
        let alike = |value: f64, mean: f64| (value - mean).abs() <= ALIKE * mean;
        let goes_on = self.cycles > 0
            && alike(cycle.period_s, self.period_s)
            && alike(cycle.amplitude, self.amplitude);
        if !goes_on {
            *self = Self {
                start_s: cycle.start_s,
                ..Self::default()
            };
        }
        self.cycles += 1;
        let share = 1.0 / f64::from(self.cycles);
        self.period_s += share * (cycle.period_s - self.period_s);
        self.amplitude += share * (cycle.amplitude - self.amplitude);
        self.end_s = cycle.start_s + cycle.period_s;
        goes_on
    }

    /// Whether the oscillation is steady: three cycles that are alike.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.cycles >= 3
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    /// Cycles of levels and outputs at consecutive samples of 1/64 s, which is exact in binary.
    fn cycles(samples: impl IntoIterator<Item = (bool, f64)>) -> Vec<Cycle> {
        let mut detector = CycleDetector::new();
        samples
            .into_iter()
            .enumerate()
            .filter_map(|(k, (high, output))| detector.push(k as f64 / 64.0, high, output))
            .collect()
    }

    /// High for 24 of 64 samples; the output is a triangle from -1 to 3.
    fn square(k: usize) -> (bool, f64) {
        let phase = k % 64;
        let triangle = if phase < 32 {
            phase as f64
        } else {
            64.0 - phase as f64
        };
        (phase < 24, triangle / 8.0 - 1.0)
    }

    // A first half period of 200 samples asks for levels of 50, and those of the oscillation last 24 and 40. After four times
    // 200 samples without a switch, 50 begins to fall, and is below 40 after 1,000 samples.
    #[test]
    fn a_long_first_half_does_not_hide_the_oscillation() {
        let first = (0..64).chain(std::iter::repeat_n(0, 200)).map(square);
        let found = cycles(first.chain((0..64 * 40).map(square)));
        assert!(found.len() > 20, "{}", found.len());
        for cycle in &found[2..] {
            assert_eq!(cycle.period_s, 1.0);
        }
    }

    // The detector waits for a quarter of the last half period, 24 or 40 samples, before a level counts, and
    // then dates it back: the wait must not change the cycles.
    #[test]
    fn square_wave_is_found_exactly() {
        let found = cycles((0..64 * 6).map(square));
        // The rise at sample 0 is not seen as a rise; the rises at 1, 2, ... 5 s bound four cycles.
        assert_eq!(found.len(), 4);
        for (index, cycle) in found.iter().enumerate() {
            assert_eq!(cycle.start_s, 1.0 + index as f64);
            assert_eq!(cycle.period_s, 1.0);
            assert_eq!(cycle.duty, 24.0 / 64.0);
            assert_eq!(cycle.amplitude, 2.0);
            assert_eq!(cycle.centre, 1.0);
        }
    }

    // Levels of up to 5 samples (below a quarter of 24) change nothing, wherever they occur.
    #[test]
    fn glitches_are_ignored() {
        let clean = cycles((0..64 * 6).map(square));
        for at in 0..64 {
            let glitch = |k: usize| k > 128 && (0..5).contains(&((k + 64 - at) % 64));
            let found = cycles((0..64 * 6).map(|k| {
                let (high, output) = square(k);
                // Not within the wait after an edge (10 samples): there the level has not lasted yet and counts
                // from after the glitch.
                let edge = [0, 24].iter().any(|edge| (at + 69 - edge) % 64 < 16);
                (high != (glitch(k) && !edge), output)
            }));
            assert_eq!(found, clean, "glitch at {at}");
        }
    }

    // Rises at samples 64 and 128: the second counts six samples later (a quarter of the last complete half
    // period, 24), at sample 134. If the stream ends before that, the cycle is the same; without sample 128
    // there is no cycle.
    #[test]
    fn the_last_edge_ends_a_cycle_that_samples_no_longer_confirm() {
        let complete = cycles((0..135).map(square));
        assert_eq!(complete.len(), 1);
        for count in 127..=135 {
            let mut detector = CycleDetector::new();
            let found: Vec<Cycle> = (0..count)
                .filter_map(|k| {
                    let (high, output) = square(k);
                    detector.push(k as f64 / 64.0, high, output)
                })
                .collect();
            assert_eq!(found.len(), usize::from(count == 135), "{count}");
            let last = detector.finish();
            assert_eq!(last.is_some(), (129..135).contains(&count), "{count}");
            if let Some(last) = last {
                assert_eq!(last, complete[0]);
            }
        }
    }

    #[test]
    fn nothing_is_found_where_nothing_switches() {
        assert!(cycles((0..1000).map(|k| (true, k as f64))).is_empty());
        assert!(cycles((0..1000).map(|k| (k > 500, k as f64))).is_empty());
    }

    fn cycle(start_s: f64, period_s: f64, amplitude: f64) -> Cycle {
        Cycle {
            start_s,
            period_s,
            duty: 0.5,
            amplitude,
            centre: 0.0,
        }
    }

    // 1, 1.1 and 1.2 are within 30 % of the running means 1 and 1.05; 1.5 is not within 30 % of 1.1 and begins a
    // new run.
    #[test]
    fn steady_after_three_alike() {
        let mut run = SteadyRun::default();
        assert!(!run.push(&cycle(0.0, 1.0, 2.0)));
        assert!(run.push(&cycle(1.0, 1.1, 2.1)) && !run.is_steady());
        assert!(run.push(&cycle(2.1, 1.2, 2.2)) && run.is_steady());
        assert!((run.period_s - 1.1).abs() < 1e-15 && (run.amplitude - 2.1).abs() < 1e-15);
        assert_eq!((run.start_s, run.end_s), (0.0, 2.1 + 1.2));

        assert!(!run.push(&cycle(3.3, 1.5, 2.1)));
        assert_eq!((run.cycles, run.period_s, run.start_s), (1, 1.5, 3.3));
        assert!(!run.is_steady());
    }

    #[test]
    fn an_amplitude_that_jumps_is_not_steady() {
        let mut run = SteadyRun::default();
        for (k, amplitude) in [1.0, 1.0, 1.5, 1.0, 1.0].into_iter().enumerate() {
            run.push(&cycle(k as f64, 1.0, amplitude));
            assert!(!run.is_steady());
        }
    }
}
