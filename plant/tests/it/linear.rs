//! Linear processes of every structure: steps against partial fractions by hand, disturbances against their variances.

use onecycle_design::{Linear, Model, Parameter, Structure};
use onecycle_onboard::{Pd, Soiptd};
use onecycle_plant::{
    Bandwidths, Disturbances, Experiment, FilteredPd, FixedStepLinear, Noise, NoiseSource,
    SampledPd, VariableStepLinear,
};

const T_PROP_S: f64 = 0.08;
const T_PROP2_S: f64 = 0.03;
const T_BODY_S: f64 = 0.7;
const K: f64 = -2.5;
const W0_RAD_PER_S: f64 = 4.0;
const ZETA: f64 = 0.3;
/// 13.7 steps.
const TAU_S: f64 = 0.137;
const STEP_S: f64 = 0.01;

fn process(structure: Structure) -> Linear {
    Linear::from_parameters(structure, |parameter| match parameter {
        Parameter::K if structure != Structure::DoubleIntegratorLag => Some(K),
        Parameter::KOverTBody if structure == Structure::DoubleIntegratorLag => Some(K),
        Parameter::TProp => Some(T_PROP_S),
        Parameter::TProp2 => Some(T_PROP2_S),
        Parameter::TBody => Some(T_BODY_S),
        Parameter::NaturalFrequency => Some(W0_RAD_PER_S),
        Parameter::Zeta => Some(ZETA),
        Parameter::Tau => Some(TAU_S),
        _ => None,
    })
    .unwrap()
}

/// Response to a unit step at zero, by partial fractions; `T1`, `T2`, `T3` are the lags, the longest first.
fn step_response(structure: Structure, time_s: f64) -> f64 {
    let t = time_s - TAU_S;
    if t <= 0.0 {
        return 0.0;
    }
    let (t1, t2, t3) = (T_BODY_S, T_PROP_S, T_PROP2_S);
    let decay = |lag: f64| (-t / lag).exp();
    let (zw, wd) = (
        ZETA * W0_RAD_PER_S,
        W0_RAD_PER_S * (1.0 - ZETA * ZETA).sqrt(),
    );
    let unit = match structure {
        Structure::Iptd => t,
        Structure::IntegratorLag => t - t2 * (1.0 - decay(t2)),
        Structure::DoubleIntegratorLag => 0.5 * t * t - t2 * t + t2 * t2 * (1.0 - decay(t2)),
        Structure::Soiptd => t - t1 - t2 + (t1 * t1 * decay(t1) - t2 * t2 * decay(t2)) / (t1 - t2),
        Structure::Toiptd => {
            let part = |a: f64, b: f64, c: f64| a.powi(3) * decay(a) / ((a - b) * (a - c));
            t - t1 - t2 - t3 + part(t1, t2, t3) + part(t2, t3, t1) + part(t3, t1, t2)
        }
        Structure::Foptd => 1.0 - decay(t1),
        Structure::Soptd => 1.0 - (t1 * decay(t1) - t2 * decay(t2)) / (t1 - t2),
        Structure::Toptd => {
            let part = |a: f64, b: f64, c: f64| a * a * decay(a) / ((a - b) * (a - c));
            1.0 - part(t1, t2, t3) - part(t2, t3, t1) - part(t3, t1, t2)
        }
        // 1 - C e^(-t/T2) - e^(-zeta w0 t) (A cos + B sin); at zero the response and its slope are zero.
        Structure::Resonant | Structure::ResonantLag => {
            let x = W0_RAD_PER_S * t2;
            let c = if structure == Structure::ResonantLag {
                x * x / (1.0 - 2.0 * ZETA * x + x * x)
            } else {
                0.0
            };
            let (a, b) = (1.0 - c, (c / t2 + zw * (1.0 - c)) / wd);
            1.0 - c * decay(t2) - (-zw * t).exp() * (a * (wd * t).cos() + b * (wd * t).sin())
        }
        _ => unreachable!("a structure without a response by hand"),
    };
    K * unit
}

