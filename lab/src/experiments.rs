//! Random relay experiments: draw a process, run the relay, cut the cycles.

pub mod outsiders;
pub mod recipe;

pub use recipe::{Family, Recipe, RecipeError};

use onecycle_identify::Signals;
use onecycle_plant::{NoiseSource, Trace};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Noise from the generator that the process of the experiment was drawn from: one stream for both.
pub struct DrawnNoise<'a, R>(pub &'a mut R);

impl<R: Rng> NoiseSource for DrawnNoise<'_, R> {
    #[inline]
    fn standard_normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }
}

/// A simulated experiment at an even sample period (s), as measured.
#[must_use]
pub fn signals_of(trace: &Trace, sample_period_s: f64) -> Signals<'_> {
    Signals {
        time_s: &trace.time_s,
        input: &trace.input,
        output: &trace.output,
        samples_per_point: 1,
        sample_period_s,
        breaks: &[],
    }
}
