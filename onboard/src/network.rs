//! Dense layers of a small neural network, with the weights read where they lie.
//!
//! ```text
//! y_o = f(b_o + sum_i w_oi x_i)              f32 weights
//! y_o = f(b_o + s_o sum_i q_oi x_i)          byte weights: q is an integer, -127..127
//!
//! f: identity, max(x, 0), tanh x
//! ```
//!
//! The weights are stored as in PyTorch and in the trainer, one row per output. They stay in flash or in the
//! file, at any address. Weights of one byte with a scale per row need no calibration, because the inputs stay
//! f32.
//!
//! Reference for the byte weights: R. Krishnamoorthi, "Quantizing deep convolutional networks for efficient
//! inference", arXiv 1806.08342, section 3 (symmetric, per channel).
//!
//! ```
//! use onecycle_onboard::floats::Floats;
//! use onecycle_onboard::network::{Activation, Dense, Weights};
//!
//! // 0.5 (1 * 2 + 4 * 3) + 1 = 8 and 2 (-1 * 2 + 0 * 3) + 1 = -3, which the activation sets to 0.
//! let [half, one, two] = [0.5_f32, 1.0, 2.0].map(f32::to_le_bytes);
//! let (scales, biases) = ([half, two].concat(), [one, one].concat());
//! let weights = Weights::Bytes {
//!     rows: &[1, 4, 0xff, 0],
//!     scales: Floats::new(&scales).ok_or("scales")?,
//! };
//! let biases = Floats::new(&biases).ok_or("biases")?;
//! let layer = Dense::new(2, weights, biases, Activation::Relu).ok_or("sizes")?;
//! let mut outputs = [0.0; 2];
//! layer.forward(&[2.0, 3.0], &mut outputs);
//! assert_eq!(outputs, [8.0, 0.0]);
//! # Ok::<(), &str>(())
//! ```

use crate::floats::Floats;

/// Number of partial sums per row: a single chain of additions would wait for the latency of each (3 to 4 cycles
/// on a Cortex-M7 or a desktop core), and four f32 fill a 128-bit register.
const LANES: usize = 4;

/// Weights of a layer, row by row, one row per output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weights<'a> {
    /// `w`.
    Floats(Floats<'a>),
    /// `w = s q`.
    Bytes {
        /// `q`: one byte each, two's complement.
        rows: &'a [u8],
        /// `s`: value of one unit of the row, its largest weight divided by 127.
        scales: Floats<'a>,
    },
}

/// Activation function of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// Identity.
    None,
    /// `max(x, 0)`; a NaN stays a NaN.
    Relu,
    /// The hyperbolic tangent.
    Tanh,
}

/// A dense layer. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dense<'a> {
    inputs: usize,
    weights: Weights<'a>,
    biases: Floats<'a>,
    activation: Activation,
}

impl<'a> Dense<'a> {
    /// A layer with this number of inputs and as many outputs as biases. `None` if there are no inputs or if the
    /// numbers of weights and scales do not fit.
    #[must_use]
    pub fn new(
        inputs: usize,
        weights: Weights<'a>,
        biases: Floats<'a>,
        activation: Activation,
    ) -> Option<Self> {
        let outputs = biases.len();
        let (count, scales) = match weights {
            Weights::Floats(floats) => (floats.len(), outputs),
            Weights::Bytes { rows, scales } => (rows.len(), scales.len()),
        };
        let fits = inputs > 0 && inputs.checked_mul(outputs) == Some(count) && scales == outputs;
        fits.then_some(Self {
            inputs,
            weights,
            biases,
            activation,
        })
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.biases.len()
    }

    /// Weights.
    #[must_use]
    pub fn weights(&self) -> Weights<'a> {
        self.weights
    }

    /// Biases, `b`.
    #[must_use]
    pub fn biases(&self) -> Floats<'a> {
        self.biases
    }

    /// Activation function.
    #[must_use]
    pub fn activation(&self) -> Activation {
        self.activation
    }

    /// Computes the outputs. Missing inputs count as zeros; inputs and outputs beyond the size of the layer are
    /// ignored.
    pub fn forward(&self, inputs: &[f32], outputs: &mut [f32]) {
        let sums = outputs.iter_mut().zip(self.biases.iter());
        match self.weights {
            Weights::Floats(weights) => {
                let rows = weights.chunks().chunks_exact(self.inputs);
                for ((sum, bias), row) in sums.zip(rows) {
                    *sum = bias + dot(row, inputs, f32::from_le_bytes);
                }
            }
            Weights::Bytes { rows, scales } => {
                let rows = rows.as_chunks::<1>().0.chunks_exact(self.inputs);
                for (((sum, bias), row), scale) in sums.zip(rows).zip(scales.iter()) {
                    *sum = bias + scale * dot(row, inputs, |[byte]| f32::from(byte as i8));
                }
            }
        }
        let outputs = outputs.iter_mut().take(self.outputs());
        match self.activation {
            Activation::None => {}
            // Not `max`, which would turn a NaN into zero.
            Activation::Relu => outputs.for_each(|x| *x = if *x < 0.0 { 0.0 } else { *x }),
            Activation::Tanh => outputs.for_each(|x| *x = libm::tanhf(*x)),
        }
    }
}

