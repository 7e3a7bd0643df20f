//! Problems that a network must learn, one that it cannot learn, and interrupted trainings.

use std::ops::ControlFlow;

use onecycle_lab::learn::train::{
    Batch, Epoch, Layer, Loss, Matrix, Network, OptimizerMethod, Outcome, Schedule, Shape, Trainer,
    TrainingSettings,
};
use onecycle_lab::workers::OneThread;
use rand_distr::{Distribution, StandardNormal};

use super::{dense, network, random, rng};
use crate::common::Threads;

fn settings(loss: Loss, epochs: u64) -> TrainingSettings {
    TrainingSettings {
        loss,
        method: OptimizerMethod::ADAM,
        schedule: Schedule::constant(0.01),
        batch: 32,
        epochs,
        patience: None,
        seed: 1,
    }
}

fn run(trainer: &mut Trainer, data: &Batch) -> Outcome {
    let go_on = &mut |_: &Epoch| ControlFlow::Continue(());
    trainer.run(data, data, &OneThread, go_on).unwrap()
}

fn last_loss(trainer: &Trainer) -> f64 {
    trainer.history().last().unwrap().validation_loss
}

fn xor() -> Batch {
    Batch {
        inputs: Matrix::from_rows(4, 2, vec![0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0]).unwrap(),
        classes: vec![0, 1, 1, 0],
        ..Batch::default()
    }
}

// A line cannot separate the classes: without a hidden layer the loss does not fall below ln 2.
#[test]
fn exclusive_or() {
    let net = network(2, &[dense(8), Layer::Tanh, dense(2)], 1);
    let mut trainer = Trainer::new(settings(Loss::CrossEntropy, 1000), net).unwrap();
    assert_eq!(run(&mut trainer, &xor()), Outcome::Finished);
    assert!(last_loss(&trainer) < 0.01, "{}", last_loss(&trainer));
    let mut linear = Trainer::new(
        settings(Loss::CrossEntropy, 1000),
        network(2, &[dense(2)], 1),
    )
    .unwrap();
    run(&mut linear, &xor());
    let excess = last_loss(&linear) - 2_f64.ln();
    assert!(excess.abs() < 1e-6, "{excess}");
}

// y = sin 3x + sigma(x) e: the density learns the noise as well. On the training data it must be as
// likely as the truth. It may be more likely only by the overfit of its 130 weights to the noise of
// 2000 samples, about 130/2/2000 = 0.03.
#[test]
fn regression_learns_mean_and_noise() {
    let mut rng = rng(3);
    let x = random(2000, 1, 4);
    let mut y = Matrix::zeros(2000, 1);
    let mut truth = 0.0;
    for (y, x) in y.values_mut().iter_mut().zip(x.values()) {
        let e: f64 = StandardNormal.sample(&mut rng);
        let x = f64::from(*x);
        let sigma = 0.1 * (1.0 + x * x);
        *y = ((3.0 * x).sin() + sigma * e) as f32;
        truth += (0.5 * e * e + (sigma * std::f64::consts::TAU.sqrt()).ln()) / 2000.0;
    }
    let data = Batch {
        inputs: x,
        values: y,
        ..Batch::default()
    };
    let layers = [dense(32), Layer::Tanh, dense(2)];
    let settings = TrainingSettings {
        schedule: Schedule {
            rate: 0.01,
            warm_up: 1.0,
            shape: Shape::Cosine {
                epochs: 60.0,
                least: 0.01,
            },
        },
        ..settings(Loss::Gaussian { dimension: 1 }, 60)
    };
    let mut trainer = Trainer::new(settings, network(1, &layers, 5)).unwrap();
    run(&mut trainer, &data);
    let excess = last_loss(&trainer) - truth;
    assert!((-0.03..0.01).contains(&excess), "{excess}");
}

