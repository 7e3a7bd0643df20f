//! Step tests: what was before the first row and before the step, and tests of few rows.

use onecycle_design::{Parameter, Structure};
use onecycle_identify::{Identification, Options, Remark, Verdict};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::steps::{HEATER, SAMPLE_S, Test, is_heater, normal};

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
    let mut noise = || normal(&mut random);
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

/// The identified gain lies between that of the tank at rest, 3.43, and that at the end of the step, 3.92.
fn is_tank(found: &Identification, what: &str) {
    let identified = found.outcome.as_ref().map_err(Verdict::kind);
    let gain = identified.map(|of| of.estimate.get(Parameter::K).unwrap().estimate);
    assert!(
        matches!(gain, Ok(Some(gain)) if (3.43..3.92).contains(&gain)),
        "{what}: {gain:?}"
    );
}

// From any state at the start such a step explains nothing, and an integrator that drifts until the step stops it explains as much as
// the tank.
#[test]
fn a_tank_is_answered_after_three_rows_of_rest() {
    let mut assumed = 0;
    for seed in 1..9 {
        let mut test = tank(seed);
        let found = test.identify(&Options::default());
        is_tank(&found, &format!("{seed}, after three rows"));
        assumed += usize::from(found.remarks.contains(&Remark::RestBeforeStep));
        for signal in [&mut test.time_s, &mut test.input, &mut test.output] {
            signal.drain(..3);
        }
        let stated = Options::default().input_before(Some(7.0));
        is_tank(&test.identify(&stated), &format!("{seed}, stated"));
    }
    assert!(assumed > 0);
}

// The same with another input before the span that is asked for.
#[test]
fn the_first_input_of_a_span_is_that_of_rest() {
    for seed in 1..9 {
        let mut test = tank(seed);
        test.time_s
            .splice(..0, (-40..0).map(|row| 0.2 * f64::from(row)));
        test.input.splice(..0, [2.0; 40]);
        test.output.splice(..0, [12.0; 40]);
        let cut = Options::default().span_s(Some(0.0), None);
        is_tank(&test.identify(&cut), &format!("{seed}"));
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
    for output in &mut test.output {
        *output += 0.005 * gain * normal(&mut random);
    }
    (test, gain)
}

// Who logs by hand has no more rows. Six of eight tests or more are answered, all of them rightly, and no random walk that has nothing to do
// with the step.
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
