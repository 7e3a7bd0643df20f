//! Betaflight and INAV: gyro, set-point and motors of the main frames.
//!
//! The input is the torque that the motors are told, as a fraction of their range:
//! `u = sum of s_i motor_i / (4 (high - low))` with the signs `s_i` of the mixer of a quadcopter X in the order of
//! Betaflight (rear right, front right, rear left, front left). Without these motors it is the sum of the terms of the
//! controller / 1000. Gains: P, I, D and F of the headers in Betaflight's scales (0.032029, 0.244381, 0.000529, 0.013754
//! at 1 deg/s, 1000 = full range). Reference: Betaflight documentation, "PID controller", "Mixer".

use super::{gain, spans_of};
use crate::log::flight::{Firmware, FirmwareKind, Gain, Mark, MarkKind, Span, Term};
use crate::log::loops::{Axis, ControlLoop};
use crate::log::plan::{Map, Plan, Quantity};
use crate::log::tables::FlightTables;

pub(super) const WANTED: &[(&str, &str)] = &[("main", "debug[1]"), ("main", "debug[2]")];

pub(super) const FILTERS: &[&str] = &[
    "gyro_lowpass",
    "gyro_lpf",
    "gyro_notch",
    "gyro_rpm_notch",
    "rpm_filter",
    "dyn_notch",
    "dterm_lowpass",
    "dterm_lpf",
    "dterm_notch",
    "dterm_filter",
    "yaw_lowpass",
];

pub(super) const MIXER: &[&str] = &[
    "mixer",
    "yaw_motors_reversed",
    "motorOutput",
    "thrust_linear",
];

/// Signs of roll, pitch and yaw of the four motors of a quadcopter X. Those of yaw depend on the direction of the
/// propellers, which most logs do not tell: they are taken from the terms of the controller.
const SIGNS: [[f64; 4]; 3] = [
    [-1.0, -1.0, 1.0, 1.0],
    [1.0, -1.0, 1.0, -1.0],
    [1.0, -1.0, -1.0, 1.0],
];

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// P, I, D and F of the headers that make a gain of one in SI units.
const P_SCALE: f64 = 544.9;
const I_SCALE: f64 = 71.42;
const D_SCALE: f64 = 32_993.0;
const F_SCALE: f64 = 126_900.0;
/// The integral gain of yaw is larger by this factor.
const YAW_I: f64 = 2.5;

pub(super) fn firmware(flight: &FlightTables) -> Firmware {
    let fact = |name: &str| flight.info.get(name).cloned().unwrap_or_default();
    let version = fact("Firmware revision");
    let is_inav = version.starts_with("INAV") || fact("Firmware type").contains("INAV");
    Firmware {
        kind: if is_inav {
            FirmwareKind::Inav
        } else {
            FirmwareKind::Betaflight
        },
        version,
        board: fact("Board information"),
    }
}

/// Degrees per second of one unit of the logged gyro: the header is a float in hexadecimal.
fn gyro_scale(flight: &FlightTables) -> f64 {
    let header = flight
        .info
        .get("gyro_scale")
        .or_else(|| flight.info.get("gyro.scale"));
    let bits = header.and_then(|text| u32::from_str_radix(text.trim_start_matches("0x"), 16).ok());
    let scale = bits.map_or(1.0, |bits| f64::from(f32::from_bits(bits)));
    let scale = if scale.is_finite() && scale > 0.0 {
        scale
    } else {
        1.0
    };
    scale / finer(flight)
}

/// 10 if rates are logged in tenths of a degree per second.
fn finer(flight: &FlightTables) -> f64 {
    if flight.parameter("blackbox_high_resolution") == Some(1.0) {
        10.0
    } else {
        1.0
    }
}

fn linear(fields: Vec<String>, weights: Vec<f64>) -> Quantity {
    Quantity {
        topic: "main",
        fields,
        map: Map::Linear(weights, 0.0),
        stamp: None,
    }
}

pub(super) fn plans(flight: &FlightTables, of: ControlLoop) -> Vec<Plan> {
    let throttles = [
        Quantity::scaled("main", "setpoint[3]", 1e-3),
        Quantity {
            map: Map::Linear(vec![1e-3], -1.0),
            ..Quantity::scaled("main", "rcCommand[3]", 1.0)
        },
    ];
    let throttle = throttles
        .into_iter()
        .find(|throttle| throttle.logged(flight).is_some());
    let has = |field: &str| flight.topic("main").is_some_and(|topic| topic.has(field));
    match of {
        ControlLoop::Rate(axis) => inputs(flight, axis, &has)
            .into_iter()
            .map(|input| Plan {
                control_loop: of,
                sign: terms(axis, &has).filter(|_| axis == Axis::Yaw),
                input,
                output: Quantity::scaled(
                    "main",
                    format!("gyroADC[{}]", axis.index()),
                    gyro_scale(flight) * DEGREE,
                ),
                set_point: set_point(flight, axis, &has),
                throttle: throttle.clone(),
                input_unit: "1",
            })
            .collect(),
        // Neither angles nor climb rate are logged.
        ControlLoop::Attitude(_) | ControlLoop::Altitude => Vec::new(),
    }
}

