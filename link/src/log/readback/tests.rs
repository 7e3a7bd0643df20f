//! Gain read-back on real logs, and on logs with wrong gains, signals and motors.

use super::*;
use crate::log::tables::Topic;

fn log(name: &str) -> (Vec<u8>, FlightLog) {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/logs/");
    let bytes = std::fs::read(format!("{folder}{name}")).unwrap();
    let log = FlightLog::scan(&bytes[..]).unwrap();
    (bytes, log)
}

fn ratio(read: &ReadBack, term: Term) -> f64 {
    let of = read.terms.iter().find(|own| own.term == term);
    of.and_then(ReadTerm::ratio).unwrap()
}

// The logs of PX4 and ArduPilot come from simulations of the whole firmware: the gains are known exactly.
#[test]
fn gains_of_three_firmwares() {
    let cases = [
        ("px4_chirps.ulg", [0.02, 0.05]),
        ("ap_sysid_roll.bin", [0.01, 0.01]),
        ("betaflight_acro.bfl", [0.06, 0.05]),
    ];
    for (name, [p, d]) in cases {
        let (bytes, log) = log(name);
        let read = log.read_back(&bytes[..], 1).unwrap();
        assert_eq!(read.len(), 3, "{name}");
        for axis in &read[..2] {
            assert_eq!(axis.agreement(), Agreement::Agrees, "{name} {axis:?}");
            assert!(
                (ratio(axis, Term::Proportional) - 1.0).abs() < p,
                "{name} {axis:?}"
            );
            assert!(
                (ratio(axis, Term::Derivative) - 1.0).abs() < d,
                "{name} {axis:?}"
            );
            assert!(axis.explained.unwrap() > 0.9, "{name} {axis:?}");
        }
    }
}

// Wrong sign, gains of another unit (degrees), gains of another axis or version (half).
#[test]
fn wrong_gains_differ() {
    for name in ["px4_chirps.ulg", "ap_sysid_roll.bin", "betaflight_acro.bfl"] {
        for factor in [-1.0, 180.0 / std::f64::consts::PI, 0.5] {
            let (bytes, mut log) = log(name);
            for own in &mut log.flights[0].loops {
                let gains = own.gains.iter_mut();
                gains.for_each(|gain| gain.si = gain.si.map(|si| factor * si));
            }
            for axis in log.read_back(&bytes[..], 1).unwrap() {
                assert_eq!(
                    axis.agreement(),
                    Agreement::Differs,
                    "{name} {factor} {axis:?}"
                );
            }
        }
    }
}

/// A ULog with messages of a parameter after these shares of its messages.
fn with_changes(bytes: &[u8], name: &str, changes: &[(f64, f32)]) -> Vec<u8> {
    let size = |at: usize| 3 + usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
    let next = |&at: &usize| Some(at + size(at)).filter(|next| next + 3 < bytes.len());
    let starts: Vec<usize> = std::iter::successors(Some(16), next).collect();
    let mut changed = Vec::new();
    let mut copied = 0;
    for &(share, value) in changes {
        let at = starts[(share * starts.len() as f64) as usize];
        changed.extend(&bytes[copied..at]);
        copied = at;
        let key = format!("float {name}");
        changed.extend(((1 + key.len() + 4) as u16).to_le_bytes());
        changed.extend([b'P', key.len() as u8]);
        changed.extend(key.bytes());
        changed.extend(value.to_le_bytes());
    }
    changed.extend(&bytes[copied..]);
    changed
}

// The gain is given another value, and its own again: only the signals after that are read. Then another value for good, with
// which the vehicle did not fly.
#[test]
fn gains_changed_in_flight() {
    let (bytes, log) = log("px4_chirps.ulg");
    let name = "MC_ROLLRATE_P";
    let own = log.flights[0].tables.parameter(name).unwrap() as f32;
    let before = log.read_back(&bytes[..], 1).unwrap();
    assert_eq!(before[0].since_s, None);
    let read = |changes: &[(f64, f32)]| {
        let bytes = with_changes(&bytes, name, changes);
        let log = FlightLog::scan(&bytes[..]).unwrap();
        log.read_back(&bytes[..], 1).unwrap()
    };
    let there_and_back = read(&[(0.2, 2.0 * own), (0.4, own)]);
    assert_eq!(there_and_back[0].agreement(), Agreement::Agrees);
    assert!(there_and_back[0].since_s.is_some());
    assert!(there_and_back[0].rows < before[0].rows);
    assert_eq!(there_and_back[1], before[1]);
    let other = read(&[(0.2, 2.0 * own)]);
    assert_eq!(other[0].agreement(), Agreement::Differs);
    let stated = other[0].terms.iter().find(|term| term.name == name);
    let ratio = stated.unwrap().stated[0] / f64::from(2.0 * own);
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
}

