extern crate std;

use core::f64::consts::TAU;

use std::vec::Vec;

use super::*;

/// Rows of a test: reference and value.
fn rows(count: usize) -> Vec<(f32, f32)> {
    (0..count)
        .map(|k| {
            let t = k as f64;
            let reference = if k > 40 { 1.5 } else { -0.25 };
            let value = 0.4 * libm::sin(TAU * t / 37.0) + 0.01 * t + 0.3 * libm::cos(TAU * t / 5.0);
            (reference, value as f32)
        })
        .collect()
}

/// The law of the module's documentation as difference equations in `z`, in double precision, from rest at the first
/// value: `F` and `s F` multiplied out, `(1 + 2/z + 1/z^2)` and `(2/h) (1 - 1/z^2)` over one denominator.
fn difference_equations(settings: &PidSettings, h: f64, rows: &[(f32, f32)]) -> Vec<f64> {
    let c = 2.0 / h;
    let tf = f64::from(settings.filter_s);
    let [a0, a1, a2] = [
        1.0 + tf * c + 0.5 * tf * tf * c * c,
        2.0 - tf * tf * c * c,
        1.0 - tf * c + 0.5 * tf * tf * c * c,
    ];
    let first = f64::from(rows[0].1);
    let (mut y, mut filtered, mut slope) = ([first; 3], [first; 3], [0.0; 3]);
    let (mut integral, mut out) = (0.0, Vec::new());
    for &(reference, value) in rows {
        let reference = f64::from(reference);
        y = [f64::from(value), y[0], y[1]];
        let next = (y[0] + 2.0 * y[1] + y[2] - a1 * filtered[0] - a2 * filtered[1]) / a0;
        filtered = [next, filtered[0], filtered[1]];
        let next = (c * (y[0] - y[2]) - a1 * slope[0] - a2 * slope[1]) / a0;
        slope = [next, slope[0], slope[1]];
        integral += f64::from(settings.ki) * h * (reference - filtered[0]);
        let weighted = f64::from(settings.setpoint_weight) * reference - filtered[0];
        out.push(f64::from(settings.kp) * weighted + integral - f64::from(settings.kd) * slope[0]);
    }
    out
}

// Single precision: 6e-8 of the largest term at a tick, remembered by the filter for 2 Tf/h, that is, 200 ticks at most.
#[test]
fn the_law_is_its_discretisation() {
    let rows = rows(400);
    for (filter_s, h) in [(0.02, 0.0025_f64), (0.01, 0.01), (0.1, 0.001)] {
        let settings = PidSettings::new(3.0, 7.0, 0.4)
            .with_filter_s(filter_s)
            .with_setpoint_weight(0.6);
        let mut law = PidLaw::new(settings).unwrap();
        let expected = difference_equations(&settings, h, &rows);
        let largest = expected.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
        for (&(reference, value), expected) in rows.iter().zip(expected) {
            let u = law.step(h as f32, reference, &Measurement::of(value));
            let off = (f64::from(u) - expected).abs();
            assert!(off < 1.2e-5 * largest, "{filter_s} {h}: {u} {expected}");
        }
    }
}

// h = 1/4, kp = 2, ki = 1, kd = 1/2, b = 1/2, no filter; r = 1, y = 0 then 1/4. First tick: 2 (1/2 - 0) + 1/4 - 0.
// Second: 2 (1/2 - 1/4) + 1/4 + 3/16 - 1/2 (1/4)/(1/4). A measured rate of 3 replaces the last term: - 3/2.
#[test]
fn two_ticks_by_hand() {
    let settings = PidSettings::new(2.0, 1.0, 0.5).with_setpoint_weight(0.5);
    let mut law = PidLaw::new(settings).unwrap();
    assert_eq!(law.step(0.25, 1.0, &Measurement::of(0.0)), 1.25);
    let mut other = law;
    assert_eq!(law.step(0.25, 1.0, &Measurement::of(0.25)), 0.4375);
    let measured = Measurement::of(0.25).with_rate(3.0);
    assert_eq!(other.step(0.25, 1.0, &measured), -0.5625);
    assert_eq!((law.integral(), law.status()), (0.4375, PidStatus::Free));
}

