//! Standard coordinates of the inputs: less their mean, over their deviation.
//!
//! The numbers of a cycle have large means and different variances, and only a per cent of them
//! distinguishes shapes. Gradient steps hardly move along that part, whatever the loss: with raw inputs
//! a network learns the period and no more. So the first layer learns from
//!
//! ```text
//! x^ = (x - mean) / (deviation + 0.02)
//! ```
//!
//! with mean and deviation over the training set. This is a batch normalisation with known statistics,
//! and the finished network has it as its first layer; [`Network::folded`] multiplies it into the next
//! one.

use super::ClassifierError;
use super::examples::Examples;
use crate::learn::train::{Batch, Dataset, Layer, Network};

/// Keeps nearly constant numbers from counting more than others: a fiftieth of the amplitude, which is
/// the effect of noise.
const LEAST_DEVIATION: f64 = 0.02;

/// Added to the variance by batch normalisation, so it is subtracted here.
const EPSILON: f64 = 1e-5;

/// Mean and deviation of every input.
#[derive(Clone, Debug, PartialEq)]
pub struct Standard {
    mean: Vec<f64>,
    deviation: Vec<f64>,
}

/// Examples in standard coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Standardised<'a> {
    /// The examples.
    pub examples: &'a Examples,
    /// The coordinates.
    pub standard: &'a Standard,
}

impl Standard {
    /// These rows of inputs less their mean alone, as the authors' published code has it.
    #[must_use]
    pub fn centred(inputs: usize, rows: impl Iterator<Item = impl AsRef<[f32]>>) -> Self {
        let mut this = Self::of(inputs, rows);
        this.deviation.fill(1.0);
        this
    }

    /// Standard coordinates of these rows of inputs.
    #[must_use]
    pub fn of(inputs: usize, rows: impl Iterator<Item = impl AsRef<[f32]>>) -> Self {
        let (mut sums, mut squares) = (vec![0.0; inputs], vec![0.0; inputs]);
        let mut count = 0_u64;
        for row in rows {
            count += 1;
            for (k, value) in row.as_ref().iter().enumerate() {
                let value = f64::from(*value);
                sums[k] += value;
                squares[k] += value * value;
            }
        }
        let count = count.max(1) as f64;
        let mean: Vec<f64> = sums.iter().map(|sum| sum / count).collect();
        let deviation = (squares.iter().zip(&mean))
            .map(|(square, mean)| (square / count - mean * mean).max(0.0).sqrt() + LEAST_DEVIATION)
            .collect();
        Self { mean, deviation }
    }

    /// Brings a row of inputs into these coordinates.
    pub fn apply(&self, row: &mut [f32]) {
        for ((value, mean), deviation) in row.iter_mut().zip(&self.mean).zip(&self.deviation) {
            *value = ((f64::from(*value) - mean) / deviation) as f32;
        }
    }

    /// The same network for raw inputs: with a batch normalisation before its layers.
    ///
    /// # Errors
    /// [`ClassifierError`]: the network has another number of inputs.
    pub fn before(&self, network: &Network) -> Result<Network, ClassifierError> {
        let mut layers = vec![Layer::BatchNorm];
        layers.extend(network.layers());
        let single = |value: &f64| *value as f32;
        let variance =
            (self.deviation.iter()).map(|deviation| (deviation * deviation - EPSILON) as f32);
        // Weight one and bias zero, then mean and variance.
        let inputs = self.mean.len();
        let mut numbers = [vec![1.0; inputs], vec![0.0; inputs]].concat();
        numbers.extend(self.mean.iter().map(single));
        numbers.extend(variance);
        numbers.extend(network.numbers());
        Ok(Network::zeros(inputs, &layers)?.with_numbers(&numbers)?)
    }
}

impl Dataset for Standardised<'_> {
    fn len(&self) -> usize {
        self.examples.len()
    }

    fn fill(&self, samples: &[usize], batch: &mut Batch) {
        self.examples.fill(samples, batch);
        for i in 0..samples.len() {
            self.standard.apply(batch.inputs.row_mut(i));
        }
    }
}
