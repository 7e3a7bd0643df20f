//! Step tests, square waves and drift: recordings without a steady oscillation, against exact solutions.

use onecycle_design::Parameter;
use onecycle_identify::{Evidence, Identification, Options, Remark, Signals, Verdict, identify};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Heater: gain, longer and shorter lag (s), dead time (s).
pub(crate) const HEATER: [f64; 4] = [120.0, 600.0, 20.0, 5.0];
pub(crate) const SAMPLE_S: f64 = 1.0;

/// Response of a process such as the heater to a unit step `since` seconds ago.
fn response([gain, slow_s, fast_s, tau_s]: [f64; 4], since: f64) -> f64 {
    let s = (since - tau_s).max(0.0);
    gain * (1.0 - (slow_s * (-s / slow_s).exp() - fast_s * (-s / fast_s).exp()) / (slow_s - fast_s))
}

/// Sum of twelve uniform numbers: nearly normal, of variance one.
pub(crate) fn normal(random: &mut Pcg64Mcg) -> f64 {
    (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0
}

pub(crate) struct Test {
    pub(crate) time_s: Vec<f64>,
    pub(crate) input: Vec<f64>,
    pub(crate) output: Vec<f64>,
}

impl Test {
    /// `count` samples of the response of the heater to steps of the input, from rest at 22, with noise of 0.05. A step: its time
    /// and size.
    pub(crate) fn of(steps: &[(f64, f64)], count: usize) -> Self {
        Self::of_process(HEATER, steps, count)
    }

    pub(crate) fn of_process(process: [f64; 4], steps: &[(f64, f64)], count: usize) -> Self {
        let time_s = (0..count).map(|k| k as f64 * SAMPLE_S).collect();
        Self::at(time_s, steps, &|since| response(process, since))
    }

    /// Samples at these times of the response to steps, that to a unit step being `response`.
    fn at(time_s: Vec<f64>, steps: &[(f64, f64)], response: &dyn Fn(f64) -> f64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let total = |time_s: f64, of: &dyn Fn(f64) -> f64| -> f64 {
            let passed = steps.iter().filter(|(at_s, _)| *at_s <= time_s);
            passed.map(|(at_s, size)| size * of(time_s - at_s)).sum()
        };
        Self {
            input: time_s.iter().map(|t| total(*t, &|_| 1.0)).collect(),
            output: time_s
                .iter()
                .map(|t| 22.0 + total(*t, response) + 0.05 * normal(&mut random))
                .collect(),
            time_s,
        }
    }

    pub(crate) fn identify(&self, options: &Options) -> Identification {
        let signals = Signals {
            time_s: &self.time_s,
            input: &self.input,
            output: &self.output,
            samples_per_point: 1,
            sample_period_s: self.time_s[1] - self.time_s[0],
            breaks: &[],
        };
        identify(&signals, options)
    }
}

/// The gain and the dead time lie within their intervals, and the gain within 3 %.
pub(crate) fn is_heater(found: &Identification, what: &str) {
    assert!(
        found.outcome.is_ok(),
        "{what}: {:?}",
        found.outcome.as_ref().err()
    );
    let identified = found.outcome.as_ref().unwrap();
    let structure = identified.model.structure();
    assert_eq!(structure.stages().integrators, 0, "{what}: {structure:?}");
    let gain = identified.estimate.get(Parameter::K).unwrap();
    assert!(
        (gain.estimate.unwrap() / HEATER[0] - 1.0).abs() < 0.03,
        "{what}: {gain:?}"
    );
    assert!(gain.holds(HEATER[0]), "{what}: {gain:?}");
}

// Stamps 4 and 3 s apart leave five of seven points of their grid without a sample. The end is calm all the same, and no row of the
// fit is one without a sample, where the model's mean over none is zero.
#[test]
fn a_settled_end_with_uneven_stamps_is_no_failure_of_prediction() {
    let times_s = (0..3600).filter(|k| matches!(k % 7, 0 | 4)).map(f64::from);
    let test = Test::at(times_s.collect(), &[(0.0, 0.5)], &|since| {
        response(HEATER, since)
    });
    let found = test.identify(&Options::default());
    is_heater(&found, "uneven");
    let identified = found.outcome.unwrap();
    let Evidence::Innovations(innovations) = &identified.fit.evidence else {
        panic!("one objective");
    };
    assert!(innovations.prediction.unwrap().explained > 0.999);
    for row in &innovations.rows {
        assert!((row.measured - row.simulated).abs() < 0.5, "{row:?}");
    }
}

// A square wave whose output settles is no oscillation of a relay.
#[test]
fn a_square_wave_of_steps_is_answered() {
    let steps: Vec<(f64, f64)> = (0..6)
        .map(|k| {
            (
                20.0 + 3500.0 * f64::from(k),
                if k % 2 == 0 { 0.5 } else { -0.5 },
            )
        })
        .collect();
    let test = Test::of(&steps, 20_000);
    is_heater(&test.identify(&Options::default()), "square wave");
}

// A random walk of the ambient temperature that has nothing to do with the input stays a disturbance: a fit without it explains
// no more than chance.
#[test]
fn a_walk_that_ignores_the_input_is_no_gain() {
    for seed in 1..4 {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let steps: Vec<(f64, f64)> = (0..10)
            .map(|k| (800.0 * f64::from(k) + 50.0, random.random_range(-0.3..0.3)))
            .collect();
        let mut test = Test::of(&steps, 8000);
        let (mut walk, mut ambient) = (0.0, 0.0);
        for output in &mut test.output {
            walk += 0.1 * random.random_range(-1.0..1.0);
            ambient += SAMPLE_S / HEATER[1] * (walk - ambient);
            *output += ambient;
        }
        let found = test.identify(&Options::default());
        let identified = found.outcome.unwrap();
        let gain = identified.estimate.get(Parameter::K).unwrap();
        assert!(
            (gain.estimate.unwrap() / HEATER[0] - 1.0).abs() < 0.1,
            "{gain:?}"
        );
        assert!(!found.remarks.contains(&Remark::DriftOrGain), "{seed}");
    }
}

// Samples every 0.1 ps: a wrong unit of time. It ended in a panic.
#[test]
fn a_sample_period_below_a_nanosecond_is_refused() {
    let mut test = Test::of(&[(20.0, 0.5)], 500);
    test.time_s.iter_mut().for_each(|time_s| *time_s *= 1e-13);
    let found = test.identify(&Options::default());
    assert_eq!(found.outcome.unwrap_err(), Verdict::Units);
}

// 60,000 rows of steps 5,000 apart: a part of 20,000 hardly holds one response of a process this slow, all of it does.
#[test]
fn a_slow_process_in_a_long_fast_log_is_answered() {
    let process = [2.0, 2860.0, 300.0, 670.0];
    let sizes = [10.0, -15.0, 12.0, -18.0, 20.0, -9.0, 14.0, -20.0, 8.0, 6.0];
    let steps: Vec<(f64, f64)> = (sizes.iter().zip(1..))
        .map(|(size, number)| (5000.0 * f64::from(number), *size))
        .collect();
    let found = Test::of_process(process, &steps, 60_000).identify(&Options::default());
    let model = found.outcome.expect("identified").model;
    let of = |parameter| model.parameter(parameter).unwrap();
    for (parameter, value) in [
        (Parameter::K, 2.0),
        (Parameter::TBody, 2860.0),
        (Parameter::Tau, 670.0),
    ] {
        assert!(
            (of(parameter) / value - 1.0).abs() < 0.01,
            "{parameter:?} {}",
            of(parameter)
        );
    }
}

// Two sines of load on a process under a P controller: the input is the output times -0.4 in the same row, whatever the process is.
#[test]
fn a_controller_is_not_taken_for_the_process() {
    let (mut level, mut input, mut output) = (0.0, vec![], vec![]);
    let mut random = Pcg64Mcg::seed_from_u64(2);
    for k in 0_i32..900 {
        let time_s = f64::from(k);
        let measured = level + random.random_range(-0.02..0.02);
        output.push(measured);
        input.push(-0.4 * measured);
        let load = (0.031 * time_s).sin() + 0.6 * (0.087 * time_s).sin();
        let acting: f64 = input[(k - 4).max(0) as usize];
        level += (1.2 * (acting + load) - level) / 22.0;
    }
    let time_s: Vec<f64> = (0..900).map(f64::from).collect();
    let found = Test {
        time_s,
        input,
        output,
    }
    .identify(&Options::default());
    let verdict = found.outcome.err();
    assert!(
        matches!(
            verdict,
            Some(Verdict::OutputLeads { .. } | Verdict::OfController)
        ),
        "{verdict:?}"
    );
}

// Stamps of a log that stores at any time: increments of the exponential law, whose longest are ten times the median. The rounding of
// the stamps is hidden in the noise.
#[test]
fn stamps_that_follow_no_grid() {
    let mut random = Pcg64Mcg::seed_from_u64(2);
    let mut time_s = vec![0.0];
    for k in 0..1500 {
        time_s.push(time_s[k] - 2.0 * (1.0 - random.random_range(0.0..1.0_f64)).ln() + 1e-3);
    }
    let steps = [(time_s[20], 0.5), (time_s[700], -0.2), (time_s[1100], 0.3)];
    let test = Test::at(time_s, &steps, &|since| response(HEATER, since));
    let found = test.identify(&Options::default());
    is_heater(&found, "uneven stamps");
}

// (1 - 16 s) e^(-3 s) / ((20 s + 1) (8 s + 1)), which no structure has: a lag behind a longer dead time predicts most of it, and its
// controller would be unstable with it. The past input shows that.
#[test]
fn a_response_that_begins_in_the_wrong_direction() {
    let inverse = |since: f64| {
        let (process, zero_s, step_s) = ([1.0, 20.0, 8.0, 3.0], 16.0, 1e-4);
        let rate = (response(process, since + step_s) - response(process, since)) / step_s;
        response(process, since) - zero_s * rate
    };
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let mut steps = vec![(50.0, 5.0)];
    for k in 0..12 {
        let size = if k % 2 == 0 { -5.0 } else { 5.0 };
        steps.push((
            steps[k].0 + random.random_range(60.0..160.0_f64).round(),
            size,
        ));
    }
    let time_s = (0..1500).map(f64::from).collect();
    let found = Test::at(time_s, &steps, &inverse).identify(&Options::default());
    let verdict = found.outcome.err();
    assert!(
        matches!(verdict, Some(Verdict::InputLeft { .. })),
        "{verdict:?}"
    );
}

// The gain of a sensor falls with the output, to 0.4 and 0.28 of that at rest. A thrust that falls with the input stood for it, and the
// gain was not told.
#[test]
fn the_curve_of_a_sensor_is_no_thrust() {
    let levels = [0.0, 0.2, 0.4, 0.1, 0.3, 0.5, 0.2, 0.4];
    let changes: Vec<(f64, f64)> = (1..levels.len())
        .map(|k| (400.0 * k as f64, levels[k] - levels[k - 1]))
        .collect();
    for curve in [0.005, 0.006] {
        let mut test = Test::of_process([120.0, 30.0, 2.0, 1.0], &changes, 3200);
        for y in &mut test.output {
            *y -= curve * (*y - 22.0).powi(2);
        }
        let found = test.identify(&Options::default());
        let kinds: Vec<&str> = found.remarks.iter().map(Remark::kind).collect();
        assert!(found.outcome.is_ok(), "{curve}: {kinds:?}");
        assert!(!kinds.contains(&"nonlinear"), "{curve}: {kinds:?}");
        let gain = found.outcome.as_ref().unwrap().estimate.get(Parameter::K);
        let gain = gain.unwrap().estimate.unwrap();
        assert!(
            ((1.0 - 120.0 * curve) * 120.0..120.0).contains(&gain),
            "{gain}"
        );
    }
}

/// A square wave of half periods of 100 s, and the output that a lag of 10 s answers to it after a dead time; negative: before it.
fn square_wave(tau_s: f64) -> Test {
    let changes = |late_s: f64| -> Vec<(f64, f64)> {
        let size = |k: i32| {
            if k == 0 {
                1.0
            } else {
                2.0 * f64::from(1 - 2 * (k % 2))
            }
        };
        (0..30)
            .map(|k| (100.0 * f64::from(k) + late_s, size(k)))
            .collect()
    };
    let process = [20.0, 10.0, 0.01, 0.0];
    Test {
        input: Test::of_process(process, &changes(20.0), 2900).input,
        ..Test::of_process(process, &changes(20.0 + tau_s), 2900)
    }
}

// An output that is logged 5 s before its input is that of the other sign after 95 s, or of any half period more. A dead time of 60 s is
// one: with the other sign the output would begin 40 s before its input.
#[test]
fn half_a_period_of_dead_time_is_the_other_sign() {
    let found = square_wave(-5.0).identify(&Options::default());
    assert_eq!(found.outcome.unwrap_err(), Verdict::SignNotTold);
    let found = square_wave(60.0).identify(&Options::default());
    let estimate = found.outcome.unwrap().estimate;
    let of = |parameter| estimate.get(parameter).unwrap().estimate.unwrap();
    let (gain, tau_s) = (of(Parameter::K), of(Parameter::Tau));
    assert!(
        (gain - 20.0).abs() < 0.1 && (tau_s - 60.0).abs() < 0.1,
        "{gain} {tau_s}"
    );
}
