//! Is the process unstable without its controller?
//!
//! No structure has an unstable pole, and under feedback a stable one can fit the record of an unstable process. The prediction
//! of the output from past outputs and inputs shows the pole, whatever the controller is. Noise draws its roots inwards, so that
//! a root beyond one is not its doing.

use std::ops::Range;

use super::arx::Arx;
use super::record::Blocks;
use crate::thresholds::SURE;

/// Largest ratio of the rates of two halves: coloured noise moves the root outwards by other amounts.
const ALIKE: f64 = 1.5;

/// Rate (1/s) at which the output grows without the controller. `None` unless both halves of the record show the same.
pub(super) fn growth_per_s(blocks: &Blocks<'_>) -> Option<f64> {
    let half = blocks.len() / 2;
    let (early, late) = (
        growth_in(blocks, 0..half)?,
        growth_in(blocks, half..blocks.len())?,
    );
    let is_same = early < ALIKE * late && late < ALIKE * early;
    is_same.then(|| (early * late).sqrt())
}

fn growth_in(blocks: &Blocks<'_>, part: Range<usize>) -> Option<f64> {
    let Arx { a, covariance } = Arx::of(blocks, part)?;
    let root = 0.5 * (a[0] + (a[0] * a[0] + 4.0 * a[1]).sqrt());
    // dz (2 z - a1) = z da1 + da2
    let slope = [root / (2.0 * root - a[0]), 1.0 / (2.0 * root - a[0])];
    let square: f64 = (0..4)
        .map(|k| slope[k / 2] * covariance[k / 2][k % 2] * slope[k % 2])
        .sum();
    (root - 1.0 > SURE * square.sqrt()).then(|| root.ln() / blocks.block_s())
}