// The largest response is 3.6; rounding leaves 1e-13 of it.
#[test]
fn fixed_steps_follow_partial_fractions() {
    for structure in Structure::ALL {
        let mut noise = Noise::from_seed(0);
        let none = Disturbances::default();
        let mut simulated = FixedStepLinear::new(&process(structure), &none, STEP_S, &mut noise);
        for k in 0..200 {
            let error = simulated.output() - step_response(structure, f64::from(k) * STEP_S);
            assert!(error.abs() < 1e-12, "{structure:?} {k}: {error}");
            simulated.step(1.0, &mut noise);
        }
        // Without disturbances nothing is drawn.
        assert_eq!(noise, Noise::from_seed(0));
    }
}

#[test]
fn uneven_steps_follow_partial_fractions() {
    for structure in Structure::ALL {
        let mut noise = Noise::from_seed(0);
        let mut simulated =
            VariableStepLinear::new(&process(structure), &Disturbances::default(), &mut noise);
        let mut time_s = 0.0;
        for k in 0..200 {
            let error = simulated.output() - step_response(structure, time_s);
            assert!(error.abs() < 1e-12, "{structure:?} {k}: {error}");
            let duration_s = STEP_S * (1.0 + 0.5 * f64::from(k).sin());
            simulated.advance(1.0, duration_s, &mut noise);
            time_s += duration_s;
        }
    }
}

// The slope of the response, by central differences of the solution by hand: their error is 1e-8.
#[test]
fn the_rate_is_the_slope_of_the_output() {
    for structure in Structure::ALL {
        let mut noise = Noise::from_seed(0);
        let none = Disturbances::default();
        let mut simulated = FixedStepLinear::new(&process(structure), &none, STEP_S, &mut noise);
        for _ in 0..50 {
            simulated.step(1.0, &mut noise);
        }
        let at = |time_s| step_response(structure, time_s);
        let slope = (at(0.5 + 1e-5) - at(0.5 - 1e-5)) / 2e-5;
        let error = simulated.rate() - slope;
        assert!(error.abs() < 1e-7, "{structure:?}: {error}");
    }
}

/// Closed loop of 2 s.
fn loop_of(process: impl Into<Model>, jitter: f64, disturbances: Disturbances) -> Vec<f64> {
    Experiment::new(process, 1e-3, 2.0)
        .with_reference(1.0)
        .with_input_bias(0.1)
        .with_jitter(jitter)
        .with_disturbances(disturbances)
        .run(
            &mut SampledPd(Pd { kp: 8.0, kd: 2.5 }),
            &mut Noise::from_seed(0),
        )
        .true_output
}

// A random walk of 1e-30 chooses the general simulation and changes nothing.
#[test]
fn a_soiptd_in_a_loop_is_the_specialised_simulation() {
    let process = Soiptd::new(1.5, 0.03, 1.2, 0.0213).unwrap();
    let special = loop_of(process, 0.0, Disturbances::default());
    let invisible = Disturbances::default().with_output_walk(1e-30);
    for jitter in [0.0, 1e-13] {
        for (one, other) in special.iter().zip(loop_of(process, jitter, invisible)) {
            assert!((one - other).abs() < 1e-12, "{one} against {other}");
        }
    }
    // The loop is closed: the output is near the reference of 1.
    assert!((special.last().unwrap() - 1.0).abs() < 0.05);
}

// At rest K kp (r - y) = y, hence y = r K kp / (1 + K kp) = 3/4 of the reference.
#[test]
fn a_first_order_loop_comes_to_rest_as_predicted() {
    let process = Linear::from_parameters(Structure::Foptd, |parameter| match parameter {
        Parameter::K => Some(1.5),
        Parameter::TBody => Some(0.5),
        Parameter::Tau => Some(0.05),
        _ => None,
    });
    let gains = Pd { kp: 2.0, kd: 0.02 };
    let trace = Experiment::new(process.unwrap(), 1e-3, 10.0)
        .with_reference(2.0)
        .run(&mut FilteredPd::new(gains, 0.01), &mut Noise::from_seed(0));
    assert!((trace.true_output.last().unwrap() - 1.5).abs() < 1e-12);
}

