//! Closed loops with results predicted by hand.

use onecycle_onboard::{Pd, Relay, RelaySettings, Soiptd};
use onecycle_plant::{Experiment, Noise, SampledPd, Sensor, Trace};

fn noise(seed: u64) -> Noise {
    Noise::from_seed(seed)
}

// At rest the input of the integrator is zero: kp (r - y) + bias = 0, so r - y = -bias / kp exactly. The slowest
// pole of the loop is near 2.4/s: after 20 s only e^-48 is left.
#[test]
fn a_bias_leaves_the_predicted_error() {
    let process = Soiptd::new(1.5, 0.03, 1.2, 0.02).unwrap();
    let experiment = Experiment::new(process, 1e-3, 20.0)
        .with_reference(0.7)
        .with_input_bias(-0.25)
        .with_initial_output(0.2);
    let pd = Pd { kp: 8.0, kd: 2.5 };
    let trace = experiment.run(&mut SampledPd(pd), &mut noise(0));
    let error = experiment.reference - trace.true_output[trace.len() - 1];
    assert!((error - 0.25 / 8.0).abs() < 1e-13, "{error}");
    // The remaining input is minus the bias.
    assert!((trace.input[trace.len() - 1] - 0.25).abs() < 1e-12);
}

/// Triple pole of the loop below (1/s).
const POLE: f64 = 10.0;

/// Output at 0.4 s of the sampled loop with a triple pole.
///
/// No damping, b = 1, lag T: `s^2 (T s + 1) + kd s + kp = T (s + p)^3` for `T = 1/(3 p)`,
/// `kd = 3 p^2 T = p`, `kp = p^3 T = p^2 / 3`.
fn sampled_at_400_ms(sample_s: f64) -> f64 {
    let process = Soiptd::from_acceleration_gain(1.0, 1.0 / (3.0 * POLE), 0.0, 0.0).unwrap();
    let pd = Pd {
        kp: POLE * POLE / 3.0,
        kd: POLE,
    };
    let experiment = Experiment::new(process, sample_s, 0.4 + sample_s).with_reference(1.0);
    let trace = experiment.run(&mut SampledPd(pd), &mut noise(0));
    let last = trace.len() - 1;
    assert!((trace.time_s[last] - 0.4).abs() < 1e-12);
    trace.true_output[last]
}

// Continuous loop: y = 1 - e^-x (1 + x + x^2/2) with x = p t. Holding the input delays the feedback by half a
// sample on average (but not the reference, which jumps at a sample). So the sampled loop differs by dt/2 w,
// where w is the derivative of kp G r / (1 + e^(-s d) C G) by d at zero: W = p^5 (3 s + p) / (s + p)^6, w = p
// e^-x (x^4/8 - x^5/60). The remainder is of second order.
#[test]
fn sampled_pd_converges_to_the_continuous_loop() {
    let x = POLE * 0.4;
    let continuous = 1.0 - (-x).exp() * (1.0 + x + 0.5 * x * x);
    let w = POLE * (-x).exp() * (x.powi(4) / 8.0 - x.powi(5) / 60.0);
    let rest = |sample_s: f64| sampled_at_400_ms(sample_s) - continuous - 0.5 * sample_s * w;
    let rests = [2e-3, 1e-3, 5e-4, 2.5e-4].map(rest);
    for pair in rests.windows(2) {
        // Four, plus the third order, which is proportional to the sample period: 0.027 at 2 ms.
        let ratio = pair[0] / pair[1];
        assert!((ratio - 4.0).abs() < 0.03, "{rests:?}: {ratio}");
    }
    assert!((rests[2] / rests[3] - 4.0).abs() < 0.01);
    // Remainder of the first order at 1 ms, and the first order: x = 4, w = 10 e^-4 (32 - 17.07).
    assert!((w - 2.735).abs() < 1e-3, "{w}");
    assert!(rests[1].abs() < 3e-6 && 0.5e-3 * w > 1.3e-3);
}

fn noisy_relay(seed: u64, jitter: f64) -> Trace {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap();
    let settings = RelaySettings {
        noise_sigma: 3e-5,
        ..RelaySettings::new(1.0, -0.73)
    };
    let experiment = Experiment::new(process, 1e-3, 10.0)
        .with_sensor(Sensor::noisy(3e-5))
        .with_jitter(jitter);
    experiment.run(&mut Relay::new(settings).unwrap(), &mut noise(seed))
}

#[test]
fn same_seed_same_bits() {
    for jitter in [0.0, 0.02] {
        let trace = noisy_relay(1, jitter);
        assert_eq!(trace, noisy_relay(1, jitter));
        let other = noisy_relay(2, jitter);
        assert_ne!(trace.output, other.output);
        assert_eq!(trace.time_s == other.time_s, jitter == 0.0);
    }
}

// For n = 10,000 increments the mean has a standard error of 0.02/sqrt(n) periods, the standard deviation one of
// 0.02/sqrt(2 n); three of each.
#[test]
fn jitter_has_the_given_spread() {
    let trace = noisy_relay(5, 0.02);
    let increments: Vec<f64> = trace
        .time_s
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / 1e-3)
        .collect();
    let n = increments.len() as f64;
    let mean = increments.iter().sum::<f64>() / n;
    let sigma = (increments.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt();
    assert!((mean - 1.0).abs() < 3.0 * 0.02 / n.sqrt(), "{mean}");
    assert!(
        (sigma - 0.02).abs() < 3.0 * 0.02 / (2.0 * n).sqrt(),
        "{sigma}"
    );
}

#[test]
fn time_always_advances() {
    // Jitter of half a period: 7 % of the increments are outside 0.1..1.9 periods and are limited.
    let trace = noisy_relay(5, 0.5);
    let mut at_limits = 0;
    for pair in trace.time_s.windows(2) {
        let increment = (pair[1] - pair[0]) / 1e-3;
        assert!((0.1 - 1e-9..=1.9 + 1e-9).contains(&increment));
        at_limits += usize::from(!(0.1 + 1e-9..=1.9 - 1e-9).contains(&increment));
    }
    // P(|x| > 1.8 sigma) = 0.0719: 719 of 10,000, plus or minus three times sqrt(719 * 0.93) = 26.
    assert!((at_limits as f64 - 719.0).abs() < 78.0, "{at_limits}");
}

// Without jitter the fixed grid is used. A vanishing jitter uses the variable propagation on nearly that grid:
// the same trajectory, with times and switches a part in 1e12 off.
#[test]
fn both_propagations_run_the_same_loop() {
    let process = Soiptd::new(1.5, 0.03, 1.2, 0.0213).unwrap();
    let run = |jitter| {
        let experiment = Experiment::new(process, 1e-3, 2.0)
            .with_reference(1.0)
            .with_input_bias(0.1)
            .with_jitter(jitter);
        experiment
            .run(&mut SampledPd(Pd { kp: 8.0, kd: 2.5 }), &mut noise(0))
            .true_output
    };
    for (fixed, variable) in run(0.0).iter().zip(&run(1e-13)) {
        assert!(
            (fixed - variable).abs() < 1e-12,
            "{fixed} against {variable}"
        );
    }
}
