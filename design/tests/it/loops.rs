//! The numerics of general loops against the exact methods for an integrator with two lags under a PD, against the
//! quadrature of the cascade, and against the exact sampled loop.

use num_complex::Complex64;
use onecycle_design::state_space::StateSpace;
use onecycle_design::{
    Autopilot, Cascade, Controller, Execution, Linear, Model, Pid, Structure, ise, load_iae,
    load_response, loop_response, margins, reference_iae, sensitivity, step_response,
};
use onecycle_onboard::{Pd, Soiptd};

fn close(found: f64, expected: f64, tolerance: f64) {
    let off = (found / expected - 1.0).abs();
    assert!(off <= tolerance, "{found} {expected} {off:e}");
}

/// Processes with gains: the paper's hexacopter, a slow multirotor, a negative gain, a long dead time, no dead time.
fn pairs() -> [(Soiptd, Pd); 5] {
    let pd = |kp, kd| Pd { kp, kd };
    let hexacopter = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap();
    [
        (hexacopter, pd(48.0, 12.7)),
        (Soiptd::new(1.0, 0.3, 2.0, 0.1).unwrap(), pd(4.0, 4.0)),
        (hexacopter.with_gain_scaled(-2.0).unwrap(), pd(-24.0, -6.0)),
        (Soiptd::new(2.0, 0.1, 1.0, 5.0).unwrap(), pd(0.05, 0.02)),
        (Soiptd::new(1.0, 0.05, 1.0, 0.0).unwrap(), pd(20.0, 8.0)),
    ]
}

// The same loop as Controller::Pd (exact road) and as Controller::Pid (general road): margins to rounding, ISE to 1e-8,
// overshoot and times of the step response to the interpolation of the exact road.
#[test]
fn both_roads_agree() {
    for (process, pd) in pairs() {
        let model = Model::from(process);
        let (exact, general) = (
            Controller::from(pd),
            Controller::from(Pid::new(pd.kp, 0.0, pd.kd)),
        );
        let (a, b) = (
            margins(&model, &exact).unwrap(),
            margins(&model, &general).unwrap(),
        );
        close(b.phase_margin_rad, a.phase_margin_rad, 1e-11);
        close(
            b.gain_crossover_rad_per_s,
            a.gain_crossover_rad_per_s,
            1e-11,
        );
        close(b.delay_margin_s, a.delay_margin_s, 1e-11);
        match (a.gain_margin, b.gain_margin) {
            (Some(a), Some(b)) => close(b, a, 1e-11),
            (a, b) => assert!(
                a.is_none() && b.is_none() || a.is_some_and(|a| a > 900.0),
                "{a:?} {b:?}"
            ),
        }
        close(
            ise(&model, &general).unwrap(),
            ise(&model, &exact).unwrap(),
            1e-8,
        );
        let (a, b) = (
            step_response(&model, &exact).unwrap(),
            step_response(&model, &general).unwrap(),
        );
        let off = (a.metrics.overshoot - b.metrics.overshoot).abs();
        assert!(off < 1e-6, "{process:?} {:?} {:?}", a.metrics, b.metrics);
        close(b.metrics.rise_time_s, a.metrics.rise_time_s, 1e-6);
        close(b.metrics.settling_time_s, a.metrics.settling_time_s, 1e-5);
        for omega in [0.1, 1.0, 7.0, 40.0] {
            let a = loop_response(&model, &exact, omega).unwrap();
            let b = loop_response(&model, &general, omega).unwrap();
            close(b.magnitude, a.magnitude, 1e-12);
            assert!((a.phase_rad - b.phase_rad).abs() < 1e-11 * (1.0 + a.phase_rad.abs()));
        }
    }
}

// The cascade's ISE by quadrature over frequencies, an independent method.
#[test]
fn a_cascade_has_the_ise_of_its_quadrature() {
    let process = Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap();
    for (rate_i, rate_d) in [(0.0, 0.0), (1.5, 0.0), (1.5, 0.004)] {
        let gains = Cascade {
            angle_p: 4.0,
            rate_p: 11.0,
            rate_i,
            rate_d,
        };
        let expected = gains.cost(&process).unwrap();
        let controller = Controller::from(Autopilot::from(gains));
        close(
            ise(&process.into(), &controller).unwrap(),
            expected.ise,
            1e-7,
        );
        let margin_rad = margins(&process.into(), &controller)
            .unwrap()
            .phase_margin_rad;
        close(margin_rad, expected.phase_margin_rad, 1e-4);
    }
}

// An integrator with dead time 1 under P with gain 0.3: load steps leave y = 1/0.3, and the reference has the IE 1/0.3, which is the IAE of
// a response without overshoot (0.3 < 1/e).
#[test]
fn an_integrator_under_p_by_hand() {
    let model: Model = Linear::new(Structure::Iptd).with_tau_s(1.0).into();
    let controller = Controller::from(Pid::new(0.3, 0.0, 0.0));
    close(reference_iae(&model, &controller).unwrap(), 1.0 / 0.3, 1e-8);
    assert_eq!(load_iae(&model, &controller), None);
    let load = load_response(&model, &controller).unwrap();
    close(load.samples.last().unwrap().y, 1.0 / 0.3, 1e-4);
    assert_eq!(load.iae, f64::INFINITY);
    let step = step_response(&model, &controller).unwrap();
    assert_eq!(step.metrics.overshoot, 0.0);
    assert_eq!(step.samples[0].u, 0.3);
    // y = 0.3 (t - 1) while the input is constant: until t = 2.
    let at = step.samples.iter().find(|sample| sample.t_s > 1.5).unwrap();
    close(at.y, 0.3 * (at.t_s - 1.0), 1e-10);
}