// Half a tick, a whole one and three: h enters the integral, the difference and the filter of that tick only. The
// filtered value of a constant 1 from rest at 0 rises to 1 for any sequence of ticks, its slope to 0.
#[test]
fn a_changed_time_step_counts_at_its_tick() {
    let mut law = PidLaw::new(PidSettings::new(0.0, 2.0, 0.0)).unwrap();
    for (dt_s, expected) in [(0.125, 0.25), (0.25, 0.75), (0.75, 2.25)] {
        assert_eq!(law.step(dt_s, 1.0, &Measurement::of(0.0)), expected);
    }
    let mut filter = Filter::at(0.0);
    for tick in 0..200 {
        filter.step(1.0, [0.005, 0.01, 0.03][tick % 3], 0.05);
    }
    assert!((filter.output - 1.0).abs() < 1e-6 && filter.slope.abs() < 1e-5);
}

// With ki = 0, b = 1 and without filter the law is `PdLaw`, bit for bit.
#[test]
fn without_an_integral_it_is_the_pd_law() {
    let pd = crate::control::PdLaw {
        kp: 3.3,
        kd: 0.77,
        offset: 0.123,
    };
    let mut law = PidLaw::new(PidSettings::new(pd.kp, 0.0, pd.kd)).unwrap();
    law = law.started_at(0.9, pd.offset);
    for (reference, value) in rows(300) {
        let rate = 1.7 * value - reference;
        let u = law.step(0.001, reference, &Measurement::of(value).with_rate(rate));
        assert_eq!(u.to_bits(), pd.output(reference, value, rate).to_bits());
    }
}

// At the take-over the output goes on from the old command; at a change of the gains from the last output. Both differ
// by ki h (r - y) = 2 (0.01) (0.5) = 0.01 alone.
#[test]
fn take_over_and_change_without_a_bump() {
    let settings = PidSettings::new(4.0, 2.0, 1.0)
        .with_filter_s(0.05)
        .with_setpoint_weight(0.3);
    let mut law = PidLaw::new(settings).unwrap();
    let measured = Measurement::of(1000.0).with_rate(0.25);
    law.take_over(1000.5, &measured, -0.7);
    let step = |law: &mut PidLaw| law.step(0.01, 1000.5, &measured);
    assert!((step(&mut law) + 0.69).abs() < 1e-6, "{}", law.command());
    let changed = PidSettings::new(9.0, 2.0, 0.2).with_setpoint_weight(0.9);
    law.change(changed).unwrap();
    assert!((step(&mut law) + 0.68).abs() < 1e-6, "{}", law.command());
    assert_eq!(law.settings(), &changed);
    law.reset();
    assert_eq!(law, PidLaw::new(changed).unwrap());
}

// At 1 kHz the integral of a thousandth grows by 1e-6 (1/1024) a tick, far below the rounding of 1/2 in single
// precision, 3e-8: in a hundred seconds by 1e5 (1e-6)/1024 = 9.765625e-5.
#[test]
fn small_errors_are_integrated() {
    let mut law = PidLaw::new(PidSettings::new(0.0, 0.001, 0.0)).unwrap();
    law = law.started_at(0.0, 0.5);
    for _ in 0..100_000 {
        law.step(1.0 / 1024.0, 0.001, &Measurement::of(0.0));
    }
    let grown = law.integral() - 0.5;
    assert!((grown - 9.765_625e-5).abs() < 1e-7, "{grown}");
}

// The integral follows a limited output with the tracking time: kd/ki = 1/4, so 1/2 s; h = 1/2 gives a share of one
// half. kp = 0: wanted 2 (1/2) 4 = 4 at the limit of 1; the integral is drawn from 4 to 4 - 3/2. Next tick without an
// error: wanted 2.5, drawn to 2.5 - 0.75.
#[test]
fn back_calculation_by_hand() {
    let settings = PidSettings::new(0.0, 2.0, 0.5).with_limits(-1.0, 1.0);
    let mut law = PidLaw::new(settings).unwrap();
    let at = Measurement::of(0.0).with_rate(0.0);
    assert_eq!(law.step(0.5, 4.0, &at), 1.0);
    assert_eq!((law.integral(), law.status()), (2.5, PidStatus::AtHighest));
    law.step(0.5, 0.0, &at);
    assert_eq!(law.integral(), 1.75);
    // Without kp and kd it follows at once.
    let settings = PidSettings::new(0.0, 2.0, 0.0).with_limits(-1.0, 1.0);
    let mut law = PidLaw::new(settings).unwrap();
    assert_eq!(law.step(0.5, -4.0, &at), -1.0);
    assert_eq!((law.integral(), law.status()), (-1.0, PidStatus::AtLowest));
}

