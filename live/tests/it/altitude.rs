//! The relay test of the altitude on an exact process: what it finds, what ends it, and what the vehicle does then.

use std::cell::Cell;
use std::time::Duration;

use mavlink::dialects::common::{MavAutopilot, MavMessage};
use onecycle::{CsvOptions, Identify, Parameter};
use onecycle_link::CsvWriter;
use onecycle_live::{
    AltitudeAbort, AltitudeFlight, AltitudeRefusal, AltitudeTest, HandBack, ThrustSource,
};
use onecycle_onboard::Soiptd;

use crate::hovering::{HEIGHT_M, Hovering};
use crate::vehicle::{GUIDED, HOLD, LOITER, Scripted};
use crate::world::{Shared, World, connect};

/// K/T_body 20 m/s^2 of full thrust, T_prop 50 ms, T_body 1 s, dead time 20 ms: like PX4's simulated vehicle.
fn process() -> Soiptd {
    Soiptd::from_acceleration_gain(20.0, 0.05, 1.0, 0.02).unwrap()
}

fn world(autopilot: MavAutopilot, edit: impl FnOnce(&mut Hovering)) -> Shared {
    let scripted = match autopilot {
        MavAutopilot::MAV_AUTOPILOT_PX4 => Scripted::px4(),
        _ => Scripted::ardupilot(),
    };
    let mut hovering = Hovering::new(&process());
    edit(&mut hovering);
    World::of(scripted.hovering(hovering))
}

const PX4: MavAutopilot = MavAutopilot::MAV_AUTOPILOT_PX4;
const ARDUPILOT: MavAutopilot = MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA;

/// Flies the test; `event` is called with the time (s) since its begin and the vehicle, as often as the test asks for its end,
/// and says whether the operator ends it.
fn fly(
    world: &Shared,
    mut event: impl FnMut(f64, &mut Scripted) -> bool,
) -> Result<AltitudeFlight, AltitudeRefusal> {
    let mut vehicle = connect(world, None).unwrap();
    let begin = Cell::new(None);
    let event = std::cell::RefCell::new(&mut event);
    let is_over = || {
        let mut world = world.borrow_mut();
        let from = begin.get().unwrap_or(world.now);
        begin.set(Some(from));
        let since_s = (world.now - from).as_secs_f64();
        (event.borrow_mut())(since_s, &mut world.vehicle)
    };
    vehicle.altitude_test(AltitudeTest::default(), &is_over)
}

fn height_m(world: &Shared) -> f64 {
    world.borrow().vehicle.hovering.as_ref().unwrap().height_m()
}

/// Parameters that the existing estimator finds.
fn identified(flight: &AltitudeFlight) -> Vec<(Parameter, f64, [f64; 2])> {
    let mut bytes = Vec::new();
    let relay = format!(
        "relay: amplitude {}, beta {}, trim on",
        flight.test.amplitude, flight.beta
    );
    let mut writer = CsvWriter::new(&mut bytes, &[&relay], &[]).unwrap();
    for sample in &flight.samples {
        writer
            .row(sample.time_s, sample.height_m, sample.thrust, &[])
            .unwrap();
    }
    writer.finish().unwrap();
    let recording = onecycle::read_from(&bytes[..], &CsvOptions::default()).unwrap();
    let found = Identify::new().run(&recording).outcome;
    let found = found.unwrap_or_else(|verdict| panic!("{verdict:?}"));
    let value = |(parameter, interval): (Parameter, onecycle::Interval)| {
        let ends = [interval.low, interval.high].map(|end| end.unwrap_or(f64::NAN));
        (parameter, interval.estimate.unwrap_or(f64::NAN), ends)
    };
    found.estimate.iter().map(value).collect()
}

// The gain is 20. The dead time is 20 ms of the process; the reports are sampled, every 20 ms.
#[test]
fn the_process_is_found() {
    for autopilot in [PX4, ARDUPILOT] {
        let world = world(autopilot, |_| {});
        let flight = fly(&world, |_, _| false).unwrap();
        assert_eq!(flight.abort, None);
        assert_eq!(flight.source, ThrustSource::Reported);
        assert_eq!(flight.hand_back, HandBack::Holds);
        assert!(
            (flight.hover_thrust - 0.5).abs() < 1e-3,
            "{}",
            flight.hover_thrust
        );
        let found = identified(&flight);
        let gain = found
            .iter()
            .find(|(name, _, _)| name.symbol() == "K/T_body");
        let (_, estimate, [low, high]) = gain.unwrap();
        assert!((estimate / 20.0 - 1.0).abs() < 0.1, "{found:?}");
        assert!(high / low < 1.5, "{found:?}");
        assert!((height_m(&world) - HEIGHT_M).abs() < 0.2);
    }
}

