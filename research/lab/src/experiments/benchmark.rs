//! The experiments of the benchmark: random processes of the paper's domain, one relay test each.
//!
//! | what             | how                                                                       |
//! |------------------|---------------------------------------------------------------------------|
//! | process          | times uniform in the paper's domain; `K` from 0.1 to 10, uniform in logarithms |
//! | relay            | amplitude 1, `beta` -0.73, 1 kHz, the relay of the board                  |
//! | input bias       | uniform up to half the relay's amplitude, either sign                     |
//! | noise            | uniform up to 3 % of the amplitude of the noise-free oscillation, or another limit |
//! | protocol         | odd numbers: the relay trims the bias away; even numbers: it does not     |
//! | kept             | the last four complete cycles, 1.5 periods before them, and the rest of the recording after them, at most another 1.5 periods |
//!
//! Outputs are rounded to less than a millionth of the amplitude, inputs to 1e-7. That is far below the
//! least noise and halves the size of a file.

use onecycle_identify::Signals;
use onecycle_onboard::Soiptd;
use onecycle_onboard::cycle::Cycle;
use onecycle_plant::Trace;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::campaign::{Campaign, SAMPLE_S};
use super::cut::cycles;
use super::experiment::{ExperimentError, RelayExperiment};
use super::relays::{AsymmetricRelay, SweptRelay};

/// Duration of a relay test that is to be identified from, in periods: the transient and the cycles to
/// fit.
pub const IDENTIFICATION_PERIODS: f64 = 30.0;

/// Complete cycles at the end of a recording that are kept.
pub const CYCLES_KEPT: usize = 4;
/// Periods kept before those cycles: the past that still acts on the process in the first cycle.
const PERIODS_BEFORE: f64 = 1.5;

/// Gains, uniform in logarithms, so that no method can assume one.
const GAINS: (f64, f64) = (0.1, 10.0);
/// Keeps the seed of the gain apart from the seeds of the other draws.
const GAIN_STREAM: u64 = 0x6761_696e;

/// Levels of the asymmetric relay: as far apart as those of the benchmark's relay, in the published ratio
/// of two. The largest bias leaves a quarter of the smaller level.
const ASYMMETRIC_LEVELS: (f64, f64) = (4.0 / 3.0, -2.0 / 3.0);
/// Hysteresis of the asymmetric relay, in standard deviations of the noise: one false switch in a million
/// samples.
const HYSTERESIS_SIGMAS: f64 = 5.0;
/// Duration of the asymmetric relay test, in periods at the distinguishing phase: ten cycles and more of
/// that relay, whose cycles are longer, and longer still under a bias.
const ASYMMETRIC_PERIODS: f64 = 150.0;

/// The benchmark: a number of experiments from a seed.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Benchmark {
    /// Number of experiments, which are numbered from one.
    pub experiments: u64,
    /// Seed of the first experiment, far enough below the limit of a `u64` for the numbers to be added.
    pub seed: u64,
    /// Largest standard deviation of the noise, divided by the amplitude of the noise-free oscillation.
    #[serde(default = "public_sigma")]
    pub sigma: f64,
}

/// Largest noise of the public benchmark, also of folders that do not name it.
fn public_sigma() -> f64 {
    0.03
}

impl Default for Benchmark {
    /// The public one: a thousand experiments.
    fn default() -> Self {
        Self {
            experiments: 1000,
            seed: 70_000,
            sigma: public_sigma(),
        }
    }
}

/// The experiment that a method reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RelayTest {
    /// The benchmark's recording: the relay at the distinguishing phase.
    Recorded,
    /// The same relay with its phase swept, from rest.
    Swept,
    /// A relay with two unequal levels and a hysteresis, from rest.
    Asymmetric,
}

/// The truth behind a recording.
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
    /// Hysteresis of the relay (output unit); zero for a relay without one.
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

    /// The recording as columns.
    #[must_use]
    pub fn signals(&self) -> Signals<'_> {
        Signals {
            time_s: &self.time_s,
            input: &self.input,
            output: &self.output,
            samples_per_point: 1,
            sample_period_s: SAMPLE_S,
            breaks: &[],
        }
    }
}

impl Benchmark {
    /// The campaign that draws the experiments of a protocol.
    fn campaign(&self, is_trimmed: bool) -> Campaign {
        Campaign {
            cases: self.experiments,
            seed: self.seed,
            bias: 0.5,
            sigma: self.sigma,
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
        let experiment = self.campaign(is_trimmed).experiment(number)?;
        let (trace, _) = experiment.run(IDENTIFICATION_PERIODS)?;
        let seed = self.seed + number;
        let (least, most) = GAINS;
        let part: f64 = Pcg64Mcg::seed_from_u64(seed ^ (GAIN_STREAM << 32)).random_range(0.0..1.0);
        // The process is linear: a gain scales the output and nothing else.
        let gain = least * (most / least).powf(part);
        let truth = Truth {
            number,
            process: experiment.process.with_gain_scaled(gain)?,
            input_bias: experiment.input_bias,
            noise_sigma: gain * experiment.noise_sigma,
            seed,
            is_trimmed,
        };
        let amplitude = gain * experiment.oscillation.amplitude;
        Ok((truth, kept(&trace, gain, amplitude)?))
    }
}

/// The end of a trace, with its output scaled and rounded for a file.
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
        // Whole milliseconds: the shortest numbers.
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
    /// `None` for the benchmark's own recording, which is in its files.
    ///
    /// # Errors
    /// [`ExperimentError`]: the truth is out of range.
    pub fn recorded_by(&self, test: RelayTest) -> Result<Option<Recorded>, ExperimentError> {
        if test == RelayTest::Recorded {
            return Ok(None);
        }
        let experiment = self.experiment()?;
        if test == RelayTest::Swept {
            let settings = experiment.relay;
            let duration_s = f64::from(settings.preroll_s) + SweptRelay::PAPER_DURATION_S;
            let mut relay = SweptRelay::paper(settings)?;
            let trace = experiment.simulate(&mut relay, duration_s);
            return Ok(Some(Recorded::of(trace, 0.0)));
        }
        let (high, low) = ASYMMETRIC_LEVELS;
        let hysteresis = HYSTERESIS_SIGMAS * self.noise_sigma;
        let mut relay = AsymmetricRelay::new(high, low, hysteresis)?;
        let duration_s = ASYMMETRIC_PERIODS * experiment.oscillation.period_s;
        let trace = experiment.simulate(&mut relay, duration_s);
        Ok(Some(Recorded::of(trace, hysteresis)))
    }

    fn experiment(&self) -> Result<RelayExperiment, ExperimentError> {
        let campaign = Campaign {
            trim: self.is_trimmed,
            ..Campaign::QUIET
        };
        let mut experiment = campaign.at_rest(self.process, self.seed)?;
        experiment.input_bias = self.input_bias;
        experiment.noise_sigma = self.noise_sigma;
        Ok(experiment)
    }
}
