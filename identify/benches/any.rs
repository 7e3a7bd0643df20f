//! Time of the likelihood, the choice of the structure included: 20 s at 1 kHz, and 30 min at 400 Hz.

use divan::Bencher;
use onecycle_design::{Linear, Structure};
use onecycle_identify::{Identification, Options, Signals, identify};
use onecycle_onboard::{Relay, RelaySettings};
use onecycle_plant::{
    Controller, Disturbances, Experiment, Noise, Sensor, Stimulus, TestSignal, TestSignalError,
    Trace,
};

fn main() {
    divan::main();
}

/// Recording of an integrator with two lags in wind.
fn recorded(sample_s: f64, duration_s: f64, controller: &mut impl Controller) -> Trace {
    let process = Linear::new(Structure::Soiptd)
        .with_gain(40.0)
        .with_lags_s([0.05, 1.0])
        .with_pole_per_s(1.0)
        .with_tau_s(0.015);
    Experiment::new(process, sample_s, duration_s)
        .with_sensor(Sensor::noisy(0.02))
        .with_disturbances(Disturbances::default().with_input_walk(0.01))
        .run(controller, &mut Noise::from_seed(1))
}

/// Recording with a test signal of amplitude 0.2 from 0.1 s on.
fn tested(sample_s: f64, duration_s: f64, signal: Result<TestSignal, TestSignalError>) -> Trace {
    let signal = signal.expect("valid settings");
    recorded(sample_s, duration_s, &mut Stimulus::new(signal, 0.1))
}

fn identified(trace: &Trace, sample_period_s: f64) -> Identification {
    let signals = Signals {
        time_s: &trace.time_s,
        input: &trace.input,
        output: &trace.output,
        samples_per_point: 1,
        sample_period_s,
        breaks: &[],
    };
    identify(&signals, &Options::default())
}

#[divan::bench(args = ["chirp", "relay", "3-2-1-1", "multisine"], sample_count = 10, sample_size = 1)]
fn of_20_s_at_1_khz(bencher: Bencher<'_, '_>, test: &str) {
    let trace = match test {
        "chirp" => tested(1e-3, 20.0, TestSignal::chirp(0.2, 0.1, 8.0, 19.9)),
        "3-2-1-1" => tested(1e-3, 20.0, TestSignal::three_two_one_one(0.2, 0.4)),
        "multisine" => tested(1e-3, 20.0, TestSignal::multisine(0.2, 0.1, 8.0, 12)),
        _ => {
            let settings = RelaySettings::new(0.2, -0.73);
            let mut relay = Relay::new(settings).expect("valid settings");
            recorded(1e-3, 20.0, &mut relay)
        }
    };
    bencher.bench_local(|| identified(&trace, 1e-3));
}

#[divan::bench(sample_count = 3, sample_size = 1)]
fn prbs_of_30_min_at_400_hz(bencher: Bencher<'_, '_>) {
    // The sequence has 65,535 bits of 0.05 s, and does not repeat.
    let trace = tested(2.5e-3, 1800.0, TestSignal::prbs(0.2, 0.05, 16));
    bencher.bench_local(|| identified(&trace, 2.5e-3));
}
