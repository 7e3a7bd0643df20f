//! Writing parameters: all of them or none, whatever happens to the link.

use std::time::Duration;

use onecycle_live::{Assignment, Cause, LiveError, Outcome, Plan, Refusal, Vehicle};

use crate::vehicle::Scripted;
use crate::world::{Shared, Way, World, connect};

const PATIENCE: Duration = Duration::from_secs(60);
const FOREVER: Duration = Duration::from_secs(100_000);
/// Names with old and new values, as the scripted PX4 has them.
const GAINS: [(&str, f32, f32); 3] = [
    ("MC_ROLLRATE_P", 0.15, 0.12),
    ("MC_ROLLRATE_I", 0.2, 0.25),
    ("MC_ROLLRATE_D", 0.003, 0.0015),
];

fn wanted(pairs: &[(&str, f64)]) -> Vec<Assignment> {
    let one = |&(name, value): &(&str, f64)| Assignment {
        name: name.to_owned(),
        value,
    };
    pairs.iter().map(one).collect()
}

fn gains() -> Vec<Assignment> {
    wanted(&GAINS.map(|(name, _, new)| (name, f64::from(new))))
}

fn values(world: &Shared) -> [f32; 3] {
    GAINS.map(|(name, _, _)| world.borrow().vehicle.value(name) as f32)
}

const OLD: [f32; 3] = [GAINS[0].1, GAINS[1].1, GAINS[2].1];
const NEW: [f32; 3] = [GAINS[0].2, GAINS[1].2, GAINS[2].2];

fn write(world: &Shared) -> Outcome {
    let mut vehicle = connect(world, None).unwrap();
    let plan = Plan::new(&mut vehicle, &gains(), false).unwrap();
    plan.run(&mut vehicle, PATIENCE, |_| {})
}

/// What the outcome says is so in the vehicle.
fn is_true(outcome: &Outcome, world: &Shared) -> bool {
    let vehicle = &world.borrow().vehicle;
    match outcome {
        Outcome::Written => values_of(vehicle) == NEW,
        Outcome::RolledBack(_) => values_of(vehicle) == OLD,
        Outcome::Uncertain(_, left) => GAINS.iter().all(|(name, old, new)| {
            let value = vehicle.value(name) as f32;
            match left.iter().find(|one| one.name == *name) {
                None => value == *old,
                Some(one) => match one.now {
                    Some(now) => value == now as f32,
                    None => value == *old || value == *new,
                },
            }
        }),
        _ => false,
    }
}

fn values_of(vehicle: &Scripted) -> [f32; 3] {
    GAINS.map(|(name, _, _)| vehicle.value(name) as f32)
}

#[test]
fn written_and_read_back() {
    let world = World::of(Scripted::px4());
    let mut vehicle = connect(&world, None).unwrap();
    let plan = Plan::new(&mut vehicle, &gains(), false).unwrap();
    assert_eq!(values(&world), OLD);
    let old: Vec<f32> = plan.steps().iter().map(|step| step.old as f32).collect();
    assert_eq!(old, OLD);
    let mut told = Vec::new();
    let outcome = plan.run(&mut vehicle, PATIENCE, |step| told.push(step.name.clone()));
    assert!(matches!(outcome, Outcome::Written), "{outcome:?}");
    assert_eq!(values(&world), NEW);
    assert_eq!(told, GAINS.map(|(name, _, _)| name));
}

// An integer goes through both encodings.
#[test]
fn integers() {
    for (scripted, name, value) in [
        (Scripted::px4(), "SYS_AUTOSTART", 4019.0),
        (Scripted::ardupilot(), "FRAME_CLASS", 2.0),
    ] {
        let world = World::of(scripted);
        let mut vehicle = connect(&world, None).unwrap();
        let plan = Plan::new(&mut vehicle, &wanted(&[(name, value)]), false).unwrap();
        assert!(matches!(
            plan.run(&mut vehicle, PATIENCE, |_| {}),
            Outcome::Written
        ));
        assert_eq!(world.borrow().vehicle.value(name), value);
        let refused = Plan::new(&mut vehicle, &wanted(&[(name, 1.5)]), false).err();
        assert!(
            matches!(refused, Some(Refusal::NotInteger(_, _))),
            "{refused:?}"
        );
    }
}

