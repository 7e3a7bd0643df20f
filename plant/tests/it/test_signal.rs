//! Test signals, and where they enter a loop.

use onecycle_onboard::{Pd, Soiptd};
use onecycle_plant::test_signal::PRBS_ORDERS;
use onecycle_plant::{
    Controller, Entry, ExcitedLoop, Experiment, FilteredPd, Noise, SampledPd, Sensed, Sensor,
    Stimulus, TestSignal,
};

// A time just before each edge and the edge itself.
#[test]
fn pulses_by_hand() {
    let doublet = TestSignal::doublet(2.0, 0.3).unwrap();
    let times = [-0.1, 0.0, 0.29, 0.3, 0.59, 0.6, 9.0];
    let expected = [0.0, 2.0, 2.0, -2.0, -2.0, 0.0, 0.0];
    assert_eq!(times.map(|time_s| doublet.at(time_s)), expected);
    let multistep = TestSignal::three_two_one_one(1.0, 0.5).unwrap();
    let times = [0.0, 1.4, 1.5, 2.4, 2.5, 2.9, 3.0, 3.4, 3.5];
    let expected = [1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 0.0];
    assert_eq!(times.map(|time_s| multistep.at(time_s)), expected);
    let step = TestSignal::step(0.7).unwrap();
    assert_eq!(
        [-1e-9, 0.0, 1e6].map(|time_s| step.at(time_s)),
        [0.0, 0.7, 0.7]
    );
}

/// One period of a PRBS with bits of 1 s.
fn period(order: u32) -> Vec<f64> {
    let prbs = TestSignal::prbs(1.0, 1.0, order).unwrap();
    (0..(1_u32 << order) - 1)
        .map(|bit| prbs.at(f64::from(bit) + 0.5))
        .collect()
}

// A maximum-length sequence holds every word of `order` bits but one once in a period.
#[test]
fn a_prbs_has_the_longest_period() {
    for order in PRBS_ORDERS {
        let bits = period(order);
        let mut seen = vec![false; 1 << order];
        for start in 0..bits.len() {
            let word = (0..order as usize).fold(0, |word, k| {
                2 * word + usize::from(bits[(start + k) % bits.len()] > 0.0)
            });
            assert!(!seen[word], "order {order} repeats {word}");
            seen[word] = true;
        }
    }
}

// Its autocorrelation is -1 at every shift; it repeats after its period.
#[test]
fn a_prbs_is_white() {
    let bits = period(9);
    for shift in 1..bits.len() {
        let sum: f64 = (0..bits.len())
            .map(|k| bits[k] * bits[(k + shift) % bits.len()])
            .sum();
        assert_eq!(sum, -1.0, "{shift}");
    }
    let prbs = TestSignal::prbs(1.0, 0.1, 9).unwrap();
    assert_eq!(prbs.at(0.1), prbs.at(51.2));
    assert_ne!(prbs.at(0.85), prbs.at(0.95));
}

// From 1 Hz to e Hz in 1 s the phase is 2 pi (e^t - 1): 1/4, 1/2 and 3/4 of a turn at t = ln 1.25, ln 1.5 and ln 1.75.
#[test]
fn a_chirp_by_hand() {
    let chirp = TestSignal::chirp(2.0, 1.0, std::f64::consts::E, 1.0).unwrap();
    for (turns, value) in [(0.25, 2.0), (0.5, 0.0), (0.75, -2.0), (1.25, 2.0)] {
        assert!((chirp.at((1.0_f64 + turns).ln()) - value).abs() < 1e-9);
    }
    assert_eq!(chirp.at(1.0), 0.0);
}

// 1, 2 and 4 Hz over one second: the power of one sine, A^2 / 2.
#[test]
fn a_multisine_has_the_power_of_a_sine() {
    let multisine = TestSignal::multisine(3.0, 1.0, 4.0, 3).unwrap();
    let square = |k: u32| multisine.at(f64::from(k) / 64.0).powi(2);
    let power = (0..64).map(square).sum::<f64>() / 64.0;
    assert!((power - 4.5).abs() < 1e-9, "{power}");
}

#[test]
fn settings_out_of_range() {
    let refused = [
        (
            TestSignal::step(0.0),
            "the amplitude must be positive, but is 0",
        ),
        (
            TestSignal::doublet(1.0, -1.0),
            "the length of a pulse must be positive, but is -1",
        ),
        (
            TestSignal::prbs(1.0, 0.1, 21),
            "the order of the PRBS must be 3 to 20, but is 21",
        ),
        (
            TestSignal::chirp(1.0, 2.0, 2.0, 1.0),
            "the highest frequency must be above the lowest, but is 2",
        ),
        (
            TestSignal::chirp(1.0, f64::NAN, 2.0, 1.0),
            "the lowest frequency must be positive, but is NaN",
        ),
        (
            TestSignal::multisine(1.0, 1.0, 2.0, 1),
            "the number of sines must be at least 2, but is 1",
        ),
    ];
    for (signal, sentence) in refused {
        assert_eq!(signal.unwrap_err().to_string(), sentence);
    }
}

