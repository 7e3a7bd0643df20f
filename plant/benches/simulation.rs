//! Steps per second of the process alone and of the whole relay experiment.

use std::ops::ControlFlow;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{Experiment, FixedStepProcess, Noise, Sensor, VariableStepProcess};

const STEPS: usize = 1_000_000;
const SAMPLE_S: f64 = 1e-3;
/// One per cent of the amplitude of the hover process's limit cycle, 0.003.
const NOISE_SIGMA: f64 = 3e-5;

fn main() {
    divan::main();
}

/// The paper's hover process.
fn hover() -> Soiptd {
    Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).expect("the times are positive")
}

fn relay() -> Relay {
    let settings = RelaySettings {
        noise_sigma: NOISE_SIGMA as f32,
        trim_gain: RelaySettings::TRIM_GAIN,
        ..RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA)
    };
    Relay::new(settings).expect("the settings are in range")
}

#[divan::bench]
fn fixed_step_process(bencher: Bencher) {
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        let mut process = FixedStepProcess::new(&hover(), SAMPLE_S);
        for step in 0..STEPS {
            process.step(if step & 128 == 0 { 1.0 } else { -1.0 });
        }
        black_box(process.output())
    });
}

#[divan::bench]
fn variable_step_process(bencher: Bencher) {
    const FEWER: usize = STEPS / 50;
    bencher.counter(ItemsCount::new(FEWER)).bench_local(|| {
        let mut process = VariableStepProcess::new(&hover());
        for step in 0..FEWER {
            process.advance(
                if step & 128 == 0 { 1.0 } else { -1.0 },
                black_box(SAMPLE_S),
            );
        }
        black_box(process.output())
    });
}

/// Relay, process, observer; with and without noise.
#[divan::bench(args = [0.0, NOISE_SIGMA])]
fn relay_experiment(bencher: Bencher, noise_sigma: f64) {
    let experiment = Experiment::new(hover(), SAMPLE_S, STEPS as f64 * SAMPLE_S)
        .with_sensor(Sensor::noisy(noise_sigma));
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        let mut sum = 0.0;
        experiment.observe(&mut relay(), &mut Noise::from_seed(1), |row| {
            sum += row.input * row.true_output;
            ControlFlow::Continue(())
        });
        black_box(sum)
    });
}