/// Sum of products over the common length; `weight` decodes the `SIZE` bytes of a weight.
fn dot<const SIZE: usize>(
    weights: &[[u8; SIZE]],
    inputs: &[f32],
    weight: impl Fn([u8; SIZE]) -> f32,
) -> f32 {
    let both = weights.len().min(inputs.len());
    let (weights, last_weights) = weights[..both].as_chunks::<LANES>();
    let (inputs, last_inputs) = inputs[..both].as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (weights, inputs) in weights.iter().zip(inputs) {
        for lane in 0..LANES {
            sums[lane] += weight(weights[lane]) * inputs[lane];
        }
    }
    for ((sum, &bytes), input) in sums.iter_mut().zip(last_weights).zip(last_inputs) {
        *sum += weight(bytes) * input;
    }
    let [a, b, c, d] = sums;
    (a + c) + (b + d)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    fn le(values: &[f32]) -> Vec<u8> {
        values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect()
    }

    fn floats(bytes: &[u8]) -> Floats<'_> {
        Floats::new(bytes).unwrap()
    }

    // Row o is o + 1, o + 2, ...; the inputs are 1, 2, ... n: sum (o + i) i = o n (n + 1) / 2 + n (n + 1) (2 n +
    // 1) / 6, plus ten times o. Integers, so exact; n reaches past two full rounds of partial sums.
    #[test]
    fn sums_are_exact_at_every_length() {
        for n in [1, 3, 4, 7, 8, 11] {
            let rows: Vec<u8> = (0..3).flat_map(|o| (1..=n).map(move |i| o + i)).collect();
            let values: Vec<f32> = rows.iter().map(|&w| f32::from(w)).collect();
            let (values, scales) = (le(&values), le(&[1.0; 3]));
            let biases = le(&[0.0, 10.0, 20.0]);
            let inputs: Vec<f32> = (1..=n).map(f32::from).collect();
            let count = f32::from(n);
            let expected = [0.0, 1.0, 2.0].map(|o| {
                let squares = count * (count + 1.0) * (2.0 * count + 1.0) / 6.0;
                o * count * (count + 1.0) / 2.0 + squares + 10.0 * o
            });
            let bytes = Weights::Bytes {
                rows: &rows,
                scales: floats(&scales),
            };
            for weights in [Weights::Floats(floats(&values)), bytes] {
                let biases = floats(&biases);
                let dense = Dense::new(usize::from(n), weights, biases, Activation::None).unwrap();
                let mut outputs = [0.0, 0.0, 0.0, 7.0];
                dense.forward(&inputs, &mut outputs);
                assert_eq!(outputs[..3], expected);
                assert_eq!(outputs[3], 7.0);
            }
        }
    }

    // Inputs 1 and 2 and a missing third: 1 + 2 * 2 = 5, not 5 + 3 * x.
    #[test]
    fn missing_inputs_count_as_zeros() {
        let (weights, biases) = (le(&[1.0, 2.0, 3.0]), le(&[0.0]));
        let weights = Weights::Floats(floats(&weights));
        let dense = Dense::new(3, weights, floats(&biases), Activation::None).unwrap();
        let mut outputs = [0.0];
        dense.forward(&[1.0, 2.0], &mut outputs);
        assert_eq!(outputs, [5.0]);
    }

    // 0.25 (127 - 2 * 127) + 1 = -30.75 and 0.5 (-127 + 2 * 64) - 1 = -0.5.
    #[test]
    fn every_row_has_its_scale() {
        let (scales, biases) = (le(&[0.25, 0.5]), le(&[1.0, -1.0]));
        let weights = Weights::Bytes {
            rows: &[127, 0x81, 0x81, 64],
            scales: floats(&scales),
        };
        let dense = Dense::new(2, weights, floats(&biases), Activation::None).unwrap();
        let mut outputs = [0.0; 2];
        dense.forward(&[1.0, 2.0], &mut outputs);
        assert_eq!(outputs, [-30.75, -0.5]);
    }

    // tanh(ln 2) = (2 - 1/2) / (2 + 1/2) = 0.6.
    #[test]
    fn activations_are_what_they_say() {
        let run = |input: f32, activation| {
            let (weights, biases) = (le(&[1.0]), le(&[0.0]));
            let weights = Weights::Floats(floats(&weights));
            let dense = Dense::new(1, weights, floats(&biases), activation).unwrap();
            let mut outputs = [0.0];
            dense.forward(&[input], &mut outputs);
            outputs[0]
        };
        assert_eq!(run(-1.5, Activation::None), -1.5);
        assert_eq!(run(-1.5, Activation::Relu), 0.0);
        assert_eq!(run(2.5, Activation::Relu), 2.5);
        assert!(run(f32::NAN, Activation::Relu).is_nan());
        let low = run(-core::f32::consts::LN_2, Activation::Tanh);
        assert!((low + 0.6).abs() < 1e-7, "{low}");
        assert_eq!(run(0.0, Activation::Tanh), 0.0);
        assert_eq!(run(50.0, Activation::Tanh), 1.0);
    }

    #[test]
    fn sizes_that_do_not_fit_are_no_layer() {
        let numbers = le(&[1.0; 6]);
        let six = floats(&numbers);
        let two = six.range(0, 2).unwrap();
        let made = |inputs, weights, biases| {
            Dense::new(inputs, weights, biases, Activation::None).map(|dense| dense.outputs())
        };
        assert_eq!(made(3, Weights::Floats(six), two), Some(2));
        assert_eq!(made(2, Weights::Floats(six), two), None);
        assert_eq!(made(0, Weights::Floats(Floats::default()), two), None);
        assert_eq!(made(usize::MAX, Weights::Floats(six), two), None);
        let rows = &[0; 6];
        assert_eq!(made(3, Weights::Bytes { rows, scales: two }, two), Some(2));
        assert_eq!(made(3, Weights::Bytes { rows, scales: six }, two), None);
    }
}
