//! PX4: torque and rates as topics of uORB.
//!
//! Reference: PX4 user guide, "Multicopter PID tuning" (parameters), `msg/` (topics).

use super::{gain, spans};
use crate::log::flight::{Firmware, FirmwareKind, Gain, Mark, MarkKind, Span, Term};
use crate::log::loops::{Axis, ControlLoop};
use crate::log::plan::{Plan, Quantity};
use crate::log::tables::{FlightTables, LogParameter};

pub(super) const WANTED: &[(&str, &str)] = &[
    ("vehicle_status", "arming_state"),
    ("actuator_armed", "armed"),
    ("vehicle_land_detected", "landed"),
    ("autotune_attitude_control_status", "state"),
];

pub(super) const FILTERS: &[&str] = &[
    "IMU_GYRO_CUTOFF",
    "IMU_DGYRO_CUTOFF",
    "IMU_GYRO_NF",
    "IMU_GYRO_DNF",
];

/// Cutoff (Hz) of the low-pass of the gyro, `LowPassFilter2p`.
pub(super) const GYRO_FILTER: &str = "IMU_GYRO_CUTOFF";

pub(super) const MIXER: &[&str] = &["CA_AIRFRAME", "CA_ROTOR", "MAV_TYPE", "THR_MDL_FAC"];

/// `vehicle_status.arming_state` of an armed vehicle.
const ARMED: f64 = 2.0;

pub(super) fn firmware(flight: &FlightTables) -> Firmware {
    let fact = |name: &str| flight.info.get(name).cloned().unwrap_or_default();
    // One byte each of major, minor and patch version, and of the kind of release.
    let release = fact("ver_sw_release").parse().unwrap_or(0.0) as u32;
    let version = match release.to_be_bytes() {
        [0, 0, 0, _] => fact("ver_sw").chars().take(8).collect(),
        [major, minor, patch, _] => format!("{major}.{minor}.{patch}"),
    };
    Firmware {
        kind: FirmwareKind::Px4,
        version,
        board: fact("ver_hw"),
    }
}

pub(super) fn plans(of: ControlLoop) -> Vec<Plan> {
    match of {
        ControlLoop::Rate(axis) => rate(axis),
        ControlLoop::Attitude(axis) => attitude(axis),
        ControlLoop::Altitude => altitude(),
    }
}

fn rate(axis: Axis) -> Vec<Plan> {
    let at = axis.index();
    let xyz = format!("xyz[{at}]");
    let control = format!("control[{at}]");
    let speed = format!("{}speed", axis.name());
    let torque = Quantity::scaled("vehicle_torque_setpoint", &xyz, 1.0).stamped();
    let mixed = Quantity::scaled("actuator_controls_0", &control, 1.0).stamped();
    let gyro = Quantity::scaled("vehicle_angular_velocity", &xyz, 1.0).stamped();
    let old_gyro = Quantity::scaled("vehicle_attitude", speed, 1.0);
    [
        (torque, gyro.clone()),
        (mixed.clone(), gyro),
        (mixed, old_gyro),
    ]
    .into_iter()
    .map(|(input, output)| Plan {
        control_loop: ControlLoop::Rate(axis),
        throttle: Some(throttle(input.topic)),
        input,
        output,
        set_point: Some(Quantity::scaled("vehicle_rates_setpoint", axis.name(), 1.0)),
        input_unit: "1",
        sign: None,
    })
    .collect()
}

fn throttle(input: &str) -> Quantity {
    match input {
        "actuator_controls_0" => Quantity::scaled("actuator_controls_0", "control[3]", 1.0),
        _ => Quantity::scaled("vehicle_thrust_setpoint", "xyz[2]", -1.0),
    }
}

