//! Sensor of the output: white noise, outliers, then rounding to a quantum; some samples are dropped.

use crate::noise::NoiseSource;

/// A sensor. The default is perfect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Sensor {
    /// Standard deviation of the white noise of a sample (output unit).
    pub noise_sigma: f64,
    /// Resolution (output unit); 0 means unlimited.
    pub quantum: f64,
    /// Share of the samples that have an outlier (0 to 1).
    pub outlier_share: f64,
    /// Error of an outlier (output unit); its sign is random.
    pub outlier_size: f64,
    /// Share of the samples that are dropped (0 to 1).
    pub drop_out_share: f64,
}

impl Sensor {
    /// A sensor with white noise of this standard deviation (output unit) and unlimited resolution.
    #[must_use]
    pub fn noisy(noise_sigma: f64) -> Self {
        Self {
            noise_sigma,
            ..Self::default()
        }
    }

    /// The same sensor with this resolution (output unit).
    #[must_use]
    pub fn with_quantum(self, quantum: f64) -> Self {
        Self { quantum, ..self }
    }

    /// The same sensor with outliers: their share of the samples (0 to 1) and their size (output unit).
    #[must_use]
    pub fn with_outliers(self, outlier_share: f64, outlier_size: f64) -> Self {
        Self {
            outlier_share,
            outlier_size,
            ..self
        }
    }

    /// The same sensor with this share of dropped samples (0 to 1).
    #[must_use]
    pub fn with_drop_outs(self, drop_out_share: f64) -> Self {
        Self {
            drop_out_share,
            ..self
        }
    }

    /// Sample of `output`: [`Self::read`], or `None` if it is dropped.
    #[inline]
    pub fn sample(&self, output: f64, noise: &mut impl NoiseSource) -> Option<f64> {
        if self.drop_out_share > 0.0 && happens(self.drop_out_share, noise) {
            return None;
        }
        Some(self.read(output, noise))
    }

    /// Measured value of `output`. Takes numbers from `noise` only if the sensor is noisy or has outliers.
    #[inline]
    pub fn read(&self, output: f64, noise: &mut impl NoiseSource) -> f64 {
        let mut reading = output;
        if self.noise_sigma > 0.0 {
            reading += self.noise_sigma * noise.standard_normal();
        }
        if self.outlier_share > 0.0 && happens(self.outlier_share, noise) {
            reading += outlier(self.outlier_size, noise);
        }
        if self.quantum > 0.0 {
            reading = (reading / self.quantum).round() * self.quantum;
        }
        reading
    }
}

/// Draws whether something of this probability happens. Apart, so that the loop of a good sensor stays small.
#[cold]
fn happens(probability: f64, noise: &mut impl NoiseSource) -> bool {
    noise.uniform() < probability
}

/// Error of this size with a random sign.
#[cold]
fn outlier(size: f64, noise: &mut impl NoiseSource) -> f64 {
    size.copysign(noise.standard_normal())
}
