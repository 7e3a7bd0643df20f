//! Is the process unstable without its controller?
//!
//! No structure has an unstable pole, and under feedback a stable one can fit the record of an unstable process. The prediction
//! of the output from past outputs and inputs shows the pole, whatever the controller is:
//!
//! ```text
//! y(k) = a1 y(k-1) + a2 y(k-2) + b1 u(k-1) + ... + b4 u(k-4) + c,      z^2 = a1 z + a2
//! ```
//!
//! by least squares over the blocks. Noise in the regressors draws the poles inwards, so that a root beyond one is not its
//! doing. Reference: L. Ljung, "System Identification" (1999), section 13.4.

use std::ops::Range;

use super::orthogonal::Orthogonal;
use super::record::Blocks;

/// Past inputs of the prediction.
const INPUTS: usize = 4;
/// Distance of the root from one, in standard deviations, from which the process is unstable.
const SURE: f64 = 4.0;
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
    let inputs = blocks.mean_inputs();
    let output = |block: usize| blocks.mean_output(block).unwrap_or(0.0);
    let rows: Vec<usize> = (part.start + INPUTS..part.end)
        .filter(|row| (row - 2..=*row).all(|block| blocks.present(block) > 0))
        .collect();
    let column = |value: &dyn Fn(usize) -> f64| rows.iter().map(|row| value(*row)).collect();
    let mut columns: Vec<Vec<f64>> = vec![
        column(&|row| output(row - 1)),
        column(&|row| output(row - 2)),
    ];
    columns.extend((1..=INPUTS).map(|lag| column(&|row| inputs[row - lag])));
    columns.push(vec![1.0; rows.len()]);
    let y: Vec<f64> = column(&output);
    let freedom = rows
        .len()
        .checked_sub(columns.len())
        .filter(|freedom| *freedom > 0)?;
    let regressors = Orthogonal::new(&columns)?;
    let (rest, x) = regressors.solve(&y);
    let variance = rest.iter().map(|r| r * r).sum::<f64>() / freedom as f64;
    let root = 0.5 * (x[0] + (x[0] * x[0] + 4.0 * x[1]).sqrt());
    // dz (2 z - a1) = z da1 + da2
    let slope = [root / (2.0 * root - x[0]), 1.0 / (2.0 * root - x[0])];
    let covariance = regressors.covariance(&[0, 1]);
    let square: f64 = (0..4)
        .map(|k| slope[k / 2] * covariance[k / 2][k % 2] * slope[k % 2])
        .sum();
    let deviation = (variance * square).sqrt();
    (root - 1.0 > SURE * deviation).then(|| root.ln() / blocks.block_s())
}
