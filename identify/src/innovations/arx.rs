//! Prediction of the output from past outputs and past inputs, by least squares over the blocks:
//!
//! ```text
//! y(k) = a1 y(k-1) + ... + ap y(k-p) + b1 u(k-1) + ... + bn u(k-n) + c,      A(z) = z^p - a1 z^(p-1) - ... - ap
//! ```
//!
//! It needs no start, so its roots are starts for fits that do, and it shows a root outside the unit circle whatever the controller
//! is. With two past outputs the noise of the sensor draws the roots inwards; more of them model the noise too.
//! References: L. Ljung, "System Identification" (1999), sections 7.3 and 13.4; on the test of a root above one P. C. B. Phillips,
//! Y. Wu, J. Yu, Int. Econ. Rev. 52 (2011).

use std::ops::Range;

use onecycle_design::roots;

use super::lifted::dot;
use super::orthogonal::Orthogonal;
use super::record::Blocks;

/// A fit of the prediction from `P` past outputs.
pub(super) struct Arx<const P: usize> {
    /// `a1` to `ap`.
    a: [f64; P],
    /// Covariance of these.
    covariance: [[f64; P]; P],
}

impl<const P: usize> Arx<P> {
    /// Fit to the blocks of `part` with `past` inputs. `None` if there are fewer blocks than unknowns, or if one column of past outputs
    /// and inputs is a combination of the others.
    pub(super) fn of(blocks: &Blocks<'_>, part: Range<usize>, past: usize) -> Option<Self> {
        let inputs = blocks.mean_inputs();
        let output = |block: usize| blocks.mean_output(block).unwrap_or(0.0);
        let rows: Vec<usize> = (part.start + past.max(P)..part.end)
            .filter(|row| (row - P..=*row).all(|block| blocks.present(block) > 0))
            .collect();
        let column = |value: &dyn Fn(usize) -> f64| rows.iter().map(|row| value(*row)).collect();
        let mut columns: Vec<Vec<f64>> = (1..=P)
            .map(|lag| column(&|row| output(row - lag)))
            .collect();
        columns.extend((1..=past).map(|lag| column(&|row| inputs[row - lag])));
        columns.push(vec![1.0; rows.len()]);
        let y: Vec<f64> = column(&output);
        let freedom = rows
            .len()
            .checked_sub(columns.len())
            .filter(|freedom| *freedom > 0)?;
        let regressors = Orthogonal::new(&columns)?;
        let (rest, x) = regressors.solve(&y);
        let variance = rest.iter().map(|r| r * r).sum::<f64>() / freedom as f64;
        let covariance = regressors.covariance(&std::array::from_fn(|i| i));
        Some(Self {
            a: std::array::from_fn(|i| x[i]),
            covariance: covariance.map(|row| row.map(|of_one| variance * of_one)),
        })
    }

    /// A real root of `A` above one, if `A` is negative by more than `sure` standard deviations at one or half-way to the root. A disturbance
    /// that is a random walk makes `A(1)` zero, so the middle counts too. The deviation of the root itself is no measure: an integrator
    /// and a walk have two roots at one, which any noise parts.
    pub(super) fn root_above_one(&self, sure: f64) -> Option<f64> {
        // Horner's scheme.
        let value = |z: f64| self.a.iter().fold(1.0, |sum, a| sum * z - a);
        if value(1.0) >= 0.0 {
            return None;
        }
        // A is positive beyond the sum of the sizes of its coefficients.
        let most = 1.0 + self.a.iter().map(|a| a.abs()).sum::<f64>();
        let root = roots::root(value, 1.0, most, 1e-12);
        let is_negative = |z: f64| {
            let powers: [f64; P] = std::array::from_fn(|i| z.powi((P - 1 - i) as i32));
            let products = std::array::from_fn(|i| dot(&self.covariance[i], &powers));
            value(z) < -sure * dot(&powers, &products).sqrt()
        };
        (is_negative(1.0) || is_negative(0.5 * (1.0 + root))).then_some(root)
    }
}

impl Arx<2> {
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
