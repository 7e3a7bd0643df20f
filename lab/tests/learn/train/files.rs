//! Weights into files and out of them; batch normalisation folded away.

use std::ops::ControlFlow;

use onecycle_lab::learn::train::{
    Batch, Dropped, Layer, Loss, Network, OptimizerMethod, Schedule, Tape, TensorFile, Trainer,
    TrainingSettings,
};
use onecycle_lab::workers::OneThread;

use super::{dense, network, random};

/// A network whose normalisation has seen batches, in three places: after a dense layer, before
/// one, and with none on either side.
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

#[test]
fn weights_come_back() {
    let network = seasoned();
    let mut other = Network::zeros(4, &network.layers()).unwrap();
    other.load(&network.save()).unwrap();
    assert_eq!(other, network);
    let names: Vec<_> = network
        .tensors()
        .into_iter()
        .map(|t| (t.name, t.shape))
        .collect();
    assert_eq!(names[0], ("0.weight".to_owned(), vec![6, 4]));
    assert_eq!(names[1], ("0.bias".to_owned(), vec![6]));
    assert_eq!(names[5], ("1.running_var".to_owned(), vec![6]));
}

#[test]
fn files_of_other_networks_are_refused() {
    let network = seasoned();
    type Spoil = fn(&mut TensorFile);
    let cases: [(Spoil, &str); 5] = [
        (|f| drop(f.tensors.remove(1)), "tensor 0.bias is missing"),
        (
            |f| f.tensors[1].name = "0.bias2".to_owned(),
            "tensor 0.bias is missing",
        ),
        (
            |f| f.tensors[0].shape = vec![4, 6],
            "tensor 0.weight must have shape [6, 4], but has [4, 6]",
        ),
        (
            |f| f.tensors[5].values[0] = -1.0,
            "tensor 1.running_var holds -1.0",
        ),
        (
            |f| {
                let mut more = f.tensors[1].clone();
                more.name = "9.bias".to_owned();
                f.tensors.push(more);
            },
            "tensor 9.bias belongs to another network",
        ),
    ];
    for (spoil, sentence) in cases {
        let mut file = TensorFile {
            tensors: network.tensors(),
            ..TensorFile::default()
        };
        spoil(&mut file);
        let mut loaded = network.clone();
        let error = loaded.load(&file.to_bytes()).unwrap_err();
        assert_eq!(error.to_string(), sentence);
        assert_eq!(loaded, network);
    }
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

    type Spoil = fn(&mut TensorFile);
    let cases: [(Spoil, &str); 5] = [
        (|f| f.metadata.clear(), "the file is not one of a training"),
        (|f| drop(f.tensors.pop()), "tensor second.1 is missing"),
        (
            |f| replace(f, "\"outputs\":3", "\"outputs\":300000000"),
            "its layers have 900000000 numbers, but it holds 36",
        ),
        (
            |f| replace(f, "\"number\":1", "\"number\":2"),
            "not numbered",
        ),
        (
            |f| replace(f, "\"batch\":4", "\"batch\":0"),
            "batch must be",
        ),
    ];
    for (spoil, sentence) in cases {
        let mut file = TensorFile::from_bytes(&bytes).unwrap();
        spoil(&mut file);
        let error = Trainer::resume(&file.to_bytes()).unwrap_err().to_string();
        assert!(error.contains(sentence), "{error}");
    }
}

fn replace(file: &mut TensorFile, from: &str, to: &str) {
    for value in file.metadata.values_mut() {
        assert!(value.contains(from), "{value}");
        *value = value.replace(from, to);
    }
}
