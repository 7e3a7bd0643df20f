//! Batch normalisation: scales every column of a batch to mean zero and variance one, then scales and
//! shifts it.
//!
//! ```text
//! x^ = (x - mean) / sqrt(var + eps),   y = weight x^ + bias
//!
//! learning:   mean, var  of the batch, var = sum (x - mean)^2 / m
//!             running := 0.9 running + 0.1 batch, its variance times m / (m - 1)
//! evaluating: mean, var  the running ones
//!
//! dL/dx = weight / sqrt(var + eps) (dy - mean(dy) - x^ mean(dy x^))
//! ```
//!
//! Reference: S. Ioffe, C. Szegedy, "Batch normalization: accelerating deep network training by
//! reducing internal covariate shift", ICML (2015). The two variances, `eps` and the share of the
//! batch are the conventions of PyTorch's `BatchNorm1d`.

use super::TrainError;
use super::matrix::Matrix;

/// Added to the variance: PyTorch's.
const EPSILON: f64 = 1e-5;

/// Share of a batch in the running statistics: PyTorch's.
const MOMENTUM: f64 = 0.1;

/// Four rows with one number for each column.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BatchNorm {
    pub(super) weight: Matrix,
    pub(super) bias: Matrix,
    pub(super) running_mean: Matrix,
    pub(super) running_var: Matrix,
}

impl BatchNorm {
    /// Scale one, shift zero, running statistics of a standard normal variable.
    pub(super) fn new(columns: usize) -> Self {
        let mut ones = Matrix::zeros(1, columns);
        ones.values_mut().fill(1.0);
        let zeros = Matrix::zeros(1, columns);
        Self {
            weight: ones.clone(),
            bias: zeros.clone(),
            running_mean: zeros,
            running_var: ones,
        }
    }

    /// `(scale, shift)` of every column for evaluation.
    pub(super) fn scale_and_shift(&self) -> impl Iterator<Item = (f64, f64)> {
        let [weight, bias, mean, var] = [
            &self.weight,
            &self.bias,
            &self.running_mean,
            &self.running_var,
        ]
        .map(Matrix::values);
        (0..weight.len()).map(move |j| {
            let scale = f64::from(weight[j]) / (f64::from(var[j]) + EPSILON).sqrt();
            (scale, f64::from(bias[j]) - scale * f64::from(mean[j]))
        })
    }

    pub(super) fn evaluate(&self, values: &mut Matrix) {
        let columns: Vec<_> = self.scale_and_shift().collect();
        for i in 0..values.rows() {
            for (value, (scale, shift)) in values.row_mut(i).iter_mut().zip(&columns) {
                *value = (scale * f64::from(*value) + shift) as f32;
            }
        }
    }

    /// Leaves `x^` in `normal` and `1 / sqrt(var + eps)` in `scale` for [`Self::backward`].
    pub(super) fn learn(
        &mut self,
        input: &Matrix,
        output: &mut Matrix,
        (normal, scale): (&mut Matrix, &mut Vec<f64>),
    ) -> Result<(), TrainError> {
        if input.rows() < 2 {
            return Err(TrainError::OneSample);
        }
        let samples = input.rows() as f64;
        let mut mean = input.column_sums();
        mean.iter_mut().for_each(|mean| *mean /= samples);
        let mut var = vec![0.0; mean.len()];
        for row in input.iter_rows() {
            for ((var, mean), x) in var.iter_mut().zip(&mean).zip(row) {
                *var += (f64::from(*x) - mean).powi(2);
            }
        }
        var.iter_mut().for_each(|var| *var /= samples);
        let unbiased = samples / (samples - 1.0);
        blend(self.running_mean.values_mut(), &mean, 1.0);
        blend(self.running_var.values_mut(), &var, unbiased);

        scale.clear();
        scale.extend(var.iter().map(|var| (var + EPSILON).sqrt().recip()));
        normal.reshape(input.rows(), input.columns());
        output.reshape(input.rows(), input.columns());
        let (weight, bias) = (self.weight.values(), self.bias.values());
        for i in 0..input.rows() {
            let normal = normal.row_mut(i);
            for (j, x) in input.row(i).iter().enumerate() {
                normal[j] = ((f64::from(*x) - mean[j]) * scale[j]) as f32;
            }
            for (j, y) in output.row_mut(i).iter_mut().enumerate() {
                *y = weight[j] * normal[j] + bias[j];
            }
        }
        Ok(())
    }

    /// Turns the gradient of the outputs into that of the inputs; the gradients of weight and bias go
    /// to `into`.
    pub(super) fn backward(
        &self,
        (normal, scale): (&Matrix, &[f64]),
        gradient: &mut Matrix,
        into: &mut [Matrix],
    ) {
        let sums = gradient.column_sums();
        let mut products = vec![0.0; sums.len()];
        for (dy, normal) in gradient.iter_rows().zip(normal.iter_rows()) {
            for ((product, dy), normal) in products.iter_mut().zip(dy).zip(normal) {
                *product += f64::from(*dy) * f64::from(*normal);
            }
        }
        for (into, from) in into.iter_mut().zip([&products, &sums]) {
            for (to, from) in into.values_mut().iter_mut().zip(from) {
                *to = *from as f32;
            }
        }
        let samples = gradient.rows() as f64;
        let columns: Vec<[f64; 3]> = (self.weight.values().iter().enumerate())
            .map(|(j, weight)| {
                let slope = f64::from(*weight) * scale[j];
                [slope, sums[j] / samples, products[j] / samples]
            })
            .collect();
        for i in 0..gradient.rows() {
            let dx = gradient.row_mut(i).iter_mut();
            for ((dx, normal), [scale, mean, slope]) in dx.zip(normal.row(i)).zip(&columns) {
                *dx = (scale * (f64::from(*dx) - mean - slope * f64::from(*normal))) as f32;
            }
        }
    }
}

/// Updates running statistics with a batch, whose statistics count `times` their value.
fn blend(running: &mut [f32], batch: &[f64], times: f64) {
    for (running, batch) in running.iter_mut().zip(batch) {
        *running = ((1.0 - MOMENTUM) * f64::from(*running) + MOMENTUM * times * batch) as f32;
    }
}
