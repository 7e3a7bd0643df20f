//! Examples to learn from: always the same ones, of the processes they say, and learnable.

// Helpers of tests are tests too, which the lint does not see.
#![allow(clippy::unwrap_used)]

use std::ops::ControlFlow;

use onecycle_lab::dataset::{Example, Recipe, VALUES, process_of};
use onecycle_lab::train::{
    Batch, Gaussian, Layer, Loss, Matrix, Method, Network, OneThread, Schedule, Settings, Shape,
    Trainer,
};
use onecycle_lab::{Space, deterioration, pd_at_phase_margin};
use onecycle_onboard::signature::LENGTH;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

fn examples(recipe: &Recipe, numbers: std::ops::Range<u64>) -> Vec<Example> {
    numbers.filter_map(|n| recipe.example(n).unwrap()).collect()
}

// 0.4 % of the paper's multirotors are not steady after 14 periods: of 400 at most 6 are missing, and the
// rest have duties near one half, for the trim has followed the bias.
#[test]
fn nearly_every_experiment_is_an_example() {
    let recipe = Recipe::default();
    let made = examples(&recipe, 0..400);
    assert!(made.len() >= 394, "{}", made.len());
    for example in &made {
        let duty = example.signature.values[LENGTH - 2];
        assert!((0.4..0.6).contains(&duty), "{duty}");
        assert_eq!(example.signature.sign, 1.0);
    }
    assert_eq!(examples(&recipe, 17..19), made[17..19]);
    let later = Recipe { seed: 18, ..recipe };
    assert_eq!(later.example(0), recipe.example(17));
}

// The values are the process: back from them its parameters agree to rounding.
#[test]
fn values_are_the_process() {
    for example in examples(&Recipe::default(), 0..50) {
        let back = process_of(example.values(), &example.signature, example.period_s).unwrap();
        let truth = example.process;
        for (a, b) in [
            (back.tau_s(), truth.tau_s()),
            (back.pole_sum().0, truth.pole_sum().0),
            (back.pole_sum().1, truth.pole_sum().1),
            (back.k_over_t_body(), truth.k_over_t_body()),
        ] {
            assert!((a / b - 1.0).abs() < 1e-12, "{back:?} {truth:?}");
        }
    }
}

// A space a thousand times as slow gives the same examples, but for a switch that rounding moves to the
// next sample: 0.013 of the shortest of these periods, twice that of the amplitude.
#[test]
fn time_scale_plays_no_part() {
    let scaled = |(low, high): (f64, f64)| (1000.0 * low, 1000.0 * high);
    let fast = Recipe::default();
    let slow = Recipe {
        space: Space {
            t_prop_s: scaled(fast.space.t_prop_s),
            t_body_s: scaled(fast.space.t_body_s),
            tau_s: scaled(fast.space.tau_s),
            ..fast.space
        },
        sigma: 0.0,
        ..fast
    };
    let fast = Recipe { sigma: 0.0, ..fast };
    for (a, b) in examples(&fast, 0..20).iter().zip(examples(&slow, 0..20)) {
        assert!((b.period_s / a.period_s / 1e3 - 1.0).abs() < 0.015);
        for (x, y) in a.values().iter().zip(b.values()) {
            assert!((x - y).abs() < 0.03, "{:?} {:?}", a.values(), b.values());
        }
    }
}

#[test]
fn errors_name_the_field() {
    type Spoil = fn(&mut Recipe);
    let spoilt: [(Spoil, &str); 5] = [
        (|r| r.bias = 1.0, "bias"),
        (|r| r.sigma = -0.1, "sigma"),
        (|r| r.samples_per_period.0 = 10.0, "samples_per_period"),
        (
            |r| r.samples_per_period = (500.0, 100.0),
            "samples_per_period",
        ),
        (|r| r.space.beta = 2.0, "beta"),
    ];
    for (spoil, field) in spoilt {
        let mut recipe = Recipe::default();
        spoil(&mut recipe);
        assert_eq!(recipe.validate().unwrap_err().field, field);
        assert!(recipe.example(0).is_err());
    }
}

/// Puts numbers of the order of one where values are: ratio and delay are at most 1/4 and 1/8.
const SCALE: [f64; VALUES] = [1.0, 8.0, 8.0, 1.0];

fn batch(examples: &[Example]) -> Batch {
    let mut batch = Batch {
        inputs: Matrix::zeros(examples.len(), LENGTH),
        values: Matrix::zeros(examples.len(), VALUES),
        ..Batch::default()
    };
    for (row, example) in examples.iter().enumerate() {
        let inputs = batch.inputs.row_mut(row);
        inputs.copy_from_slice(&example.signature.values);
        // ln(samples per period), 4.5 to 7.7.
        inputs[LENGTH - 1] = (inputs[LENGTH - 1] - 6.0) / 2.0;
        let values = example.values();
        for (k, value) in batch.values.row_mut(row).iter_mut().enumerate() {
            *value = (SCALE[k] * values[k]) as f32;
        }
    }
    batch
}

// From 4,000 experiments 2,638 weights learn enough in seconds that the controller of the mean of their
// density costs 0.9 % more than the optimum (median of 100 other processes, one cycle each), at worst 7 %.
#[test]
fn a_small_network_learns_controllers() {
    let recipe = Recipe::default();
    let training = batch(&examples(&recipe, 0..4000));
    let unseen = examples(&recipe, 1_000_000..1_000_100);
    let validation = batch(&unseen);
    let layers = [
        Layer::Dense { outputs: 32 },
        Layer::Tanh,
        Layer::Dense { outputs: 32 },
        Layer::Tanh,
        Layer::Dense {
            outputs: Gaussian::outputs(VALUES),
        },
    ];
    let network = Network::new(LENGTH, &layers, &mut Pcg64Mcg::seed_from_u64(1)).unwrap();
    assert_eq!(network.weights(), 2638);
    let settings = Settings {
        loss: Loss::Gaussian { dimension: VALUES },
        method: Method::Adam {
            b1: 0.9,
            b2: 0.999,
            decay: 0.0,
        },
        schedule: Schedule {
            rate: 4e-3,
            warm_up: 0.5,
            shape: Shape::Cosine {
                epochs: 60.0,
                least: 0.01,
            },
        },
        batch: 64,
        epochs: 60,
        patience: None,
        seed: 1,
    };
    let mut trainer = Trainer::new(settings, network).unwrap();
    trainer
        .run(&training, &validation, &OneThread, &mut |_| {
            ControlFlow::Continue(())
        })
        .unwrap();
    let outputs = trainer
        .best()
        .evaluate(&validation.inputs, &OneThread)
        .unwrap();
    let margin = 20_f64.to_radians();
    let mut costs: Vec<f64> = unseen
        .iter()
        .enumerate()
        .map(|(row, example)| {
            let density = Gaussian::from_outputs(VALUES, outputs.row(row)).unwrap();
            let values = std::array::from_fn(|k| density.mean[k] / SCALE[k]);
            let found = process_of(values, &example.signature, example.period_s).unwrap();
            let made = pd_at_phase_margin(&found, margin).unwrap();
            let best = pd_at_phase_margin(&example.process, margin).unwrap();
            deterioration(made.pd, &example.process, &best)
                .relative()
                .map_or(f64::INFINITY, f64::abs)
        })
        .collect();
    costs.sort_by(f64::total_cmp);
    assert!(costs[50] < 0.015, "median {}", costs[50]);
    assert!(costs[costs.len() - 1] < 0.15, "{costs:?}");
}
