//! ArduPilot: `RATE`, `ANG`, `ATT`, `PSCD`, `CTUN`.
//!
//! Reference: ArduPilot documentation, "Onboard message log messages", "System Identification Mode".

use super::{gain, spans, spans_of};
use crate::log::flight::{Firmware, FirmwareKind, Gain, Mark, MarkKind, Span, Term};
use crate::log::loops::{Axis, ControlLoop};
use crate::log::plan::{Plan, Quantity};
use crate::log::tables::FlightTables;

pub(super) const WANTED: &[(&str, &str)] = &[
    ("EV", "Id"),
    ("ARM", "ArmState"),
    ("SIDS", "Ax"),
    ("SIDS", "TR"),
    ("SIDD", "Time"),
    ("ATUN", "Axis"),
    ("ATUN", "TuneStep"),
    ("VER", "Maj"),
    ("VER", "Min"),
    ("VER", "Pat"),
];

pub(super) const FILTERS: &[&str] = &[
    "INS_GYRO_FILTER",
    "INS_HNTCH_ENABLE",
    "INS_HNTCH_FREQ",
    "INS_HNTCH_BW",
    "INS_HNTCH_MODE",
    "INS_HNTC2_ENABLE",
    "ATC_RAT_RLL_FLT",
    "ATC_RAT_PIT_FLT",
    "ATC_RAT_YAW_FLT",
];

/// Cutoff (Hz) of the low-pass of the gyro, `LowPassFilter2p`.
pub(super) const GYRO_FILTER: &str = "INS_GYRO_FILTER";

pub(super) const MIXER: &[&str] = &[
    "FRAME_CLASS",
    "FRAME_TYPE",
    "MOT_THST_EXPO",
    "MOT_THST_HOVER",
];

/// Events of `EV`.
const ARMED: f64 = 10.0;
const DISARMED: f64 = 11.0;
const LANDED: [f64; 2] = [17.0, 18.0];
const NOT_LANDED: f64 = 28.0;

/// Samples of SYSTEMID that are farther apart, in seconds, belong to two runs.
const PAUSE_S: f64 = 1.0;

pub(super) fn firmware(flight: &FlightTables) -> Firmware {
    let said = |starts: &[&str]| {
        let is_it = |text: &&String| starts.iter().any(|start| text.starts_with(start));
        flight
            .messages
            .iter()
            .map(|(_, text)| text)
            .find(is_it)
            .cloned()
    };
    // Before release 3.6: `APM:Copter V3.4.6`.
    let old = |text: String| match text.strip_prefix("APM:") {
        Some(vehicle) => format!("Ardu{vehicle}"),
        None => text,
    };
    let named = said(&["Ardu", "APM:", "Blimp", "Rover", "AntennaTracker"]).map(old);
    let version = named.or_else(|| {
        let topic = flight.topic("VER")?;
        let part = |field| topic.column(field)?.first().copied();
        Some(format!(
            "{}.{}.{}",
            part("Maj")?,
            part("Min")?,
            part("Pat")?
        ))
    });
    // `CubeOrange 00230045 3138510A ...`: a name and the serial number of the chip.
    let is_board = |text: &&String| {
        let mut words = text.split_whitespace().skip(1);
        words.clone().count() == 3
            && words
                .all(|word| word.len() == 8 && word.bytes().all(|byte| byte.is_ascii_hexdigit()))
    };
    let board = flight.messages.iter().map(|(_, text)| text).find(is_board);
    let name = board.and_then(|text| text.split_whitespace().next());
    Firmware {
        kind: FirmwareKind::ArduPilot,
        version: version.unwrap_or_default(),
        board: name.unwrap_or_default().to_owned(),
    }
}

/// Letter and name of an axis in topics.
fn names(axis: Axis) -> [&'static str; 2] {
    match axis {
        Axis::Roll => ["R", "Roll"],
        Axis::Pitch => ["P", "Pitch"],
        Axis::Yaw => ["Y", "Yaw"],
    }
}

/// Rates and angles are logged in degrees.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

pub(super) fn plans(of: ControlLoop) -> Vec<Plan> {
    let throttle = Some(Quantity::scaled("RATE", "AOut", 1.0));
    match of {
        ControlLoop::Rate(axis) => {
            let [letter, _] = names(axis);
            vec![Plan {
                control_loop: of,
                input: Quantity::scaled("RATE", format!("{letter}Out"), 1.0),
                output: Quantity::scaled("RATE", letter, DEGREE),
                set_point: Some(Quantity::scaled("RATE", format!("{letter}Des"), DEGREE)),
                throttle,
                input_unit: "1",
                sign: None,
            }]
        }
        ControlLoop::Attitude(axis) => {
            let [letter, name] = names(axis);
            let plan = |topic| Plan {
                control_loop: of,
                input: Quantity::scaled("RATE", format!("{letter}Des"), DEGREE),
                output: Quantity::scaled(topic, name, DEGREE),
                set_point: Some(Quantity::scaled(topic, format!("Des{name}"), DEGREE)),
                throttle: throttle.clone(),
                input_unit: "rad/s",
                sign: None,
            };
            ["ANG", "ATT"].into_iter().map(plan).collect()
        }
        ControlLoop::Altitude => {
            let plan = |input: (&'static str, &str), output, set_point| Plan {
                control_loop: of,
                input: Quantity::scaled(input.0, input.1, 1.0),
                output,
                set_point: Some(set_point),
                throttle: throttle.clone(),
                input_unit: "1",
                sign: None,
            };
            let down = |field| Quantity::scaled("PSCD", field, -1.0);
            // CTUN has cm/s.
            let up = |field| Quantity::scaled("CTUN", field, 0.01);
            vec![
                plan(("RATE", "AOut"), down("VD"), down("TVD")),
                plan(("CTUN", "ThO"), down("VD"), down("TVD")),
                plan(("CTUN", "ThO"), up("CRt"), up("DCRt")),
            ]
        }
    }
}

