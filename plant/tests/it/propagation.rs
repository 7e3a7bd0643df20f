//! Propagation against solutions by hand: the method of steps in closed form.
//!
//! Under `u = u_i` from `T_i` on, the output is the sum of shifted step responses,
//! `y(t) = sum (u_i - u_(i-1)) s(t - T_i - tau)`, with `s` the step response without delay:
//!
//! ```text
//! lags T, B:        s = K (t - T - B + (B^2 e^(-t/B) - T^2 e^(-t/T)) / (B - T))
//! equal lags T:     s = K (t - 2 T + (2 T + t) e^(-t/T))
//! no damping:       s = b (t^2/2 - T t + T^2 (1 - e^(-t/T)))
//! ```
//!
//! Each is zero at zero, has zero slope there, and solves the differential equation.

use onecycle_onboard::Soiptd;
use onecycle_plant::{FixedStepProcess, VariableStepProcess};

/// Relative to the largest output: a thousand roundings over a few hundred steps.
const TOLERANCE: f64 = 1e-12;

/// Output and rate of the step response at the time `t` after the step, by hand.
type ByHand = Box<dyn Fn(f64) -> (f64, f64)>;

fn distinct_lags(k: f64, lag: f64, body: f64) -> ByHand {
    Box::new(move |t| {
        let (slow, fast) = ((-t / body).exp(), (-t / lag).exp());
        let y = t - lag - body + (body * body * slow - lag * lag * fast) / (body - lag);
        let v = 1.0 - (body * slow - lag * fast) / (body - lag);
        (k * y, k * v)
    })
}

fn equal_lags(k: f64, lag: f64) -> ByHand {
    Box::new(move |t| {
        let e = (-t / lag).exp();
        (
            k * (t - 2.0 * lag + (2.0 * lag + t) * e),
            k * (1.0 - (1.0 + t / lag) * e),
        )
    })
}

fn no_damping(b: f64, lag: f64) -> ByHand {
    Box::new(move |t| {
        let gone = 1.0 - (-t / lag).exp();
        (
            b * (0.5 * t * t - lag * t + lag * lag * gone),
            b * (t - lag * gone),
        )
    })
}

/// Superposed steps `(begins_s, input)`, from rest without input.
fn superposed(steps: &[(f64, f64)], tau_s: f64, by_hand: &ByHand, t: f64) -> (f64, f64) {
    let mut before = 0.0;
    let (mut y, mut v) = (0.0, 0.0);
    for &(begins_s, input) in steps {
        let since = t - begins_s - tau_s;
        if since > 0.0 {
            let (step_y, step_v) = by_hand(since);
            y += (input - before) * step_y;
            v += (input - before) * step_v;
        }
        before = input;
    }
    (y, v)
}

/// Delays in sample periods: none, part of a step, whole steps, many steps.
const DELAYS: [f64; 6] = [0.0, 0.4, 1.0, 3.0, 3.7, 57.3];

/// Processes and their step responses without the delay.
fn processes(tau_s: f64) -> [(Soiptd, ByHand); 4] {
    let new = |k, lag, body| Soiptd::new(k, lag, body, tau_s).unwrap();
    [
        (new(2.0, 0.0321, 1.6886), distinct_lags(2.0, 0.0321, 1.6886)),
        (new(-0.7, 0.3, 0.2), distinct_lags(-0.7, 0.3, 0.2)),
        (new(1.3, 0.15, 0.15), equal_lags(1.3, 0.15)),
        (
            Soiptd::from_acceleration_gain(3.0, 0.05, 0.0, tau_s).unwrap(),
            no_damping(3.0, 0.05),
        ),
    ]
}

fn assert_matches(actual: &[(f64, f64)], expected: &[(f64, f64)]) {
    let scale =
        |part: fn(&(f64, f64)) -> f64| expected.iter().map(|p| part(p).abs()).fold(0.0, f64::max);
    let (y_scale, v_scale) = (scale(|p| p.0), scale(|p| p.1));
    for (index, (a, e)) in actual.iter().zip(expected).enumerate() {
        assert!(
            (a.0 - e.0).abs() <= TOLERANCE * y_scale,
            "{index}: {a:?} against {e:?}"
        );
        assert!(
            (a.1 - e.1).abs() <= TOLERANCE * v_scale,
            "{index}: {a:?} against {e:?}"
        );
    }
}

