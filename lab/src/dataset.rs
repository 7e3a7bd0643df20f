//! Relay experiments to learn from: random processes of a space, the signature of one steady cycle
//! of each, and what a network is to read off it.
//!
//! The experiment is that of the board: its relay with noise protection and trim, the exact process,
//! noise and bias. Example `n` of a recipe is the same whatever else is made. What is learnt has no
//! unit and no time scale (section III-C of the paper learns classes; Ayyad, Chehadeh, Awad, Zweiri
//! 2020): with `T` the period, `a` the amplitude of the signature and `p1`, `p2` the poles,
//!
//! ```text
//! values = ln((p1 + p2) T),   p1 p2 / (p1 + p2)^2,   tau / T,   ln(a / (K/T_body T^2))
//! ```
//!
//! The first three are the estimator's own coordinates, regular for equal lags and for double
//! integrators. The fourth gives the gain: the amplitude of a sampled, smoothed relay is not that of
//! the continuous one, and a gain taken from that costs several per cent.

use onecycle_onboard::cycle::{Cycle, SteadyRun};
use onecycle_onboard::signature::Signature;
use onecycle_onboard::window::Window;
use onecycle_onboard::{Process, ProcessError, Relay, RelayError, RelaySettings};
use onecycle_plant::{Experiment, Trace};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::campaign::cycles;
use crate::limit_cycle::symmetric;
use crate::space::{FieldError, Range, Space, first_out_of_range};

/// How examples are made.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Where processes are drawn from, uniform, and the relay.
    pub space: Space,
    /// Seed of the first example; the others follow.
    pub seed: u64,
    /// Input bias, uniform between plus and minus this part of the relay's amplitude.
    pub bias: f64,
    /// Noise of a sample, uniform up to this part of the amplitude of the noise-free oscillation.
    pub sigma: f64,
    /// Samples in a period of the noise-free oscillation, uniform in logarithms.
    pub samples_per_period: Range,
    /// Whether the relay follows the bias.
    pub trim: bool,
}

impl Default for Recipe {
    /// The paper's multirotors at 1 kHz, whose periods are 89 to 2306 samples.
    fn default() -> Self {
        Self {
            space: Space::MULTIROTOR,
            seed: 1,
            bias: 0.5,
            sigma: 0.03,
            samples_per_period: (89.0, 2306.0),
            trim: true,
        }
    }
}

/// Number of values that describe a process.
pub const VALUES: usize = 4;

/// One experiment: what is seen, and what it is of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Example {
    /// What a network sees.
    pub signature: Signature,
    /// Period of the cycle it was taken from (s).
    pub period_s: f64,
    /// The process, its velocity gain one.
    pub process: Process,
}

