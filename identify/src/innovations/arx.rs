//! Prediction of the output from two past outputs and four past inputs, by least squares over the blocks:
//!
//! ```text
//! y(k) = a1 y(k-1) + a2 y(k-2) + b1 u(k-1) + ... + b4 u(k-4) + c,      z^2 = a1 z + a2
//! ```
//!
//! It needs no start, so its roots are starts for fits that do, and it shows a root outside the unit circle whatever the controller
//! is. Noise in the regressors draws the roots inwards. Reference: L. Ljung, "System Identification" (1999), sections 7.3 and 13.4.

use std::ops::Range;

use super::orthogonal::Orthogonal;
use super::record::Blocks;

/// Past inputs of the prediction.
const INPUTS: usize = 4;

/// A fit of the prediction.
pub(super) struct Arx {
    /// `a1` and `a2`.
    pub(super) a: [f64; 2],
    /// Covariance of these.
    pub(super) covariance: [[f64; 2]; 2],
}

impl Arx {
    /// Fit to the blocks of `part`. `None` of too few, or if the regressors depend on each other.
    pub(super) fn of(blocks: &Blocks<'_>, part: Range<usize>) -> Option<Self> {
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
        let covariance = regressors.covariance(&[0, 1]);
        Some(Self {
            a: [x[0], x[1]],
            covariance: std::array::from_fn(|i| {
                std::array::from_fn(|j| variance * covariance[i][j])
            }),
        })
    }

    /// `c1` and `c0` of the denominator `s^2 + c1 s + c0` (1/s, 1/s^2) with the same poles at samples of `step_s`. `None` if a
    /// root is not a pole of a continuous process.
    pub(super) fn pair(&self, step_s: f64) -> Option<[f64; 2]> {
        let [a1, a2] = self.a;
        // z = e^(s h), so the product of the roots, -a2, is e^(-c1 h).
        let c1 = -(-a2).ln() / step_s;
        let square = 0.25 * a1 * a1 + a2;
        let c0 = if square < 0.0 {
            let turn = (-square).sqrt().atan2(0.5 * a1) / step_s;
            turn * turn + 0.25 * c1 * c1
        } else {
            let (large, small) = (0.5 * a1 + square.sqrt(), 0.5 * a1 - square.sqrt());
            large.ln() * small.ln() / (step_s * step_s)
        };
        (c1.is_finite() && c0.is_finite() && c0 > 0.0).then_some([c1, c0])
    }
}