// +1 on [0, 40) samples, -1 on [40, 130), 0.5 on [130, 300).
#[test]
fn fixed_steps_match_the_method_of_steps() {
    let sample_s = 0.01;
    let input = |sample: usize| match sample {
        0..40 => 1.0,
        40..130 => -1.0,
        _ => 0.5,
    };
    let steps = [(0.0, 1.0), (40.0 * sample_s, -1.0), (130.0 * sample_s, 0.5)];
    for delay in DELAYS {
        let tau_s = delay * sample_s;
        for (process, by_hand) in processes(tau_s) {
            let mut simulated = FixedStepProcess::new(&process, sample_s);
            let (mut actual, mut expected) = (Vec::new(), Vec::new());
            for sample in 0..300 {
                actual.push((simulated.output(), simulated.rate()));
                expected.push(superposed(
                    &steps,
                    tau_s,
                    &by_hand,
                    sample as f64 * sample_s,
                ));
                simulated.step(input(sample));
            }
            assert_matches(&actual, &expected);
        }
    }
}

// The same input edges, none on a common grid with the output times: steps of 3.7, 11.3 and 0.9 ms in turn, cut
// where the input changes.
#[test]
fn variable_steps_match_the_method_of_steps() {
    let steps: [(f64, f64); 3] = [(0.0, 1.0), (0.4123, -1.0), (1.3017, 0.5)];
    for delay in DELAYS {
        let tau_s = delay * 0.01;
        for (process, by_hand) in processes(tau_s) {
            let mut simulated = VariableStepProcess::new(&process);
            let (mut actual, mut expected) = (Vec::new(), Vec::new());
            let mut t = 0.0;
            for duration in [0.0037, 0.0113, 0.0009].into_iter().cycle().take(500) {
                let end = t + duration;
                let mut from = t;
                for (index, &(_, input)) in steps.iter().enumerate() {
                    let until = steps
                        .get(index + 1)
                        .map_or(end, |next| next.0.clamp(from, end));
                    if until > from {
                        simulated.advance(input, until - from);
                        from = until;
                    }
                }
                t = end;
                actual.push((simulated.output(), simulated.rate()));
                expected.push(superposed(&steps, tau_s, &by_hand, t));
            }
            assert_matches(&actual, &expected);
        }
    }
}

fn after_200_steps(process: &Soiptd) -> f64 {
    let mut simulated = FixedStepProcess::new(process, 0.01);
    for sample in 0..200 {
        simulated.step(if sample < 70 { 1.0 } else { -0.5 });
    }
    simulated.output()
}

// The response is symmetric in the lags: with the lags T (1 +/- e/2) it is that of equal lags T up to a term in
// e^2, a few tenths of it here. At e = 1e-3 partial fractions are still accurate to 1e-16 / 1e-3.
#[test]
fn nothing_happens_where_the_lags_meet() {
    let tau_s = 0.0137;
    let at = |e: f64| {
        let (lag, body) = (0.2 * (1.0 - 0.5 * e), 0.2 * (1.0 + 0.5 * e));
        after_200_steps(&Soiptd::new(1.0, lag, body, tau_s).unwrap())
    };
    let steps = [(0.0, 1.0), (0.7, -0.5)];
    let (equal, _) = superposed(&steps, tau_s, &equal_lags(1.0, 0.2), 2.0);
    let (near, _) = superposed(&steps, tau_s, &distinct_lags(1.0, 0.1999, 0.2001), 2.0);
    assert!((at(0.0) - equal).abs() < 1e-13);
    assert!((at(1e-3) - near).abs() < 1e-12);
    assert!((at(1e-3) - equal).abs() < 0.5 * 1e-6);
    // Neither e^2 = 1e-18 nor a division by the difference of the lags may appear.
    for e in [1e-9, -1e-9] {
        assert!((at(e) - equal).abs() < 1e-13, "{e}: {}", at(e) - equal);
    }
}

