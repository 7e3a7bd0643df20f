//! Batches and datasets.

use super::matrix::Matrix;
use super::{TrainError, expect_size};

/// Samples and their targets. A [`Loss`](super::Loss) says which targets it reads; the others may be
/// empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// Inputs: one row for each sample, one column for each input.
    pub inputs: Matrix,
    /// The true class of every sample.
    pub classes: Vec<usize>,
    /// Costs: one row for each sample, one column for each class: `J_iT`, the cost of taking class `i`
    /// for the true class, as a fraction; infinite if the loop would be unstable.
    pub costs: Matrix,
    /// Values: one row for each sample, one column for each dimension of the density.
    pub values: Matrix,
    /// Weight of every sample; if empty, all weights are one.
    pub weights: Vec<f32>,
}

impl Batch {
    /// Sum of the weights.
    ///
    /// # Errors
    /// [`TrainError`]: the weights have no mean, or are not as many as the samples.
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

    /// Weight of sample `i`.
    pub(super) fn weight(&self, i: usize) -> f64 {
        self.weights.get(i).copied().map_or(1.0, f64::from)
    }
}

/// Samples with numbers: kept in memory, read, or made on demand.
pub trait Dataset {
    /// Number of samples.
    fn len(&self) -> usize;

    /// Whether there are no samples.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Replaces the contents of a batch by these samples, in this order. A sample must be the same each
    /// time.
    fn fill(&self, samples: &[usize], batch: &mut Batch);
}

/// The rows of a batch as a dataset.
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
