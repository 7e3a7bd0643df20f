//! Lags that are equal, and time constants below a sample, against the truth.

use onecycle_design::{Linear, Parameter, Structure};
use onecycle_identify::{Identification, Options, Remark, Signals, identify};
use onecycle_plant::{Disturbances, FixedStepLinear, Noise, NoiseSource};

const STEP_S: f64 = 0.05;
const SAMPLES: u32 = 4000;
const SIGMA: f64 = 0.02;
const GAIN: f64 = 2.0;

/// Structure with its lags `T_body`, `T_prop` and `T_prop2` (s) and its dead time (s).
struct Truth {
    structure: Structure,
    lags_s: [f64; 3],
    tau_s: f64,
}

const LAGS: [Parameter; 3] = [Parameter::TBody, Parameter::TProp, Parameter::TProp2];

impl Truth {
    fn process(&self) -> Linear {
        let value = |parameter: Parameter| match parameter {
            Parameter::K => Some(GAIN),
            Parameter::Tau => Some(self.tau_s),
            lag => Some(self.lags_s[LAGS.iter().position(|other| *other == lag)?]),
        };
        Linear::from_parameters(self.structure, value).unwrap()
    }

    /// Response to an input of random size in each 2 s, with noise of the output.
    fn identify(&self, seed: u64) -> Identification {
        let mut noise = Noise::from_seed(seed);
        let none = Disturbances::default();
        let mut process = FixedStepLinear::new(&self.process(), &none, STEP_S, &mut noise);
        let (mut time_s, mut input, mut output) = (vec![], vec![], vec![]);
        let mut u = 0.0;
        for k in 0..SAMPLES {
            if k % 40 == 0 {
                u = noise.standard_normal();
            }
            time_s.push(f64::from(k) * STEP_S);
            input.push(u);
            output.push(process.output() + SIGMA * noise.standard_normal());
            process.step(u, &mut noise);
        }
        let signals = Signals {
            time_s: &time_s,
            input: &input,
            output: &output,
            samples_per_point: 1,
            sample_period_s: STEP_S,
            breaks: &[],
        };
        identify(&signals, &Options::default())
    }
}

// Of every structure with lags: they were refused ("the recording does not tell K/T_body"), called a resonance, or had intervals
// from 1e-40 to 1e40.
#[test]
fn equal_lags_are_one_multiple_lag() {
    use Parameter::{TBody, TProp, TProp2};
    for (structure, lags_s, expected) in [
        (Structure::Soptd, [1.0, 1.0, 0.0], vec![TBody, TProp]),
        (Structure::Soiptd, [1.0, 1.0, 0.0], vec![TBody, TProp]),
        (Structure::Toptd, [3.0, 1.0, 1.0], vec![TProp, TProp2]),
        (Structure::Toiptd, [3.0, 1.0, 1.0], vec![TProp, TProp2]),
        (Structure::Toptd, [1.0; 3], vec![TBody, TProp, TProp2]),
        (Structure::Toiptd, [1.0; 3], vec![TBody, TProp, TProp2]),
    ] {
        let truth = Truth {
            structure,
            lags_s,
            tau_s: 0.3,
        };
        for seed in 1..3 {
            let what = format!("{structure:?} {lags_s:?}, seed {seed}");
            let found = truth.identify(seed);
            assert!(found.outcome.is_ok(), "{what}: {:?}", found.outcome.err());
            let identified = found.outcome.as_ref().unwrap();
            assert_eq!(identified.model.structure(), structure, "{what}");
            for (lag, lag_s) in LAGS.iter().zip(lags_s).filter(|(_, lag_s)| *lag_s > 0.0) {
                let interval = identified.estimate.get(*lag).unwrap();
                let (low, high) = (interval.low.unwrap(), interval.high.unwrap());
                assert!(high < 1.5 * low, "{what}, {lag:?}: {interval:?}");
                // Nine of ten intervals hold the truth, and all nearly.
                let is_near = 0.93 * low < lag_s && lag_s < 1.07 * high;
                assert!(is_near, "{what}, {lag:?}: {interval:?}");
            }
            let equal = found.remarks.iter().find_map(|remark| match remark {
                Remark::EqualLags { lags, mean_s } => Some((lags, mean_s)),
                _ => None,
            });
            let Some((lags, mean_s)) = equal else {
                // Ruled out in one of ten recordings.
                assert!(seed == 2, "{what}: {:?}", identified.estimate);
                continue;
            };
            assert_eq!(lags, &expected, "{what}");
            let (low, high) = (mean_s.low.unwrap(), mean_s.high.unwrap());
            assert!(
                0.98 < low && low < 1.01 && 0.99 < high && high < 1.02,
                "{what}: {mean_s:?}"
            );
        }
    }
}

// A body or an actuator that is faster than a sample: an interval of zero width at the bound of the search said that it is known.
#[test]
fn what_is_faster_than_a_sample_is_below_it() {
    for (structure, lags_s, tau_s, expected) in [
        (
            Structure::Foptd,
            [1e-3, 0.0, 0.0],
            0.28,
            vec![Parameter::TBody],
        ),
        (
            Structure::Foptd,
            [1e-3, 0.0, 0.0],
            0.0,
            vec![Parameter::TBody, Parameter::Tau],
        ),
        (Structure::Foptd, [1.0, 0.0, 0.0], 0.28, vec![]),
    ] {
        let truth = Truth {
            structure,
            lags_s,
            tau_s,
        };
        let identified = truth.identify(1).outcome.unwrap();
        let estimate = &identified.estimate;
        let parameters = estimate.iter().map(|(parameter, _)| parameter);
        let below: Vec<Parameter> = parameters
            .filter(|parameter| estimate.is_below(*parameter))
            .collect();
        assert_eq!(below, expected);
        for parameter in below {
            let interval = estimate.get(parameter).unwrap();
            let high = interval.high.unwrap();
            assert!(0.8 * STEP_S < high && high < 1.2 * STEP_S, "{interval:?}");
        }
        for (parameter, value) in [
            (Parameter::K, GAIN),
            (Parameter::TBody, lags_s[0]),
            (Parameter::Tau, tau_s),
        ] {
            let interval = estimate.get(parameter).unwrap();
            let is_held = interval.holds(value) || estimate.is_below(parameter);
            assert!(is_held, "{parameter:?} {value}: {interval:?}");
        }
    }
}