const RUNS: u64 = 4000;

/// Mean square over the seeds, as a ratio to `expected`; its standard error is `sqrt(2 / RUNS)` = 2.2 %.
fn ratio(expected: f64, run: impl Fn(&mut Noise) -> f64) -> f64 {
    let sum: f64 = (0..RUNS)
        .map(|seed| run(&mut Noise::from_seed(seed)).powi(2))
        .sum();
    sum / RUNS as f64 / expected
}

fn assert_near_one(ratio: f64) {
    assert!(
        (ratio - 1.0).abs() < 3.0 * (2.0 / RUNS as f64).sqrt(),
        "{ratio}"
    );
}

/// Output and rate after `steps` at rest.
fn driven(process: &Linear, disturbances: Disturbances, step_s: f64, noise: &mut Noise) -> f64 {
    let mut simulated = FixedStepLinear::new(process, &disturbances, step_s, noise);
    for _ in 0..(2.0 / step_s) as usize {
        simulated.step(0.0, noise);
    }
    simulated.output()
}

// After t = 2 s, by hand: an integrator of gain K turns white noise q into K^2 q t, a random walk into K^2 q t^3 / 3; a
// walk of the output is q t. A double integrator behind its lag turns white noise into b^2 q t^3 / 3, a walk into
// b^2 q t^5 / 20. The result does not depend on the step.
#[test]
fn variances_of_driven_integrators() {
    let integrator = process(Structure::Iptd);
    let double = process(Structure::DoubleIntegratorLag);
    let none = Disturbances::default();
    let (white, walk) = (none.with_input_white(0.3), none.with_input_walk(0.3));
    let (q, t): (f64, f64) = (0.09, 2.0);
    for (process, disturbances, expected) in [
        (&integrator, white, K * K * q * t),
        (&integrator, walk, K * K * q * t.powi(3) / 3.0),
        (&integrator, none.with_output_walk(0.3), q * t),
        (&double, white, K * K * q * t.powi(3) / 3.0),
        (&double, walk, K * K * q * t.powi(5) / 20.0),
    ] {
        for step_s in [1.0, 0.1] {
            assert_near_one(ratio(expected, |noise| {
                driven(process, disturbances, step_s, noise)
            }));
        }
    }
}

// The same numbers at uneven steps with a dead time in between.
#[test]
fn variances_at_uneven_steps() {
    let integrator = process(Structure::Iptd);
    let walk = Disturbances::default().with_input_walk(0.3);
    let expected = K * K * 0.09 * 8.0 / 3.0;
    assert_near_one(ratio(expected, |noise| {
        let mut simulated = VariableStepLinear::new(&integrator, &walk, noise);
        for duration_s in [0.3, 0.9, 0.05, 0.75] {
            simulated.advance(0.0, duration_s, noise);
        }
        simulated.output()
    }));
}

// Gusts of standard deviation s and correlation time T are stationary: an integrator shows K g as its rate at once, with
// variance K^2 s^2. A lag 1/(s + a) turns them into s^2 / (a (a + 1/T)); after 2 s of T_body = 0.2 s the start is
// forgotten to e^-20.
#[test]
fn variances_of_gusts() {
    let gusts = Disturbances::default().with_gusts(0.4, 0.5);
    let integrator = process(Structure::Iptd);
    let stationary = K * K * 0.16;
    for steps in [0, 3] {
        assert_near_one(ratio(stationary, |noise| {
            let mut simulated = FixedStepLinear::new(&integrator, &gusts, 0.2, noise);
            for _ in 0..steps {
                simulated.step(0.0, noise);
            }
            simulated.rate()
        }));
    }
    let lag = Linear::new(Structure::Foptd).with_pole_per_s(5.0);
    let expected = 0.16 / (5.0 * (5.0 + 2.0));
    assert_near_one(ratio(expected, |noise| driven(&lag, gusts, 0.05, noise)));
}