// The controller's output of roll against the signals of pitch, and against the gyro with the wrong sign.
#[test]
fn wrong_signals_differ() {
    let name = "px4_chirps.ulg";
    let (bytes, log) = log(name);
    let about = &log.flights[0];
    let tables = read_tables(&bytes[..], &Wanted::everything()).unwrap();
    let tables = &tables.flights[0];
    let signals = |axis| {
        let plan = firmware::plan(FirmwareKind::Px4, tables, ControlLoop::Rate(axis)).unwrap();
        plan.join(1, tables)
    };
    let right = signals(Axis::Roll);
    let mut crossed = signals(Axis::Pitch);
    crossed.input.clone_from(&right.input);
    let mut opposed = right.clone();
    opposed.output.iter_mut().for_each(|rate| *rate = -*rate);
    let verdict = |signals: &Signals| {
        let read = read_axis(about, tables, Axis::Roll, signals).unwrap();
        read.agreement()
    };
    assert_eq!(verdict(&right), Agreement::Agrees);
    assert_eq!(verdict(&crossed), Agreement::Differs);
    assert_eq!(verdict(&opposed), Agreement::Differs);
}

// The motors of Betaflight mix to the sum of the terms; not those of another axis, nor with the other sign.
#[test]
fn mixer_of_betaflight() {
    let (bytes, log) = log("betaflight_acro.bfl");
    let read = log.read_back(&bytes[..], 1).unwrap();
    assert!(
        (ratio(&read[0], Term::Mixer) - 1.0).abs() < 0.03,
        "{read:?}"
    );
    assert!(
        (ratio(&read[2], Term::Mixer) - 1.0).abs() < 0.05,
        "{read:?}"
    );
    let about = &log.flights[0];
    let tables = read_tables(&bytes[..], &Wanted::everything()).unwrap();
    let tables = &tables.flights[0];
    let kind = FirmwareKind::Betaflight;
    let signals = |axis| {
        let plan = firmware::plan(kind, tables, ControlLoop::Rate(axis)).unwrap();
        plan.join(1, tables)
    };
    let mixer = |signals: &Signals| {
        let read = read_axis(about, tables, Axis::Roll, signals).unwrap();
        let own = read.terms.iter().find(|own| own.term == Term::Mixer);
        (own.unwrap().agreement, read.agreement())
    };
    let right = signals(Axis::Roll);
    assert_eq!(mixer(&right), (Agreement::Agrees, Agreement::Agrees));
    let mut crossed = right.clone();
    crossed.input = signals(Axis::Yaw).input;
    let mut opposed = right.clone();
    opposed.input.iter_mut().for_each(|input| *input = -*input);
    for wrong in [crossed, opposed] {
        assert_eq!(mixer(&wrong), (Agreement::Differs, Agreement::Differs));
    }
}

// A log at 9 Hz and one of an axis that hardly moves prove nothing.
#[test]
fn slow_logs_prove_nothing() {
    let (bytes, log) = log("px4_motor_failure.ulg");
    let read = log.read_back(&bytes[..], 1).unwrap();
    assert!(
        read.iter()
            .all(|axis| axis.agreement() == Agreement::Unknown),
        "{read:?}"
    );
    assert!(log.read_back(&bytes[..], 2).is_err());
}

/// A topic of motors.
fn motor_topic(
    name: &str,
    fields: &[String],
    time_s: &[f64],
    motor: impl Fn(usize, usize) -> f64,
) -> Topic {
    let mut topic = Topic::new(name, 0, fields.to_vec(), &Wanted::everything());
    topic.rows = time_s.len() as u64;
    topic.time_s = time_s.to_vec();
    let column = |at: usize| (0..time_s.len()).map(|row| motor(at, row)).collect();
    topic.columns = (0..fields.len()).map(|at| (at, column(at))).collect();
    topic
}

/// Numbers between -1 and 1.
fn random(count: usize) -> Vec<f64> {
    let mut state = 7_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 16) / 32768.0 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

/// Verdict and ratio of the mix of roll, pitch and yaw.
fn mixes(about: &Flight, tables: &FlightTables) -> Vec<(Agreement, f64)> {
    let kind = about.firmware.kind;
    let of = |axis: &Axis| {
        let plan = firmware::plan(kind, tables, ControlLoop::Rate(*axis)).unwrap();
        let read = read_axis(about, tables, *axis, &plan.join(1, tables)).unwrap();
        let own = read
            .terms
            .iter()
            .find(|own| own.term == Term::Mixer)
            .unwrap();
        (own.agreement, own.ratio().unwrap())
    };
    Axis::ALL.iter().map(of).collect()
}

