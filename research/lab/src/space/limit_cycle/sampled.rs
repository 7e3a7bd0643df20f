//! Limit cycles of a relay that reads the output, and switches, at samples only.
//!
//! Without bias the output is high for `n` samples and low for `n`. The response is then known and odd
//! about its mean, and the relay either switches first at sample `n` or it does not. Often several `n`
//! are possible, and the start decides. The cycles are stable: a small deviation does not move a
//! switch, so it decays as the process does, except for a shift of the mean output within the bounds
//! that keep the switches in place.
//!
//! With a bias, `high (1 + bias) = low (1 - bias)` seldom has a solution in whole samples, and the
//! durations form a pattern over many cycles, or no pattern.

use onecycle_onboard::Soiptd;
use onecycle_plant::FixedStepProcess;

use super::waveform::{Moment, Waveform};
use super::{LimitCycle, symmetric};

/// A limit cycle of the sampled relay without bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledLimitCycle {
    /// Samples for which the output is high, and equally low.
    pub half_period: u32,
    /// Half the peak-to-peak output, also between samples (output unit).
    pub amplitude: f64,
}

/// Range of half periods that are tried, over that of the relay without sampling, and additional
/// samples.
const HALF_PERIODS: (f64, f64) = (0.5, 2.0);
const SAMPLES_BEYOND: f64 = 4.0;

/// All symmetric cycles of the relay sampled every `sample_s`, the shortest first.
#[must_use]
pub fn symmetric_cycles(process: &Soiptd, beta: f64, sample_s: f64) -> Vec<SampledLimitCycle> {
    let Some(LimitCycle { high_s, .. }) = symmetric(process, beta) else {
        return Vec::new();
    };
    let samples = high_s / sample_s;
    let (from, to) = (
        HALF_PERIODS.0 * samples,
        HALF_PERIODS.1 * samples + SAMPLES_BEYOND,
    );
    (from.max(1.0) as u32..=to as u32)
        .filter_map(|half_period| cycle_of(process, beta, sample_s, half_period))
        .collect()
}

fn cycle_of(
    process: &Soiptd,
    beta: f64,
    sample_s: f64,
    half_period: u32,
) -> Option<SampledLimitCycle> {
    let high_s = f64::from(half_period) * sample_s;
    if process.tau_s() >= 2.0 * high_s {
        return None;
    }
    let waveform = Waveform::new(process, high_s, 2.0 * high_s, 0.0);
    let course = waveform.course(true);
    let [first, last] = [course[0], course[course.len() - 1]];
    // The response is odd about its mean: the output at the rise is minus that at the fall.
    let mean = 0.5 * (first.y + last.y);
    let level = |sample: u32| waveform.at(f64::from(sample) * sample_s).0.y - mean;
    if first_switch(&course, sample_s, half_period, -beta, level) != Some(half_period) {
        return None;
    }
    let lowest = course
        .iter()
        .fold(f64::INFINITY, |low, moment| low.min(moment.y));
    let highest = course
        .iter()
        .fold(f64::NEG_INFINITY, |high, moment| high.max(moment.y));
    Some(SampledLimitCycle {
        half_period,
        amplitude: process.k_over_t_body().abs() * (mean - lowest).max(highest - mean),
    })
}

/// The sample at which the relay, high from sample zero on, switches. Between turning points the output
/// is monotone, so it is enough to check the samples on either side of each.
fn first_switch(
    course: &[Moment],
    sample_s: f64,
    half_period: u32,
    b: f64,
    level: impl Fn(u32) -> f64,
) -> Option<u32> {
    let mut samples = vec![0];
    for moment in &course[1..course.len() - 1] {
        let before = (moment.time_s / sample_s) as u32;
        samples.extend([before, before + 1]);
    }
    samples.extend([half_period - 1, half_period]);
    let mut lowest = f64::INFINITY;
    samples
        .into_iter()
        .filter(|&sample| sample <= half_period)
        .find(|&sample| {
            let y = level(sample);
            lowest = lowest.min(y);
            sample > 0 && lowest < 0.0 && y >= b * lowest
        })
}

