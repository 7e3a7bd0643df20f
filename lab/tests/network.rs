//! The network on board against the one that learns: the same weights, the same outputs.

// Helpers of tests are tests too, which the lint does not see.
#![allow(clippy::unwrap_used)]

use onecycle_lab::train::{Layer, Matrix, Network, OneThread, TensorFile};
use onecycle_onboard::network::{Dense, QuantisedDense, relu, tanh};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const IN: usize = 34;
const HIDDEN: usize = 32;
const OUT: usize = 9;

/// Samples that the networks are compared on.
const SAMPLES: usize = 1000;

/// Weights and biases of a layer, as they would lie in flash.
struct Stored<const I: usize, const O: usize> {
    weights: [[f32; I]; O],
    biases: [f32; O],
}

impl<const I: usize, const O: usize> Stored<I, O> {
    /// Of the tensors of a dense layer: weight and bias.
    fn of(weight: &[f32], bias: &[f32]) -> Self {
        let (rows, rest) = weight.as_chunks::<I>();
        assert!(rest.is_empty());
        Self {
            weights: rows.try_into().unwrap(),
            biases: bias.try_into().unwrap(),
        }
    }

    fn forward(&self, inputs: &[f32; I]) -> [f32; O] {
        let dense = Dense {
            weights: &self.weights,
            biases: &self.biases,
        };
        dense.forward(inputs)
    }

    /// To whole numbers of a 127th of the largest weight of the row.
    fn quantised_forward(&self, inputs: &[f32; I]) -> [f32; O] {
        let (weights, scales) = quantised(&self.weights);
        let dense = QuantisedDense {
            weights: &weights,
            scales: &scales,
            biases: &self.biases,
        };
        dense.forward(inputs)
    }
}

fn quantised<const I: usize, const O: usize>(weights: &[[f32; I]; O]) -> ([[i8; I]; O], [f32; O]) {
    let scales = weights.map(|row| row.iter().fold(0.0, |most: f32, w| most.max(w.abs())) / 127.0);
    let rows = std::array::from_fn(|o| weights[o].map(|w| (w / scales[o]).round() as i8));
    (rows, scales)
}

/// 34-32-32-9 with drawn weights and biases, and its three dense layers.
struct Networks {
    trained: Network,
    first: Stored<IN, HIDDEN>,
    second: Stored<HIDDEN, HIDDEN>,
    last: Stored<HIDDEN, OUT>,
}

fn networks(activation: Layer, rng: &mut Pcg64Mcg) -> Networks {
    let layers = [
        Layer::Dense { outputs: HIDDEN },
        activation,
        Layer::Dense { outputs: HIDDEN },
        activation,
        Layer::Dense { outputs: OUT },
    ];
    let mut trained = Network::new(IN, &layers, rng).unwrap();
    let mut file = TensorFile::from_bytes(&trained.save()).unwrap();
    for tensor in &mut file.tensors {
        if tensor.name.ends_with("bias") {
            (tensor.values).fill_with(|| rng.random_range(-0.5..0.5));
        }
    }
    trained.load(&file.to_bytes()).unwrap();
    let parameters: Vec<_> = trained.parameters().map(Matrix::values).collect();
    let [w1, b1, w2, b2, w3, b3] = parameters[..] else {
        unreachable!("three dense layers have six parameters");
    };
    let (first, second, last) = (Stored::of(w1, b1), Stored::of(w2, b2), Stored::of(w3, b3));
    Networks {
        trained,
        first,
        second,
        last,
    }
}

/// Inputs as a signature's: between -1 and 1.
fn inputs(rng: &mut Pcg64Mcg) -> Matrix {
    let values = (0..SAMPLES * IN).map(|_| rng.random_range(-1.0..1.0));
    Matrix::from_rows(SAMPLES, IN, values.collect()).unwrap()
}

/// The largest difference of an output from the trainer's, relative where that is beyond one, and the
/// root mean square of the trainer's.
fn difference(
    trained: &Network,
    inputs: &Matrix,
    forward: impl Fn(&[f32; IN]) -> [f32; OUT],
) -> (f32, f32) {
    let expected = trained.evaluate(inputs, &OneThread).unwrap();
    let (mut most, mut squares) = (0.0_f32, 0.0);
    for (row, expected) in inputs.iter_rows().zip(expected.iter_rows()) {
        for (output, expected) in forward(row.try_into().unwrap()).iter().zip(expected) {
            most = most.max((output - expected).abs() / expected.abs().max(1.0));
            squares += expected * expected;
        }
    }
    (most, (squares / (SAMPLES * OUT) as f32).sqrt())
}

// Sums of 34 and 32 terms near one in another order: a few units of 2^-24 = 6e-8 a layer, and the
// outputs are of the order of one.
#[test]
fn outputs_are_the_trainers() {
    let mut rng = Pcg64Mcg::seed_from_u64(20);
    for activation in [Layer::Relu, Layer::Tanh] {
        let Networks {
            trained,
            first,
            second,
            last,
        } = networks(activation, &mut rng);
        let inputs = inputs(&mut rng);
        let (most, size) = difference(&trained, &inputs, |row| match activation {
            Layer::Tanh => last.forward(&tanh(second.forward(&tanh(first.forward(row))))),
            _ => last.forward(&relu(second.forward(&relu(first.forward(row))))),
        });
        assert!(size > 0.3 && size < 3.0, "{size}");
        assert!(most < 1e-6, "{most} with {activation:?}");
    }
}

// A weight is off by up to half a step, evenly: s / sqrt(12) for steps s of a 127th of the row's
// largest, some 2.2 standard deviations sqrt(2 / 34) of the weights: 0.5 % of it, thus 0.5 % of the
// size of the sums a layer, in three layers 0.9 % of the outputs; the largest of 9000 some four or
// five times that, 4 % (3.4 % as drawn).
#[test]
fn bytes_are_a_few_per_cent_off() {
    let mut rng = Pcg64Mcg::seed_from_u64(21);
    let Networks {
        trained,
        first,
        second,
        last,
    } = networks(Layer::Relu, &mut rng);
    let inputs = inputs(&mut rng);
    let (most, size) = difference(&trained, &inputs, |row| {
        let hidden = relu(first.quantised_forward(row));
        last.quantised_forward(&relu(second.quantised_forward(&hidden)))
    });
    assert!(
        most < 0.05 * size && most > 0.005 * size,
        "{most} of {size}"
    );
}