fn inputs(flight: &FlightTables, axis: Axis, has: &dyn Fn(&str) -> bool) -> Vec<Quantity> {
    let at = axis.index();
    let range = flight
        .parameter("motorOutput[1]")
        .zip(flight.parameter("motorOutput[0]"));
    // INAV and old Betaflight drive motors from minthrottle to maxthrottle.
    let old = flight
        .parameter("maxthrottle")
        .zip(flight.parameter("minthrottle"));
    let range = range
        .or(old)
        .map(|(high, low)| high - low)
        .filter(|range| *range > 0.0);
    let mut inputs = Vec::new();
    if let Some(range) = range.filter(|_| !has("motor[4]")) {
        let share = 0.25 / range;
        let motors = (0..4).map(|motor| format!("motor[{motor}]")).collect();
        inputs.push(linear(motors, SIGNS[at].map(|sign| sign * share).to_vec()));
    }
    inputs.extend(terms(axis, has));
    inputs
}

/// The sum of the terms of the controller, as a fraction of the range of a motor.
fn terms(axis: Axis, has: &dyn Fn(&str) -> bool) -> Option<Quantity> {
    let term = |term: &str| format!("{term}[{}]", axis.index());
    let terms = ["axisP", "axisI", "axisD", "axisF", "axisS"].map(term);
    let terms: Vec<String> = terms.into_iter().filter(|term| has(term)).collect();
    let weights = vec![1e-3; terms.len()];
    (!terms.is_empty()).then(|| linear(terms, weights))
}

/// The set-point, or what the proportional term of Betaflight tells about it.
fn set_point(flight: &FlightTables, axis: Axis, has: &dyn Fn(&str) -> bool) -> Option<Quantity> {
    let at = axis.index();
    let field = format!("setpoint[{at}]");
    if has(&field) {
        return Some(Quantity::scaled("main", field, DEGREE / finer(flight)));
    }
    if firmware(flight).kind == FirmwareKind::Inav {
        // Its proportional gain has another unit.
        let rate = format!("axisRate[{at}]");
        return has(&rate).then(|| Quantity::scaled("main", rate, DEGREE));
    }
    let p = flight
        .parameter(&format!("{}PID[0]", axis.name()))
        .filter(|p| *p > 0.0)?;
    let fields = vec![format!("axisP[{at}]"), format!("gyroADC[{at}]")];
    // Terms are in thousandths of the range.
    let weights = vec![1e-3 * P_SCALE / p, gyro_scale(flight) * DEGREE];
    Some(linear(fields, weights))
}

pub(super) fn gains(flight: &FlightTables, of: ControlLoop) -> Vec<Gain> {
    let ControlLoop::Rate(axis) = of else {
        return Vec::new();
    };
    let (at, pid) = (axis.index(), format!("{}PID", axis.name()));
    let i_scale = if axis == Axis::Yaw {
        I_SCALE / YAW_I
    } else {
        I_SCALE
    };
    let list = [
        (Term::Proportional, format!("{pid}[0]"), P_SCALE),
        (Term::Integral, format!("{pid}[1]"), i_scale),
        (Term::Derivative, format!("{pid}[2]"), D_SCALE),
        (Term::DerivativeLimit, format!("d_min[{at}]"), D_SCALE),
        (Term::DerivativeLimit, format!("d_max[{at}]"), D_SCALE),
        (
            Term::FeedForward,
            format!("feedforward_weight[{at}]"),
            F_SCALE,
        ),
        (Term::FeedForward, format!("ff_weight[{at}]"), F_SCALE),
    ];
    list.into_iter()
        .filter_map(|(term, name, scale)| gain(flight, term, name, Some(1.0 / scale)))
        .collect()
}

/// Debug mode CHIRP: axis in `debug[1]`, frequency in tenths of a hertz in `debug[2]`. The number of the mode differs
/// between versions, so the values must look like it, and the headers must know the chirp.
pub(super) fn marks(flight: &FlightTables) -> Vec<Mark> {
    let knows = flight.info.keys().any(|name| name.starts_with("chirp_"));
    let Some(topic) = flight.topic("main").filter(|_| knows) else {
        return Vec::new();
    };
    let (Some(axes), Some(frequencies)) = (topic.column("debug[1]"), topic.column("debug[2]"))
    else {
        return Vec::new();
    };
    let rows = || topic.time_s.iter().zip(axes).zip(frequencies);
    let fits = rows().all(|((_, axis), frequency)| {
        [0.0, 1.0, 2.0].contains(axis) && (0.0..=10_000.0).contains(frequency)
    });
    if !fits {
        return Vec::new();
    }
    let on = |wanted: Axis| {
        let states = rows().map(move |((&time_s, &axis), &frequency)| {
            (time_s, frequency > 0.0 && axis == wanted.index() as f64)
        });
        let spans: Vec<Span> = spans_of(states, topic.end_s);
        spans.into_iter().map(move |span| Mark {
            kind: MarkKind::BetaflightChirp,
            axis: Some(wanted),
            span,
        })
    };
    Axis::ALL.into_iter().flat_map(on).collect()
}
