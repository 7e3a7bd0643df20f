//! The state of a vehicle.

use onecycle_link::{Axis, ControlLoop, FirmwareKind};

use crate::vehicle::Scripted;
use crate::world::{World, connect};

// 1.15.4 official; mode 4,3 of PX4 is Hold. The script has three gains of the roll rate.
#[test]
fn px4() {
    let mut scripted = Scripted::px4();
    scripted.custom_mode = u32::from_le_bytes([0, 0, 4, 3]);
    scripted.is_armed = true;
    let state = connect(&World::of(scripted), None)
        .unwrap()
        .state()
        .unwrap();
    assert_eq!(state.firmware, Some(FirmwareKind::Px4));
    assert_eq!(state.version.as_deref(), Some("1.15.4"));
    assert_eq!((state.kind.as_str(), state.system), ("quadrotor", 7));
    assert_eq!(
        (state.mode.as_str(), state.status.as_str()),
        ("Hold", "standby")
    );
    assert!(state.is_armed && !state.is_signed);
    let battery = state.battery.unwrap();
    assert_eq!(
        (battery.voltage_v, battery.charge),
        (Some(15.6), Some(0.87))
    );
    assert_eq!(state.unhealthy, Some(vec!["GPS"]));
    // The vehicle hovers 10 m above the origin.
    assert_eq!(state.position_m, Some([0.0, 0.0, 10.0]));
    let [of] = &state.gains[..] else {
        panic!("{:?}", state.gains);
    };
    assert_eq!(of.control_loop, ControlLoop::Rate(Axis::Roll));
    let names: Vec<&str> = of
        .parameters
        .iter()
        .map(|(name, _)| name.as_str())
        .collect();
    assert_eq!(names, ["MC_ROLLRATE_P", "MC_ROLLRATE_I", "MC_ROLLRATE_D"]);
}

#[test]
fn ardupilot() {
    let mut scripted = Scripted::ardupilot();
    scripted.custom_mode = 5;
    let state = connect(&World::of(scripted), None)
        .unwrap()
        .state()
        .unwrap();
    assert_eq!(state.mode, "Loiter");
    assert_eq!(state.gains[0].parameters[0].0, "ATC_RAT_RLL_P");
    // Without ESTIMATOR_STATUS the health of the AHRS tells.
    assert_eq!(state.not_estimated, Some(vec![]));
}
