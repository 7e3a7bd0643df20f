//! PX4's ARX(2,2).

use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;
use onecycle_identify::Signals;
use onecycle_lab::experiments::signals_of;
use onecycle_lab::judge::baselines::arx::{ArxSettings, Estimator, Model, identify};
use onecycle_lab::judge::baselines::{BaselineAnswer, BaselineError};
use onecycle_plant::FixedStepProcess;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{SAMPLE_S, cost, margin, process, processes, relay_test};

/// A random sequence of 1 and -1.
fn coins(samples: usize) -> Vec<f64> {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    (0..samples)
        .map(|_| {
            if rng.random_range(0.0..1.0) < 0.5 {
                -1.0
            } else {
                1.0
            }
        })
        .collect()
}

// The start has a weight of 0.999^20000 = 2e-9 and there is no noise: the coefficients are those of the
// model.
#[test]
fn a_known_model_is_reproduced() {
    let model = [-1.7, 0.72, 0.03, 0.05, -0.02];
    let [a1, a2, b0, b1, b2] = model;
    let mut estimator = Estimator::new(0.999).unwrap();
    let (mut rates, mut inputs) = ([0.0; 2], [0.0; 3]);
    for input in coins(20_000) {
        let rate =
            -a1 * rates[0] - a2 * rates[1] + b0 * inputs[0] + b1 * inputs[1] + b2 * inputs[2];
        estimator.push(input, rate);
        rates = [rate, rates[0]];
        inputs = [input, inputs[0], inputs[1]];
    }
    for (found, expected) in estimator.coefficients().iter().zip(model) {
        assert!(
            (found - expected).abs() < 1e-6,
            "{:?}",
            estimator.coefficients()
        );
    }
}

// A dead time of up to one sample, two lags and a held input are exactly an ARX(2,2) with one sample of
// delay. The conversion back is exact, also for equal lags (to half the digits) and without dead time.
#[test]
fn a_model_is_its_process() {
    for (k, t_prop_s, t_body_s, tau_s, tolerance) in [
        (1.5, 0.05, 0.5, 0.006, 1e-6),
        (0.3, 0.02, 2.0, 0.0, 1e-6),
        (1.0, 0.1, 0.1, 0.01, 1e-2),
    ] {
        let truth = process(k, t_prop_s, t_body_s, tau_s);
        let model_s = 0.01;
        let mut simulated = FixedStepProcess::new(&truth, model_s);
        let mut estimator = Estimator::new(0.999).unwrap();
        for input in coins(20_000) {
            estimator.push(input, simulated.rate());
            simulated.step(input);
        }
        let model = Model {
            coefficients: estimator.coefficients(),
            sample_s: model_s,
        };
        let found = model.process(0.5 * model_s).unwrap();
        let close = |a: f64, b: f64| (a - b).abs() < tolerance * b.abs();
        assert!(close(found.k().unwrap(), k), "{found:?}");
        assert!(close(found.t_prop_s(), t_prop_s), "{found:?}");
        assert!(close(found.t_body_s().unwrap(), t_body_s), "{found:?}");
        let off_s = (found.tau_s() - tau_s).abs();
        assert!(off_s < 100.0 * tolerance * model_s, "{found:?}");
    }
}

// Poles at 1.01 and 0.5 with a dead time of one sample become an integrator and a lag of 1/ln 2
// samples. A pair 0.9 e^(+-0.1j) becomes two lags of -1/ln 0.9 samples. The gain is 2 units of rate per
// unit of input and sample: sum b / (1 - 0.5).
#[test]
fn other_poles_become_the_nearest_lags() {
    let of = |a1: f64, a2: f64| {
        let model = Model {
            coefficients: [a1, a2, 1.0, 0.0, 0.0],
            sample_s: 1.0,
        };
        model.process(0.5).unwrap()
    };
    let unstable = of(-1.51, 0.505);
    assert_eq!(unstable.inv_t_body_per_s(), 0.0);
    assert!((unstable.t_prop_s() - 1.0 / 2_f64.ln()).abs() < 1e-12);
    assert!((unstable.k_over_t_body() - 2.0).abs() < 1e-12);
    let pair = of(-1.8 * 0.1_f64.cos(), 0.81);
    let lag_s = -1.0 / 0.9_f64.ln();
    assert!((pair.t_prop_s() - lag_s).abs() < 1e-12);
    assert!((pair.t_body_s().unwrap() - lag_s).abs() < 1e-12);
}

// Without noise, filters scaled to the oscillation leave an error of a few per cent (at most 4.3 % on
// 50 random processes). PX4's own filters leave a dead time of ten samples to a model that holds two:
// on (0.3, 2, 0.1) its controller is unstable.
#[test]
fn the_filters_decide() {
    for truth in processes() {
        let trace = relay_test(truth, 0.0, 30.0);
        let signals = signals_of(&trace, SAMPLE_S);
        let scaled = ArxSettings::scaled_to_oscillation(&signals).unwrap();
        let by_differences = cost(identify(&signals, &scaled, margin()), &truth);
        let mut simulated = FixedStepProcess::new(&truth, SAMPLE_S);
        let rate: Vec<f64> = trace
            .input
            .iter()
            .map(|&input| {
                let rate = simulated.rate();
                simulated.step(input);
                rate
            })
            .collect();
        // From the rate itself, which is late by half a sample of the hold.
        let model = Model::of(&signals, &rate, &scaled).unwrap();
        let found = model.process(0.5 * SAMPLE_S).unwrap();
        let pd = pd_at_phase_margin(&found, margin()).unwrap().pd;
        let process = Some(found);
        let by_sensor = cost(Ok(BaselineAnswer { process, pd }), &truth);
        for cost in [by_differences, by_sensor] {
            assert!(
                cost.is_some_and(|cost| cost.abs() < 0.05),
                "{truth:?}: {cost:?}"
            );
        }
    }
    let slow = processes()[0];
    let trace = relay_test(slow, 0.0, 30.0);
    let signals = signals_of(&trace, SAMPLE_S);
    assert_eq!(
        cost(identify(&signals, &ArxSettings::PX4, margin()), &slow),
        None
    );
}

#[test]
fn errors_say_what_is_wrong() {
    let trace = relay_test(process(1.0, 0.02, 0.3, 0.01), 0.0, 10.0);
    let signals = signals_of(&trace, SAMPLE_S);
    let settings = ArxSettings {
        low_pass_hz: 500.0,
        ..ArxSettings::PX4
    };
    let found = identify(&signals, &settings, margin());
    assert_eq!(found, Err(BaselineError::Setting("the low pass", 500.0)));
    let found = Model::of(&signals, &[1.0; 7], &ArxSettings::PX4);
    assert_eq!(found, Err(BaselineError::Uneven));
    assert!(matches!(
        Estimator::new(0.0),
        Err(BaselineError::Setting(..))
    ));
    let short = Signals {
        time_s: &trace.time_s[..50],
        input: &trace.input[..50],
        output: &trace.output[..50],
        ..signals
    };
    let found = identify(&short, &ArxSettings::PX4, margin());
    assert_eq!(found, Err(BaselineError::TooShort { samples: 50 }));
}
