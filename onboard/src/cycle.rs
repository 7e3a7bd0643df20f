//! Cycles: from the relay's level and the measured output to complete, comparable oscillations.
//!
//! A cycle runs from one rise of the relay to the next. A level that does not last (a switch that
//! the relay took back, a glitch in a recording) starts no cycle.

/// A level counts once it has lasted this part of the last half period: the relay's own dwell is
/// longer, what it takes back is shorter.
const LASTING: f64 = 0.25;

/// One complete cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Time of the rise that begins it (s).
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
    /// Level that counts, once there was one, and when it began.
    level: Option<(bool, f64)>,
    /// A new level that has yet to last, and when it began.
    candidate: Option<(bool, f64)>,
    half_s: f64,
    /// Rise that began the running cycle, and its fall.
    rise_s: Option<f64>,
    fall_s: f64,
    lowest: f64,
    highest: f64,
}

impl CycleDetector {
    /// No samples seen.
    #[must_use]
    pub fn new() -> Self {
        Self {
            lowest: f64::INFINITY,
            highest: f64::NEG_INFINITY,
            ..Self::default()
        }
    }

    /// A sample: its time (s), whether the relay is high from it on, and the output. Returns the
    /// cycle that is known to be complete now; it ended a little earlier.
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
        if time_s - began_s < LASTING * self.half_s {
            return None;
        }
        self.candidate = None;
        self.half_s = began_s - since_s;
        self.level = Some((high, began_s));
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

/// How far a cycle's period and amplitude may lie from the mean of the run it belongs to. Noise of
/// 5 % of the amplitude moves them by up to 15 %; a relay that has not settled, or a gust, by more.
const ALIKE: f64 = 0.2;

/// A run of consecutive cycles that are alike: the judgement of a steady oscillation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SteadyRun {
    /// Cycles in the run.
    pub cycles: u32,
    /// Their mean period (s).
    pub period_s: f64,
    /// Their mean amplitude (output unit).
    pub amplitude: f64,
    /// Start of the first (s).
    pub start_s: f64,
    /// End of the last (s).
    pub end_s: f64,
}

impl SteadyRun {
    /// Takes the next cycle in; a cycle unlike the run begins a new one. Returns whether it went on.
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

    /// Whether the oscillation is steady: three cycles alike.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.cycles >= 3
    }
}