/// The refusal of a plan. Nothing was set.
fn refusal(scripted: Scripted, assignments: &[Assignment], may_be_armed: bool) -> Option<Refusal> {
    let world = World::of(scripted);
    let mut vehicle = connect(&world, None).unwrap();
    let refusal = Plan::new(&mut vehicle, assignments, may_be_armed).err();
    let is_set = |message: &mavlink::dialects::common::MavMessage| {
        matches!(message, mavlink::dialects::common::MavMessage::PARAM_SET(_))
    };
    assert!(!world.borrow().vehicle.received.iter().any(is_set));
    refusal
}

#[test]
fn armed() {
    let scripted = || {
        let mut scripted = Scripted::px4();
        scripted.is_armed = true;
        scripted
    };
    assert!(matches!(
        refusal(scripted(), &gains(), false),
        Some(Refusal::Armed)
    ));
    assert!(refusal(scripted(), &gains(), true).is_none());
}

// The firmware says so, or it says nothing.
#[test]
fn missing_parameter() {
    for tells in [false, true] {
        let mut scripted = Scripted::px4();
        scripted.tells_missing = tells;
        let pairs = [
            ("MC_ROLLRATE_P", 0.1),
            ("MC_ROLLRATE_X", 1.0),
            ("NOSUCH", 2.0),
        ];
        match refusal(scripted, &wanted(&pairs), false) {
            Some(Refusal::Missing(names)) => assert_eq!(names, ["MC_ROLLRATE_X", "NOSUCH"]),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn not_finite() {
    for value in [f64::NAN, f64::INFINITY, 1e39] {
        let refusal = refusal(Scripted::px4(), &wanted(&[("MC_ROLLRATE_P", value)]), false);
        assert!(
            matches!(refusal, Some(Refusal::NotFinite(_))),
            "{refusal:?}"
        );
    }
}

// A write that then fails could not restore it.
#[test]
fn the_old_value_is_not_finite() {
    let mut scripted = Scripted::px4();
    for (name, value) in &mut scripted.parameters {
        if name == "MC_ROLLRATE_I" {
            value.1 = f64::NAN;
        }
    }
    match refusal(scripted, &gains(), false) {
        Some(Refusal::OldNotFinite(name)) => assert_eq!(name, "MC_ROLLRATE_I"),
        other => panic!("{other:?}"),
    }
}

// The second of three is clipped: the first returns to its old value too.
#[test]
fn a_value_that_the_vehicle_clips() {
    let mut scripted = Scripted::px4();
    scripted
        .most
        .insert("MC_ROLLRATE_I".to_owned(), f64::from(0.22_f32));
    let world = World::of(scripted);
    match write(&world) {
        Outcome::RolledBack(Cause::Mismatch { name, found, .. }) => {
            assert_eq!((name.as_str(), found as f32), ("MC_ROLLRATE_I", 0.22));
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(values(&world), OLD);
}

#[test]
fn armed_during_the_write() {
    let world = World::of(Scripted::px4());
    let mut vehicle = connect(&world, None).unwrap();
    let plan = Plan::new(&mut vehicle, &gains(), false).unwrap();
    world.borrow_mut().vehicle.is_armed = true;
    // The heartbeat that says so comes while an answer is awaited.
    let sent = world.borrow().counts[Way::ToVehicle as usize];
    world.borrow_mut().fate = Box::new(move |way, number| {
        usize::from(way == Way::ToUs || !(sent + 2..sent + 6).contains(&number))
    });
    let outcome = plan.run(&mut vehicle, PATIENCE, |_| {});
    assert!(
        matches!(outcome, Outcome::RolledBack(Cause::Armed)),
        "{outcome:?}"
    );
    assert_eq!(values(&world), OLD);
}

// A quarter of the messages is lost, an eighth doubled, each way: the write takes longer.
#[test]
fn lost_and_doubled_messages() {
    for seed in 0..20 {
        let world = World::of(Scripted::px4());
        let mut state: u32 = seed;
        world.borrow_mut().fate = Box::new(move |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            [0, 0, 1, 1, 1, 1, 1, 2][state as usize >> 29]
        });
        let outcome = write(&world);
        assert!(
            matches!(outcome, Outcome::Written),
            "seed {seed}: {outcome:?}"
        );
        assert!(is_true(&outcome, &world), "seed {seed}: {outcome:?}");
    }
}

fn prepared() -> (Shared, Vehicle, Plan) {
    let world = World::of(Scripted::px4());
    let mut vehicle = connect(&world, None).unwrap();
    let plan = Plan::new(&mut vehicle, &gains(), false).unwrap();
    (world, vehicle, plan)
}

/// Numbers of the messages that a write without faults sends to the vehicle.
fn steps_of_a_write() -> std::ops::Range<usize> {
    let (world, mut vehicle, plan) = prepared();
    let first = world.borrow().counts[0];
    assert!(matches!(
        plan.run(&mut vehicle, PATIENCE, |_| {}),
        Outcome::Written
    ));
    let end = world.borrow().counts[0];
    // A setting and a reading of each parameter, and all of them once more.
    assert!(end - first >= 9, "{first} {end}");
    first..end
}

// The link is lost at every step for 1, 10 and 30 s: what the outcome says is so, and nothing is left uncertain.
#[test]
fn link_lost_at_every_step_and_back() {
    for step in steps_of_a_write() {
        for seconds in [1, 10, 30] {
            let (world, mut vehicle, plan) = prepared();
            world.borrow_mut().cut = Some((step, Duration::from_secs(seconds)));
            let outcome = plan.run(&mut vehicle, PATIENCE, |_| {});
            let about = format!("step {step}, {seconds} s: {outcome:?} {:?}", values(&world));
            assert!(is_true(&outcome, &world), "{about}");
            assert!(!matches!(outcome, Outcome::Uncertain(_, _)), "{about}");
            assert!(
                seconds > 1 || matches!(outcome, Outcome::Written),
                "{about}"
            );
        }
    }
}

// The link is lost at every step and does not come back: the outcome names what is uncertain.
#[test]
fn link_lost_at_every_step_for_ever() {
    for step in steps_of_a_write() {
        let (world, mut vehicle, plan) = prepared();
        world.borrow_mut().cut = Some((step, FOREVER));
        let outcome = plan.run(&mut vehicle, PATIENCE, |_| {});
        let about = format!("step {step}: {outcome:?} {:?}", values(&world));
        assert!(matches!(outcome, Outcome::Uncertain(_, _)), "{about}");
        assert!(is_true(&outcome, &world), "{about}");
        // It gives up in time: the write's own waiting, then the patience, then one last try.
        assert!(world.borrow().now < PATIENCE * 2, "{about}");
    }
}

// At every step the vehicle restarts with the values that were stored: it is down for 4 s.
#[test]
fn restart_at_every_step() {
    for step in steps_of_a_write() {
        let (world, mut vehicle, plan) = prepared();
        world.borrow_mut().cut = Some((step, Duration::from_secs(4)));
        world.borrow_mut().event = Box::new(move |vehicle, number| {
            if number == step {
                vehicle.restart();
            }
        });
        let outcome = plan.run(&mut vehicle, PATIENCE, |_| {});
        let about = format!("step {step}: {outcome:?} {:?}", values(&world));
        assert!(is_true(&outcome, &world), "{about}");
        assert!(!matches!(outcome, Outcome::Uncertain(_, _)), "{about}");
    }
}

// Before anything is written.
#[test]
fn link_lost_while_reading() {
    let world = World::of(Scripted::px4());
    let mut vehicle = connect(&world, None).unwrap();
    let next = world.borrow().counts[0];
    world.borrow_mut().cut = Some((next, FOREVER));
    let refusal = Plan::new(&mut vehicle, &gains(), false).err();
    assert!(
        matches!(refusal, Some(Refusal::Live(LiveError::Lost))),
        "{refusal:?}"
    );
    assert_eq!(values(&world), OLD);
}