// Whatever is not a number leaves the state as it was, and the command too.
#[test]
fn what_is_not_a_number_is_held() {
    let settings = PidSettings::new(2.0, 1.0, 0.5)
        .with_filter_s(0.1)
        .with_limits(-3.0, 3.0);
    let mut law = PidLaw::new(settings).unwrap();
    let good = Measurement::of(0.5).with_rate(0.1);
    let command = law.step(0.01, 1.0, &good);
    let held = PidLaw {
        status: PidStatus::Held,
        ..law
    };
    let (nan, infinite) = (f32::NAN, f32::INFINITY);
    for (dt_s, reference, measurement) in [
        (nan, 1.0, good),
        (0.0, 1.0, good),
        (-0.01, 1.0, good),
        (infinite, 1.0, good),
        (0.01, nan, good),
        (0.01, infinite, good),
        (0.01, 1.0, Measurement::of(nan)),
        (0.01, 1.0, good.with_rate(nan)),
        (0.01, f32::MAX, Measurement::of(f32::MIN)),
    ] {
        assert_eq!(law.step(dt_s, reference, &measurement), command);
        assert_eq!(law, held);
    }
    law.take_over(nan, &good, 0.0);
    law.take_over(0.0, &good, nan);
    assert_eq!(law, held);
    law.step(0.01, 1.0, &good);
    assert_eq!(law.status(), PidStatus::Free);
}

#[test]
fn settings_out_of_range_are_named() {
    let good = PidSettings::new(2.0, 1.0, 0.5);
    let nan = f32::NAN;
    for (settings, words) in [
        (
            PidSettings::new(nan, 1.0, 0.5),
            "the gain kp must be finite, but is NaN",
        ),
        (PidSettings::new(2.0, -1.0, 0.5), "must have the same sign"),
        (
            good.with_filter_s(-0.1),
            "zero or a positive time, but is -0.1 s",
        ),
        (
            good.with_setpoint_weight(nan),
            "weight must be 0 to 1, but is NaN",
        ),
        (
            good.with_limits(1.0, 1.0),
            "below the upper one, but they are 1 and 1",
        ),
        (good.with_limits(nan, 1.0), "below the upper one"),
    ] {
        let error = PidLaw::new(settings).unwrap_err();
        assert!(std::format!("{error}").contains(words), "{error}");
        let mut law = PidLaw::new(good).unwrap();
        let changed = law.change(settings).unwrap_err();
        assert_eq!(std::format!("{changed}"), std::format!("{error}"));
        assert_eq!(law.settings(), &good);
    }
    // A process that falls when the input rises.
    assert!(PidLaw::new(PidSettings::new(-2.0, -1.0, 0.0)).is_ok());
}

// Any bits as time step, reference, value, rate and command, among usual ones: every output is finite and within the limits.
#[test]
fn no_input_leaves_the_limits() {
    let mut random = 1_u64;
    let mut bits = || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let any = f32::from_bits((random >> 32) as u32);
        if random >> 20 & 3 == 0 {
            any
        } else {
            (random >> 40) as f32 / 16_777_216.0
        }
    };
    let settings = PidSettings::new(3.0, 5.0, 0.7)
        .with_filter_s(0.02)
        .with_setpoint_weight(0.4)
        .with_limits(-2.0, 1.5);
    let mut law = PidLaw::new(settings).unwrap();
    let mut statuses = [0; 4];
    for tick in 0..200_000 {
        let measurement = Measurement::of(bits()).with_rate(bits());
        if tick % 97 == 0 {
            law.take_over(bits(), &measurement, bits());
        }
        let output = law.step(0.01 * bits(), bits(), &measurement);
        assert!((-2.0..=1.5).contains(&output), "{tick}: {output}");
        assert!(law.integral().is_finite());
        statuses[law.status() as usize] += 1;
    }
    // Each status occurs, so the test has seen them.
    assert!(statuses.iter().all(|count| *count > 1000), "{statuses:?}");
}
