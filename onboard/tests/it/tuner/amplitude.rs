//! A second amplitude of the relay: nonlinear actuators are refused, linear ones are not.

use onecycle_onboard::guard::Abort;
use onecycle_onboard::identification::Refusal;
use onecycle_onboard::tuner::{Tuner, TunerPhase, TunerSettings};
use onecycle_onboard::{RelaySettings, Soiptd};

use super::axis::{Axis, Noise};
use super::{SAMPLE_S, height, settings, tuner};

/// Amplitude of the relay (input unit).
const H: f32 = 0.1;

fn at_two_amplitudes(noise_sigma: f64) -> TunerSettings {
    let settings = settings();
    TunerSettings {
        relay: RelaySettings {
            noise_sigma: noise_sigma as f32,
            ..settings.relay
        },
        second_amplitude: TunerSettings::SECOND_AMPLITUDE,
        ..settings
    }
}

type Actuator = Box<dyn FnMut(f32) -> f32>;

/// Runs a test through an actuator until it is decided.
fn fly(tuner: &mut Tuner<'_>, axis: &mut Axis, mut actuator: impl FnMut(f32) -> f32) {
    tuner.start();
    for _ in 0..60_000 {
        let output = tuner.step(axis.time_s(), &axis.measure(), 0.0);
        axis.push(actuator(output));
        if tuner.is_proven() || tuner.phase() == TunerPhase::Aborted {
            return;
        }
    }
    assert!(
        axis.tick < 60_000,
        "{:?} {:?}",
        tuner.phase(),
        tuner.stage()
    );
}

fn dead_zone(input: f32) -> f32 {
    input - input.clamp(-0.3 * H, 0.3 * H)
}

fn saturation(input: f32) -> f32 {
    input.clamp(-0.7 * H, 0.7 * H)
}

/// A play of 0.3 h in all.
fn backlash() -> impl FnMut(f32) -> f32 {
    let mut output = 0.0_f32;
    move |input| {
        output = output.clamp(input - 0.15 * H, input + 0.15 * H);
        output
    }
}

// Two levels of a relay pass as two other levels. Gain at 0.6 h over that at h: 0.5/0.7 in the dead zone, 1/0.7 in the
// saturation, 0.75/0.85 in the backlash. Nothing is put in force: the last output is that of the safe controller, zero.
#[test]
fn nonlinear_actuators_are_refused() {
    let actuators: [(&str, Actuator, f64); 3] = [
        ("dead zone", Box::new(dead_zone), 0.5 / 0.7),
        ("saturation", Box::new(saturation), 1.0 / 0.7),
        ("backlash", Box::new(backlash()), 0.75 / 0.85),
    ];
    for (name, actuator, expected) in actuators {
        let mut tuner = tuner(&at_two_amplitudes(0.0));
        let mut axis = Axis::new(height(), SAMPLE_S, 1);
        fly(&mut tuner, &mut axis, actuator);
        let reason = tuner.reason();
        let ratio = reason.and_then(|reason| match reason {
            Abort::Refused(Refusal::AmplitudeDependent(ratio)) => Some(ratio),
            _ => None,
        });
        assert!(ratio.is_some(), "{name}: {reason:?}");
        let ratio = ratio.unwrap();
        assert!((ratio / expected - 1.0).abs() < 0.01, "{name}: {ratio}");
        assert!(tuner.identified().is_none() && tuner.law().is_none());
        let output = tuner.step(axis.time_s(), &axis.measure(), 0.0);
        assert_eq!(output, 0.0, "{name}");
    }
}

// Without the second amplitude the same dead zone passes: 30 % of the gain is missing.
#[test]
fn one_amplitude_does_not_see_a_dead_zone() {
    let mut tuner = tuner(&settings());
    let mut axis = Axis::new(height(), SAMPLE_S, 1);
    fly(&mut tuner, &mut axis, dead_zone);
    let gain = tuner.identified().unwrap().process.k_over_t_body();
    assert!(
        (gain / height().k_over_t_body() - 0.7).abs() < 0.01,
        "{gain}"
    );
}

// The result with a second amplitude is that of the first one.
#[test]
fn a_linear_actuator_keeps_its_result() {
    let [one, two] = [0.0, TunerSettings::SECOND_AMPLITUDE].map(|second_amplitude| {
        let mut tuner = tuner(&TunerSettings {
            second_amplitude,
            ..settings()
        });
        let mut axis = Axis::new(height(), SAMPLE_S, 1);
        axis.bias = 0.02;
        fly(&mut tuner, &mut axis, |input| input);
        assert!(tuner.is_proven(), "{:?}", tuner.reason());
        *tuner.identified().unwrap()
    });
    assert_eq!(one, two);
}

// Noise of 1 % of the oscillation, random processes and biases: none is refused.
#[test]
fn noise_is_no_amplitude() {
    let mut noise = Noise(18);
    for seed in 0..50 {
        let process = Soiptd::from_acceleration_gain(
            4.0,
            noise.between(0.02, 0.1),
            noise.between(0.0, 2.0),
            noise.between(0.005, 0.04),
        )
        .unwrap();
        let mut clean = tuner(&settings());
        fly(&mut clean, &mut Axis::new(process, SAMPLE_S, seed), |u| u);
        let sigma = 0.01 * clean.identified().unwrap().amplitude;
        let mut tuner = tuner(&at_two_amplitudes(sigma));
        let mut axis = Axis::new(process, SAMPLE_S, seed);
        axis.noise_sigma = sigma;
        axis.bias = noise.between(-0.03, 0.03);
        fly(&mut tuner, &mut axis, |input| input);
        assert!(tuner.is_proven(), "{seed}: {:?}", tuner.reason());
    }
}
