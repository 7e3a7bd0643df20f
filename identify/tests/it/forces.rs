//! Nonlinear forces: recordings of a body simulated here in small steps.

use onecycle_design::Parameter;
use onecycle_identify::{Identification, Nonlinear, Options, Remark, Signals, identify};
use onecycle_plant::{Noise, NoiseSource};

const SAMPLE_S: f64 = 2e-3;
/// Steps of the simulation a sample; its error is some microseconds of the dead time.
const STEPS: usize = 40;
/// Actuator lag, dead time (s), damping (1/s) and gain (1/s^2).
const LAG_S: f64 = 0.05;
const TAU_S: f64 = 0.03;
const DAMPING_PER_S: f64 = 0.5;
const GAIN: f64 = 0.7;

/// `v' = GAIN (l + thrust l^2) - DAMPING_PER_S v - drag v |v| - GAIN friction sign(v)` under a plain relay for eight seconds, with measurement noise
/// of a standard deviation of 1e-4.
fn relay_test([drag, friction, thrust]: [f64; 3]) -> Identification {
    let count: usize = 4000;
    let delay = (TAU_S / SAMPLE_S).round() as usize;
    let mut noise = Noise::from_seed(5);
    let [mut input, mut output] = [vec![], vec![]];
    let (mut lag, mut rate, mut position) = (0.0, 0.0, 0.0);
    let step_s = SAMPLE_S / STEPS as f64;
    for k in 0..count {
        let measured = position + 1e-4 * noise.standard_normal();
        output.push(measured);
        input.push(if measured > 0.0 { -1.0 } else { 1.0 });
        let acting: f64 = input[k.saturating_sub(delay)];
        for _ in 0..STEPS {
            lag += step_s / LAG_S * (acting - lag);
            let force = GAIN * (lag + thrust * lag * lag);
            let resistance =
                drag * rate * f64::abs(rate) + GAIN * friction * f64::tanh(rate / 1e-3);
            rate += step_s * (force - DAMPING_PER_S * rate - resistance);
            position += step_s * rate;
        }
    }
    let time_s: Vec<f64> = (0..count).map(|k| SAMPLE_S * k as f64).collect();
    let signals = Signals {
        time_s: &time_s,
        input: &input,
        output: &output,
        samples_per_point: 1,
        sample_period_s: SAMPLE_S,
        breaks: &[],
    };
    identify(&signals, &Options::default())
}

/// The forces found.
fn found(test: &Identification) -> Nonlinear {
    let mut remarks = test.remarks.iter();
    let forces = remarks.find_map(|remark| match remark {
        Remark::Nonlinear(forces) => Some(*forces),
        _ => None,
    });
    forces.unwrap_or_default()
}

fn is_near(test: &Identification, parameter: Parameter, truth: f64, share: f64) {
    let estimate = &test.outcome.as_ref().unwrap().estimate;
    let interval = estimate.get(parameter).unwrap();
    let value = interval.estimate.unwrap();
    assert!((value / truth - 1.0).abs() < share, "{parameter:?} {value}");
}

// A linear fit finds a gain 14 % too high and a lag 70 % too long here.
#[test]
fn a_quadratic_drag_is_found_and_the_linear_parts_are_right() {
    let test = relay_test([20.0, 0.0, 0.0]);
    let forces = found(&test);
    assert!(
        (forces.drag.unwrap() / 20.0 - 1.0).abs() < 0.05,
        "{forces:?}"
    );
    assert_eq!((forces.friction, forces.thrust), (None, None));
    is_near(&test, Parameter::KOverTBody, GAIN, 0.01);
    is_near(&test, Parameter::TProp, LAG_S, 0.03);
    is_near(&test, Parameter::Tau, TAU_S, 0.03);
}

// A linear fit finds a gain 12 % too low and a lag 35 % too short here, and a disturbance.
#[test]
fn friction_is_found() {
    let test = relay_test([0.0, 0.3, 0.0]);
    let forces = found(&test);
    assert!(
        (forces.friction.unwrap() / 0.3 - 1.0).abs() < 0.1,
        "{forces:?}"
    );
    is_near(&test, Parameter::KOverTBody, GAIN, 0.02);
    is_near(&test, Parameter::TProp, LAG_S, 0.06);
}

#[test]
fn a_quadratic_thrust_is_found() {
    let test = relay_test([0.0, 0.0, 0.2]);
    let forces = found(&test);
    // The gain is the slope at the mean input.
    let slope = 1.0 + 2.0 * 0.2 * forces.middle;
    assert!(
        (forces.thrust.unwrap() * slope / 0.2 - 1.0).abs() < 0.1,
        "{forces:?}"
    );
    assert_eq!((forces.drag, forces.friction), (None, None));
    is_near(&test, Parameter::KOverTBody, GAIN * slope, 0.01);
}

#[test]
fn a_linear_process_has_none() {
    assert_eq!(found(&relay_test([0.0; 3])), Nonlinear::default());
}