// Motors of PX4's quadcopter X (front right and rear left turn one way) put the logged torque out at 24 Hz, thrust 0.5 with
// noise of 0.02. On real logs with their own motors the ratio is 1.00 +- 0.01 (four logs of PX4 1.15 to 1.17), and 1.07 on the
// roll of ArduPilot's SITL.
#[test]
fn motors_of_px4() {
    let (bytes, log) = log("px4_chirps.ulg");
    let about = &log.flights[0];
    let mut tables = read_tables(&bytes[..], &Wanted::everything()).unwrap();
    let tables = &mut tables.flights[0];
    let torque = tables.topic("vehicle_torque_setpoint").unwrap();
    let time_s: Vec<f64> = torque.time_s.iter().step_by(10).copied().collect();
    let axes = [0, 1, 2].map(|at| torque.column(&format!("xyz[{at}]")).unwrap().to_vec());
    let noise = random(time_s.len());
    let signs = [
        [-1.0, 1.0, 1.0],
        [1.0, -1.0, 1.0],
        [1.0, 1.0, -1.0],
        [-1.0, -1.0, -1.0],
    ];
    let motor = |at: usize, row: usize| {
        let scale = [0.5_f64.sqrt(), 0.5_f64.sqrt(), 1.0];
        let moved = (0..3).map(|axis| signs[at][axis] * scale[axis] * axes[axis][10 * row]);
        0.5 + 0.02 * noise[row] + moved.sum::<f64>()
    };
    let fields: Vec<String> = (0..4).map(|at| format!("control[{at}]")).collect();
    let count = tables.topics.len();
    let mut with = |order: [usize; 4], sign: f64| {
        tables.topics.truncate(count);
        let motor = |at: usize, row: usize| 0.5 + sign * (motor(order[at], row) - 0.5);
        let topic = motor_topic("actuator_motors", &fields, &time_s, motor);
        tables.topics.push(topic);
        mixes(about, tables)
    };
    for (verdict, ratio) in with([0, 1, 2, 3], 1.0) {
        assert_eq!(verdict, Agreement::Agrees);
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    }
    // Two exchanged motors change two axes: these two put out what they should not.
    for (order, wrong) in [
        ([1, 0, 2, 3], [true, true, false]),
        ([2, 1, 0, 3], [true, false, true]),
        ([3, 1, 2, 0], [false, true, true]),
    ] {
        for ((verdict, ratio), wrong) in with(order, 1.0)
            .into_iter()
            .zip([wrong[0], wrong[1], wrong[2]])
        {
            let expected = if wrong {
                Agreement::Differs
            } else {
                Agreement::Agrees
            };
            assert_eq!(verdict, expected, "{order:?} {ratio}");
        }
    }
    for (verdict, ratio) in with([0, 1, 2, 3], -1.0) {
        assert_eq!(verdict, Agreement::Differs, "{ratio}");
    }
}

// ArduPilot's quadcopter plus (right, left, front, rear): pulses of 1 us behind the inverse of the thrust curve, at 10 Hz. Its
// pitch and yaw hardly moved.
#[test]
fn motors_of_ardupilot() {
    let (bytes, log) = log("ap_sysid_roll.bin");
    let about = &log.flights[0];
    let parameter = |name: &str| about.tables.parameter(name).unwrap();
    assert_eq!(
        [parameter("FRAME_CLASS"), parameter("FRAME_TYPE")],
        [1.0, 0.0]
    );
    let mut tables = read_tables(&bytes[..], &Wanted::everything()).unwrap();
    let tables = &mut tables.flights[0];
    let rate = tables.topic("RATE").unwrap();
    let time_s: Vec<f64> = rate.time_s.iter().step_by(40).copied().collect();
    let axes = ["ROut", "POut", "YOut"].map(|name| rate.column(name).unwrap().to_vec());
    let [expo, low, high] = ["MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX"].map(parameter);
    let factors = [
        [-0.5, 0.0, 0.5],
        [0.5, 0.0, 0.5],
        [0.0, 0.5, -0.5],
        [0.0, -0.5, -0.5],
    ];
    let pulse = |at: usize, row: usize| {
        let moved = (0..3).map(|axis| factors[at][axis] * axes[axis][40 * row]);
        let thrust = 0.39 + moved.sum::<f64>();
        // The root of (1 - e) x + e x^2 = thrust.
        let root = ((1.0 - expo).powi(2) + 4.0 * expo * thrust).sqrt();
        let x = (root - (1.0 - expo)) / (2.0 * expo);
        (1000.0 + 1000.0 * (low + (high - low) * x)).round()
    };
    let fields: Vec<String> = (1..=4).map(|at| format!("C{at}")).collect();
    // The log declares RCOU and has no rows of it.
    tables.topics.retain(|topic| topic.name != "RCOU");
    let count = tables.topics.len();
    let mut roll = |order: [usize; 4]| {
        tables.topics.truncate(count);
        let motor = |at: usize, row: usize| pulse(order[at], row);
        tables
            .topics
            .push(motor_topic("RCOU", &fields, &time_s, motor));
        mixes(about, tables)[0]
    };
    let (verdict, ratio) = roll([0, 1, 2, 3]);
    assert_eq!(verdict, Agreement::Agrees);
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    // Right and left exchanged: the other sign. Right and front: half, and pitch shows the other half.
    assert_eq!(roll([1, 0, 2, 3]).0, Agreement::Differs);
    let (verdict, ratio) = roll([2, 1, 0, 3]);
    assert_eq!(verdict, Agreement::Differs);
    assert!((ratio - 0.5).abs() < 0.05, "{ratio}");
}
