//! Who holds the axis: consent to a controller that was found, another controller beside the tuner, and an analysis that runs
//! elsewhere.

use onecycle_onboard::control::{Measurement, PdLaw};
use onecycle_onboard::guard::Abort;
use onecycle_onboard::identification::{Analysis, Bench, Desk};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::tuner::{Consent, Tuner, TunerCore, TunerPhase, TunerSettings};

use super::axis::Axis;
use super::{SAMPLE_S, height, settings, tuner};

/// Slow and well damped.
const SAFE: PdLaw = PdLaw {
    kp: 0.5,
    kd: 0.4,
    offset: 0.0,
};

fn with(consent: Consent) -> TunerSettings {
    TunerSettings {
        safe: SAFE,
        bias_filter_s: 0.5,
        consent,
        ..settings()
    }
}

/// A tuner whose test has ended in a proposal, and its axis with a bias.
fn proposed(consent: Consent) -> (Tuner<'static>, Axis) {
    let mut tuner = tuner(&with(consent));
    let mut axis = Axis::new(height(), SAMPLE_S, 1);
    axis.bias = 0.03;
    axis.fly(&mut tuner, 0.0, 10.0, |_, _| false);
    tuner.start();
    axis.fly(&mut tuner, 0.0, 20.0, |tuner, _| {
        tuner.phase() == TunerPhase::Proposed
    });
    assert!(!tuner.is_in_charge() && tuner.law().is_none());
    (tuner, axis)
}

// The safe controller holds the axis as long as it takes; then the controller found flies and proves itself.
#[test]
fn a_controller_is_put_in_force_after_consent() {
    let (mut tuner, mut axis) = proposed(Consent::Ask);
    let process = tuner.identified().unwrap().process;
    assert!(
        (process.k_over_t_body() / 4.0 - 1.0).abs() < 1e-4,
        "{process:?}"
    );
    axis.fly(&mut tuner, 0.0, 10.0, |_, _| false);
    assert_eq!(tuner.phase(), TunerPhase::Proposed);
    let value = axis.value();
    let before = tuner.step(axis.time_s(), &axis.measure(), 0.0);
    axis.push(before);
    assert!(
        (before - SAFE.output(0.0, value as f32, 0.0)).abs() < 1e-3,
        "{before}"
    );
    assert!(tuner.accept() && tuner.is_in_charge() && !tuner.accept());
    let after = tuner.step(axis.time_s(), &axis.measure(), 0.0);
    axis.push(after);
    // It goes on from there, and its integral begins to remove the error that the safe controller left.
    let removed = tuner.integral().ki * f64::from(value as f32) * SAMPLE_S;
    let jump = f64::from(after - before) + removed;
    assert!(jump.abs() < 1e-5, "{before}, then {after}: {jump}");
    axis.fly(&mut tuner, 0.0, 10.0, |tuner, _| tuner.is_proven());
    assert!(tuner.is_proven(), "{:?}", tuner.reason());
}

#[test]
fn without_consent_it_stays_a_proposal() {
    let (mut tuner, mut axis) = proposed(Consent::Never);
    assert!(!tuner.accept());
    axis.fly(&mut tuner, 0.0, 1.0, |_, _| false);
    assert_eq!(tuner.phase(), TunerPhase::Proposed);
    tuner.abort();
    assert_eq!(
        (tuner.phase(), tuner.reason()),
        (TunerPhase::Aborted, Some(Abort::Operator))
    );
    tuner.reset();
    assert_eq!(
        (tuner.phase(), tuner.identified()),
        (TunerPhase::Idle, None)
    );
}

// A controller that is accepted on another vehicle than the one that was tested is withdrawn.
#[test]
fn an_accepted_controller_is_checked() {
    let (mut tuner, axis) = proposed(Consent::Ask);
    let other = height().with_gain_scaled(5.0).unwrap();
    let mut changed = Axis::new(other, SAMPLE_S, 1);
    changed.bias = axis.bias;
    changed.tick = axis.tick;
    changed.fly(&mut tuner, 0.0, 5.0, |_, _| false);
    assert!(tuner.accept());
    changed.fly(&mut tuner, 0.0, 5.0, |tuner, _| {
        tuner.phase() == TunerPhase::Aborted
    });
    assert!(
        matches!(tuner.reason(), Some(Abort::Mismatch(_))),
        "{:?}",
        tuner.reason()
    );
}

/// Flies with a PI controller of another program that holds the axis until the tuner is in charge, and whose integral stands
/// still meanwhile. Returns its commands and the tuner's outputs.
fn beside(
    tuner: &mut Tuner<'_>,
    axis: &mut Axis,
    seconds: f64,
    integral: &mut f32,
) -> Vec<[f32; 2]> {
    let ticks = (seconds / SAMPLE_S) as usize;
    let tick = |_| {
        let measurement = axis.measure();
        let rate = measurement.rate.unwrap();
        if !tuner.is_in_charge() {
            *integral -= 0.2 * SAMPLE_S as f32 * measurement.value;
        }
        let command = SAFE.output(0.0, measurement.value, rate) + *integral;
        tuner.beside(command);
        let output = tuner.step(axis.time_s(), &measurement, 0.0);
        axis.push(output);
        [command, output]
    };
    (0..ticks).map(tick).collect()
}

