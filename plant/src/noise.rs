//! Noise of sensors and wind: a stream of independent standard normal numbers.
//!
//! The same seed gives the same numbers on every machine and in every version: the generator is the permuted
//! congruential generator PCG XSL RR 128/64 (multiplicative), the normal numbers come from the ziggurat method.
//!
//! ```
//! use onecycle_plant::{Noise, NoiseSource};
//!
//! let (mut one, mut same) = (Noise::from_seed(7), Noise::from_seed(7));
//! assert_eq!(one.standard_normal(), same.standard_normal());
//! ```
//!
//! Reference: M. E. O'Neill, "PCG: a family of simple fast space-efficient statistically good algorithms for random
//! number generation", HMC-CS-2014-0905 (2014).

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Source of the noise of a simulation. Implement it to continue a generator of your own.
pub trait NoiseSource {
    /// The next independent number with mean zero and variance one.
    fn standard_normal(&mut self) -> f64;

    /// A number between 0 and 1, uniform: `exp(-(a^2 + b^2) / 2)` of the next two normal numbers, because `a^2 + b^2` has
    /// an exponential distribution.
    fn uniform(&mut self) -> f64 {
        let (a, b) = (self.standard_normal(), self.standard_normal());
        (-0.5 * (a * a + b * b)).exp()
    }
}

/// Noise from a seed. See the [module](self).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Noise(Pcg64Mcg);

impl Noise {
    /// The stream of this seed, from its beginning.
    #[must_use]
    pub fn from_seed(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }
}

impl NoiseSource for Noise {
    #[inline]
    fn standard_normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }
}