fn attitude(axis: Axis) -> Vec<Plan> {
    let body = format!("{}_body", axis.name());
    let set_points = [
        Quantity::angle("vehicle_attitude_setpoint", "q_d", axis),
        Quantity::scaled("vehicle_attitude_setpoint", body, 1.0),
    ];
    let plan = |set_point| Plan {
        control_loop: ControlLoop::Attitude(axis),
        input: Quantity::scaled("vehicle_rates_setpoint", axis.name(), 1.0),
        output: Quantity::angle("vehicle_attitude", "q", axis),
        set_point: Some(set_point),
        throttle: Some(throttle("")),
        input_unit: "rad/s",
        sign: None,
    };
    set_points.into_iter().map(plan).collect()
}

fn altitude() -> Vec<Plan> {
    let inputs = [
        Quantity::scaled("vehicle_thrust_setpoint", "xyz[2]", -1.0),
        Quantity::scaled("actuator_controls_0", "control[3]", 1.0),
    ];
    let plan = |input: Quantity| Plan {
        control_loop: ControlLoop::Altitude,
        throttle: Some(input.clone()),
        input,
        output: Quantity::scaled("vehicle_local_position", "vz", -1.0),
        set_point: Some(Quantity::scaled(
            "vehicle_local_position_setpoint",
            "vz",
            -1.0,
        )),
        input_unit: "1",
        sign: None,
    };
    inputs.into_iter().map(plan).collect()
}

/// Parameters of the gains of a loop.
pub(super) fn gain_names(of: ControlLoop) -> Vec<(Term, String)> {
    let named = |axis: Axis| axis.name().to_uppercase();
    match of {
        ControlLoop::Rate(axis) => [
            (Term::Factor, "K"),
            (Term::Proportional, "P"),
            (Term::Integral, "I"),
            (Term::Derivative, "D"),
            (Term::FeedForward, "FF"),
        ]
        .map(|(term, short)| (term, format!("MC_{}RATE_{short}", named(axis))))
        .to_vec(),
        ControlLoop::Attitude(axis) => {
            vec![(Term::Proportional, format!("MC_{}_P", named(axis)))]
        }
        ControlLoop::Altitude => [
            (Term::Factor, "MPC_Z_P"),
            (Term::Proportional, "MPC_Z_VEL_P_ACC"),
            (Term::Integral, "MPC_Z_VEL_I_ACC"),
            (Term::Derivative, "MPC_Z_VEL_D_ACC"),
        ]
        .map(|(term, name)| (term, name.to_owned()))
        .to_vec(),
    }
}

/// The gains of the rate are those of the parallel form: `MC_ROLLRATE_K` times each.
pub(super) fn gains(flight: &FlightTables, of: ControlLoop) -> Vec<Gain> {
    let names = gain_names(of);
    let factor = names.iter().find(|(term, _)| *term == Term::Factor);
    let factor = factor.and_then(|(_, name)| flight.parameters.get(name));
    let factor = factor.map(LogParameter::last);
    let si_per_unit = |term| match (of, term) {
        (_, Term::Factor) | (ControlLoop::Altitude, _) => None,
        (_, Term::FeedForward) | (ControlLoop::Attitude(_), _) => Some(1.0),
        _ => Some(factor.unwrap_or(1.0)),
    };
    (names.into_iter())
        .filter_map(|(term, name)| gain(flight, term, name, si_per_unit(term)))
        .collect()
}

/// States 2 to 10 of the autotune excite the axes and pause between them. Their numbers differ between versions, so the
/// axis is not told.
pub(super) fn marks(flight: &FlightTables) -> Vec<Mark> {
    let topic = flight.topic("autotune_attitude_control_status");
    let found = spans(topic, "state", |state| (2.0..=10.0).contains(&state));
    let mark = |span| Mark {
        kind: MarkKind::Px4Autotune,
        axis: None,
        span,
    };
    found.unwrap_or_default().into_iter().map(mark).collect()
}

pub(super) fn armed_and_airborne(flight: &FlightTables) -> [Option<Vec<Span>>; 2] {
    let armed = spans(flight.topic("vehicle_status"), "arming_state", |state| {
        state == ARMED
    })
    .or_else(|| spans(flight.topic("actuator_armed"), "armed", |flag| flag != 0.0));
    [
        armed,
        spans(flight.topic("vehicle_land_detected"), "landed", |flag| {
            flag == 0.0
        }),
    ]
}
