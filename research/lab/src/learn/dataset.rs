//! Training examples: the signature of one steady cycle of a relay experiment on a random process,
//! and the target values of a network.
//!
//! The experiment uses the relay of the board with noise protection and trim, the exact process, noise
//! and bias. Example `n` of a [`Recipe`] does not depend on what else is made. The values have no unit
//! and no time scale (section III-C of the paper learns classes; Ayyad, Chehadeh, Awad, Zweiri 2020).
//! With `T` the period, `a` the amplitude of the signature and `p1`, `p2` the poles,
//!
//! ```text
//! values = ln((p1 + p2) T),   p1 p2 / (p1 + p2)^2,   tau / T,   ln(a / (K p1 p2 T^3))
//! ```
//!
//! These are the estimator's own coordinates. They are regular for equal lags and for double
//! integrators, because none says which pole is the actuator's. The fourth gives the gain: `K p1 p2` is
//! the jerk for a unit of input. The amplitude of a sampled, smoothed relay is not that of the
//! continuous one, and a gain from that would be off by several per cent.
//!
//! | question                                  | answer                                        |
//! |-------------------------------------------|-----------------------------------------------|
//! | which experiments?                        | [`Recipe`], with one or more [`Family`](crate::experiments::Family)       |
//! | what does a network see, and what is true?| [`Example`]                                   |
//! | what does an error in the values cost?    | [`Example::cost_gradient`]                    |
//! | how are many examples stored?             | [`shards`]: files that NumPy reads            |
//! | how do other programs read them?          | `parquet`, one table (feature `parquet`)      |
//! | how does a network learn from them?       | [`learning`]: rows of a [`Batch`]             |
//!
//! [`Batch`]: crate::learn::train::Batch

pub mod learning;
pub mod parquet;
mod sensitivity;
pub mod shards;

use onecycle_onboard::Soiptd;
pub use onecycle_onboard::pack::VALUES;
use onecycle_onboard::signature::Signature;

use crate::experiments::{Drawn, ExperimentError, Recipe, SteadyCycle};

/// One example: what a network sees of an experiment, and the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Example {
    /// Inputs of a network.
    pub signature: Signature,
    /// Period of the cycle (s).
    pub period_s: f64,
    /// The process.
    pub process: Soiptd,
    /// Number of the family in the recipe, from zero.
    pub family: usize,
    /// Input bias over the relay's amplitude.
    pub bias: f64,
    /// Noise of a sample over the amplitude of the noise-free oscillation.
    pub sigma: f64,
    /// Samples in a period of the noise-free oscillation.
    pub samples_per_period: f64,
}

/// Duration of an experiment (periods). Of 45,300 of the paper's multirotors 3 are not steady by then.
const PERIODS: f64 = 14.0;

impl Recipe {
    /// Example number `n`; `None` if the relay does not make the process oscillate, or the oscillation is
    /// not steady in time.
    ///
    /// # Errors
    /// [`ExperimentError`]: a field of the recipe is out of its range.
    pub fn example(&self, n: u64) -> Result<Option<Example>, ExperimentError> {
        let Some(drawn) = self.experiment(n)? else {
            return Ok(None);
        };
        let experiment = &drawn.experiment;
        let (trace, _) = experiment.run(PERIODS)?;
        let cycle = SteadyCycle::last_of(&trace, experiment.sample_s);
        Ok(cycle.map(|cycle| Example::of(&drawn, &cycle)))
    }
}

impl Example {
    fn of(drawn: &Drawn, cycle: &SteadyCycle) -> Self {
        Self {
            signature: cycle.signature,
            period_s: cycle.period_s,
            process: drawn.experiment.process,
            family: drawn.family,
            bias: drawn.experiment.input_bias,
            sigma: drawn.sigma,
            samples_per_period: drawn.samples_per_period,
        }
    }

    /// Target values of a network, see the [module](self).
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
