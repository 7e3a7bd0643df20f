//! Rows that a network learns from, scaled to the order of one.
//!
//! ```text
//! inputs    the signature, but for its last: (ln(samples in a period) - 6) / 2
//! outputs   s_k values_k,  s = 1, 8, 8, 1
//! slopes    gradient_k / s_k: what an error of a scaled value costs
//! ```

use onecycle_onboard::signature::{LENGTH, Signature};

use super::VALUES;
use super::shards::ExampleRecord;
use crate::learn::train::{Batch, Matrix};

/// Scale of each value: a ratio of poles is at most 1/4, a delay about 1/8.
pub const SCALE: [f64; VALUES] = [1.0, 8.0, 8.0, 1.0];

/// Middle and half range of the logarithm of samples per period: 40 to 2500 samples are 3.7 to 7.8.
pub(crate) const LN_SAMPLES: (f32, f32) = (6.0, 2.0);

/// Inputs of a network for a signature.
#[must_use]
pub fn inputs(signature: &Signature) -> [f32; LENGTH] {
    let mut inputs = signature.values;
    let last = &mut inputs[LENGTH - 1];
    *last = (*last - LN_SAMPLES.0) / LN_SAMPLES.1;
    inputs
}

/// Values from the outputs of a network.
#[must_use]
pub fn values(scaled: [f64; VALUES]) -> [f64; VALUES] {
    std::array::from_fn(|k| scaled[k] / SCALE[k])
}

/// Targets of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// The values: for [`Loss::Gaussian`](crate::learn::train::Loss::Gaussian).
    Values,
    /// The values, then the costs of their errors: for
    /// [`Loss::CostAwareGaussian`](crate::learn::train::Loss::CostAwareGaussian).
    ValuesAndSlopes,
}

/// A batch with one row for each record.
#[must_use]
pub fn batch(records: &[ExampleRecord], wanted: Wanted) -> Batch {
    let columns = match wanted {
        Wanted::Values => VALUES,
        Wanted::ValuesAndSlopes => 2 * VALUES,
    };
    let mut batch = Batch {
        inputs: Matrix::zeros(records.len(), LENGTH),
        values: Matrix::zeros(records.len(), columns),
        ..Batch::default()
    };
    for (row, record) in records.iter().enumerate() {
        (batch.inputs.row_mut(row)).copy_from_slice(&inputs(&record.example.signature));
        let values = (0..VALUES).map(|k| SCALE[k] * record.values[k]);
        let slopes = (0..VALUES).map(|k| record.gradient[k] / SCALE[k]);
        for (to, from) in (batch.values.row_mut(row).iter_mut()).zip(values.chain(slopes)) {
            *to = from as f32;
        }
    }
    batch
}
