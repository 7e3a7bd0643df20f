//! The experiments of the benchmark: random processes of the paper's domain, one relay test each.
//!
//! | what             | how                                                                       |
//! |------------------|---------------------------------------------------------------------------|
//! | process          | times uniform in the paper's domain; `K` from 0.1 to 10, uniform in logarithms |
//! | relay            | amplitude 1, `beta` -0.73, 1 kHz, the relay of the board                  |
//! | input bias       | uniform up to half the relay's amplitude, either way                      |
//! | noise            | uniform up to 3 % of the amplitude of the noise-free oscillation          |
//! | protocol         | odd numbers: the relay trims the bias away; even ones: it is left in      |
//! | kept             | the last four complete cycles, a period and a half before them, and what follows to the end, at most another period and a half |
//!
//! Outputs are rounded to less than a millionth of the amplitude, inputs to 1e-7: far below the least
//! noise, and half the size of a file.

use std::f64::consts::TAU;

use onecycle_onboard::cycle::Cycle;
use onecycle_onboard::{Soiptd, SoiptdError};
use onecycle_plant::{Controller, Experiment, Noise, Trace};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{RelayTest, Seen};
use crate::judge::baselines::RivalError;
use crate::judge::baselines::asymmetric::AsymmetricRelay;
use crate::judge::baselines::pem::SweptRelay;
use crate::judge::campaign::{Campaign, CaseError, IDENTIFICATION_PERIODS, cycles};
use crate::space::Space;
use onecycle_design::soiptd_pd::optimum::OptimumError;
use onecycle_identify::Signals;

/// Complete cycles at the end of a recording that are kept.
pub const CYCLES_KEPT: usize = 4;
/// Periods kept before them: what is still under way in a process at the first of them.
const PERIODS_BEFORE: f64 = 1.5;

/// Gains, uniform in logarithms: so that no method may take one for granted.
const GAINS: (f64, f64) = (0.1, 10.0);
/// What sets the seed of the gain apart from those of the other draws.
const GAIN_STREAM: u64 = 0x6761_696e;

/// Sample period (s): the paper's.
const SAMPLE_S: f64 = 1e-3;

/// Levels of the asymmetric relay, as far apart as those of the other one, in the published ratio of two:
/// the largest bias leaves the smaller level a quarter of its size.
const ASYMMETRIC_LEVELS: (f64, f64) = (4.0 / 3.0, -2.0 / 3.0);
/// Its hysteresis, in standard deviations of the noise: one false switch in a million samples.
const HYSTERESIS_SIGMAS: f64 = 5.0;
/// Its duration, in periods at the distinguishing phase: ten cycles and more of its own, which are longer,
/// and longer still under a bias.
const ASYMMETRIC_PERIODS: f64 = 150.0;

/// The benchmark: so many experiments from a seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Benchmark {
    /// Experiments, numbered from one.
    pub experiments: u64,
    /// Seed of them all, far enough below the limit of a `u64` for the numbers to be added.
    pub seed: u64,
}

impl Default for Benchmark {
    /// The public one: a thousand experiments.
    fn default() -> Self {
        Self {
            experiments: 1000,
            seed: 70_000,
        }
    }
}

/// Why an experiment cannot be made; none of the benchmark's is so.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExperimentError {
    /// The case cannot be run.
    #[error("{0}")]
    Case(#[from] CaseError),
    /// The process has no optimum to compare with.
    #[error("{0}")]
    Optimum(#[from] OptimumError),
    /// The relay of a rival cannot be made.
    #[error("{0}")]
    Relay(#[from] RivalError),
    /// The relay has not made this many cycles.
    #[error("the relay has made only {0} cycles")]
    TooFewCycles(usize),
}

impl From<SoiptdError> for ExperimentError {
    fn from(error: SoiptdError) -> Self {
        Self::Case(error.into())
    }
}

/// What is behind a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Number of the experiment.
    pub number: u64,
    /// The process.
    pub process: Soiptd,
    /// Constant added to the input; the relay's amplitude is one.
    pub input_bias: f64,
    /// Standard deviation of the noise (output unit).
    pub noise_sigma: f64,
    /// Seed of the noise.
    pub seed: u64,
    /// Whether the relay trims the bias away.
    pub is_trimmed: bool,
}

/// A recording as a method gets it: single samples at an even period.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Time of each sample (s), from zero.
    pub time_s: Vec<f64>,
    /// Input held from each sample to the next (input unit).
    pub input: Vec<f64>,
    /// Output (output unit).
    pub output: Vec<f64>,
    /// Hysteresis of the relay (output unit); zero where it has none.
    pub hysteresis: f64,
}

impl Recorded {
    fn of(trace: Trace, hysteresis: f64) -> Self {
        Self {
            time_s: trace.time_s,
            input: trace.input,
            output: trace.output,
            hysteresis,
        }
    }