const REST: Sensed = Sensed {
    output: 0.0,
    rate: 0.0,
};

// Bits of 0.1 s from 0.1 s on at 1 kHz: the bit of sample 100 (n + 1) to 100 (n + 1) + 99 is bit n, after a million
// samples too.
#[test]
fn switching_times_stay_exact() {
    let prbs = TestSignal::prbs(1.0, 0.1, 14).unwrap();
    let mut stimulus = Stimulus::new(prbs.clone(), 0.1);
    for sample in 0..1_000_000_u32 {
        let value = stimulus.step(1e-3, 0.0, REST);
        let bit = f64::from(sample / 100) - 0.5;
        assert_eq!(value, prbs.at(0.1 * bit), "{sample}");
    }
}

fn roll() -> Soiptd {
    Soiptd::new(1.5, 0.03, 1.2, 0.0213).unwrap()
}

const GAINS: SampledPd = SampledPd(Pd { kp: 8.0, kd: 2.5 });

// A step of the set-point is the reference itself; the set-point of each row says so.
#[test]
fn a_step_of_the_setpoint_is_the_reference() {
    let experiment = Experiment::new(roll(), 1e-3, 1.0);
    let step = Stimulus::new(TestSignal::step(0.7).unwrap(), 0.0);
    let mut excited = ExcitedLoop::new(step, GAINS, Entry::Setpoint);
    let stepped = experiment.run(&mut excited, &mut Noise::from_seed(0));
    let followed = experiment
        .with_reference(0.7)
        .run(&mut GAINS.clone(), &mut Noise::from_seed(0));
    assert_eq!(stepped, followed);
    assert_eq!(excited.setpoint(0.0), 0.7);
}

// A step at the input is an input bias that is recorded; it leaves the set-point alone.
#[test]
fn a_step_of_the_input_is_a_bias() {
    let experiment = Experiment::new(roll(), 1e-3, 1.0);
    let step = Stimulus::new(TestSignal::step(0.5).unwrap(), 0.0);
    let mut excited = ExcitedLoop::new(step, GAINS, Entry::Input);
    let stepped = experiment.run(&mut excited, &mut Noise::from_seed(0));
    let biased = experiment
        .with_input_bias(0.5)
        .run(&mut GAINS.clone(), &mut Noise::from_seed(0));
    for k in 0..stepped.len() {
        assert!((stepped.true_output[k] - biased.true_output[k]).abs() < 1e-14);
        assert!((stepped.input[k] - biased.input[k] - 0.5).abs() < 1e-12);
    }
    assert_eq!(excited.setpoint(0.2), 0.2);
}

// kp 2, kd 3, filter 0.1 s, samples of 0.1 s, r = 1, y = 0, 1, 1. Rates: 0, (0 + 1)/0.2 = 5, (0.1 * 5 + 0)/0.2 = 2.5.
#[test]
fn a_filtered_derivative_by_hand() {
    let mut controller = FilteredPd::new(Pd { kp: 2.0, kd: 3.0 }, 0.1);
    let inputs = [0.0, 1.0, 1.0].map(|output| {
        controller.step(
            0.1,
            1.0,
            Sensed {
                output,
                rate: f64::NAN,
            },
        )
    });
    for (input, expected) in inputs.into_iter().zip([2.0, -15.0, -7.5]) {
        assert!((input - expected).abs() < 1e-14, "{input}");
    }
}

/// Passes the measured output on as the input.
struct Echo;

impl Controller for Echo {
    fn step(&mut self, _dt_s: f64, _reference: f64, sensed: Sensed) -> f64 {
        sensed.output
    }
}

// 20 % of 20,000 samples: 4,000 with a standard deviation of 57. The controller keeps the last measured value.
#[test]
fn dropped_samples_hold_the_last_one() {
    let experiment =
        Experiment::new(roll(), 1e-3, 20.0).with_sensor(Sensor::noisy(0.1).with_drop_outs(0.2));
    let (mut dropped, mut last) = (0, 0.0);
    experiment.observe(&mut Echo, &mut Noise::from_seed(3), |row| {
        dropped += i32::from(row.output.is_none());
        last = row.output.unwrap_or(last);
        assert_eq!(row.input, last);
        std::ops::ControlFlow::Continue(())
    });
    assert!((dropped - 4000).abs() < 170, "{dropped}");
    let trace = experiment.run(&mut Echo, &mut Noise::from_seed(3));
    assert_eq!(trace.len() as i32, 20_000 - dropped);
}

// The observer stops the run.
#[test]
fn an_observer_breaks_off() {
    let mut rows = 0;
    Experiment::new(roll(), 1e-3, 20.0).observe(&mut Echo, &mut Noise::from_seed(0), |_| {
        rows += 1;
        if rows == 7 {
            std::ops::ControlFlow::Break(())
        } else {
            std::ops::ControlFlow::Continue(())
        }
    });
    assert_eq!(rows, 7);
}
