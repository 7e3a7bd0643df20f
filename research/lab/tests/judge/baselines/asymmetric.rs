//! The asymmetric relay.

use std::collections::VecDeque;

use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;
use onecycle_lab::experiments::ExperimentError;
use onecycle_lab::experiments::relays::AsymmetricRelay;
use onecycle_lab::experiments::signals_of;
use onecycle_lab::judge::baselines::asymmetric::{HalfPeriods, identify};
use onecycle_plant::{Controller, Sensed, Trace};

use super::{SAMPLE_S, cost, margin, process, processes, run};

/// Levels 2:1 with a mean of one, as in the paper's own.
const LEVELS: (f64, f64) = (4.0 / 3.0, -2.0 / 3.0);

/// The exact half periods of `K e^(-L s)/(T s + 1)`, for K = 2 and T = 3, from its step responses.
fn first_order(delay_s: f64, hysteresis: f64) -> HalfPeriods {
    let (gain, lag_s, above, below) = (2.0, 3.0, LEVELS.0, -LEVELS.1);
    let grown = (above + below) * f64::exp(delay_s / lag_s);
    let half = |towards: f64, away: f64| {
        lag_s * ((hysteresis / gain - away + grown) / (towards - hysteresis / gain)).ln()
    };
    let (on_s, off_s) = (half(above, below), half(below, above));
    HalfPeriods {
        on_s,
        off_s,
        above,
        below,
        hysteresis,
        output_span: f64::NAN,
    }
}

/// The relay with `2 e^(-s)/(3 s + 1)`, exact at samples of 1 ms.
fn simulated_first_order(relay: &mut AsymmetricRelay) -> Trace {
    let sample_s = 1e-3;
    let keep = f64::exp(-sample_s / 3.0);
    let mut under_way = VecDeque::from(vec![0.0; 1000]);
    let (mut output, mut trace) = (0.0, Trace::default());
    for k in 0..60_000 {
        let sensed = Sensed { output, rate: 0.0 };
        let input = relay.step(sample_s, 0.0, sensed);
        trace.push(f64::from(k) * sample_s, input, output, output);
        under_way.push_back(input);
        let arrived = under_way.pop_front().unwrap();
        output = keep * output + 2.0 * (1.0 - keep) * arrived;
    }
    trace
}

// Simulated half periods equal those above, except for the sample that the relay waits at each switch:
// some ms in 2 s or more.
#[test]
fn a_recording_is_measured_right() {
    let mut relay = AsymmetricRelay::new(LEVELS.0, LEVELS.1, 0.01).unwrap();
    let trace = simulated_first_order(&mut relay);
    let signals = signals_of(&trace, 1e-3);
    let measured = HalfPeriods::measure(&signals, 0.01, 4).unwrap();
    let exact = first_order(1.0, 0.01);
    assert!((measured.above - LEVELS.0).abs() < 1e-12 && (measured.below + LEVELS.1).abs() < 1e-12);
    assert!(
        (measured.on_s - exact.on_s).abs() < 5e-3,
        "{measured:?} {exact:?}"
    );
    assert!(
        (measured.off_s - exact.off_s).abs() < 5e-3,
        "{measured:?} {exact:?}"
    );
}

// Integrator with dead time by hand, Kv = 0.5, L = 0.2, h = 0.03, levels 2 and -1. After -h the output
// falls on by Kv L, then rises by 2 Kv to h and on by 2 Kv L: peak to peak 2 h + 3 Kv L = 0.36, t_on =
// 0.36, t_off = 0.72.
#[test]
fn an_integrator_by_hand() {
    let half_periods = HalfPeriods {
        on_s: 0.36,
        off_s: 0.72,
        above: 2.0,
        below: 1.0,
        hysteresis: 0.03,
        output_span: 0.36,
    };
    let found = half_periods.integrator().unwrap();
    assert!((found.k().unwrap() - 0.5).abs() < 1e-12, "{found:?}");
    assert!((found.tau_s() - 0.2).abs() < 1e-12, "{found:?}");
}

// The same in a simulation, with and without an unknown bias: exact to the sampling. A cycle may be one
// sample (1 ms of 0.3 s or more) longer than the next, and the relay waits one sample at either switch.
#[test]
fn an_integrator_from_a_recording_whatever_the_bias() {
    let truth = process(0.5, 1e-9, 1e-9, 0.2);
    for bias in [0.0, 0.3, -0.4] {
        let mut relay = AsymmetricRelay::new(LEVELS.0, LEVELS.1, 0.03).unwrap();
        let trace = run(truth, bias, 20.0, &mut relay);
        let signals = signals_of(&trace, SAMPLE_S);
        let found = identify(&signals, 0.03, 4, margin())
            .unwrap()
            .process
            .unwrap();
        assert!(
            (found.k().unwrap() / 0.5 - 1.0).abs() < 5e-3,
            "{bias}: {found:?}"
        );
        assert!((found.tau_s() - 0.2).abs() < 2e-3, "{bias}: {found:?}");
    }
}

// Lags of a millionth of the dead time do not affect the controller: lags a thousand times as long
// change the gains by less than one per cent.
#[test]
fn the_missing_lags_do_not_matter() {
    let [fast, slow] = [1e-6, 1e-3].map(|part| {
        let process = process(1.0, part * 0.1, part * 0.1, 0.1);
        pd_at_phase_margin(&process, margin()).unwrap().pd
    });
    assert!((fast.kp / slow.kp - 1.0).abs() < 0.01, "{fast:?} {slow:?}");
    assert!((fast.kd / slow.kd - 1.0).abs() < 0.01, "{fast:?} {slow:?}");
}

// A model of a dead time instead of two lags: on the paper's processes the controller is stable and
// costs about 20 to 170 % above the optimum.
#[test]
fn lags_taken_for_a_dead_time_cost() {
    for process in processes() {
        let mut relay = AsymmetricRelay::new(LEVELS.0, LEVELS.1, 0.0).unwrap();
        let trace = run(process, 0.0, 120.0, &mut relay);
        let found = identify(&signals_of(&trace, SAMPLE_S), 0.0, 8, margin());
        let cost = cost(found, &process);
        assert!(
            cost.is_some_and(|cost| (0.1..2.0).contains(&cost)),
            "{process:?}: {cost:?}"
        );
    }
}

#[test]
fn errors_name_the_setting() {
    for (high, low, hysteresis, name, value) in [
        (-1.0, -1.0, 0.0, "the high level", -1.0),
        (1.0, 0.5, 0.0, "the low level", 0.5),
        (1.0, -1.0, -0.1, "the hysteresis", -0.1),
    ] {
        let error = AsymmetricRelay::new(high, low, hysteresis).unwrap_err();
        assert_eq!(error, ExperimentError::Setting(name, value));
    }
}
