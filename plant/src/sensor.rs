//! What the sensor makes of the output: white noise, then rounding to its quantum.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// A sensor; the default one is perfect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensor {
    /// Standard deviation of white noise at the samples (output unit).
    pub noise_sigma: f64,
    /// Resolution (output unit); 0 does not round.
    pub quantum: f64,
}

impl Sensor {
    /// The reading of `output`, with noise drawn from `rng`.
    #[inline]
    pub fn read<R: Rng + ?Sized>(&self, output: f64, rng: &mut R) -> f64 {
        let mut reading = output;
        if self.noise_sigma > 0.0 {
            let noise: f64 = StandardNormal.sample(rng);
            reading += self.noise_sigma * noise;
        }
        if self.quantum > 0.0 {
            reading = (reading / self.quantum).round() * self.quantum;
        }
        reading
    }
}
