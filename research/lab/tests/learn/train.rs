//! The trainer compared with finite differences and with PyTorch, and on problems with a known answer.

mod files;
mod gradients;
mod learning;
mod matrix;
mod torch;

use onecycle_lab::learn::train::{Layer, Matrix, Network};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn rng(seed: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed)
}

/// Random multiples of `2^-10` in -1..1, so that steps of that size are exact.
fn random(rows: usize, columns: usize, seed: u64) -> Matrix {
    let mut rng = rng(seed);
    let values = (0..rows * columns).map(|_| rng.random_range(-1024..1024) as f32 / 1024.0);
    Matrix::from_rows(rows, columns, values.collect()).unwrap()
}

fn network(inputs: usize, layers: &[Layer], seed: u64) -> Network {
    Network::new(inputs, layers, &mut rng(seed)).unwrap()
}

fn dense(outputs: usize) -> Layer {
    Layer::Dense { outputs }
}
