//! Simulated step response against hand calculations and against the closed form of the cost.

use onecycle_design::soiptd_pd::cost::ise;
use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;
use onecycle_design::soiptd_pd::step_response::{StepResponseError, step_response};
use onecycle_onboard::{Pd, Soiptd, Transition};

// From tau to 2 tau the delayed input is still Kp, so the output is the open-loop step response of the process, which
// has a closed form.
#[test]
fn second_dead_time_is_the_open_loop_step() {
    for (gain, t_prop, damping) in [(0.5, 0.3, 0.5), (-2.0, 0.1, 10.0), (4.0, 0.05, 0.0)] {
        let process = Soiptd::from_acceleration_gain(gain, t_prop, damping, 0.1).unwrap();
        let pd = pd_at_phase_margin(&process, 0.35).unwrap().pd;
        let samples = step_response(&process, pd).unwrap().samples;
        assert_eq!(
            (samples[0].t_s, samples[0].y, samples[0].u),
            (0.0, 0.0, pd.kp)
        );
        let mut compared = 0;
        for sample in samples
            .iter()
            .filter(|sample| (0.1..=0.2).contains(&sample.t_s))
        {
            let exact = Transition::over(&process, sample.t_s - 0.1).step_response();
            let (y, v) = (gain * pd.kp * exact.y, gain * pd.kp * exact.v);
            assert!((sample.y - y).abs() <= 1e-12 * y, "{} {y}", sample.y);
            let u = pd.kp * (1.0 - y) - pd.kd * v;
            assert!(
                (sample.u - u).abs() <= 1e-11 * pd.kp.abs(),
                "{} {u}",
                sample.u
            );
            compared += 1;
        }
        assert!(compared > 10, "{compared}");
    }
}

// T_prop = 1/5, 1/T_body = 1, Kp = Kd = 6/5: closed-loop poles -1, -2, -3 and y = (1 - e^-t)^3. So y reaches the level
// p at t = -ln(1 - cbrt p) and never exceeds 1. The largest input is Kp, at the start.
#[test]
fn three_real_poles_by_hand() {
    let process = Soiptd::from_acceleration_gain(1.0, 0.2, 1.0, 0.0).unwrap();
    let response = step_response(&process, Pd { kp: 1.2, kd: 1.2 }).unwrap();
    for sample in &response.samples {
        let y = (1.0 - (-sample.t_s).exp()).powi(3);
        assert!((sample.y - y).abs() < 1e-9, "{} {y}", sample.y);
    }
    let reaches = |level: f64| -(1.0 - level.cbrt()).ln();
    let metrics = response.metrics;
    assert_eq!((metrics.overshoot, metrics.peak_time_s), (0.0, None));
    assert!((metrics.rise_time_s - (reaches(0.9) - reaches(0.1))).abs() < 1e-8);
    assert!((metrics.settling_time_s - reaches(0.98)).abs() < 1e-7);
    assert!((metrics.peak_input - 1.2).abs() < 1e-15);
    assert!(
        (response.ise - 73.0 / 60.0).abs() < 2e-9,
        "{}",
        response.ise
    );
}

// T_prop = 1/2, 1/T_body = 2, Kp = 5, Kd = 5/2: closed-loop poles -2, -1 +- 2j, y = 1 - e^-2t - e^-t sin 2t. At the
// peak 2 e^-t + sin 2t - 2 cos 2t = 0.
#[test]
fn complex_poles_by_hand() {
    let process = Soiptd::from_acceleration_gain(1.0, 0.5, 2.0, 0.0).unwrap();
    let response = step_response(&process, Pd { kp: 5.0, kd: 2.5 }).unwrap();
    let error = |t: f64| (-2.0 * t).exp() + (-t).exp() * (2.0 * t).sin();
    for sample in &response.samples {
        assert!(
            (sample.y - 1.0 + error(sample.t_s)).abs() < 1e-9,
            "{sample:?}"
        );
    }
    let metrics = response.metrics;
    let peak = metrics.peak_time_s.unwrap();
    let slope = 2.0 * (-peak).exp() + (2.0 * peak).sin() - 2.0 * (2.0 * peak).cos();
    assert!(slope.abs() < 1e-7, "{slope}");
    assert!((metrics.overshoot + error(peak)).abs() < 1e-9);
    assert!((error(metrics.settling_time_s).abs() - 0.02).abs() < 1e-9);
    assert!(
        (response.ise - 197.0 / 260.0).abs() < 2e-9,
        "{}",
        response.ise
    );
}

