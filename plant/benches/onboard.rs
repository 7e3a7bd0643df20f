//! On-board code: a tick of the relay, a sample into cycle detector and window, a fit.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use onecycle_onboard::cycle::CycleDetector;
use onecycle_onboard::refine::refine;
use onecycle_onboard::window::Window;
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{Experiment, Noise, Sensor, Trace};

const SAMPLE_S: f64 = 1e-3;
/// One per cent of the amplitude of the hover process's limit cycle, 0.003.
const NOISE_SIGMA: f64 = 3e-5;

fn main() {
    divan::main();
}

fn relay() -> Relay {
    let settings = RelaySettings {
        noise_sigma: NOISE_SIGMA as f32,
        trim_gain: RelaySettings::TRIM_GAIN,
        ..RelaySettings::new(1.0, RelaySettings::DISTINGUISHING_BETA)
    };
    Relay::new(settings).expect("the settings are in range")
}

/// Ten seconds of the paper's hover process under the relay.
fn experiment() -> Trace {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).expect("the times are positive");
    let experiment = Experiment::new(process, SAMPLE_S, 10.0)
        .with_sensor(Sensor::noisy(NOISE_SIGMA))
        .with_input_bias(0.1);
    experiment.run(&mut relay(), &mut Noise::from_seed(1))
}

/// The last cycles of the experiment with two periods of input before them, and their period.
fn last_cycles<const BINS: usize>(trace: &Trace, cycles: usize) -> (Window<BINS, 64>, f64) {
    let mut detector = CycleDetector::new();
    let mut found = Vec::new();
    for row in 0..trace.len() {
        found.extend(detector.push(trace.time_s[row], trace.input[row] > 0.0, trace.output[row]));
    }
    let (first, last) = (found[found.len() - cycles], found[found.len() - 1]);
    let end_s = last.start_s + last.period_s;
    let period_s = (end_s - first.start_s) / cycles as f64;
    let mut window = Window::new(first.start_s, SAMPLE_S);
    for row in 0..trace.len() {
        let time_s = trace.time_s[row];
        if time_s < first.start_s - 2.0 * period_s || time_s > end_s - 0.5 * SAMPLE_S {
            continue;
        }
        window
            .push_input(time_s, trace.input[row])
            .expect("a relay makes few edges");
        window.push_output(time_s, trace.output[row]);
    }
    (window, period_s)
}

/// An item is a tick.
#[divan::bench]
fn relay_tick(bencher: Bencher) {
    let errors: Vec<f32> = experiment()
        .output
        .iter()
        .map(|output| -*output as f32)
        .collect();
    bencher
        .counter(ItemsCount::new(errors.len()))
        .bench_local(|| {
            let mut relay = relay();
            let mut sum = 0.0;
            for error in &errors {
                sum += relay.step(black_box(*error), SAMPLE_S as f32);
            }
            sum
        });
}

/// An item is a sample.
#[divan::bench]
fn cycles_and_window(bencher: Bencher) {
    let trace = experiment();
    bencher
        .counter(ItemsCount::new(trace.len()))
        .bench_local(|| {
            let mut detector = CycleDetector::new();
            let mut window = Window::<260, 64>::new(0.0, SAMPLE_S);
            let mut cycles = 0;
            for row in 0..trace.len() {
                let (time_s, output) = (trace.time_s[row], trace.output[row]);
                let cycle = detector.push(time_s, trace.input[row] > 0.0, output);
                cycles += usize::from(cycle.is_some());
                window.push_output(time_s, output);
            }
            (cycles, black_box(window.noise_sigma()))
        });
}

#[divan::bench(args = [1, 2, 4])]
fn refine_255_bins(bencher: Bencher, cycles: usize) {
    let (window, period_s) = last_cycles::<260>(&experiment(), cycles);
    bencher.bench_local(|| refine(black_box(&window), period_s));
}

#[divan::bench(args = [1, 2, 4])]
fn refine_127_bins(bencher: Bencher, cycles: usize) {
    let (window, period_s) = last_cycles::<132>(&experiment(), cycles);
    bencher.bench_local(|| refine(black_box(&window), period_s));
}