    /// The same as columns.
    #[must_use]
    pub fn seen(&self) -> Seen<'_> {
        Seen {
            signals: Signals {
                time_s: &self.time_s,
                input: &self.input,
                output: &self.output,
                samples_per_point: 1,
                sample_period_s: SAMPLE_S,
                breaks: &[],
            },
            hysteresis: self.hysteresis,
        }
    }
}

impl Benchmark {
    /// The campaign that its experiments of a protocol are cases of.
    fn campaign(&self, is_trimmed: bool) -> Campaign {
        Campaign {
            cases: self.experiments,
            seed: self.seed,
            bias: 0.5,
            sigma: 0.03,
            sigma_uniform: true,
            trim: is_trimmed,
            cycles: CYCLES_KEPT,
            ..Campaign::QUIET
        }
    }

    /// An experiment by its number: the truth and the recording.
    ///
    /// # Errors
    /// [`ExperimentError`]; none for a number of the benchmark.
    pub fn experiment(&self, number: u64) -> Result<(Truth, Recorded), ExperimentError> {
        let is_trimmed = number % 2 == 1;
        let campaign = self.campaign(is_trimmed);
        let case = campaign.case(number)?;
        let (trace, _) = campaign.run(&case, IDENTIFICATION_PERIODS)?;
        let seed = self.seed + number;
        let (least, most) = GAINS;
        let part: f64 = Pcg64Mcg::seed_from_u64(seed ^ (GAIN_STREAM << 32)).random_range(0.0..1.0);
        // The process is linear: a gain scales the output and nothing else.
        let gain = least * (most / least).powf(part);
        let truth = Truth {
            number,
            process: case.process.with_gain_scaled(gain)?,
            input_bias: case.bias,
            noise_sigma: gain * case.sigma,
            seed,
            is_trimmed,
        };
        Ok((truth, kept(&trace, gain, gain * case.amplitude)?))
    }
}

/// The end of a trace, its output scaled and rounded for a file.
fn kept(trace: &Trace, gain: f64, amplitude: f64) -> Result<Recorded, ExperimentError> {
    let cycles: Vec<Cycle> = cycles(trace, &trace.output).collect();
    let Some(first) = cycles.len().checked_sub(CYCLES_KEPT).map(|at| &cycles[at]) else {
        return Err(ExperimentError::TooFewCycles(cycles.len()));
    };
    let begin_s = first.start_s - PERIODS_BEFORE * first.period_s;
    let begin = trace.time_s.partition_point(|&time_s| time_s < begin_s);
    let digits = -(1e-6 * amplitude).log10().floor();
    let rounded = |value: f64, digits: f64| {
        let unit = 10_f64.powf(digits);
        (value * unit).round() / unit
    };
    let samples = trace.len() - begin;
    Ok(Recorded {
        // Whole milliseconds, as short as they are.
        time_s: (0..samples).map(|k| k as f64 / (1.0 / SAMPLE_S)).collect(),
        input: trace.input[begin..]
            .iter()
            .map(|&u| rounded(u, 7.0))
            .collect(),
        output: trace.output[begin..]
            .iter()
            .map(|&y| rounded(gain * y, digits))
            .collect(),
        hysteresis: 0.0,
    })
}

impl Truth {
    /// The recording of another relay test on the same process, with the same bias, noise and seed;
    /// `None` for the one that is there already.
    ///
    /// # Errors
    /// [`ExperimentError`]: the truth is out of range.
    pub fn recorded_by(&self, test: RelayTest) -> Result<Option<Recorded>, ExperimentError> {
        match test {
            RelayTest::Recorded => Ok(None),
            RelayTest::Swept => {
                let campaign = Benchmark::default().campaign(self.is_trimmed);
                let settings = campaign.relay_settings();
                let duration_s = f64::from(settings.preroll_s) + SweptRelay::PAPER_DURATION_S;
                let mut relay = SweptRelay::paper(settings).map_err(CaseError::from)?;
                Ok(Some(Recorded::of(self.run(&mut relay, duration_s), 0.0)))
            }
            RelayTest::Asymmetric => {
                let (high, low) = ASYMMETRIC_LEVELS;
                let hysteresis = HYSTERESIS_SIGMAS * self.noise_sigma;
                let mut relay = AsymmetricRelay::new(high, low, hysteresis)?;
                let oscillation =
                    (self.process).describing_function_oscillation(1.0, Space::MULTIROTOR.beta);
                let (omega, _) = oscillation.ok_or(CaseError::NoOscillation)?;
                let duration_s = ASYMMETRIC_PERIODS * TAU / omega;
                Ok(Some(Recorded::of(
                    self.run(&mut relay, duration_s),
                    hysteresis,
                )))
            }
        }
    }

    fn run(&self, relay: &mut impl Controller, duration_s: f64) -> Trace {
        let mut experiment = Experiment::new(self.process, SAMPLE_S, duration_s);
        experiment.input_bias = self.input_bias;
        experiment.sensor.noise_sigma = self.noise_sigma;
        experiment.run(relay, &mut Noise::from_seed(!self.seed))
    }
}
