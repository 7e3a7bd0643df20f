//! What a network learns from.

use super::matrix::Matrix;
use super::{TrainError, expect_size};

/// Samples and what is wanted of them. A [`Loss`](super::Loss) reads what it says; the rest may
/// stay empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// A row a sample, a column an input.
    pub inputs: Matrix,
    /// The true class of every sample.
    pub classes: Vec<usize>,
    /// A row a sample, a column a class: `J_iT`, what it costs to take class `i` for the true one,
    /// as a fraction (0.1 is ten percent); infinite where the loop would be unstable.
    pub costs: Matrix,
    /// A row a sample, a column a dimension: where the density is evaluated.
    pub values: Matrix,
    /// How much every sample counts; where it is empty, all count alike.
    pub weights: Vec<f32>,
}

impl Batch {
    /// How much all samples count together.
    ///
    /// # Errors
    /// Where the weights have no mean, or are not as many as the samples.
    pub fn total_weight(&self) -> Result<f64, TrainError> {
        if self.weights.is_empty() {
            return Ok(self.inputs.rows() as f64);
        }
        let (samples, weights) = (self.inputs.rows(), self.weights.len());
        expect_size("the number of weights of samples", samples, weights)?;
        let total: f64 = self.weights.iter().copied().map(f64::from).sum();
        let is_negative = self.weights.iter().any(|&weight| weight < 0.0);
        if is_negative || !total.is_finite() || total <= 0.0 {
            return Err(TrainError::SampleWeights);
        }
        Ok(total)
    }

    /// How much sample `i` counts.
    pub(super) fn weight(&self, i: usize) -> f64 {
        self.weights.get(i).copied().map_or(1.0, f64::from)
    }
}

/// Samples, known by their numbers: kept in memory, read, or made when asked for.
pub trait Dataset {
    /// How many there are.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Fills a batch, whatever it holds, with these samples in this order. A sample must be the
    /// same each time.
    fn fill(&self, samples: &[usize], batch: &mut Batch);
}

/// A batch is a dataset: its rows.
impl Dataset for Batch {
    fn len(&self) -> usize {
        self.inputs.rows()
    }

    fn fill(&self, samples: &[usize], batch: &mut Batch) {
        for (from, to) in [
            (&self.inputs, &mut batch.inputs),
            (&self.costs, &mut batch.costs),
            (&self.values, &mut batch.values),
        ] {
            let rows = if from.rows() == 0 { 0 } else { samples.len() };
            to.reshape(rows, from.columns());
            for (i, &sample) in samples.iter().enumerate().take(rows) {
                to.row_mut(i).copy_from_slice(from.row(sample));
            }
        }
        pick(&self.classes, samples, &mut batch.classes);
        pick(&self.weights, samples, &mut batch.weights);
    }
}

fn pick<T: Copy>(from: &[T], samples: &[usize], to: &mut Vec<T>) {
    to.clear();
    to.extend(samples.iter().filter_map(|&sample| from.get(sample)));
}
