//! Exact limit cycles of a process and a relay, and their stability.
//!
//! The relay is the modified one with amplitude one (the paper's equation 4 as meant; Ayyad, Chehadeh,
//! Awad, Zweiri 2020): while its output is high it follows the minimum of `y` since the last switch,
//! and switches once that is negative and `y` has returned to `-beta` times it; mirrored while it is
//! low. A constant `bias` adds to its output.
//!
//! The process integrates, so the mean input of a cycle is zero: `high (1 + bias) = low (1 - bias)`.
//! The period determines both durations, they determine the periodic response up to a constant
//! (`waveform`), and both switches determine that constant:
//!
//! ```text
//! y(high) + c = b (min + c),    y(period) + c = b (max + c),    b = -beta
//! F(period) = (b min - y(high)) / (1 - b) - (b max - y(period)) / (1 - b) = 0
//! ```
//!
//! This is one equation in one unknown, without describing function or simulation in time. Its roots
//! are limit cycles if the relay would not have switched earlier. They are searched for over
//! [`PERIODS`] around the describing function's; a dead time longer than the period is left out.
//! References for exact methods: K. J. Astrom, "Oscillations in systems with relay feedback", IMA Vol.
//! Math. Appl. 74 (1995); I. Boiko, "Discontinuous Control Systems", Birkhauser (2009).

mod poincare;
pub mod sampled;
mod waveform;

use std::f64::consts::TAU;

use onecycle_onboard::Soiptd;

use self::poincare::Orbit;
use self::waveform::{Moment, Waveform};
use crate::space::Range;
use onecycle_design::roots::root;

/// A periodic solution of process and relay; the relay's amplitude is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitCycle {
    /// Time for which the relay's output is high (s).
    pub high_s: f64,
    /// Time for which it is low (s).
    pub low_s: f64,
    /// Half the peak-to-peak output (output unit).
    pub amplitude: f64,
    /// Mean of the output's extremes (output unit).
    pub centre: f64,
    /// Spectral radius of the Poincare map: what remains of a small deviation after a cycle.
    pub spectral_radius: f64,
}

impl LimitCycle {
    /// Period (s).
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.high_s + self.low_s
    }

    /// Whether small deviations decay.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.spectral_radius < 1.0
    }
}

/// Range of the search, in periods of the describing function: a bias of 0.9 stretches the cycles of
/// multirotors five times.
pub const PERIODS: Range = (0.25, 32.0);

/// Ratio of successive trial periods.
const SCAN_RATIO: f64 = 1.06;

/// Range of the search for the cycle without bias, in periods of the describing function.
const SYMMETRIC_PERIODS: Range = (0.5, 4.0);

/// The limit cycle without bias that is nearest to the describing function's; `None` if the describing
/// function or the exact condition has none.
#[must_use]
pub fn symmetric(process: &Soiptd, beta: f64) -> Option<LimitCycle> {
    let search = Search {
        process,
        beta: [beta; 2],
        bias: 0.0,
    };
    let expected_s = search.expected_period_s()?;
    let (mut below, mut above) = (1.0, 1.0);
    let is_positive = |periods: f64| Some(search.imbalance(periods * expected_s)? > 0.0);
    let start = is_positive(1.0)?;
    while below > SYMMETRIC_PERIODS.0 || above < SYMMETRIC_PERIODS.1 {
        if above < SYMMETRIC_PERIODS.1 {
            let next = above * SCAN_RATIO;
            if is_positive(next)? != start {
                return search.cycle_between(above * expected_s, next * expected_s);
            }
            above = next;
        }
        if below > SYMMETRIC_PERIODS.0 {
            let next = below / SCAN_RATIO;
            if is_positive(next).is_some_and(|positive| positive != start) {
                return search.cycle_between(next * expected_s, below * expected_s);
            }
            below = next;
        }
    }
    None
}

/// Spectral radius of the [`symmetric`] cycle of a relay with trim: at each rise the trim moves by
/// `trim_gain` times the mean of the relay's output about the trim over the cycle. The trim cancels any
/// bias, so this is the cycle and its stability under every bias.
///
/// `None` without a cycle, or if the dead time is longer than half of it.
#[must_use]
pub fn trimmed_spectral_radius(process: &Soiptd, beta: f64, trim_gain: f64) -> Option<f64> {
    let cycle = symmetric(process, beta)?;
    let search = Search {
        process,
        beta: [beta; 2],
        bias: 0.0,
    };
    let waveform = search.waveform(cycle.period_s())?;
    let [high, low] = [true, false].map(|high| Window::of(&waveform, high));
    let orbit = search.orbit(&waveform, [&high, &low]);
    (process.tau_s() < cycle.high_s).then(|| orbit.trimmed_spectral_radius(trim_gain))
}