// The autocorrelation of the gusts after t is e^(-t/T): 0.2 s of T = 0.5 s give 0.670. One run of n correlated samples;
// the standard error is below 3 / sqrt(n) = 0.7 %.
#[test]
fn gusts_have_their_correlation_time() {
    let gusts = Disturbances::default().with_gusts(0.4, 0.5);
    let mut noise = Noise::from_seed(11);
    let integrator = process(Structure::Iptd);
    let mut simulated = FixedStepLinear::new(&integrator, &gusts, 0.2, &mut noise);
    let mut rates = Vec::new();
    for _ in 0..200_000 {
        rates.push(simulated.rate());
        simulated.step(0.0, &mut noise);
    }
    let product: f64 = rates.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let square: f64 = rates.iter().map(|rate| rate * rate).sum();
    assert!((product / square - (-0.4_f64).exp()).abs() < 0.01);
}

// Numbers of an independent implementation (Python, numpy): w1 = 3, w0 = 2, dt = 0.02 s, two states behind the lag, unit
// noise and unit gain give the intensities 14.58 and 0.32; a gain of 4 divides them by 16.
#[test]
fn bandwidths_as_intensities() {
    let process = |gain| {
        Linear::new(Structure::Soiptd)
            .with_gain(gain)
            .with_lags_s([0.05, 1.0])
            .with_pole_per_s(0.5)
    };
    let mut bandwidths = Bandwidths::default();
    bandwidths.w1_rad_per_s = 3.0;
    bandwidths.w0_rad_per_s = 2.0;
    bandwidths.wy_rad_per_s = 5.0;
    for gain in [1.0, -4.0] {
        let process = process(gain);
        let found = Disturbances::from_bandwidths(&bandwidths, &process, 1.0, 0.02);
        assert!((found.input_walk.powi(2) * gain * gain - 14.58).abs() < 1e-12);
        assert!((found.input_white.powi(2) * gain * gain - 0.32).abs() < 1e-14);
        assert!((found.output_walk.powi(2) - 0.5).abs() < 1e-14);
        let back = found.bandwidths(&process, 1.0, 0.02).unwrap();
        assert!((back.w1_rad_per_s - 3.0).abs() < 1e-14);
        assert!((back.w0_rad_per_s - 2.0).abs() < 1e-14);
        assert!((back.wy_rad_per_s - 5.0).abs() < 1e-14);
        assert_eq!(found.bandwidths(&process, 0.0, 0.02), None);
    }
    // No bandwidth is no disturbance, also for a power of zero.
    let none = Disturbances::from_bandwidths(&Bandwidths::default(), &process(1.0), 1.0, 0.02);
    assert!(none.is_none());
}

// All disturbances at once; another seed gives another output.
#[test]
fn same_seed_same_bits() {
    let all = Disturbances::default()
        .with_input_walk(0.1)
        .with_input_white(0.1)
        .with_output_walk(0.1)
        .with_gusts(0.1, 0.3);
    for structure in Structure::ALL {
        let run = |seed| driven(&process(structure), all, 0.01, &mut Noise::from_seed(seed));
        assert_eq!(run(4).to_bits(), run(4).to_bits());
        assert!(run(4) != run(5) && run(4).is_finite());
    }
}

// A uniform number has the mean 1/2 and the variance 1/12; three standard errors of 100,000.
#[test]
fn uniform_numbers() {
    let mut noise = Noise::from_seed(2);
    let numbers: Vec<f64> = (0..100_000).map(|_| noise.uniform()).collect();
    let mean = numbers.iter().sum::<f64>() / 1e5;
    assert!((mean - 0.5).abs() < 3.0 * (1.0_f64 / 12.0 / 1e5).sqrt());
    let below = numbers.iter().filter(|number| **number < 0.01).count();
    // 1,000, with a standard deviation of 31.5.
    assert!((below as f64 - 1000.0).abs() < 95.0, "{below}");
}