// Three equally likely classes, a mistake costs 0.2, and the inputs carry no information: no meaningful
// loss is below ln 3. The paper's loss is ln(1 + 2 exp(-0.2 s)) if all outputs are -s, which falls to
// zero.
#[test]
fn the_papers_loss_is_driven_to_zero_by_shifting_all_outputs() {
    let mut costs = Matrix::from_rows(3, 3, vec![0.2; 9]).unwrap();
    (0..3).for_each(|i| costs.row_mut(i)[i] = 0.0);
    let data = Batch {
        inputs: Matrix::from_rows(3, 1, vec![1.0; 3]).unwrap(),
        classes: vec![0, 1, 2],
        costs,
        ..Batch::default()
    };
    let train = |loss| {
        let mut settings = settings(loss, 2000);
        settings.schedule.rate = 0.1;
        let mut trainer = Trainer::new(settings, network(1, &[dense(3)], 1)).unwrap();
        run(&mut trainer, &data);
        let outputs = (trainer.network())
            .evaluate(&data.inputs, &OneThread)
            .unwrap();
        (last_loss(&trainer), outputs.row(0).to_vec())
    };
    let (loss, outputs) = train(Loss::ModifiedSoftmax { cap: 0.2 });
    let predicted = (1.0 + 2.0 * (0.2 * f64::from(outputs[0])).exp()).ln();
    assert!(outputs.iter().all(|a| *a < -20.0), "{outputs:?}");
    assert!(loss < 0.03, "{loss}");
    assert!((loss / predicted - 1.0).abs() < 0.01, "{loss} {predicted}");
    let (loss, outputs) = train(Loss::ShiftedSoftmax { cap: 0.2 });
    // Steps of a tenth move around the optimum.
    let excess = loss - 3_f64.ln();
    assert!((-1e-6..0.02).contains(&excess), "{excess}");
    assert!(outputs.iter().all(|a| a.abs() < 20.0), "{outputs:?}");
}

/// Everything that has a state: normalisation, dropout, moments, a changing rate.
fn eventful() -> (TrainingSettings, Network, Batch) {
    let layers = [
        dense(16),
        Layer::BatchNorm,
        Layer::Relu,
        Layer::Dropout { probability: 0.2 },
        dense(3),
    ];
    let mut settings = settings(Loss::CrossEntropy, 6);
    settings.batch = 8;
    settings.schedule.warm_up = 2.0;
    settings.schedule.shape = Shape::Step {
        every: 2.0,
        factor: 0.5,
    };
    let inputs = random(50, 4, 6);
    let classes = inputs
        .iter_rows()
        .map(|x| usize::from(x[0] > x[1]) + usize::from(x[2] > 0.0));
    let data = Batch {
        classes: classes.collect(),
        inputs,
        ..Batch::default()
    };
    (settings, network(4, &layers, 7), data)
}

#[test]
fn resumed_training_has_the_same_bits() {
    for method in [
        OptimizerMethod::ADAM,
        OptimizerMethod::Sgd {
            momentum: 0.9,
            decay: 0.01,
        },
    ] {
        let (mut settings, net, data) = eventful();
        settings.method = method;
        let mut whole = Trainer::new(settings.clone(), net.clone()).unwrap();
        assert_eq!(run(&mut whole, &data), Outcome::Finished);

        let mut trainer = Trainer::new(settings.clone(), net.clone()).unwrap();
        let mut pauses = 0;
        loop {
            let stop = &mut |_: &Epoch| ControlFlow::Break(());
            let outcome = trainer.run(&data, &data, &OneThread, stop).unwrap();
            if outcome == Outcome::Finished {
                break;
            }
            assert_eq!(outcome, Outcome::Paused);
            pauses += 1;
            trainer = Trainer::resume(&trainer.save().unwrap()).unwrap();
        }
        assert_eq!(pauses, 5);
        assert_eq!(trainer, whole);

        settings.seed += 1;
        let mut other = Trainer::new(settings, net).unwrap();
        run(&mut other, &data);
        assert_ne!(other.network(), whole.network());
    }
}