/// All limit cycles with two switches a period under a constant `bias` between -1 and 1, the shortest
/// first. `beta` holds the values for the switch that ends the high output and for the one that ends
/// the low output.
#[must_use]
pub fn limit_cycles(process: &Soiptd, beta: [f64; 2], bias: f64) -> Vec<LimitCycle> {
    let search = Search {
        process,
        beta,
        bias,
    };
    let Some(expected_s) = search.expected_period_s() else {
        return Vec::new();
    };
    let count = ((PERIODS.1 / PERIODS.0).ln() / SCAN_RATIO.ln()).ceil() as i32;
    let trials: Vec<(f64, f64)> = (0..=count)
        .map(|k| PERIODS.0 * SCAN_RATIO.powi(k) * expected_s)
        .filter_map(|period_s| Some((period_s, search.imbalance(period_s)?)))
        .collect();
    let mut cycles = Vec::new();
    for pair in trials.windows(2) {
        let [(from_s, before), (to_s, after)] = [pair[0], pair[1]];
        if (before > 0.0) != (after > 0.0) {
            cycles.extend(search.cycle_between(from_s, to_s));
        }
    }
    cycles
}

/// Process, relay and bias of a search.
#[derive(Clone, Copy, Debug)]
struct Search<'a> {
    process: &'a Soiptd,
    beta: [f64; 2],
    bias: f64,
}

impl Search<'_> {
    fn expected_period_s(&self) -> Option<f64> {
        let (omega, _) = self
            .process
            .describing_function_oscillation(1.0, 0.5 * (self.beta[0] + self.beta[1]))?;
        (self.bias.abs() < 1.0).then_some(TAU / omega)
    }

    /// `None` if the dead time is longer than the period.
    fn waveform(&self, period_s: f64) -> Option<Waveform> {
        let high_s = 0.5 * period_s * (1.0 - self.bias);
        (self.process.tau_s() < period_s)
            .then(|| Waveform::new(self.process, high_s, period_s, self.bias))
    }

    /// `F` of the [module](self).
    fn imbalance(&self, period_s: f64) -> Option<f64> {
        let waveform = self.waveform(period_s)?;
        let high = Window::of(&waveform, true);
        let constant = high.constant(self.b(true));
        let opposite = if self.is_symmetric() {
            // The low half is the high half mirrored at the mean.
            -constant - (high.course[0].y + high.end.y)
        } else {
            Window::of(&waveform, false).constant(self.b(false))
        };
        Some(constant - opposite)
    }

    fn is_symmetric(&self) -> bool {
        self.bias == 0.0 && self.beta[0] == self.beta[1]
    }

    fn b(&self, high: bool) -> f64 {
        -self.beta[usize::from(!high)]
    }

    /// The cycle with a period between these; `None` if the relay would have switched earlier.
    fn cycle_between(&self, from_s: f64, to_s: f64) -> Option<LimitCycle> {
        let imbalance = |period_s| self.imbalance(period_s).unwrap_or(f64::NAN);
        let period_s = root(imbalance, from_s, to_s, 0.0);
        let waveform = self.waveform(period_s)?;
        let [high, low] = [true, false].map(|high| Window::of(&waveform, high));
        let b = [self.b(true), self.b(false)];
        let constant = high.constant(b[0]);
        let switches_first_at_the_end =
            high.lasts(constant, b[0], 1.0) && low.lasts(constant, b[1], -1.0);
        let gain = self.process.k_over_t_body().abs();
        switches_first_at_the_end.then(|| LimitCycle {
            high_s: waveform.high_s,
            low_s: period_s - waveform.high_s,
            amplitude: 0.5 * gain * (low.extreme.y - high.extreme.y),
            centre: gain * (0.5 * (low.extreme.y + high.extreme.y) + constant),
            spectral_radius: self.orbit(&waveform, [&high, &low]).spectral_radius(),
        })
    }

    fn orbit<'a>(&self, waveform: &'a Waveform, windows: [&Window; 2]) -> Orbit<'a> {
        Orbit {
            waveform,
            tau_s: self.process.tau_s(),
            b: [true, false].map(|high| self.b(high)),
            extremes_s: windows.map(|window| window.extreme.time_s),
        }
    }
}

/// The output between two switches: its course, and the extremum that the relay follows.
struct Window {
    course: Vec<Moment>,
    extreme: Moment,
    end: Moment,
}

impl Window {
    fn of(waveform: &Waveform, high: bool) -> Self {
        let course = waveform.course(high);
        let sign = if high { 1.0 } else { -1.0 };
        let mut extreme = course[0];
        for moment in &course {
            if sign * moment.y < sign * extreme.y {
                extreme = *moment;
            }
        }
        let end = course[course.len() - 1];
        Self {
            course,
            extreme,
            end,
        }
    }

    /// Constant to add to the output so that the relay switches at the end.
    fn constant(&self, b: f64) -> f64 {
        (b * self.extreme.y - self.end.y) / (1.0 - b)
    }

    /// Whether the relay does not switch before the end; `sign` makes the window a high one.
    fn lasts(&self, constant: f64, b: f64, sign: f64) -> bool {
        let y = |moment: &Moment| sign * (moment.y + constant);
        let mut lowest = y(&self.course[0]);
        let last = self.course.len() - 1;
        for (k, pair) in self.course.windows(2).enumerate() {
            let (from, to) = (y(&pair[0]), y(&pair[1]));
            lowest = lowest.min(from);
            let rises = to > from;
            let reaches = rises && lowest < 0.0 && to >= b * lowest;
            if k + 1 < last && reaches {
                return false;
            }
            if k + 1 == last && !(rises && lowest < 0.0) {
                return false;
            }
        }
        true
    }
}
