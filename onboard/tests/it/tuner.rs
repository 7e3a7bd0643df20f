//! The tuner on simulated axes: from rest, from the ground, and with all kinds of faults.

mod amplitude;
mod axis;
mod consent;
mod faults;
mod rate_delay;
mod walk;

use onecycle_onboard::control::PdLaw;
use onecycle_onboard::guard::{Abort, Limits};
use onecycle_onboard::tuner::{Consent, TakeOffSettings, Tuner, TunerPhase, TunerSettings};
use onecycle_onboard::{RelaySettings, Soiptd};

use self::axis::Axis;

const SAMPLE_S: f64 = 0.001;

/// Altitude of the paper: T_prop 32.1 ms, T_body 1.6886 s, dead time 24 ms, acceleration gain 4 1/s^2.
fn height() -> Soiptd {
    Soiptd::from_acceleration_gain(4.0, 0.0321, 1.0 / 1.6886, 0.024).unwrap()
}

/// Outputs up to one, ten times the amplitude of the relay.
fn settings() -> TunerSettings {
    TunerSettings {
        output_lowest: -1.0,
        output_highest: 1.0,
        limits: Limits::NONE,
        consent: Consent::Automatic,
        ..TunerSettings::new(0.1, SAMPLE_S as f32)
    }
}

fn tuner(settings: &TunerSettings) -> Tuner<'static> {
    Tuner::new(settings).unwrap()
}

// Without noise the model is exact: the process is recovered, and the margin is the 20 degrees of the pack.
#[test]
fn a_test_from_rest_ends_in_the_controller_of_the_process() {
    let mut tuner = tuner(&settings());
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
    let law = tuner.law().unwrap().settings();
    assert_eq!((law.kp, law.kd), (found.pd.kp as f32, found.pd.kd as f32));
}

// Hover needs 0.5 of the input and the relay has 0.1. From the ground, with only the integrator and the relay,
// to the controller, with noise of 2 mm. The vehicle never exceeds the reference of one metre by more than half
// a metre.
#[test]
fn from_the_ground_without_a_controller() {
    let settings = settings();
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
            Soiptd::from_acceleration_gain(20.0, 0.0321, 1.0 / 1.6886, 0.024).unwrap(),
            SAMPLE_S,
            seed,
        );
        axis.bias = -0.5;
        axis.has_ground = true;
        axis.noise_sigma = 0.0002;
        // One tick with the reference.
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

/// A tuner with a proven controller on the height, without noise.
fn proven(settings: &TunerSettings) -> (Tuner<'static>, Axis) {
    let mut tuner = tuner(settings);
    let mut axis = Axis::new(height(), SAMPLE_S, 1);
    tuner.start();
    axis.fly(&mut tuner, 0.0, 20.0, |tuner, _| tuner.is_proven());
    assert!(tuner.is_proven(), "{:?}", tuner.reason());
    (tuner, axis)
}

// A load of 0.05, half the amplitude of the relay: without the integral it shifts the process by 0.05/kp. With it a
// tenth of that is left after 25/w, 1.5 s, and nothing after 10 s; the integral has found the load.
#[test]
fn a_load_leaves_no_offset() {
    for (phase_rad, share_then, share_later) in [(0.0, 1.0, 1.0), (0.0873, 0.1, 0.0)] {
        let (mut tuner, mut axis) = proven(&TunerSettings {
            integral_phase_rad: phase_rad,
            ..settings()
        });
        let kp = tuner.identified().unwrap().pd.kp;
        axis.fly(&mut tuner, 0.0, 10.0, |_, _| false);
        let at_rest = tuner.law().unwrap().integral();
        axis.bias -= 0.05;
        let mut share = |axis: &mut Axis, seconds| {
            axis.fly(&mut tuner, 0.0, seconds, |_, _| false);
            -axis.value() / (0.05 / kp)
        };
        let then = share(&mut axis, 1.5);
        assert!((then - share_then).abs() < 0.02, "{phase_rad}: {then}");
        let later = share(&mut axis, 10.0);
        assert!((later - share_later).abs() < 1e-3, "{phase_rad}: {later}");
        let found = tuner.law().unwrap().integral() - at_rest;
        let expected = 0.05 * (1.0 - share_later as f32);
        assert!((found - expected).abs() < 1e-4, "{phase_rad}: {found}");
    }
}

// With the integral off every output is that of the PD law with the offset, limited, bit for bit.
#[test]
fn without_the_integral_the_controller_is_the_pd() {
    let (mut tuner, mut axis) = proven(&TunerSettings {
        integral_phase_rad: 0.0,
        ..settings()
    });
    let law = PdLaw::new(tuner.identified().unwrap().pd, tuner.offset());
    axis.noise_sigma = 0.001;
    for tick in 0..4000 {
        let reference = if tick < 2000 { 0.0 } else { 0.1 };
        let measurement = axis.measure();
        let output = tuner.step(axis.time_s(), &measurement, reference);
        let rate = measurement.rate.unwrap();
        let expected = law.output(reference, measurement.value, rate);
        assert_eq!(output.to_bits(), expected.clamp(-1.0, 1.0).to_bits());
        axis.push(output);
    }
}

