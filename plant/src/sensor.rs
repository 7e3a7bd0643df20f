//! Sensor of the output: white noise, then rounding to a quantum.

use crate::noise::NoiseSource;

/// A sensor. The default is perfect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Sensor {
    /// Standard deviation of the white noise of a sample (output unit).
    pub noise_sigma: f64,
    /// Resolution (output unit); 0 means unlimited.
    pub quantum: f64,
}

impl Sensor {
    /// A sensor with white noise of this standard deviation (output unit) and unlimited resolution.
    #[must_use]
    pub fn noisy(noise_sigma: f64) -> Self {
        Self {
            noise_sigma,
            quantum: 0.0,
        }
    }

    /// The same sensor with this resolution (output unit).
    #[must_use]
    pub fn with_quantum(self, quantum: f64) -> Self {
        Self { quantum, ..self }
    }

    /// Measured value of `output`. Takes a number from `noise` only if the sensor is noisy.
    #[inline]
    pub fn read(&self, output: f64, noise: &mut impl NoiseSource) -> f64 {
        let mut reading = output;
        if self.noise_sigma > 0.0 {
            reading += self.noise_sigma * noise.standard_normal();
        }
        if self.quantum > 0.0 {
            reading = (reading / self.quantum).round() * self.quantum;
        }
        reading
    }
}