// Columns: acceleration gain, T_prop (s), 1/T_body (1/s), tau (s), phase margin (deg). Expected error: 2e-10 of the
// controller's signals from the cubic in each step, 1e-10 from the end of the simulation; below 3e-9 in all.
#[test]
fn simulated_cost_matches_the_closed_form() {
    for (gain, t_prop, damping, tau, margin_deg) in [
        (0.5, 0.3, 0.5, 0.1, 20.0_f64),
        (0.5, 0.3, 0.5, 0.1, 3.0),
        (0.5, 0.3, 0.5, 0.1, 0.5),
        (0.5, 0.3, 0.5, 0.1, 60.0),
        (-3.0, 0.3, 0.5, 0.0005, 20.0),
        (1.0, 0.3, 0.5, 0.0, 20.0),
        (1.0, 0.3, 0.5, 1e-7, 20.0),
        (1.0, 0.3, 1.0 / 0.3, 0.05, 20.0),
        (1.0, 0.3, 0.0, 0.05, 20.0),
        (1.0, 0.3, 0.0, 0.0, 3.0),
        (1.0, 0.015, 5.0, 0.1, 20.0),
        (1.0, 0.001, 1000.0, 0.1, 45.0),
        (1.0, 1e-5, 1.0, 0.01, 20.0),
        (1e-6, 3e4, 1e-5, 1e4, 20.0),
    ] {
        let process = Soiptd::from_acceleration_gain(gain, t_prop, damping, tau).unwrap();
        let best = pd_at_phase_margin(&process, margin_deg.to_radians()).unwrap();
        let simulated = step_response(&process, best.pd).unwrap().ise;
        let error = simulated / best.ise - 1.0;
        assert!(error.abs() < 3e-9, "{process:?} at {margin_deg}: {error:e}");
    }
}

// Both lags are 1e-4 of the dead time and shorter than the smallest step. The error is about 1e-5.
#[test]
fn unresolved_lags_cost_little() {
    let process = Soiptd::from_acceleration_gain(1.0, 1e-3, 1e3, 10.0).unwrap();
    let best = pd_at_phase_margin(&process, 0.8).unwrap();
    let error = step_response(&process, best.pd).unwrap().ise / best.ise - 1.0;
    assert!(error.abs() < 2e-5, "{error:e}");
}

// After the settling time the output stays within 2 % of the reference, at phase margins from 3 to 50 deg.
#[test]
fn response_ends_settled() {
    let process = Soiptd::new(1.0, 0.3, 2.0, 0.1).unwrap();
    for margin_deg in [3.0_f64, 20.0, 50.0] {
        let pd = pd_at_phase_margin(&process, margin_deg.to_radians())
            .unwrap()
            .pd;
        let response = step_response(&process, pd).unwrap();
        let after = response
            .samples
            .iter()
            .filter(|s| s.t_s > response.metrics.settling_time_s);
        assert!(after.clone().count() > 100);
        assert!(after.clone().all(|sample| (sample.y - 1.0).abs() <= 0.02));
    }
}

#[test]
fn unstable_and_endless_loops_are_variants() {
    let process = Soiptd::new(1.0, 0.3, 2.0, 0.1).unwrap();
    for (kp, kd) in [(100.0, 7.0), (-1.0, 1.0), (0.0, 1.0), (f64::NAN, 1.0)] {
        let outcome = step_response(&process, Pd { kp, kd });
        assert_eq!(outcome, Err(StepResponseError::Unstable), "{kp} {kd}");
    }
    // At a phase margin of 0.001 deg the loop rings for millions of steps.
    let pd = pd_at_phase_margin(&process, 1.7e-5).unwrap().pd;
    assert!(ise(&process, pd).is_some());
    assert_eq!(step_response(&process, pd), Err(StepResponseError::TooSlow));
}
