//! Limit cycles of the bare relay against an independent prototype of the same loop.

use std::ops::ControlFlow;

use onecycle_design::Linear;
use onecycle_design::oscillation::{Oscillation, RelayTest};
use onecycle_onboard::cycle::{Cycle, CycleDetector};
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{Disturbances, Experiment, FixedStepLinear, Noise};

/// The last cycles of a run of the bare relay at 1 ms.
fn steady_cycles(process: &Soiptd, amplitude: f32, periods_s: f64) -> Vec<Cycle> {
    let settings = RelaySettings::bare(amplitude, RelaySettings::DISTINGUISHING_BETA);
    let mut relay = Relay::new(settings).unwrap();
    let mut detector = CycleDetector::new();
    let mut cycles = Vec::new();
    let experiment = Experiment::new(*process, 1e-3, 60.0 * periods_s);
    experiment.observe(&mut relay, &mut Noise::from_seed(0), |row| {
        cycles.extend(detector.push(row.time_s, row.input > 0.0, row.true_output));
        ControlFlow::Continue(())
    });
    cycles.split_off(cycles.len() - 20)
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

type Row = ((f64, f64, f64), f64, (f64, f64));

// h = 1, K = 1, beta = -0.73. Columns: T_prop, T_body, tau; steady period (s); amplitude with half a unit of its
// last digit, from a prototype in another language at the same 1 ms. Periods are whole numbers of samples in
// every cycle.
const TABLE: [Row; 5] = [
    ((0.3, 2.0, 0.1), 2.308, (0.0644, 5e-5)),
    ((0.3, 2.0, 0.0005), 1.496, (0.0221, 5e-5)),
    ((0.015, 0.2, 0.1), 0.576, (0.04731, 5e-6)),
    ((0.015, 0.2, 0.0005), 0.092, (0.00094, 5e-6)),
    ((0.0321, 1.6886, 0.0237), 0.420, (0.00297, 5e-6)),
];

#[test]
fn limit_cycles_match_the_prototype() {
    for ((t_prop, t_body, tau), period, (amplitude, digit)) in TABLE {
        let process = Soiptd::new(1.0, t_prop, t_body, tau).unwrap();
        let cycles = steady_cycles(&process, 1.0, period);
        let mean_period = mean(cycles.iter().map(|cycle| cycle.period_s));
        let mean_amplitude = mean(cycles.iter().map(|cycle| cycle.amplitude));
        assert!(
            (mean_period - period).abs() < 1e-9,
            "{mean_period} against {period}"
        );
        assert!(
            (mean_amplitude - amplitude).abs() < digit,
            "{mean_amplitude} against {amplitude}"
        );
        // Without a bias both halves are equal up to a sample.
        let duty = mean(cycles.iter().map(|cycle| cycle.duty));
        assert!((duty - 0.5).abs() * period <= 1e-3, "duty {duty}");
    }
}

// The loop has no scale of its own for input and output: twice the relay on half the gain gives the same output
// to the bit, because all factors are powers of two.
#[test]
fn amplitude_and_gain_trade_exactly() {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap();
    let half = process.with_gain_scaled(0.5).unwrap();
    assert_eq!(
        steady_cycles(&process, 1.0, 0.42),
        steady_cycles(&half, 2.0, 0.42)
    );
}

// The describing function is off by 5 to 30 % except for short lags and a long delay, so it only gives a scale.
// The simulated period exceeds it by the values of the prototype's table: 4.6, 6.0, -0.3, 10.4 and 7.2 %.
#[test]
fn describing_function_is_a_scale() {
    let excess = [0.046, 0.060, -0.003, 0.104, 0.072];
    for (((t_prop, t_body, tau), ..), excess) in TABLE.into_iter().zip(excess) {
        let process = Soiptd::new(1.0, t_prop, t_body, tau).unwrap();
        let (omega, _) = process.describing_function_oscillation(1.0, -0.73).unwrap();
        let predicted_s = std::f64::consts::TAU / omega;
        let cycles = steady_cycles(&process, 1.0, predicted_s);
        let period_s = mean(cycles.iter().map(|cycle| cycle.period_s));
        assert!(
            (period_s / predicted_s - 1.0 - excess).abs() < 1e-3,
            "{}",
            period_s / predicted_s
        );
    }
}

/// Period (s) and amplitude of the last cycle of a process from rest under a relay with these levels and hysteresis.
fn simulated(
    process: &Linear,
    levels: [f64; 2],
    hysteresis: f64,
    (step_s, steps): (f64, u32),
) -> (f64, f64) {
    let noise = &mut Noise::from_seed(0);
    let mut plant = FixedStepLinear::new(process, &Disturbances::default(), step_s, noise);
    let (mut is_high, mut rises_s) = (true, vec![0.0]);
    let (mut low, mut high, mut amplitude) = (0.0_f64, 0.0_f64, 0.0);
    for step in 0..steps {
        let output = plant.output();
        (low, high) = (low.min(output), high.max(output));
        if is_high && output >= hysteresis {
            is_high = false;
        } else if !is_high && output <= -hysteresis {
            is_high = true;
            rises_s.push(step_s * f64::from(step));
            amplitude = 0.5 * (high - low);
            (low, high) = (output, output);
        }
        plant.step(levels[usize::from(!is_high)], noise);
    }
    (
        rises_s[rises_s.len() - 1] - rises_s[rises_s.len() - 2],
        amplitude,
    )
}

// Members of the family of a relay test, simulated: period and amplitude are those of the test, to the step of the simulation
// (1/20000 of a period). The integrator is also loaded, so that the relay is high for 0.3 of the time.
#[test]
fn members_of_a_family_oscillate_as_the_test() {
    let (relay, amplitude, period_s) = (90.0, 3.28, 28.0);
    for hysteresis in [0.0, 1.2] {
        let test = RelayTest::new(relay, amplitude, period_s).with_hysteresis(hysteresis);
        let of =
            |test: RelayTest, lags_s| Oscillation::Relay(test).process(lags_s).unwrap().linear();
        let loaded = test.with_duty(0.3);
        let lags = [
            [3.0, 0.0],
            [15.0, 0.0],
            [15.0, 2.0],
            [5.0, 5.0],
            [40.0, 6.0],
        ];
        let cases = lags.map(|lags_s| (of(test, lags_s), 0.5));
        let integrator = (of(loaded, [f64::INFINITY, 0.0]), 0.3);
        for (process, duty) in cases.into_iter().chain([integrator]) {
            let levels = [2.0 * relay * (1.0 - duty), -2.0 * relay * duty];
            let steps = (period_s / 20_000.0, 800_000);
            let (period, reached) = simulated(&process, levels, hysteresis, steps);
            assert!(
                (period / period_s - 1.0).abs() < 3e-4,
                "{period} {process:?}"
            );
            assert!(
                (reached / amplitude - 1.0).abs() < 3e-4,
                "{reached} {process:?}"
            );
        }
    }
}