#[test]
fn another_controller_holds_the_axis_outside_of_the_test() {
    let mut tuner = tuner(&with(Consent::Ask));
    let mut axis = Axis::new(height(), SAMPLE_S, 1);
    (axis.bias, axis.noise_sigma) = (0.03, 1e-5);
    let mut integral = 0.0;
    let idle = beside(&mut tuner, &mut axis, 20.0, &mut integral);
    assert!(
        idle.iter().all(|[command, output]| command == output),
        "its command is not changed"
    );
    assert!((tuner.usual() + 0.03).abs() < 1e-3 && !tuner.is_in_charge());
    tuner.start();
    assert!((tuner.offset() + 0.03).abs() < 1e-3, "{}", tuner.offset());
    let test = beside(&mut tuner, &mut axis, 3.0, &mut integral);
    assert!(tuner.is_in_charge() && test.iter().all(|[command, output]| command != output));
    tuner.abort();
    let after = beside(&mut tuner, &mut axis, 5.0, &mut integral);
    assert!(
        after.iter().all(|[command, output]| command == output),
        "from the same tick on"
    );
    assert!(axis.value().abs() < 1e-2, "{}", axis.value());
}

// Its command counts for one tick, is passed on beyond the tuner's limits, and must be a number.
#[test]
fn a_command_counts_once() {
    let mut tuner = tuner(&with(Consent::Ask));
    let step = |tuner: &mut Tuner<'_>, tick: f64| {
        tuner.step(SAMPLE_S * tick, &Measurement::of(0.0).with_rate(0.0), 0.0)
    };
    tuner.beside(7.0);
    assert_eq!([step(&mut tuner, 0.0), step(&mut tuner, 1.0)], [7.0, 0.0]);
    tuner.start();
    tuner.beside(f32::NAN);
    assert!(step(&mut tuner, 2.0).is_finite());
    assert_eq!(tuner.reason(), Some(Abort::NotFinite));
    // At a time that has been, too.
    tuner.beside(f32::NAN);
    assert!(step(&mut tuner, 1.0).is_finite());
}

/// Flies a test whose analysis takes place elsewhere: the desk is away for `away` ticks and comes back with the outcome.
fn elsewhere(
    core: &mut TunerCore,
    axis: &mut Axis,
    away: usize,
    until: impl Fn(&TunerCore) -> bool,
) {
    let mut analysis = Analysis::new(Pack::embedded().unwrap());
    let (mut desk, mut bench) = (Desk::NEW, Bench::NEW);
    let mut absent = 0;
    for _ in 0..40_000 {
        let (measurement, time_s) = (axis.measure(), axis.time_s());
        let output = if absent > 0 {
            absent -= 1;
            core.tick(None, time_s, &measurement, 0.0)
        } else {
            core.tick(Some(&mut desk), time_s, &measurement, 0.0);
            core.conclude(&mut desk)
        };
        axis.push(output);
        if absent == 0 && desk.is_ordered() {
            absent = away;
            while analysis.work(&mut desk, &mut bench, 100) {}
        }
        if until(core) {
            break;
        }
    }
    assert!(until(core), "{:?} {:?}", core.phase(), core.reason());
}

// When the work is done does not change what is found: the same cycles lie on the desk.
#[test]
fn the_analysis_may_be_elsewhere() {
    let in_one = || {
        let mut tuner = tuner(&settings());
        let mut axis = Axis::new(height(), SAMPLE_S, 1);
        tuner.start();
        axis.fly(&mut tuner, 0.0, 20.0, |tuner, _| tuner.is_proven());
        *tuner.identified().unwrap()
    };
    for away in [0, 7, 300, 2000] {
        let mut core = TunerCore::of(&settings().checked().unwrap());
        let mut axis = Axis::new(height(), SAMPLE_S, 1);
        core.start();
        elsewhere(&mut core, &mut axis, away, TunerCore::is_proven);
        assert_eq!(core.identified(), Some(&in_one()), "{away}");
    }
}

// A test that ends while its cycles are analysed leaves an outcome on the desk; the next test must not take it.
#[test]
fn an_outcome_of_an_ended_test_is_dropped() {
    let mut core = TunerCore::of(&settings().checked().unwrap());
    let mut axis = Axis::new(height(), SAMPLE_S, 1);
    let (mut desk, mut bench) = (Desk::NEW, Bench::NEW);
    let mut analysis = Analysis::new(Pack::embedded().unwrap());
    core.start();
    while !desk.is_ordered() {
        let output = core.tick(Some(&mut desk), axis.time_s(), &axis.measure(), 0.0);
        axis.push(output);
        assert!(axis.tick < 20_000);
    }
    core.abort();
    core.reset();
    while analysis.work(&mut desk, &mut bench, 100) {}
    let mut axis = Axis::new(height().with_gain_scaled(2.0).unwrap(), SAMPLE_S, 2);
    core.start();
    core.tick(Some(&mut desk), axis.time_s(), &axis.measure(), 0.0);
    core.conclude(&mut desk);
    assert_eq!((core.phase(), core.identified()), (TunerPhase::Relay, None));
    axis.push(0.1);
    elsewhere(&mut core, &mut axis, 50, TunerCore::is_proven);
    let found = core.identified().unwrap().process.k_over_t_body();
    assert!((found / 8.0 - 1.0).abs() < 1e-4, "{found}");
}