// The vehicle is back in Hold; ArduCopter is told its place, and its options are as before.
#[test]
fn everything_is_as_before() {
    let px4 = world(PX4, |_| {});
    assert_eq!(fly(&px4, |_, _| false).unwrap().is_restored, None);
    assert_eq!(px4.borrow().vehicle.custom_mode, HOLD);
    let copter = world(ARDUPILOT, |_| {});
    let flight = fly(&copter, |_, vehicle| {
        assert_eq!(vehicle.value("GUID_OPTIONS"), 9.0);
        false
    });
    assert_eq!(flight.unwrap().is_restored, Some(true));
    let copter = copter.borrow();
    assert_eq!(copter.vehicle.custom_mode, GUIDED);
    assert_eq!(copter.vehicle.value("GUID_OPTIONS"), 1.0);
    assert!(
        !copter
            .vehicle
            .hovering
            .as_ref()
            .unwrap()
            .has_attitude_target
    );
}

// Without reports the dead time contains the link: 20 ms more, and half a sample.
#[test]
fn without_reports_of_the_thrust() {
    let world = world(PX4, |_| {});
    let flight = fly(&world, |_, vehicle| {
        // The hover was measured with them.
        vehicle.hovering.as_mut().unwrap().reports = false;
        false
    });
    let flight = flight.unwrap();
    assert_eq!(flight.source, ThrustSource::Commanded);
    let found = identified(&flight);
    let delay = found
        .iter()
        .find(|(name, _, _)| name.symbol() == "tau")
        .unwrap();
    assert!((0.03..0.06).contains(&delay.1), "{found:?}");
}

fn is_set_thrust(message: &MavMessage) -> bool {
    matches!(message, MavMessage::SET_ATTITUDE_TARGET(_))
}

/// Number of set-points that the vehicle has received.
fn set_points(vehicle: &Scripted) -> usize {
    vehicle
        .received
        .iter()
        .filter(|message| is_set_thrust(message))
        .count()
}

// The pilot changes the mode: nothing more is sent.
#[test]
fn the_pilot_changes_the_mode() {
    for (autopilot, mode) in [(PX4, u32::from_le_bytes([0, 0, 3, 0])), (ARDUPILOT, LOITER)] {
        let world = world(autopilot, |_| {});
        let flight = fly(&world, |since_s, vehicle| {
            if since_s > 3.0 {
                vehicle.custom_mode = mode;
            }
            false
        });
        let flight = flight.unwrap();
        assert!(
            matches!(flight.abort, Some(AltitudeAbort::Mode(_))),
            "{:?}",
            flight.abort
        );
        assert_eq!(flight.hand_back, HandBack::NotOurs);
        let world = world.borrow();
        assert_eq!(world.vehicle.custom_mode, mode);
        let last = world
            .vehicle
            .received
            .iter()
            .rposition(is_set_thrust)
            .unwrap();
        let is_order = |message: &MavMessage| {
            matches!(
                message,
                MavMessage::COMMAND_LONG(_) | MavMessage::SET_POSITION_TARGET_LOCAL_NED(_)
            )
        };
        assert!(!world.vehicle.received[last..].iter().any(is_order));
    }
}

/// Flies with an event that must end the test; the vehicle holds its height afterwards.
fn aborted(
    autopilot: MavAutopilot,
    event: impl FnMut(f64, &mut Scripted) -> bool,
) -> (AltitudeAbort, AltitudeFlight) {
    let world = world(autopilot, |_| {});
    let flight = fly(&world, event).unwrap();
    assert_eq!(flight.hand_back, HandBack::Holds, "{:?}", flight.abort);
    let away_m = height_m(&world) - HEIGHT_M;
    assert!(away_m.abs() < 1.5, "{:?}: {away_m} m", flight.abort);
    (flight.abort.clone().unwrap(), flight)
}

#[test]
fn the_operator_ends_the_test() {
    for autopilot in [PX4, ARDUPILOT] {
        let (abort, _) = aborted(autopilot, |since_s, _| since_s > 3.0);
        assert_eq!(abort, AltitudeAbort::Operator);
    }
}

#[test]
fn a_stick_is_moved() {
    let (abort, _) = aborted(PX4, |since_s, vehicle| {
        if since_s > 3.0 {
            vehicle.hovering.as_mut().unwrap().stick_us = 1650;
        }
        false
    });
    assert_eq!(abort, AltitudeAbort::Stick);
}

#[test]
fn the_wind_carries_it_away() {
    let (abort, _) = aborted(PX4, |since_s, vehicle| {
        vehicle.hovering.as_mut().unwrap().wind_m_per_s = if since_s > 1.0 { 3.0 } else { 0.0 };
        false
    });
    assert!(matches!(abort, AltitudeAbort::Drift(_)), "{abort:?}");
}