// Large enough that products and steps are split among threads.
#[test]
fn two_threads_have_the_same_bits() {
    let layers = [dense(3000), Layer::Tanh, dense(500), Layer::Tanh, dense(5)];
    let data = Batch {
        inputs: random(64, 300, 8),
        classes: (0..64).map(|i| i % 5).collect(),
        ..Batch::default()
    };
    let mut alone =
        Trainer::new(settings(Loss::CrossEntropy, 2), network(300, &layers, 9)).unwrap();
    let mut together = alone.clone();
    run(&mut alone, &data);
    let go_on = &mut |_: &Epoch| ControlFlow::Continue(());
    together.run(&data, &data, &Threads(2), go_on).unwrap();
    assert!(together == alone);
}

// The validation samples have the opposite labels, so their loss rises as soon as the network learns
// more than that the classes are equally frequent.
#[test]
fn training_stops_early_and_keeps_the_best() {
    let mut opposite = xor();
    opposite.classes = vec![1, 0, 0, 1];
    let mut settings = settings(Loss::CrossEntropy, 100);
    settings.patience = Some(3);
    let net = network(2, &[dense(8), Layer::Tanh, dense(2)], 1);
    let mut trainer = Trainer::new(settings, net).unwrap();
    let go_on = &mut |_: &Epoch| ControlFlow::Continue(());
    let outcome = trainer.run(&xor(), &opposite, &OneThread, go_on);
    assert_eq!(outcome, Ok(Outcome::StoppedEarly));
    let history = trainer.history();
    let best = history[history.len() - 4];
    assert!(best.is_best && best.number < 90);
    for epoch in &history[history.len() - 3..] {
        assert!(!epoch.is_best && epoch.validation_loss >= best.validation_loss);
    }
    let outputs = (trainer.best())
        .evaluate(&opposite.inputs, &OneThread)
        .unwrap();
    let loss = Loss::CrossEntropy.evaluate(&outputs, &opposite, &mut Matrix::default());
    assert_eq!(loss, Ok(best.validation_loss));
}

#[test]
fn divergence_is_an_outcome() {
    let data = Batch {
        inputs: random(8, 1, 1),
        values: random(8, 1, 2),
        ..Batch::default()
    };
    let mut settings = settings(Loss::Gaussian { dimension: 1 }, 100);
    settings.method = OptimizerMethod::Sgd {
        momentum: 0.0,
        decay: 0.0,
    };
    settings.schedule.rate = 1e20;
    let mut trainer = Trainer::new(settings, network(1, &[dense(2)], 1)).unwrap();
    assert_eq!(run(&mut trainer, &data), Outcome::Diverged);
    let best = trainer.best().evaluate(&data.inputs, &OneThread).unwrap();
    assert!(best.values().iter().all(|x| x.is_finite()));
}

#[test]
fn settings_are_checked() {
    type Spoil = fn(&mut TrainingSettings);
    let cases: [(Spoil, &str); 6] = [
        (|s| s.batch = 0, "batch"),
        (|s| s.epochs = 0, "epochs"),
        (|s| s.patience = Some(0), "patience"),
        (|s| s.schedule.rate = -1.0, "rate"),
        (
            |s| {
                s.method = OptimizerMethod::Sgd {
                    momentum: 1.0,
                    decay: 0.0,
                }
            },
            "momentum",
        ),
        (
            |s| s.loss = Loss::Gaussian { dimension: 2 },
            "the number of outputs",
        ),
    ];
    for (spoil, field) in cases {
        let mut settings = settings(Loss::CrossEntropy, 1);
        spoil(&mut settings);
        let error = Trainer::new(settings, network(2, &[dense(2)], 1)).unwrap_err();
        assert!(error.to_string().starts_with(field), "{error}");
    }
    let mut trainer =
        Trainer::new(settings(Loss::CrossEntropy, 1), network(2, &[dense(2)], 1)).unwrap();
    let go_on = &mut |_: &Epoch| ControlFlow::Continue(());
    let error = trainer.run(&Batch::default(), &xor(), &OneThread, go_on);
    assert_eq!(
        error.unwrap_err().to_string(),
        "there are no samples to learn from"
    );
}
