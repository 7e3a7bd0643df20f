//! Samples per second in training: the paper's classifier and a small density network, on one and two
//! threads.

#[path = "../tests/common/mod.rs"]
mod common;

use divan::Bencher;
use divan::counter::ItemsCount;
use onecycle_lab::learn::train::{
    Batch, Dropped, Layer, Loss, Matrix, Network, Optimizer, OptimizerMethod, Tape,
};
use onecycle_lab::workers::{OneThread, Workers};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use common::Threads;

const BATCH: usize = 128;

fn main() {
    divan::main();
}

fn workers(threads: usize) -> &'static dyn Workers {
    if threads == 2 {
        &Threads(2)
    } else {
        &OneThread
    }
}

/// 4520-3000-1000-208, its layers in the order of the paper's text.
fn paper() -> (Network, Loss) {
    let mut layers = Vec::new();
    for outputs in [3000, 1000] {
        layers.extend([
            Layer::Dense { outputs },
            Layer::Relu,
            Layer::BatchNorm,
            Layer::Dropout { probability: 0.5 },
        ]);
    }
    layers.push(Layer::Dense { outputs: 208 });
    (network(4520, &layers), Loss::ShiftedSoftmax { cap: 0.2 })
}

/// 66-32-32-9: from features of a cycle to a Gaussian over three times.
fn small() -> (Network, Loss) {
    let mut layers = Vec::new();
    for outputs in [32, 32] {
        layers.extend([Layer::Dense { outputs }, Layer::Tanh]);
    }
    layers.push(Layer::Dense { outputs: 9 });
    (network(66, &layers), Loss::Gaussian { dimension: 3 })
}

fn network(inputs: usize, layers: &[Layer]) -> Network {
    Network::new(inputs, layers, &mut Pcg64Mcg::seed_from_u64(1)).expect("the sizes are in range")
}

fn batch(network: &Network) -> Batch {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let mut random = |columns: usize| {
        let mut matrix = Matrix::zeros(BATCH, columns);
        let values = matrix.values_mut().iter_mut();
        values.for_each(|value| *value = rng.random());
        matrix
    };
    Batch {
        inputs: random(network.inputs()),
        costs: random(network.outputs()),
        values: random(3),
        classes: (0..BATCH).map(|i| i % network.outputs()).collect(),
        weights: Vec::new(),
    }
}

/// Whole steps: forward, loss, backward, update.
fn steps(
    bencher: Bencher,
    (mut network, loss): (Network, Loss),
    method: OptimizerMethod,
    threads: usize,
) {
    let workers = workers(threads);
    let batch = batch(&network);
    let mut optimizer = Optimizer::new(method, &network).expect("the method is in range");
    let (mut tape, mut gradient) = (Tape::default(), Matrix::default());
    bencher.counter(ItemsCount::new(BATCH)).bench_local(|| {
        let dropped = Dropped {
            seed: 1,
            step: optimizer.steps(),
        };
        network.forward(&mut tape, &batch.inputs, dropped, workers)?;
        let outputs = tape.outputs().unwrap_or(&batch.inputs);
        let value = loss.evaluate(outputs, &batch, &mut gradient)?;
        network.backward(&mut tape, &gradient, workers)?;
        optimizer.step(&mut network, &tape, 1e-4, workers)?;
        Ok::<_, onecycle_lab::learn::train::TrainError>(value)
    });
}

const SGD: OptimizerMethod = OptimizerMethod::Sgd {
    momentum: 0.9,
    decay: 0.0,
};

#[divan::bench(args = [1, 2], sample_count = 20, sample_size = 1)]
fn paper_network_sgd(bencher: Bencher, threads: usize) {
    steps(bencher, paper(), SGD, threads);
}

#[divan::bench(args = [1, 2], sample_count = 20, sample_size = 1)]
fn paper_network_adam(bencher: Bencher, threads: usize) {
    steps(bencher, paper(), OptimizerMethod::ADAM, threads);
}

#[divan::bench(args = [1, 2])]
fn small_network_adam(bencher: Bencher, threads: usize) {
    steps(bencher, small(), OptimizerMethod::ADAM, threads);
}

/// The paper's classifier evaluates one sample.
#[divan::bench(args = [1, BATCH], sample_count = 20)]
fn paper_network_evaluates(bencher: Bencher, samples: usize) {
    let (network, _) = paper();
    let network = network.folded();
    let inputs = Matrix::zeros(samples, network.inputs());
    bencher
        .counter(ItemsCount::new(samples))
        .bench_local(|| network.evaluate(&inputs, &OneThread));
}