/// Motion of the sampled relay after many cycles.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// These cycles repeat: samples high, samples low.
    Pattern(Vec<(u32, u32)>),
    /// No repetition short enough to be seen.
    Wandering {
        /// Samples of the shortest cycle seen, and of the longest.
        period: (u32, u32),
        /// Mean samples of a cycle.
        mean: f64,
    },
    /// The relay has stopped switching.
    Stopped,
}

/// Number of cycles before the motion is observed, and number of cycles observed.
const SETTLING_CYCLES: usize = 200;
const OBSERVED_CYCLES: usize = 120;
/// Longest pattern that is searched for, so that each is seen twice.
const LONGEST_PATTERN: usize = OBSERVED_CYCLES / 2;
/// Number of half periods without a switch after which the relay counts as stopped.
const STOPPED_AFTER: f64 = 100.0;
/// Tolerance of equal states in a pattern, over the amplitude.
const SAME_STATE: f64 = 1e-9;

/// Motion of the relay sampled every `sample_s` under a constant `bias` between -1 and 1, starting half
/// its amplitude below rest. `beta` holds the values for the switch that ends the high output and for
/// the other one.
#[must_use]
pub fn motion(process: &Soiptd, beta: [f64; 2], bias: f64, sample_s: f64) -> Option<Motion> {
    let cycle = symmetric(process, 0.5 * (beta[0] + beta[1]))?;
    let mut relay = SampledLoop {
        plant: FixedStepProcess::new(process, sample_s),
        b: beta.map(|beta| -beta),
        bias,
        patience: (STOPPED_AFTER * cycle.high_s / sample_s) as u32 + 1,
    };
    relay.plant.displace(-0.5 * cycle.amplitude, 0.0);
    let mut cycles = Vec::with_capacity(OBSERVED_CYCLES);
    let mut outputs = Vec::with_capacity(OBSERVED_CYCLES);
    for k in 0..SETTLING_CYCLES + OBSERVED_CYCLES {
        let Some(durations) = relay.cycle() else {
            return Some(Motion::Stopped);
        };
        if k >= SETTLING_CYCLES {
            cycles.push(durations);
            outputs.push(relay.plant.output());
        }
    }
    let same = SAME_STATE * cycle.amplitude;
    let repeats = |length: &usize| {
        (*length..OBSERVED_CYCLES).all(|k| {
            cycles[k] == cycles[k - length] && (outputs[k] - outputs[k - length]).abs() < same
        })
    };
    if let Some(length) = (1..=LONGEST_PATTERN).find(repeats) {
        return Some(Motion::Pattern(cycles.split_off(OBSERVED_CYCLES - length)));
    }
    let periods = || cycles.iter().map(|(high, low)| high + low);
    Some(Motion::Wandering {
        period: (periods().min()?, periods().max()?),
        mean: f64::from(periods().sum::<u32>()) / OBSERVED_CYCLES as f64,
    })
}

/// The sampled relay around the process.
struct SampledLoop {
    plant: FixedStepProcess,
    b: [f64; 2],
    bias: f64,
    patience: u32,
}

impl SampledLoop {
    /// Samples high and low of the next cycle; `None` if it does not end.
    fn cycle(&mut self) -> Option<(u32, u32)> {
        Some((self.half(1.0, self.b[0])?, self.half(-1.0, self.b[1])?))
    }

    fn half(&mut self, sign: f64, b: f64) -> Option<u32> {
        let mut lowest = sign * self.plant.output();
        for samples in 1..self.patience {
            self.plant.step(sign + self.bias);
            let y = sign * self.plant.output();
            lowest = lowest.min(y);
            if lowest < 0.0 && y >= b * lowest {
                return Some(samples);
            }
        }
        None
    }
}