// FOPTD with K = 2 under P with gain 1 settles at 2/3: the metrics refer to it. The ISE of the reference is infinite.
#[test]
fn a_loop_without_integral_settles_elsewhere() {
    let model: Model = Linear::new(Structure::Foptd)
        .with_gain(2.0)
        .with_pole_per_s(1.0)
        .with_tau_s(0.1)
        .into();
    let controller = Controller::from(Pid::new(1.0, 0.0, 0.0));
    let step = step_response(&model, &controller).unwrap();
    close(step.samples.last().unwrap().y, 2.0 / 3.0, 1e-4);
    assert_eq!((step.ise, ise(&model, &controller)), (f64::INFINITY, None));
}

// An unstable loop has no margins; gains of the wrong sign and an improper loop neither.
#[test]
fn unstable_loops_have_no_figures() {
    let model: Model = Linear::new(Structure::Iptd).with_tau_s(1.0).into();
    for pid in [
        Pid::new(1.58, 0.0, 0.0),
        Pid::new(-0.1, 0.0, 0.0),
        Pid::new(0.3, 0.0, 2.0),
        Pid::new(0.3, 0.5, 0.0),
    ] {
        let controller = Controller::from(pid);
        assert_eq!(margins(&model, &controller), None, "{pid:?}");
        assert_eq!(sensitivity(&model, &controller), None);
        assert!(step_response(&model, &controller).is_err());
    }
    // The limit is pi/2.
    assert!(margins(&model, &Pid::new(1.57, 0.0, 0.0).into()).is_some());
}

/// Exact sampled process behind a hold and one sample of delay: `P(e^(j w h))`.
fn sampled_process(model: &Linear, h_s: f64, omega: f64) -> Complex64 {
    let space = StateSpace::<4>::new(model);
    let delay_s = model.tau_s() + h_s;
    let whole = (delay_s / h_s + 1e-12).floor();
    let part_s = delay_s - whole * h_s;
    let (step, late, early) = (
        space.step(h_s),
        space.step(h_s - part_s),
        space.step(part_s),
    );
    let z = Complex64::cis(omega * h_s);
    // (z I - Phi) x = late.held + late.phi early.held / z, by Gauss elimination over the three states.
    let mut rows = [[Complex64::ZERO; 4]; 3];
    for i in 0..3 {
        for j in 0..3 {
            let diagonal = if i == j { z } else { Complex64::ZERO };
            rows[i][j] = diagonal - step.phi[i][j];
        }
        let carried: f64 = (0..3).map(|j| late.phi[i][j] * early.held[j]).sum();
        rows[i][3] = late.held[i] + carried / z;
    }
    for column in 0..3 {
        for row in (0..3).filter(|row| *row != column) {
            let factor = rows[row][column] / rows[column][column];
            let lead = rows[column];
            for j in 0..4 {
                rows[row][j] -= factor * lead[j];
            }
        }
    }
    let output = rows[space.output][3] / rows[space.output][space.output];
    output * model.gain() * z.powf(-whole)
}

// A PID in code (integral by backward Euler, bilinear filter) at 1 ms and 4 ms: the exact z-domain Ms against that of the
// continuous loop with one and a half periods of dead time, to 0.0005 and 0.003; without them the error is 30 times as large.
#[test]
fn sampling_acts_as_one_and_a_half_periods_of_dead_time() {
    let model = Linear::from(Soiptd::new(1.0, 0.0321, 1.6886, 0.0237).unwrap());
    let pid = Pid::new(38.0, 60.0, 12.0).with_filter_s(0.002);
    for (h_s, tolerance) in [(0.001, 0.0005), (0.004, 0.003)] {
        let exact = (1..4000)
            .map(|i| {
                let omega = 0.3 * (std::f64::consts::PI / h_s / 0.3).powf(f64::from(i) / 4000.0);
                let z = Complex64::cis(omega * h_s);
                let s = 2.0 / h_s * (z - 1.0) / (z + 1.0);
                let t = s * pid.filter_s;
                let path =
                    (pid.kp + pid.ki * h_s * z / (z - 1.0) + pid.kd * s) / (1.0 + t + t * t / 2.0);
                1.0 / (1.0 + path * sampled_process(&model, h_s, omega)).norm()
            })
            .fold(0.0, f64::max);
        let ms = |execution| {
            sensitivity(&model.into(), &pid.with_execution(execution).into())
                .unwrap()
                .ms
        };
        let found = ms(Execution::sampled(h_s));
        assert!((found - exact).abs() < tolerance, "{found} {exact}");
        assert!((ms(Execution::default()) - exact).abs() > 10.0 * (found - exact).abs());
    }
}