// Without damping s = b (t^2/2 - T t + T^2 g) with g = 1 - e^(-t/T). Damping a divides by 1 + a/s, so s(a) = s -
// a I s + a^2 I^2 s - ..., with the integral I: I s = b (t^3/6 - T t^2/2 + T^2 t - T^3 g). The next term is a^3
// t^5/120: below 1e-18 at a = 1e-6. At a = 1 partial fractions are accurate.
#[test]
fn damping_fades_away_without_a_jump() {
    let (lag, tau_s) = (0.05, 0.0137);
    let at = |a: f64| after_200_steps(&Soiptd::from_acceleration_gain(1.0, lag, a, tau_s).unwrap());
    let series = move |a: f64| -> ByHand {
        Box::new(move |t: f64| {
            let g = 1.0 - (-t / lag).exp();
            let s0 = t.powi(2) / 2.0 - lag * t + lag.powi(2) * g;
            let s1 = t.powi(3) / 6.0 - lag * t.powi(2) / 2.0 + lag.powi(2) * t - lag.powi(3) * g;
            let s2 = t.powi(4) / 24.0 - lag * t.powi(3) / 6.0 + lag.powi(2) * t.powi(2) / 2.0
                - lag.powi(3) * t
                + lag.powi(4) * g;
            (s0 - a * s1 + a * a * s2, f64::NAN)
        })
    };
    let steps = [(0.0, 1.0), (0.7, -0.5)];
    for (a, by_hand) in [
        (1.0, distinct_lags(1.0, lag, 1.0)),
        (1e-6, series(1e-6)),
        (0.0, series(0.0)),
        (0.0, no_damping(1.0, lag)),
    ] {
        let (expected, _) = superposed(&steps, tau_s, &by_hand, 2.0);
        assert!(
            (at(a) - expected).abs() < 1e-13,
            "{a}: {} against {expected}",
            at(a)
        );
    }
}

// A displacement of the output stays (integrator); a rate v0 adds v0 B (1 - e^(-t/B)).
#[test]
fn a_displacement_follows_the_free_response() {
    let process = Soiptd::new(2.0, 0.03, 0.8, 0.02).unwrap();
    let mut fixed = FixedStepProcess::new(&process, 0.01);
    let mut variable = VariableStepProcess::new(&process);
    fixed.displace(0.3, -1.5);
    variable.displace(0.3, -1.5);
    for _ in 0..60 {
        fixed.step(0.0);
    }
    variable.advance(0.0, 0.6);
    let expected = 0.3 - 1.5 * 0.8 * (1.0 - (-0.6_f64 / 0.8).exp());
    assert!((fixed.output() - expected).abs() < 1e-13);
    assert!((variable.output() - expected).abs() < 1e-13);
    assert!((fixed.rate() + 1.5 * (-0.6_f64 / 0.8).exp()).abs() < 1e-13);
}

mod random {
    use super::{FixedStepProcess, Soiptd, VariableStepProcess, assert_matches};
    use proptest::prelude::*;
    use proptest::test_runner::{Config, RngSeed};

    /// A step: its input, and where it is cut in the variable propagation.
    fn steps() -> impl Strategy<Value = Vec<(f64, f64, f64)>> {
        prop::collection::vec((-1.0..1.0, 0.0..1.0, 0.0..1.0), 30..200)
    }

    proptest! {
        #![proptest_config(Config {
            cases: 300,
            rng_seed: RngSeed::Fixed(2020),
            failure_persistence: None,
            ..Config::default()
        })]

        // Two implementations that share only the transition. The difference is the rounding of 200 steps, a few
        // roundings of the largest output each.
        #[test]
        fn fixed_and_variable_steps_agree(
            gain in prop_oneof![-20.0..-0.1, 0.1..20.0],
            t_prop_s in 0.001..0.5,
            damping in prop_oneof![Just(0.0), 0.0..10.0],
            sample_s in 1e-4..2e-2,
            delay in prop_oneof![Just(0.0), 0.0..1.0, (0..20_u32).prop_map(f64::from), 0.0..60.0],
            steps in steps(),
        ) {
            let tau_s = delay * sample_s;
            let process =
                Soiptd::from_acceleration_gain(gain, t_prop_s, damping, tau_s).unwrap();
            let mut fixed = FixedStepProcess::new(&process, sample_s);
            let mut variable = VariableStepProcess::new(&process);
            let (mut actual, mut expected) = (Vec::new(), Vec::new());
            for (input, cut, second_cut) in steps {
                fixed.step(input);
                let first = cut * sample_s;
                let second = second_cut * (sample_s - first);
                variable.advance(input, first);
                variable.advance(input, second);
                variable.advance(input, sample_s - first - second);
                actual.push((variable.output(), variable.rate()));
                expected.push((fixed.output(), fixed.rate()));
            }
            assert_matches(&actual, &expected);
        }
    }
}