// Without limits: the gain grows sixfold at the switch to the new controller, which makes the loop unstable (its
// gain margin is about 2). The comparison with the prediction detects it and returns to the safe controller.
#[test]
fn a_response_that_is_not_the_predicted_one_falls_back() {
    let mut tuner = tuner(&settings());
    let mut axis = Axis::new(height(), SAMPLE_S, 1);
    tuner.start();
    axis.fly(&mut tuner, 0.0, 20.0, |tuner, _| {
        tuner.phase() == TunerPhase::Control
    });
    assert!(tuner.phase() == TunerPhase::Control && !tuner.is_proven());
    let amplitude = tuner.identified().unwrap().amplitude as f32;
    axis.becomes(height().with_gain_scaled(6.0).unwrap());
    axis.fly(&mut tuner, 0.0, 4.0, |tuner, _| {
        tuner.phase() == TunerPhase::Aborted
    });
    let Some(Abort::Mismatch(off)) = tuner.reason() else {
        panic!("{:?} {:?}", tuner.phase(), tuner.reason());
    };
    // Detected in the tick in which the difference exceeded 1.5 amplitudes.
    assert!((1.5..1.7).contains(&(off / amplitude)), "{off} {amplitude}");
    assert_eq!(tuner.law(), None);
}

// A bias of 0.03 under Kp = 0.5 holds the process at an offset of 0.06 with an output of -0.03. The relay begins
// there, with half its jump to either side, and nothing drifts.
#[test]
fn the_relay_begins_where_the_safe_controller_held_the_process() {
    let settings = TunerSettings {
        safe: PdLaw {
            kp: 0.5,
            kd: 0.4,
            offset: 0.0,
        },
        bias_filter_s: 0.5,
        ..settings()
    };
    let mut tuner = tuner(&settings);
    let mut axis = Axis::new(height(), SAMPLE_S, 1);
    axis.bias = 0.03;
    axis.fly(&mut tuner, 0.0, 20.0, |_, _| false);
    assert!((axis.value() - 0.06).abs() < 1e-4, "{}", axis.value());
    tuner.start();
    assert!((tuner.offset() + 0.03).abs() < 1e-4, "{}", tuner.offset());
    axis.fly(&mut tuner, 0.0, 20.0, |tuner, axis| {
        assert!((axis.value() - 0.06).abs() < 0.03, "{}", axis.value());
        tuner.phase() == TunerPhase::Control
    });
    let found = tuner.identified().unwrap();
    assert!((found.input_bias - 0.03).abs() < 1e-3, "{found:?}");
}

// After an aborted test the next one succeeds, also with another vehicle.
#[test]
fn after_a_reset_all_begins_anew() {
    let mut tuner = tuner(&settings());
    let mut axis = Axis::new(height(), SAMPLE_S, 1);
    tuner.start();
    axis.fly(&mut tuner, 0.0, 1.5, |_, _| false);
    tuner.abort();
    assert_eq!(
        (tuner.phase(), tuner.reason()),
        (TunerPhase::Aborted, Some(Abort::Operator))
    );
    tuner.start();
    assert_eq!(tuner.phase(), TunerPhase::Aborted);
    tuner.reset();
    assert_eq!((tuner.phase(), tuner.reason()), (TunerPhase::Idle, None));
    let other = height().with_gain_scaled(2.0).unwrap();
    let mut axis = Axis::new(other, SAMPLE_S, 2);
    tuner.start();
    axis.fly(&mut tuner, 0.0, 20.0, |tuner, _| tuner.is_proven());
    let found = tuner.identified().unwrap();
    assert!(
        (found.process.k_over_t_body() / 8.0 - 1.0).abs() < 1e-5,
        "{found:?}"
    );
}

type Change = fn(&mut TunerSettings);

const OUT_OF_RANGE: [(Change, &str); 16] = [
    (|s| s.sample_s = 0.0, "the sample period must be positive"),
    (
        |s| s.bias_filter_s = -1.0,
        "the bias filter's time constant",
    ),
    (
        |s| s.rate_lag_s = f32::NAN,
        "the rate's lag must be positive",
    ),
    (
        |s| s.integral_phase_rad = -0.1,
        "the integral's phase must be positive",
    ),
    (
        |s| s.integral_phase_rad = 0.4,
        "the integral's phase must be 0 to 0.34906584 rad, but is 0.4",
    ),
    (|s| s.limits.rate = 0.0, "the limit of the rate must be"),
    (
        |s| s.limits = Limits::UNSET,
        "the limit of the excursion must be set",
    ),
    (
        |s| s.output_lowest = f32::NAN,
        "the output limits must be set",
    ),
    (
        |s| s.limits.stale_s = f32::NAN,
        "the limit of a sample's age",
    ),
    (
        |s| s.take_off = take_off(0.0, 1.0),
        "the integrator's gain must",
    ),
    (
        |s| s.take_off = take_off(1.0, -1.0),
        "the climb allowed must be",
    ),
    (
        |s| s.cycles = 5,
        "the number of cycles must be 1 to 4, but is 5",
    ),
    (|s| s.slices = 0, "at least one attempt and one slice"),
    (
        |s| s.output_lowest = 1.0,
        "the lower one below the upper one",
    ),
    (|s| s.safe.kp = f32::NAN, "must be finite"),
    (|s| s.relay.amplitude = -1.0, "amplitude must be positive"),
];

fn take_off(gain: f32, climb: f32) -> Option<TakeOffSettings> {
    Some(TakeOffSettings { gain, climb })
}

// Every setting out of range is named and rejected.
#[test]
fn settings_out_of_range_are_named() {
    assert_eq!(Tuner::new(&settings()).err(), None);
    for (change, words) in OUT_OF_RANGE {
        let mut settings = settings();
        change(&mut settings);
        let error = Tuner::new(&settings).err();
        let said = error.map(|error| error.to_string()).unwrap_or_default();
        assert!(said.contains(words), "{said}");
    }
}
