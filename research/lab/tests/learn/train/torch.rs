//! Numbers of PyTorch, from `golden/torch_steps.py`, computed in f64 from the same f32 weights; the
//! difference is our rounding.

use std::collections::BTreeMap;

use onecycle_lab::learn::train::{
    Batch, Dropped, Layer, Loss, Matrix, Network, Optimizer, OptimizerMethod, Tape,
};
use onecycle_lab::workers::OneThread;
use serde::Deserialize;

use super::dense;
use crate::changed;

#[derive(Deserialize)]
struct Golden {
    inputs: Vec<f32>,
    before: BTreeMap<String, Vec<f32>>,
    classes: Vec<usize>,
    evaluated: Vec<f64>,
    outputs: Vec<f64>,
    loss: f64,
    output_gradient: Vec<f64>,
    gradients: BTreeMap<String, Vec<f64>>,
    after_forward: BTreeMap<String, Vec<f64>>,
    after_sgd: BTreeMap<String, Vec<f64>>,
    after_adam: BTreeMap<String, Vec<f64>>,
    gaussian: Density,
}

#[derive(Deserialize)]
struct Density {
    outputs: Vec<f32>,
    values: Vec<f32>,
    loss: f64,
    gradient: Vec<f64>,
}

fn golden() -> Golden {
    serde_json::from_str(include_str!("../../golden/torch_steps.json")).unwrap()
}

/// The network with PyTorch's numbers before the first step.
fn network() -> Network {
    let layers = [
        dense(8),
        Layer::BatchNorm,
        Layer::Relu,
        Layer::Dropout { probability: 0.0 },
        dense(4),
    ];
    let network = Network::zeros(5, &layers).unwrap();
    let before = golden().before;
    assert_eq!(network.arrays().count(), before.len());
    changed(network, |name, values| {
        values.copy_from_slice(&before[name]);
    })
}

fn batch(golden: &Golden) -> Batch {
    Batch {
        inputs: Matrix::from_rows(6, 5, golden.inputs.clone()).unwrap(),
        classes: golden.classes.clone(),
        ..Batch::default()
    }
}

/// Largest difference over the largest number.
fn deviation(ours: &[f32], torch: &[f64]) -> f64 {
    assert_eq!(ours.len(), torch.len());
    let largest = torch.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
    (ours.iter().zip(torch))
        .map(|(ours, torch)| (f64::from(*ours) - torch).abs() / largest)
        .fold(0.0, f64::max)
}

/// Forward, loss, backward; returns the loss and its gradient.
fn pass(network: &mut Network, tape: &mut Tape, batch: &Batch) -> (f64, Matrix) {
    let dropped = Dropped { seed: 0, step: 0 };
    network
        .forward(tape, &batch.inputs, dropped, &OneThread)
        .unwrap();
    let mut gradient = Matrix::default();
    let loss = Loss::CrossEntropy
        .evaluate(tape.outputs().unwrap(), batch, &mut gradient)
        .unwrap();
    network.backward(tape, &gradient, &OneThread).unwrap();
    (loss, gradient)
}

// About a dozen successive roundings of 6e-8.
const TOLERANCE: f64 = 1e-6;

#[test]
fn forward_loss_and_gradients() {
    let golden = golden();
    let batch = batch(&golden);
    let mut network = network();
    let evaluated = network.evaluate(&batch.inputs, &OneThread).unwrap();
    let mut tape = Tape::default();
    let (loss, output_gradient) = pass(&mut network, &mut tape, &batch);
    assert!((loss / golden.loss - 1.0).abs() < TOLERANCE);
    for (ours, torch) in [
        (&evaluated, &golden.evaluated),
        (tape.outputs().unwrap(), &golden.outputs),
        (&output_gradient, &golden.output_gradient),
    ] {
        let error = deviation(ours.values(), torch);
        assert!(error < TOLERANCE, "{error}");
    }
    let names = (network.arrays()).filter(|(name, _)| !name.contains("running"));
    for (gradient, (name, _)) in tape.gradients().iter().zip(names) {
        let torch = &golden.gradients[&name];
        if name == "0.bias" {
            // Zero to rounding, because the normalisation removes the bias.
            assert!(torch.iter().all(|x| x.abs() < 1e-15));
            assert!(gradient.values().iter().all(|x| x.abs() < 1e-7));
        } else {
            let error = deviation(gradient.values(), torch);
            assert!(error < TOLERANCE, "{name} {error}");
        }
    }
    for (name, matrix) in network.arrays() {
        let error = deviation(matrix.values(), &golden.after_forward[&name]);
        assert!(error < TOLERANCE, "{name} {error}");
    }
}

fn after_three_steps(method: OptimizerMethod, rate: f64) -> Network {
    let batch = batch(&golden());
    let mut network = network();
    let mut optimizer = Optimizer::new(method, &network).unwrap();
    let mut tape = Tape::default();
    for _ in 0..3 {
        pass(&mut network, &mut tape, &batch);
        optimizer
            .step(&mut network, &tape, rate, &OneThread)
            .unwrap();
    }
    network
}

#[test]
fn three_steps_of_sgd() {
    let method = OptimizerMethod::Sgd {
        momentum: 0.9,
        decay: 0.01,
    };
    for (name, matrix) in after_three_steps(method, 0.1).arrays() {
        let error = deviation(matrix.values(), &golden().after_sgd[&name]);
        assert!(error < TOLERANCE, "{name} {error}");
    }
}

// Adam divides a gradient by its own size. The gradient of the first bias is zero to rounding, so this
// bias moves by steps of 0.01 in a direction set by rounding, and the running mean follows it.
#[test]
fn three_steps_of_adam() {
    let method = OptimizerMethod::Adam {
        b1: 0.9,
        b2: 0.999,
        decay: 0.1,
    };
    for (name, matrix) in after_three_steps(method, 0.01).arrays() {
        let torch = &golden().after_adam[&name];
        if ["0.bias", "1.running_mean"].contains(&name.as_str()) {
            for (ours, torch) in matrix.values().iter().zip(torch) {
                assert!((f64::from(*ours) - torch).abs() < 0.031);
            }
            continue;
        }
        let error = deviation(matrix.values(), torch);
        // Adam divides a gradient near zero by its size, too.
        assert!(error < 1e-5, "{name} {error}");
    }
}

// `torch.distributions.MultivariateNormal` of a precision matrix.
#[test]
fn densities() {
    let density = golden().gaussian;
    let loss = Loss::Gaussian { dimension: 3 };
    let columns = loss.outputs().unwrap();
    let outputs = Matrix::from_rows(6, columns, density.outputs).unwrap();
    let batch = Batch {
        inputs: Matrix::zeros(6, 1),
        values: Matrix::from_rows(6, 3, density.values).unwrap(),
        ..Batch::default()
    };
    let mut gradient = Matrix::default();
    let value = loss.evaluate(&outputs, &batch, &mut gradient).unwrap();
    // All in f64, except for the gradient that is returned.
    assert!((value / density.loss - 1.0).abs() < 1e-13, "{value}");
    let error = deviation(gradient.values(), &density.gradient);
    assert!(error < 1e-7, "{error}");
}
