//! Step tests, square waves and drift: recordings without a steady oscillation, against exact solutions.

use onecycle_design::{Parameter, Structure};
use onecycle_identify::{Evidence, Identification, Options, Remark, Signals, Verdict, identify};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Heater: gain, longer and shorter lag (s), dead time (s).
const HEATER: [f64; 4] = [120.0, 600.0, 20.0, 5.0];
pub(crate) const SAMPLE_S: f64 = 1.0;

/// Response of a process such as the heater to a unit step `since` seconds ago.
fn response([gain, slow_s, fast_s, tau_s]: [f64; 4], since: f64) -> f64 {
    let s = (since - tau_s).max(0.0);
    gain * (1.0 - (slow_s * (-s / slow_s).exp() - fast_s * (-s / fast_s).exp()) / (slow_s - fast_s))
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

    fn of_process(process: [f64; 4], steps: &[(f64, f64)], count: usize) -> Self {
        let time_s = (0..count).map(|k| k as f64 * SAMPLE_S).collect();
        Self::at(time_s, steps, &|since| response(process, since))
    }

    /// Samples at these times of the response to steps, that to a unit step being `response`.
    fn at(time_s: Vec<f64>, steps: &[(f64, f64)], response: &dyn Fn(f64) -> f64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        // Sum of twelve uniform numbers: nearly normal, of variance one.
        let mut noise = || (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0;
        let total = |time_s: f64, of: &dyn Fn(f64) -> f64| -> f64 {
            let passed = steps.iter().filter(|(at_s, _)| *at_s <= time_s);
            passed.map(|(at_s, size)| size * of(time_s - at_s)).sum()
        };
        Self {
            input: time_s.iter().map(|t| total(*t, &|_| 1.0)).collect(),
            output: time_s
                .iter()
                .map(|t| 22.0 + total(*t, response) + 0.05 * noise())
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
fn is_heater(found: &Identification, what: &str) {
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

// The rows of rest before the step say nothing new. With a free initial state they alone would tell the gain, and few of them
// were refused; after many the settled end was called a failure of the prediction.
#[test]
fn a_step_is_answered_after_any_time_of_rest() {
    for rest in [1, 5, 60, 300] {
        let test = Test::of(&[(f64::from(rest), 0.5)], 3000 + rest as usize);
        is_heater(&test.identify(&Options::default()), &format!("{rest} rows"));
    }
}

/// Level of a tank that empties by the root of it (Torricelli), from rest at 12 under an input of 7: three rows of that, then 8. Its time
/// constant is 95 s at rest. Noise of 0.02, and waves.
fn tank(seed: u64) -> Test {
    const STEPS: usize = 20;
    let sample_s = 0.2;
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut noise = || (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0;
    let outflow = 7.0 / 12_f64.sqrt();
    let area = 95.0 * outflow / (2.0 * 12_f64.sqrt());
    let mut level = 12.0 * (1.0 + 0.002 * noise());
    let time_s: Vec<f64> = (0..1250).map(|row| f64::from(row) * sample_s).collect();
    let input: Vec<f64> = (0..1250).map(|row| 7.0 + f64::from(row >= 3)).collect();
    let measured = |(time_s, input): (&f64, &f64)| {
        let waves = 0.01 * (std::f64::consts::TAU * 0.7 * time_s).sin();
        let output = level + waves + 0.02 * noise();
        for _ in 0..STEPS {
            level += sample_s / STEPS as f64 * (input - outflow * level.sqrt()) / area;
        }
        output
    };
    Test {
        output: time_s.iter().zip(&input).map(measured).collect(),
        time_s,
        input,
    }
}

// From any state at the start such a step explains nothing, and an integrator that drifts until the step stops it explains as much as
// the tank. The gain is that of the level at rest, 3.43, to that at the end, 3.92.
#[test]
fn a_tank_is_answered_after_three_rows_of_rest() {
    let mut assumed = 0;
    for seed in 1..9 {
        let mut test = tank(seed);
        let is_right = |found: &Identification, what: &str| {
            let identified = found.outcome.as_ref().map_err(|verdict| verdict.kind());
            let gain = identified.map(|of| of.estimate.get(Parameter::K).unwrap().estimate);
            assert!(
                matches!(gain, Ok(Some(gain)) if (3.43..3.92).contains(&gain)),
                "{seed} {what}: {gain:?}"
            );
        };
        let found = test.identify(&Options::default());
        is_right(&found, "after three rows");
        assumed += usize::from(found.remarks.contains(&Remark::RestBeforeStep));
        for signal in [&mut test.time_s, &mut test.input, &mut test.output] {
            signal.drain(..3);
        }
        is_right(
            &test.identify(&Options::default().input_before(Some(7.0))),
            "stated",
        );
    }
    assert!(assumed > 0);
}

// The same with another input before the span that is asked for.
#[test]
fn the_first_input_of_a_span_is_that_of_rest() {
    for seed in 1..9 {
        let Test {
            mut time_s,
            mut input,
            mut output,
        } = tank(seed);
        let before = |signal: &mut Vec<f64>, value: &dyn Fn(f64) -> f64| {
            let earlier: Vec<f64> = (-40..0).map(|row| value(f64::from(row))).collect();
            signal.splice(..0, earlier);
        };
        before(&mut time_s, &|row| 0.2 * row);
        before(&mut input, &|_| 2.0);
        before(&mut output, &|_| 12.0);
        let test = Test {
            time_s,
            input,
            output,
        };
        let found = test.identify(&Options::default().span_s(Some(0.0), None));
        let gain = found.outcome.unwrap().estimate.get(Parameter::K).unwrap();
        let gain = gain.estimate.unwrap();
        assert!((3.43..3.92).contains(&gain), "{seed}: {gain}");
    }
}

/// A step in the fourth row of `rows`, the answer of two lags and a dead time that are shares of the record, and noise of 0.5 % of it.
fn short(rows: i32, seed: u64) -> (Test, f64) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let length = f64::from(rows);
    let slow_s = random.random_range(0.08..0.2) * length;
    let gain = random.random_range(10.0..60.0);
    let process = [
        gain,
        slow_s,
        random.random_range(0.05..0.4) * slow_s,
        random.random_range(0.0..0.06) * length,
    ];
    let mut test = Test::of_process(process, &[(3.0, 1.0)], rows as usize);
    let mut noise = || (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0;
    for output in &mut test.output {
        *output += 0.005 * gain * noise();
    }
    (test, gain)
}

// Who logs by hand has no more. From 30 rows on there is an answer, and it is right; of a walk that has nothing to do with the step there
// is none.
#[test]
fn a_short_step_test_is_answered() {
    for rows in [30, 40, 55] {
        let found = (0..8).map(|seed| {
            let (test, gain) = short(rows, seed);
            let outcome = test.identify(&Options::default()).outcome.ok()?;
            Some(outcome.estimate.get(Parameter::K)?.estimate? / gain)
        });
        let ratios: Vec<f64> = found.flatten().collect();
        assert!(ratios.len() >= 6, "{rows} rows: {ratios:?}");
        let is_right = |ratio: &f64| (ratio - 1.0).abs() < 0.15;
        assert!(ratios.iter().all(is_right), "{rows} rows: {ratios:?}");
        for seed in 0..8 {
            let (mut test, _) = short(rows, seed);
            let mut random = Pcg64Mcg::seed_from_u64(100 + seed);
            let mut walk = 0.0;
            for output in &mut test.output {
                walk += random.random_range(-1.0..1.0);
                *output = walk + random.random_range(-0.2..0.2);
            }
            let found = test.identify(&Options::default());
            assert!(found.outcome.is_err(), "{rows} rows of a walk, {seed}");
        }
    }
}

// Of a step in the second row the search without rest finds nothing in this structure; at rest there is a fit.
#[test]
fn a_stated_structure_is_tried_at_rest_too() {
    let test = Test::of(&[(1.0, 0.5)], 3001);
    let stated = Options::default().structure(Some(Structure::Toptd));
    is_heater(&test.identify(&stated), "stated");
}

// The input before the first row is not in the recording: it is taken as zero, and a remark says so, or stated.
#[test]
fn a_step_in_the_first_row_is_one_from_zero_or_from_the_stated_input() {
    let mut test = Test::of(&[(0.0, 0.5)], 3000);
    let found = test.identify(&Options::default());
    is_heater(&found, "from zero");
    assert!(found.remarks.contains(&Remark::AssumedRest));
    test.input.iter_mut().for_each(|input| *input += 0.2);
    let stated = test.identify(&Options::default().input_before(Some(0.2)));
    is_heater(&stated, "stated");
    assert!(!stated.remarks.contains(&Remark::AssumedRest));
}

// The input of the last row acts after it.
#[test]
fn a_change_in_the_last_row_shows_nothing() {
    let mut test = Test::of(&[(0.0, 0.5)], 3000);
    let found = test.identify(&Options::default());
    test.time_s.push(3000.0 * SAMPLE_S);
    test.input.push(0.0);
    test.output.push(22.0 + 0.5 * HEATER[0]);
    let also = test.identify(&Options::default());
    is_heater(&also, "off in the last row");
    assert_eq!(found.outcome.ok(), also.outcome.ok());
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

// Before a test that starts in the first row the process was at rest, but not under the first input. After a dead time as long as
// this a fit from rest under it makes up for the missing step with an integrator.
#[test]
fn a_test_that_starts_in_the_first_row_is_not_from_rest_under_its_first_input() {
    let switch = |k: u32| {
        (
            75.0 * f64::from(k) - 15.0,
            if k.is_multiple_of(2) { 1.0 } else { -1.0 },
        )
    };
    let steps: Vec<(f64, f64)> = std::iter::once((0.0, 0.5))
        .chain((1..26).map(switch))
        .collect();
    let [gain, slow_s, fast_s, _] = HEATER;
    let test = Test::of_process([gain, slow_s, fast_s, 45.0], &steps, 2000);
    is_heater(
        &test.identify(&Options::default()),
        "square wave from the first row",
    );
}

// One exponential may have begun long ago: it does not tell the gain.
#[test]
fn an_exponential_under_a_constant_input_is_no_step_test() {
    let mut test = Test::of(&[(0.0, 0.5)], 4000);
    for column in [&mut test.time_s, &mut test.input, &mut test.output] {
        column.drain(..300);
    }
    let found = test.identify(&Options::default());
    assert_eq!(found.outcome.unwrap_err(), Verdict::ConstantInput);
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

// A short test of a process read by a noisy sensor: the rows before the step hardly tell that it was at rest.
#[test]
fn a_short_step_is_one_from_rest_whatever_few_rows_are_before_it() {
    let process = [0.45, 33.0, 6.7, 3.7];
    for rest in [1, 2, 3, 8] {
        let test = Test::of_process(process, &[(f64::from(rest), 4.0)], 230 + rest as usize);
        let found = test.identify(&Options::default());
        let identified = found.outcome.as_ref().unwrap();
        let gain = identified.estimate.get(Parameter::K).unwrap();
        assert!(gain.holds(0.45), "{rest} rows: {gain:?}");
    }
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
