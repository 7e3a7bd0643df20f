//! Dense layers of a small network, their sizes in their types, their weights borrowed.
//!
//! ```text
//! y_o = b_o + sum_i w_oi x_i              Dense
//! y_o = b_o + s_o sum_i q_oi x_i          QuantisedDense: q a whole number, -127..127
//! ```
//!
//! Weights lie as PyTorch and the trainer keep them, a row for each output, and stay where they are:
//! in flash as a `static`. One byte a weight instead of four, with a scale for each row, needs no
//! calibration, as the inputs stay f32 (R. Krishnamoorthi, "Quantizing deep convolutional networks
//! for efficient inference", arXiv 1806.08342, section 3: symmetric, per channel).
//!
//! ```
//! use onecycle_onboard::network::{Dense, relu};
//!
//! let hidden = Dense { weights: &[[1.0, 2.0], [3.0, -4.0], [0.5, 0.5]], biases: &[0.0, 1.0, 0.0] };
//! let last = Dense { weights: &[[1.0, 1.0, 2.0]], biases: &[-1.0] };
//! // Hidden: 3, 3 - 4 + 1 = 0, 1. Out: 3 + 0 + 2 - 1.
//! assert_eq!(last.forward(&relu(hidden.forward(&[1.0, 1.0]))), [4.0]);
//! ```

/// Sums that go on side by side in a row: a chain of additions would wait for each one's latency
/// (3 to 4 cycles on a Cortex-M7 or a desktop core), and four of f32 fill a 128-bit register.
const LANES: usize = 4;

/// A dense layer. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dense<'a, const IN: usize, const OUT: usize> {
    /// `w`: a row for each output.
    pub weights: &'a [[f32; IN]; OUT],
    /// `b`.
    pub biases: &'a [f32; OUT],
}

impl<const IN: usize, const OUT: usize> Dense<'_, IN, OUT> {
    /// The outputs, before any activation.
    #[must_use]
    pub fn forward(&self, inputs: &[f32; IN]) -> [f32; OUT] {
        let mut outputs = *self.biases;
        for (output, row) in outputs.iter_mut().zip(self.weights) {
            *output += dot(row, inputs);
        }
        outputs
    }
}

/// A dense layer whose weights are bytes. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuantisedDense<'a, const IN: usize, const OUT: usize> {
    /// `q`: a row for each output.
    pub weights: &'a [[i8; IN]; OUT],
    /// `s`: what a one of the row stands for, its largest weight over 127.
    pub scales: &'a [f32; OUT],
    /// `b`.
    pub biases: &'a [f32; OUT],
}

impl<const IN: usize, const OUT: usize> QuantisedDense<'_, IN, OUT> {
    /// The outputs, before any activation.
    #[must_use]
    pub fn forward(&self, inputs: &[f32; IN]) -> [f32; OUT] {
        let mut outputs = *self.biases;
        for ((output, row), scale) in outputs.iter_mut().zip(self.weights).zip(self.scales) {
            *output += scale * dot(row, inputs);
        }
        outputs
    }
}

fn dot<W: Copy + Into<f32>, const N: usize>(weights: &[W; N], inputs: &[f32; N]) -> f32 {
    let (weights, last_weights) = weights.as_chunks::<LANES>();
    let (inputs, last_inputs) = inputs.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (weights, inputs) in weights.iter().zip(inputs) {
        for lane in 0..LANES {
            sums[lane] += weights[lane].into() * inputs[lane];
        }
    }
    for ((sum, &weight), input) in sums.iter_mut().zip(last_weights).zip(last_inputs) {
        *sum += weight.into() * input;
    }
    let [a, b, c, d] = sums;
    (a + c) + (b + d)
}

/// `max(x, 0)` of every value; what is no number stays so.
#[must_use]
pub fn relu<const N: usize>(values: [f32; N]) -> [f32; N] {
    values.map(|value| if value < 0.0 { 0.0 } else { value })
}

/// The hyperbolic tangent of every value.
#[must_use]
pub fn tanh<const N: usize>(values: [f32; N]) -> [f32; N] {
    values.map(libm::tanhf)
}

#[cfg(test)]
mod tests {
    use super::*;

    // Row o is o + 1, o + 2, ...; inputs 1, 2, ... n: sum (o + i) i = o n (n + 1) / 2 +
    // n (n + 1) (2 n + 1) / 6, and ten times o more. Whole numbers, so exact; n from none to past
    // two full rounds of the lanes.
    #[test]
    fn sums_are_exact_at_every_length() {
        fn check<const N: usize>() {
            let weights: [[i8; N]; 3] =
                core::array::from_fn(|o| core::array::from_fn(|i| (o + i + 1) as i8));
            let inputs = core::array::from_fn(|i| (i + 1) as f32);
            let biases = [0.0, 10.0, 20.0];
            let n = N as f32;
            let expected = [0.0, 1.0, 2.0].map(|o| {
                o * n * (n + 1.0) / 2.0 + n * (n + 1.0) * (2.0 * n + 1.0) / 6.0 + 10.0 * o
            });
            let dense = Dense {
                weights: &weights.map(|row| row.map(f32::from)),
                biases: &biases,
            };
            assert_eq!(dense.forward(&inputs), expected);
            let quantised = QuantisedDense {
                weights: &weights,
                scales: &[1.0; 3],
                biases: &biases,
            };
            assert_eq!(quantised.forward(&inputs), expected);
        }
        check::<0>();
        check::<1>();
        check::<3>();
        check::<4>();
        check::<7>();
        check::<8>();
        check::<11>();
    }

    // 0.25 (127 - 2 * 127) + 1 = -30.75 and 0.5 (-127 + 2 * 64) - 1 = -0.5.
    #[test]
    fn every_row_has_its_scale() {
        let dense = QuantisedDense {
            weights: &[[127, -127], [-127, 64]],
            scales: &[0.25, 0.5],
            biases: &[1.0, -1.0],
        };
        assert_eq!(dense.forward(&[1.0, 2.0]), [-30.75, -0.5]);
    }

    // tanh(ln 2) = (2 - 1/2) / (2 + 1/2) = 0.6.
    #[test]
    fn activations_are_what_they_say() {
        assert_eq!(relu([-1.5, -0.0, 0.0, 2.5]), [0.0, 0.0, 0.0, 2.5]);
        assert!(relu([f32::NAN])[0].is_nan());
        let [low, zero, high] = tanh([-core::f32::consts::LN_2, 0.0, 50.0]);
        assert!((low + 0.6).abs() < 1e-7, "{low}");
        assert_eq!((zero, high), (0.0, 1.0));
    }
}
