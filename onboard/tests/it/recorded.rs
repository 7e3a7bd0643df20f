//! Relay tests recorded in PX4's simulator, identified again. The truth is the simulator's own model.

use onecycle_onboard::identification::{
    Analysis, Bench, Collector, Desk, TestSample, TuningResult,
};
use onecycle_onboard::pack::Pack;

const SAMPLE_S: f64 = 0.004;

/// Lag of the simulated motors (s).
const MOTOR_S: f64 = 0.05;

/// Results of the windows of this many cycles, and the number of windows.
fn identify(recording: &str, cycles: u8) -> (Vec<TuningResult>, usize) {
    let rows: Vec<[f64; 3]> = recording
        .lines()
        .skip(1)
        .map(|line| {
            let mut numbers = line.split(',').map(|number| number.parse().unwrap());
            std::array::from_fn(|_| numbers.next().unwrap())
        })
        .collect();
    let inputs = || rows.iter().map(|row| row[1]);
    let middle = 0.5 * (inputs().fold(f64::MAX, f64::min) + inputs().fold(f64::MIN, f64::max));
    let mut desk = Box::new(Desk::NEW);
    let mut bench = Box::new(Bench::NEW);
    let mut analysis = Analysis::new(Pack::embedded().unwrap());
    let mut collector = Collector::new(SAMPLE_S, cycles, 0.0);
    let (mut found, mut windows) = (Vec::new(), 0);
    for [time_s, input, output] in rows {
        let sample = TestSample {
            time_s,
            input,
            output,
            is_high: input > middle,
            undone: 0,
        };
        collector.observe(Some(&mut desk), &sample);
        while desk.is_ordered() {
            analysis.work(&mut desk, &mut bench, 1000);
        }
        if let Some(outcome) = desk.take_outcome() {
            windows += 1;
            found.extend(outcome);
        }
    }
    (found, windows)
}

fn holds(recording: &str, acceleration: f64) {
    let mut all = 0;
    for cycles in [2, 3] {
        let (found, windows) = identify(recording, cycles);
        assert!(
            windows > 0,
            "{cycles} cycles: the oscillation is not steady"
        );
        all += found.len();
        for found in found {
            let error = (found.process.k_over_t_body() / acceleration).ln();
            let allowed = 3.0 * found.deviations.ln_k_over_t_body;
            assert!(
                error.abs() < allowed.min(0.25),
                "{cycles} cycles: {error}, {allowed}"
            );
            let late_s = found.process.t_prop_s() + found.process.tau_s() - MOTOR_S;
            assert!(
                (-0.01..0.025).contains(&late_s),
                "{cycles} cycles: {late_s}"
            );
        }
    }
    assert!(all >= 1, "nothing identified");
}

// 4 motors of 5 N, arms of 0.2 m at 45 degrees, 0.025 kg m^2.
const ROLL: f64 = 4.0 * 5.0 * 0.2 * std::f64::consts::FRAC_1_SQRT_2 / 0.025;

#[test]
fn roll_in_flight() {
    holds(include_str!("../data/px4_roll.csv"), ROLL);
}

#[test]
fn pitch_in_flight() {
    holds(include_str!("../data/px4_pitch.csv"), ROLL);
}

// 4 motors of 0.1 N m, 0.03 kg m^2.
#[test]
fn yaw_in_flight() {
    holds(include_str!("../data/px4_yaw.csv"), 4.0 * 0.1 / 0.03);
}

// 4 motors of 5 N, 1 kg.
#[test]
fn altitude_in_flight() {
    holds(include_str!("../data/px4_altitude.csv"), 4.0 * 5.0);
}
