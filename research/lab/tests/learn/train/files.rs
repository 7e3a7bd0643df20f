//! Numbers of networks and trainings, saved and restored; batch normalisation folded into dense layers.

use std::ops::ControlFlow;

use onecycle_lab::learn::train::{
    Batch, Dropped, Layer, Loss, Network, OptimizerMethod, Schedule, Tape, Trainer,
    TrainingSettings,
};
use onecycle_lab::workers::OneThread;

use super::{dense, network, random};

/// A network with trained batch normalisation in three places: after a dense layer, before a dense
/// layer, and next to none.
fn seasoned() -> Network {
    let layers = [
        dense(6),
        Layer::BatchNorm,
        Layer::Relu,
        Layer::BatchNorm,
        Layer::Dropout { probability: 0.5 },
        dense(5),
        Layer::Tanh,
        Layer::BatchNorm,
    ];
    let mut network = network(4, &layers, 1);
    let mut tape = Tape::default();
    for step in 0..20 {
        let inputs = random(32, 4, step);
        network
            .forward(&mut tape, &inputs, Dropped { seed: 1, step }, &OneThread)
            .unwrap();
    }
    network
}

#[test]
fn folded_network_is_the_same_function() {
    let network = seasoned();
    let folded = network.folded();
    assert_eq!(
        folded.layers(),
        [
            dense(6),
            Layer::Relu,
            dense(5),
            Layer::Tanh,
            Layer::BatchNorm
        ]
    );
    let inputs = random(50, 4, 99);
    let expected = network.evaluate(&inputs, &OneThread).unwrap();
    let found = folded.evaluate(&inputs, &OneThread).unwrap();
    let largest = (expected.values().iter()).fold(0.0_f32, |max, x| max.max(x.abs()));
    for (found, expected) in found.values().iter().zip(expected.values()) {
        assert!((found - expected).abs() < 1e-6 * largest.max(1.0));
    }
}

// Numbers are written and read in the order of the arrays, whose names are those of PyTorch.
#[test]
fn numbers_come_back() {
    let network = seasoned();
    let other = Network::zeros(4, &network.layers()).unwrap();
    assert_eq!(other.with_numbers(&network.numbers()), Ok(network.clone()));
    let arrays: Vec<_> = (network.arrays())
        .map(|(name, matrix)| (name, matrix.rows(), matrix.columns()))
        .collect();
    assert_eq!(arrays[0], ("0.weight".to_owned(), 6, 4));
    assert_eq!(arrays[1], ("0.bias".to_owned(), 1, 6));
    assert_eq!(arrays[5], ("1.running_var".to_owned(), 1, 6));
}

// 6 x 4 weights, 6 biases and three rows of six come before the first variance.
#[test]
fn numbers_of_other_networks_are_refused() {
    let network = seasoned();
    let numbers = network.numbers();
    let refused = |numbers: &[f32]| {
        let error = network.clone().with_numbers(numbers).unwrap_err();
        error.to_string()
    };
    let count = numbers.len();
    assert_eq!(
        refused(&numbers[1..]),
        format!("the count of numbers must be {count}, but is {}", count - 1)
    );
    let mut negative = numbers.clone();
    negative[24 + 6 + 3 * 6] = -1.0;
    assert_eq!(
        refused(&negative),
        "layer 1 of the network: running_var must not hold -1.0"
    );
    let mut infinite = numbers;
    infinite[24] = f32::INFINITY;
    assert_eq!(
        refused(&infinite),
        "layer 0 of the network: bias must not hold inf"
    );
}

#[test]
fn checkpoints_are_checked() {
    let settings = TrainingSettings {
        loss: Loss::CrossEntropy,
        method: OptimizerMethod::ADAM,
        schedule: Schedule::constant(0.01),
        batch: 4,
        epochs: 1,
        patience: None,
        seed: 1,
    };
    let mut trainer = Trainer::new(settings, network(2, &[dense(3)], 1)).unwrap();
    let data = Batch {
        inputs: random(8, 2, 1),
        classes: vec![0, 1, 2, 0, 1, 2, 0, 1],
        ..Batch::default()
    };
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    trainer.run(&data, &data, &OneThread, go_on).unwrap();
    let bytes = trainer.save().unwrap();
    assert_eq!(Trainer::resume(&bytes), Ok(trainer.clone()));

    let replaced = |from: &str, to: &str| {
        let end = bytes.iter().position(|&byte| byte == b'\n').unwrap();
        let head = std::str::from_utf8(&bytes[..end]).unwrap();
        assert!(head.contains(from), "{head}");
        [head.replace(from, to).as_bytes(), &bytes[end..]].concat()
    };
    // The file holds two networks and two moments, each of 3 x 2 weights and 3 biases.
    let mut negative = bytes.clone();
    let last = negative.len() - 1;
    negative[last] |= 0x80;
    for (bytes, sentence) in [
        (b"no training".to_vec(), "the file is not a saved training"),
        (b"{}\n".to_vec(), "missing field"),
        (replaced("training/2", "training/3"), "another format"),
        (bytes[..bytes.len() - 4].to_vec(), "it is cut off"),
        (bytes[..bytes.len() - 1].to_vec(), "but it holds 35"),
        (
            [&bytes[..], &[0; 4]].concat(),
            "bytes follow its last number",
        ),
        (
            replaced("\"outputs\":3", "\"outputs\":300000000"),
            "its layers have 900000000 numbers, but it holds 36",
        ),
        (replaced("\"number\":1", "\"number\":2"), "not numbered"),
        (replaced("\"batch\":4", "\"batch\":0"), "batch must be"),
        (negative, "a moment of the optimizer is -"),
    ] {
        let error = Trainer::resume(&bytes).unwrap_err().to_string();
        assert!(error.contains(sentence), "{error}");
    }
}
