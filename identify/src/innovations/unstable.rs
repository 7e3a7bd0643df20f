//! Is the process unstable without its controller?
//!
//! No structure has an unstable pole, and under feedback a stable one can fit the record of an unstable process. The prediction
//! of the output from past outputs and inputs shows the pole, whatever the controller is: a root beyond one is not noise's doing.

use std::ops::Range;

use super::arx::Arx;
use super::record::Blocks;
use crate::thresholds::SURE;

/// Past outputs of the prediction: two poles, and four for the noise of the sensor and the walk of a disturbance.
const OUTPUTS: usize = 6;
/// Largest ratio of the rates of two halves: coloured noise moves the root outwards by other amounts.
const ALIKE: f64 = 1.5;

/// Rate (1/s) at which the output grows without the controller. `None` unless both halves of the record show the same.
///
/// The prediction knows the inputs of the dead time: past outputs would tell what the controller has done since.
pub(super) fn growth_per_s(blocks: &Blocks<'_>, tau_s: f64) -> Option<f64> {
    let half = blocks.len() / 2;
    let past = OUTPUTS + 1 + (tau_s / blocks.block_s()) as usize;
    let (early, late) = (
        growth_in(blocks, 0..half, past)?,
        growth_in(blocks, half..blocks.len(), past)?,
    );
    let is_same = early < ALIKE * late && late < ALIKE * early;
    is_same.then(|| (early * late).sqrt())
}

fn growth_in(blocks: &Blocks<'_>, part: Range<usize>, past: usize) -> Option<f64> {
    let root = Arx::<OUTPUTS>::of(blocks, part, past)?.root_above_one(SURE)?;
    Some(root.ln() / blocks.block_s())
}
