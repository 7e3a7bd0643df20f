//! The tuner on simulated axes: from rest, from the ground, and everything that can go wrong.

// Helpers of tests are tests too, which the lint does not see.
#![allow(clippy::unwrap_used)]

mod axis;
mod faults;

use onecycle_onboard::control::PdLaw;
use onecycle_onboard::tuner::{TakeOffSettings, Tuner, TunerSettings};
use onecycle_onboard::{Process, RelaySettings};

use self::axis::Axis;

const SAMPLE_S: f64 = 0.001;

/// The paper's altitude: T_prop 32.1 ms, T_body 1.6886 s, dead time 24 ms, at 4 1/s^2 a unit.
fn height() -> Process {
    Process::from_acceleration_gain(4.0, 0.0321, 1.0 / 1.6886, 0.024).unwrap()
}

fn tuner(settings: &TunerSettings) -> Tuner<'static> {
    Tuner::new(settings).unwrap()
}

// Without noise the model is exact: the process comes back, and the margin is the pack's 20 degrees.
#[test]
fn a_test_from_rest_ends_in_the_controller_of_the_process() {
    let mut tuner = tuner(&TunerSettings::new(0.1, SAMPLE_S as f32));
    let mut axis = Axis::new(height(), SAMPLE_S, 1);
    axis.bias = 0.02;
    tuner.start();
    axis.fly(&mut tuner, 0.0, 20.0, |tuner, _| tuner.is_proven());
    assert!(
        tuner.is_proven(),
        "{:?} {:?}",
        tuner.phase(),
        tuner.reason()
    );
    let found = tuner.identified().unwrap();
    let (truth, process) = (height(), &found.process);
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-5;
    assert!(
        near(process.k_over_t_body(), truth.k_over_t_body()),
        "{process:?}"
    );
    assert!(near(process.t_prop_s(), truth.t_prop_s()), "{process:?}");
    assert!(near(process.tau_s(), truth.tau_s()), "{process:?}");
    assert!((found.phase_margin_rad.to_degrees() - 20.0).abs() < 0.1);
    assert!((found.input_bias - 0.02).abs() < 1e-5, "{found:?}");
    assert_eq!(*tuner.law(), PdLaw::new(found.pd, tuner.offset()));
}

// Hover needs 0.5 of the input and the relay has 0.1. From the ground, with nothing but the integrator and
// the relay, to the controller; with noise of 2 mm. At no time more than half a metre above the metre asked for.
#[test]
fn from_the_ground_without_a_controller() {
    let settings = TunerSettings::new(0.1, SAMPLE_S as f32);
    let settings = TunerSettings {
        relay: RelaySettings {
            preroll_s: 0.3,
            ..settings.relay
        },
        take_off: Some(TakeOffSettings {
            gain: 0.15,
            climb: 0.2,
        }),
        output_lowest: 0.0,
        output_highest: 1.0,
        ..settings
    };
    for seed in 0..20 {
        let mut tuner = tuner(&settings);
        let mut axis = Axis::new(
            Process::from_acceleration_gain(20.0, 0.0321, 1.0 / 1.6886, 0.024).unwrap(),
            SAMPLE_S,
            seed,
        );
        axis.bias = -0.5;
        axis.has_ground = true;
        axis.noise_sigma = 0.0002;
        // A tick for the reference to be known.
        axis.fly(&mut tuner, 1.0, SAMPLE_S, |_, _| false);
        tuner.start();
        let mut highest = 0.0_f64;
        axis.fly(&mut tuner, 1.0, 30.0, |tuner, axis| {
            highest = highest.max(axis.value());
            tuner.is_proven()
        });
        assert!(
            tuner.is_proven(),
            "{seed}: {:?} {:?}",
            tuner.phase(),
            tuner.reason()
        );
        let found = tuner.identified().unwrap();
        assert!((found.input_bias + 0.5).abs() < 0.01, "{found:?}");
        assert!(highest < 1.5, "{seed}: {highest} m");
        axis.fly(&mut tuner, 1.0, 3.0, |_, _| false);
        assert!(
            (axis.value() - 1.0).abs() < 0.05,
            "{seed}: at {} m",
            axis.value()
        );
    }
}
