//! Relay experiments to learn from: random processes of a space, the signature of one steady cycle
//! of each, and what a network is to read off it.
//!
//! The experiment is that of the board: its relay with noise protection and trim, the exact process,
//! noise and bias. Example `n` of a [`Recipe`] is the same whatever else is made. What is learnt has no
//! unit and no time scale (section III-C of the paper learns classes; Ayyad, Chehadeh, Awad, Zweiri
//! 2020): with `T` the period, `a` the amplitude of the signature and `p1`, `p2` the poles,
//!
//! ```text
//! values = ln((p1 + p2) T),   p1 p2 / (p1 + p2)^2,   tau / T,   ln(a / (K p1 p2 T^3))
//! ```
//!
//! These are the estimator's own coordinates, regular for equal lags and for double integrators: none
//! says which pole is the actuator's. The fourth gives the gain, `K p1 p2` being the jerk that a unit
//! of input comes to: the amplitude of a sampled, smoothed relay is not that of the continuous one, and
//! a gain taken from that costs several per cent.
//!
//! | question                                  | answer                                        |
//! |-------------------------------------------|-----------------------------------------------|
//! | which experiments?                        | [`Recipe`], of one [`Family`] or several      |
//! | what is seen, and of what is it?          | [`Example`]                                   |
//! | what does an error of the values cost?    | [`Example::cost_gradient`]                    |
//! | how do many of them lie on a disk?        | [`shards`]: files that NumPy reads            |
//! | and in one table, for other programs?     | `parquet`, with the feature of that name      |
//! | how does a network learn from them?       | [`learning`]: rows of a [`Batch`]             |
//!
//! [`Batch`]: crate::learn::train::Batch

pub mod learning;
mod npz;
#[cfg(feature = "parquet")]
pub mod parquet;
mod sensitivity;
pub mod shards;

use onecycle_onboard::cycle::{Cycle, SteadyRun};
use onecycle_onboard::signature::Signature;
use onecycle_onboard::window::Window;
use onecycle_onboard::{Relay, RelayError, RelaySettings, Soiptd, SoiptdError};
use onecycle_plant::{Experiment, Trace};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::judge::campaign::cycles;
use crate::space::limit_cycle::symmetric;

use crate::experiments::{DrawnNoise, Recipe, RecipeError};
pub use onecycle_onboard::pack::VALUES;

/// One experiment: what is seen, and what it is of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Example {
    /// What a network sees.
    pub signature: Signature,
    /// Period of the cycle it was taken from (s).
    pub period_s: f64,
    /// The process.
    pub process: Soiptd,
    /// Which family of the recipe it is from, counted from zero.
    pub family: usize,
    /// Input bias by the relay's amplitude.
    pub bias: f64,
    /// Noise by the amplitude of the noise-free oscillation.
    pub sigma: f64,
    /// Samples in a period of the noise-free oscillation.
    pub samples_per_period: f64,
}

/// Why an example cannot be made; those of a valid recipe can.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ExampleError {
    /// A field is out of its range.
    #[error("{0}")]
    Recipe(#[from] RecipeError),
    /// The times are no process.
    #[error("{0}")]
    Process(#[from] SoiptdError),
    /// The relay's settings are out of range.
    #[error("{0}")]
    Relay(#[from] RelayError),
}

/// Samples for which the relay first measures its noise: 0.1 s at the paper's 1 kHz.
pub(crate) const PREROLL_SAMPLES: f64 = 100.0;

/// And no longer than this part of a period: meanwhile a bias drives the process away, and one without
/// damping so far that it is not back in time. A relay that measures so briefly is told the noise.
const PREROLL_PERIODS: f64 = 0.1;

/// Periods of an experiment. Of 45,300 of the paper's multirotors 3 are not steady by then.
const PERIODS: f64 = 14.0;

/// Bins of a cycle's window, five of which it keeps for itself: each at least twice as narrow as a part
/// of the signature.
const BINS: usize = 261;
/// Edges of a cycle, and as many again that were taken back.
const EDGES: usize = 16;

impl Recipe {
    /// Example number `n`; `None` where the relay does not make the process oscillate, or not
    /// steadily in time.
    ///
    /// # Errors
    /// See [`ExampleError`].
    pub fn example(&self, n: u64) -> Result<Option<Example>, ExampleError> {
        self.validate()?;
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed.wrapping_add(n));
        let number = self.family(&mut rng);
        let family = self.families[number];
        let process = family.process(&mut rng)?;
        let bias = self.bias * rng.random_range(-1.0..=1.0);
        let sigma = self.sigma * rng.random_range(0.0..=1.0);
        let samples_per_period = family.samples(&mut rng);

        let beta = family.space.beta;
        let Some(quiet) = symmetric(&process, beta) else {
            return Ok(None);
        };
        let sample_s = quiet.period_s() / samples_per_period;
        let preroll_s = (PREROLL_SAMPLES * sample_s).min(PREROLL_PERIODS * quiet.period_s());
        let noise_sigma = sigma * quiet.amplitude;
        let mut settings = RelaySettings::new(1.0, beta as f32);
        settings.preroll_s = preroll_s as f32;
        settings.noise_sigma = noise_sigma as f32;
        if self.trim {
            settings.trim_gain = RelaySettings::TRIM_GAIN;
        }
        let duration_s = preroll_s + PERIODS * quiet.period_s();
        let mut experiment = Experiment::new(process, sample_s, duration_s);
        experiment.input_bias = bias;
        experiment.sensor.noise_sigma = noise_sigma;
        let trace = experiment.run(&mut Relay::new(settings)?, &mut DrawnNoise(&mut rng));
        Ok(last_steady_cycle(&trace)
            .and_then(|cycle| signature(&trace, &cycle, sample_s))
            .map(|(signature, period_s)| Example {
                signature,
                period_s,
                process,
                family: number,
                bias,
                sigma,
                samples_per_period,
            }))
    }
}

pub(crate) fn last_steady_cycle(trace: &Trace) -> Option<Cycle> {
    let mut run = SteadyRun::default();
    let mut last = None;
    for cycle in cycles(trace, &trace.output) {
        run.push(&cycle);
        last = run.is_steady().then_some(cycle);
    }
    last
}

fn signature(trace: &Trace, cycle: &Cycle, sample_s: f64) -> Option<(Signature, f64)> {
    let window = window(trace, cycle, sample_s)?;
    Some((Signature::new(&window, cycle).ok()?, cycle.period_s))
}

/// The samples of one cycle.
pub(crate) fn window(trace: &Trace, cycle: &Cycle, sample_s: f64) -> Option<Window<BINS, EDGES>> {
    let first = (cycle.start_s / sample_s).round() as usize;
    let count = (cycle.period_s / sample_s).round() as usize;
    let last = (first + count).min(trace.len());
    let mut window = Window::new(*trace.time_s.get(first)?, sample_s);
    for index in first..last {
        window.push_output(trace.time_s[index], trace.output[index]);
    }
    Some(window)
}

impl Example {
    /// What a network is to put out, see the [module](self).
    #[must_use]
    pub fn values(&self) -> [f64; VALUES] {
        let period_s = self.period_s;
        let (pole_sum_per_s, pole_ratio) = self.process.pole_sum();
        let moved = self.process.jerk_gain().abs() * period_s.powi(3);
        [
            (pole_sum_per_s * period_s).ln(),
            pole_ratio,
            self.process.tau_s() / period_s,
            (self.signature.amplitude / moved).ln(),
        ]
    }
}