/// Parameters of the gains of a loop.
pub(super) fn gain_names(of: ControlLoop) -> Vec<(Term, String)> {
    let short = |axis| ["RLL", "PIT", "YAW"][Axis::index(axis)];
    match of {
        ControlLoop::Rate(axis) => [
            (Term::Proportional, "P"),
            (Term::Integral, "I"),
            (Term::Derivative, "D"),
            (Term::FeedForward, "FF"),
        ]
        .map(|(term, letter)| (term, format!("ATC_RAT_{}_{letter}", short(axis))))
        .to_vec(),
        ControlLoop::Attitude(axis) => {
            vec![(Term::Proportional, format!("ATC_ANG_{}_P", short(axis)))]
        }
        ControlLoop::Altitude => [
            (Term::Factor, "PSC_VELZ_P"),
            (Term::Proportional, "PSC_ACCZ_P"),
            (Term::Integral, "PSC_ACCZ_I"),
            (Term::Derivative, "PSC_ACCZ_D"),
        ]
        .map(|(term, name)| (term, name.to_owned()))
        .to_vec(),
    }
}

pub(super) fn gains(flight: &FlightTables, of: ControlLoop) -> Vec<Gain> {
    let si_per_unit = (of != ControlLoop::Altitude).then_some(1.0);
    (gain_names(of).into_iter())
        .filter_map(|(term, name)| gain(flight, term, name, si_per_unit))
        .collect()
}

/// Axes 1 to 3, 4 to 6, 7 to 9 and 10 to 12 of SYSTEMID are roll, pitch and yaw of angle, angle, rate and mixer.
pub(super) fn marks(flight: &FlightTables) -> Vec<Mark> {
    let mut marks = Vec::new();
    let starts = flight.topic("SIDS").and_then(|topic| {
        let axes = topic.column("Ax")?.iter().copied();
        Some(topic.time_s.iter().copied().zip(axes).collect::<Vec<_>>())
    });
    let samples = flight
        .topic("SIDD")
        .map(|topic| topic.time_s.as_slice())
        .unwrap_or_default();
    for run in samples.chunk_by(|a, b| b - a < PAUSE_S) {
        let (&[from_s, ..], &[.., to_s]) = (run, run) else {
            continue;
        };
        let before = starts
            .iter()
            .flatten()
            .rev()
            .find(|(time_s, _)| *time_s <= from_s);
        let axis = before.and_then(|(_, axis)| match *axis {
            axis if (1.0..=12.0).contains(&axis) => Some(Axis::ALL[(axis as usize - 1) % 3]),
            _ => None,
        });
        marks.push(Mark {
            kind: MarkKind::ArduPilotSystemId,
            axis,
            span: Span { from_s, to_s },
        });
    }
    for axis in Axis::ALL {
        let is_axis = |value: f64| value == axis.index() as f64;
        let found = spans(flight.topic("ATUN"), "Axis", is_axis).unwrap_or_default();
        marks.extend(found.into_iter().map(|span| Mark {
            kind: MarkKind::ArduPilotAutotune,
            axis: Some(axis),
            span,
        }));
    }
    marks
}

pub(super) fn armed_and_airborne(flight: &FlightTables, span: Span) -> [Option<Vec<Span>>; 2] {
    let end_s = span.to_s;
    let events: Option<Vec<(f64, f64)>> = flight.topic("EV").and_then(|topic| {
        let ids = topic.column("Id")?.iter().copied();
        Some(topic.time_s.iter().copied().zip(ids).collect())
    });
    // A log starts when the motors are armed, if LOG_DISARMED does not say otherwise: the first event may be the end.
    let state = |on: &[f64], off: &[f64]| {
        let events = events.as_ref()?;
        let is_any = |set: &[f64], id: f64| set.contains(&id);
        let changes = events
            .iter()
            .filter(|(_, id)| is_any(on, *id) || is_any(off, *id));
        let changes: Vec<(f64, bool)> = changes
            .map(|&(time_s, id)| (time_s, is_any(on, id)))
            .collect();
        let first = changes
            .first()
            .filter(|(_, is_on)| !is_on)
            .map(|_| (span.from_s, true));
        Some(spans_of(first.into_iter().chain(changes), end_s))
    };
    [state(&[ARMED], &[DISARMED]), state(&[NOT_LANDED], &LANDED)]
}