// A third of the thrust is lost: the height leaves the band, or the relay no longer switches.
#[test]
fn the_thrust_is_lost() {
    let world = world(PX4, |_| {});
    let flight = fly(&world, |since_s, vehicle| {
        vehicle.hovering.as_mut().unwrap().lift = if since_s > 3.0 { 0.6 } else { 1.0 };
        false
    });
    let abort = flight.unwrap().abort.unwrap();
    assert!(
        matches!(abort, AltitudeAbort::Height(_) | AltitudeAbort::Climb(_)),
        "{abort:?}"
    );
    assert_eq!(world.borrow().vehicle.custom_mode, HOLD);
}

// No position for 0.5 s.
#[test]
fn the_link_is_lost() {
    let world = world(PX4, |_| {});
    let down = std::rc::Rc::clone(&world);
    let number = Cell::new(0);
    let flight = fly(&world, |since_s, vehicle| {
        if since_s > 3.0 && number.replace(1) == 0 {
            vehicle.hovering.as_mut().unwrap().every = u64::MAX;
        }
        false
    });
    let flight = flight.unwrap();
    assert!(
        matches!(flight.abort, Some(AltitudeAbort::Stale(_))),
        "{:?}",
        flight.abort
    );
    // Without positions nobody can confirm it, but the vehicle was told.
    assert_eq!(flight.hand_back, HandBack::Unconfirmed);
    assert_eq!(down.borrow().vehicle.custom_mode, HOLD);
}

#[test]
fn the_vehicle_restarts() {
    let world = world(PX4, |_| {});
    let flight = fly(&world, |since_s, vehicle| {
        if since_s > 3.0 {
            // Its clock begins anew.
            vehicle.hovering.as_mut().unwrap().on_for = Duration::ZERO;
        }
        false
    });
    let abort = flight.unwrap().abort;
    assert_eq!(abort, Some(AltitudeAbort::Reset));
}

#[test]
fn refusals_before_anything_is_sent() {
    type Case = (fn(&mut Scripted), fn(&AltitudeRefusal) -> bool);
    let cases: [Case; 5] = [
        (
            |vehicle| vehicle.is_armed = false,
            |refusal| matches!(refusal, AltitudeRefusal::NotFlying),
        ),
        (
            |vehicle| vehicle.custom_mode = u32::from_le_bytes([0, 0, 3, 0]),
            |refusal| matches!(refusal, AltitudeRefusal::Mode { wanted: "Hold", .. }),
        ),
        (
            |vehicle| vehicle.hovering.as_mut().unwrap().every = 10,
            |refusal| matches!(refusal, AltitudeRefusal::Rate(rate_hz) if *rate_hz < 6.0),
        ),
        (
            |vehicle| vehicle.hovering.as_mut().unwrap().wind_m_per_s = 1.0,
            |refusal| matches!(refusal, AltitudeRefusal::Moving(_)),
        ),
        (
            |vehicle| vehicle.hovering.as_mut().unwrap().reports = false,
            |refusal| matches!(refusal, AltitudeRefusal::Thrust(_)),
        ),
    ];
    for (number, (edit, is_right)) in cases.into_iter().enumerate() {
        let world = world(PX4, |_| {});
        edit(&mut world.borrow_mut().vehicle);
        let refusal = fly(&world, |_, _| false).unwrap_err();
        assert!(is_right(&refusal), "case {number}: {refusal:?}");
        assert_eq!(set_points(&world.borrow().vehicle), 0, "case {number}");
    }
}

// On its way to another height when the test is asked for.
#[test]
fn the_test_waits_for_the_hover() {
    let world = world(PX4, |hovering| hovering.set_place(HEIGHT_M + 20.0));
    let flight = fly(&world, |_, _| false).unwrap();
    assert_eq!(flight.abort, None);
    let end_m = height_m(&world);
    assert!((end_m - HEIGHT_M - 20.0).abs() < 0.5, "{end_m}");
}

// PX4 does not change into Offboard, for example because a switch of the transmitter forbids it.
#[test]
fn the_mode_is_refused() {
    let world = world(PX4, |_| {});
    world.borrow_mut().vehicle.takes_modes = false;
    let refusal = fly(&world, |_, _| false).unwrap_err();
    assert!(
        matches!(refusal, AltitudeRefusal::NoMode("Offboard")),
        "{refusal:?}"
    );
    assert_eq!(world.borrow().vehicle.custom_mode, HOLD);
    assert!(world.borrow().now < Duration::from_secs(60));
}
