//! Relay tests recorded in PX4's and ArduPilot's simulators, identified again. The truth is the simulator's own model.

use onecycle_onboard::identification::{
    Analysis, Bench, Collector, Desk, TestSample, TuningResult,
};
use onecycle_onboard::pack::Pack;

/// A recorded flight and the truth about it.
struct Flight {
    recording: &'static str,
    sample_s: f64,
    /// Acceleration of a full input (output unit per s^2), and its relative error.
    acceleration: f64,
    acceleration_error: f64,
    /// Lags and delays that are known: motors, filters (s).
    late_s: f64,
    /// Cycles of a window, each in turn.
    cycles: [u8; 2],
}

/// Results of the windows of this many cycles, and the number of windows.
fn identify(flight: &Flight, cycles: u8) -> (Vec<TuningResult>, usize) {
    let rows: Vec<[f64; 3]> = flight
        .recording
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
    let mut collector = Collector::new(flight.sample_s, cycles, 0.0);
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

fn holds(flight: &Flight) {
    let mut all = 0;
    for cycles in flight.cycles {
        let (found, windows) = identify(flight, cycles);
        assert!(
            windows > 0,
            "{cycles} cycles: the oscillation is not steady"
        );
        all += found.len();
        for found in found {
            let error = (found.process.k_over_t_body() / flight.acceleration).ln();
            let allowed = 3.0 * found.deviations.ln_k_over_t_body + flight.acceleration_error;
            assert!(
                error.abs() < allowed.min(0.25),
                "{cycles} cycles: {error}, {allowed}"
            );
            let late_s = found.process.t_prop_s() + found.process.tau_s() - flight.late_s;
            assert!(
                (-0.01..0.025).contains(&late_s),
                "{cycles} cycles: {late_s}"
            );
        }
    }
    assert!(all >= 1, "nothing identified");
}

/// A flight in PX4's simulator, whose motors have a lag of 50 ms.
fn in_px4(recording: &'static str, acceleration: f64) -> Flight {
    Flight {
        recording,
        sample_s: 0.004,
        acceleration,
        acceleration_error: 0.0,
        late_s: 0.05,
        cycles: [2, 3],
    }
}

// 4 motors of 5 N, arms of 0.2 m at 45 degrees, 0.025 kg m^2.
const ROLL: f64 = 4.0 * 5.0 * 0.2 * std::f64::consts::FRAC_1_SQRT_2 / 0.025;

#[test]
fn roll_in_flight() {
    holds(&in_px4(include_str!("../data/px4_roll.csv"), ROLL));
}

// A wind of 5 m/s with gusts of 1.5 m/s. The test ended before three cycles were steady.
#[test]
fn roll_in_wind() {
    holds(&Flight {
        cycles: [1, 2],
        ..in_px4(include_str!("../data/px4_roll_wind.csv"), ROLL)
    });
}

#[test]
fn pitch_in_flight() {
    holds(&in_px4(include_str!("../data/px4_pitch.csv"), ROLL));
}

// 4 motors of 0.1 N m, 0.03 kg m^2.
#[test]
fn yaw_in_flight() {
    holds(&in_px4(
        include_str!("../data/px4_yaw.csv"),
        4.0 * 0.1 / 0.03,
    ));
}

// 4 motors of 5 N, 1 kg.
#[test]
fn altitude_in_flight() {
    holds(&in_px4(include_str!("../data/px4_altitude.csv"), 4.0 * 5.0));
}

/// A flight in ArduPilot's simulator, whose motors have no lag. The angle is delayed like the gyro behind its filter of 20 Hz,
/// `sqrt(2)/(2 pi 20 Hz)`; `filter_s` is the lag of the rate loop's own filter.
fn in_ardupilot(recording: &'static str, acceleration: f64, filter_s: f64) -> Flight {
    Flight {
        recording,
        sample_s: 0.0025,
        acceleration,
        // The voltage of the battery is not constant.
        acceleration_error: 0.02,
        late_s: 0.01125 + filter_s,
        cycles: [2, 3],
    }
}

// In hover, 3 kg at 36.3 % of the thrust: 20.3 N from a full motor. A full input moves two of them by half, on arms of 0.35 m;
// 3 kg 0.25 (0.175 m)^2.
const PLUS: f64 = 2.0 * 0.5 * (3.0 * 9.81 / 4.0 / 0.363) * 0.35 / (3.0 * 0.25 * 0.175 * 0.175);

#[test]
fn ardupilot_roll_in_flight() {
    holds(&in_ardupilot(
        include_str!("../data/ardupilot_roll.csv"),
        PLUS,
        0.0,
    ));
}

#[test]
fn ardupilot_pitch_in_flight() {
    holds(&in_ardupilot(
        include_str!("../data/ardupilot_pitch.csv"),
        PLUS,
        0.0,
    ));
}

// The torque of a motor is 0.0175 m times thrust times command c, the thrust 20.3 N (0.35 c + 0.65 c^2): at c = 0.525 in hover, 0.31 N m
// for a full change of the thrust. A full input changes four motors by half; 3 kg 0.5 (0.175 m)^2. ATC_RAT_YAW_FLTE is 2.5 Hz.
#[test]
fn ardupilot_yaw_in_flight() {
    let inertia = 3.0 * 0.5 * 0.175 * 0.175;
    holds(&in_ardupilot(
        include_str!("../data/ardupilot_yaw.csv"),
        4.0 * 0.5 * 0.311 / inertia,
        1.0 / (2.0 * std::f64::consts::PI * 2.5),
    ));
}

// A relay of 0.006 instead of 0.15, in gusts: nothing may be found.
#[test]
fn ardupilot_roll_in_gusts_is_refused() {
    let flight = in_ardupilot(include_str!("../data/ardupilot_roll_gusts.csv"), PLUS, 0.0);
    let (found, windows) = identify(&flight, 1);
    assert!(
        windows > 0 && found.is_empty(),
        "{windows} windows: {found:?}"
    );
}