/// Why an example cannot be made; those of a valid recipe can.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ExampleError {
    /// A field is out of its range.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// The times are no process.
    #[error("{0}")]
    Process(#[from] ProcessError),
    /// The relay's settings are out of range.
    #[error("{0}")]
    Relay(#[from] RelayError),
}

/// Samples for which the relay first measures its noise: 0.1 s at the paper's 1 kHz.
const PREROLL_SAMPLES: f64 = 100.0;

/// Periods of an experiment. Of the paper's multirotors 0.4 % are not steady by then.
const PERIODS: f64 = 14.0;

/// Bins of a cycle's window, five of which it keeps for itself: each at least twice as narrow as a part
/// of the signature.
const BINS: usize = 261;
/// Edges of a cycle, and as many again that were taken back.
const EDGES: usize = 16;

impl Recipe {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        self.space.validate()?;
        let (least, most) = self.samples_per_period;
        first_out_of_range([
            (
                "bias",
                "0 to 0.9",
                self.bias,
                (0.0..=0.9).contains(&self.bias),
            ),
            (
                "sigma",
                "0 to 1",
                self.sigma,
                (0.0..=1.0).contains(&self.sigma),
            ),
            (
                "samples_per_period",
                "two numbers from 40 to 1e6, the lower first",
                least,
                (40.0..=1e6).contains(&least) && (least..=1e6).contains(&most),
            ),
        ])
    }

    /// Example number `n`; `None` where the relay does not make the process oscillate, or not
    /// steadily in time.
    ///
    /// # Errors
    /// See [`ExampleError`].
    pub fn example(&self, n: u64) -> Result<Option<Example>, ExampleError> {
        self.validate()?;
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed.wrapping_add(n));
        let [t_prop_s, t_body_s, tau_s] = self.space.random(&mut rng);
        let bias = self.bias * rng.random_range(-1.0..=1.0);
        let sigma = self.sigma * rng.random_range(0.0..=1.0);
        let (least, most) = self.samples_per_period;
        let samples = least * (most / least).powf(rng.random_range(0.0..=1.0));

        let process = Process::new(1.0, t_prop_s, t_body_s, tau_s)?;
        let Some(quiet) = symmetric(&process, self.space.beta) else {
            return Ok(None);
        };
        let sample_s = quiet.period_s() / samples;
        let preroll_s = PREROLL_SAMPLES * sample_s;
        let mut settings = RelaySettings::new(1.0, self.space.beta as f32);
        settings.preroll_s = preroll_s as f32;
        if self.trim {
            settings.trim_gain = RelaySettings::TRIM_GAIN;
        }
        let duration_s = preroll_s + PERIODS * quiet.period_s();
        let mut experiment = Experiment::new(process, sample_s, duration_s);
        experiment.input_bias = bias;
        experiment.sensor.noise_sigma = sigma * quiet.amplitude;
        let trace = experiment.run(&mut Relay::new(settings)?, &mut rng);
        Ok(last_steady_cycle(&trace)
            .and_then(|cycle| signature(&trace, &cycle, sample_s))
            .map(|(signature, period_s)| Example {
                signature,
                period_s,
                process,
            }))
    }
}

fn last_steady_cycle(trace: &Trace) -> Option<Cycle> {
    let mut run = SteadyRun::default();
    let mut last = None;
    for cycle in cycles(trace, &trace.output) {
        run.push(&cycle);
        last = run.is_steady().then_some(cycle);
    }
    last
}

fn signature(trace: &Trace, cycle: &Cycle, sample_s: f64) -> Option<(Signature, f64)> {
    let first = (cycle.start_s / sample_s).round() as usize;
    let count = (cycle.period_s / sample_s).round() as usize;
    let last = (first + count).min(trace.len());
    let mut window = Window::<BINS, EDGES>::new(*trace.time_s.get(first)?, sample_s);
    for index in first..last {
        window.push_output(trace.time_s[index], trace.output[index]);
    }
    Some((Signature::new(&window, cycle).ok()?, cycle.period_s))
}

impl Example {
    /// What a network is to put out, see the [module](self).
    #[must_use]
    pub fn values(&self) -> [f64; VALUES] {
        let period_s = self.period_s;
        let (pole_sum_per_s, pole_ratio) = self.process.pole_sum();
        [
            (pole_sum_per_s * period_s).ln(),
            pole_ratio,
            self.process.tau_s() / period_s,
            (self.signature.amplitude / (self.process.k_over_t_body() * period_s * period_s)).ln(),
        ]
    }
}

/// The process of these values, whatever put them out: a ratio of poles and a dead time beyond what
/// they can be are the nearest that can.
///
/// # Errors
/// Where the period, the amplitude or a value is not finite.
pub fn process_of(
    values: [f64; VALUES],
    signature: &Signature,
    period_s: f64,
) -> Result<Process, ProcessError> {
    let [ln_pole_sum, pole_ratio, delay, ln_amplitude] = values;
    let gain = signature.amplitude / (ln_amplitude.exp() * period_s * period_s);
    Process::from_pole_sum(
        signature.sign * gain,
        ln_pole_sum.exp() / period_s,
        pole_ratio.clamp(0.0, 0.25),
        delay.max(0.0) * period_s,
    )
}
