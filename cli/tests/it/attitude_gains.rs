//! Attitude gains from flight logs: logs of a simulated angle loop in the formats of two firmwares, parameters out.

use std::fmt::Write as _;

use crate::common::{Scratch, run};

/// Sample period of the logs (s).
const PERIOD_S: f64 = 0.005;

/// Angle gain in force (1/s), time constant of the rate loop (s).
const IN_FORCE: f64 = 4.5;
const LAG_S: f64 = 0.06;

/// Row of a log: set-point and angle (rad), set-point of the rate (rad/s).
struct Row {
    set_point: f64,
    angle: f64,
    rate_set_point: f64,
}

/// 40 s of an angle behind a rate loop with a lag, under a P controller, with steps of the set-point every 0.8 s and angles
/// that are known to 0.05 mrad.
fn flight() -> Vec<Row> {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    };
    let (mut angle, mut rate, mut set_point) = (0.0, 0.0, 0.0);
    (0..8000)
        .map(|row| {
            if row % 160 == 0 {
                set_point = 0.6 * uniform();
            }
            let seen = angle + 1e-4 * uniform();
            let rate_set_point = IN_FORCE * (set_point - seen);
            // Exact for an input that is held.
            let decay = (-PERIOD_S / LAG_S).exp();
            angle += rate_set_point * PERIOD_S + (rate - rate_set_point) * LAG_S * (1.0 - decay);
            rate = rate_set_point + (rate - rate_set_point) * decay;
            Row {
                set_point,
                angle: seen,
                rate_set_point,
            }
        })
        .collect()
}

/// The text form of DataFlash, in degrees, with the gain in `ATC_ANG_RLL_P`.
fn ardupilot(rows: &[Row]) -> Vec<u8> {
    let mut text = String::from(
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
         FMT, 2, 19, RATE, Qffff, TimeUS,RDes,R,ROut,AOut\n\
         FMT, 3, 19, ANG, Qff, TimeUS,DesRoll,Roll\n\
         FMT, 4, 30, PARM, QNff, TimeUS,Name,Value,Default\n\
         FMT, 5, 75, MSG, QZ, TimeUS,Message\n\
         MSG, 900, ArduCopter V4.5.7 (2a3dc4b7)\n",
    );
    let _ = writeln!(text, "PARM, 1000, ATC_ANG_RLL_P, {IN_FORCE}, 4.5");
    for (at, row) in rows.iter().enumerate() {
        let time_us = 5_000 * (at + 1);
        let [aim, angle, rate] =
            [row.set_point, row.angle, row.rate_set_point].map(f64::to_degrees);
        let _ = writeln!(text, "ANG, {time_us}, {aim:.6}, {angle:.6}");
        let _ = writeln!(text, "RATE, {time_us}, {rate:.6}, 0, 0, 0.3");
    }
    text.into_bytes()
}

/// A ULog of PX4 1.15 with the gain in `MC_ROLL_P`, angles as quaternions.
fn px4(rows: &[Row]) -> Vec<u8> {
    let mut log = b"ULog\x01\x12\x35\x01".to_vec();
    log.extend(0_u64.to_le_bytes());
    let mut message = |kind: u8, payload: &[u8]| {
        log.extend((payload.len() as u16).to_le_bytes());
        log.push(kind);
        log.extend(payload);
    };
    let value =
        |name: &str, value: [u8; 4]| [&[name.len() as u8], name.as_bytes(), &value].concat();
    message(
        b'I',
        &value("uint32_t ver_sw_release", 0x010F_04FF_u32.to_le_bytes()),
    );
    message(
        b'P',
        &value("float MC_ROLL_P", (IN_FORCE as f32).to_le_bytes()),
    );
    let topics = [
        ("vehicle_attitude", "float[4] q"),
        ("vehicle_attitude_setpoint", "float[4] q_d"),
        ("vehicle_rates_setpoint", "float[3] roll"),
    ];
    for (name, member) in topics {
        let member = member.replace("float[3] roll", "float roll;float pitch;float yaw");
        message(
            b'F',
            format!("{name}:uint64_t timestamp;{member};").as_bytes(),
        );
    }
    for (id, (name, _)) in topics.iter().enumerate() {
        message(b'A', &[&[0, id as u8, 0], name.as_bytes()].concat());
    }
    for (at, row) in rows.iter().enumerate() {
        let about_x = |angle: f64| [(0.5 * angle).cos(), (0.5 * angle).sin(), 0.0, 0.0];
        let values = [
            about_x(row.angle).to_vec(),
            about_x(row.set_point).to_vec(),
            vec![row.rate_set_point, 0.0, 0.0],
        ];
        for (id, values) in values.iter().enumerate() {
            let mut payload = vec![id as u8, 0];
            payload.extend((5_000 * (at as u64 + 1)).to_le_bytes());
            let numbers = values.iter().map(|value| (*value as f32).to_le_bytes());
            payload.extend(numbers.flatten());
            message(b'D', &payload);
        }
    }
    log
}

/// Identifies the attitude loop of a log, writes all of the way to the proposed gain, and returns report and both files.
fn written(log: &[u8]) -> (serde_json::Value, [String; 2]) {
    let folder = Scratch::new();
    let path = folder.write("flight.log", log);
    let ask = [
        "identify",
        &path,
        "--axis",
        "roll",
        "--loop",
        "attitude",
        "--step",
        "1",
        "--json",
        "--write",
        &folder.name("roll.txt"),
    ];
    let outcome = run(&ask);
    let report: serde_json::Value = serde_json::from_str(&outcome.stdout).unwrap();
    assert_eq!(outcome.code, Some(0), "{}", report["log"]);
    let read = |name: &str| std::fs::read_to_string(folder.path(name)).unwrap();
    (report, [read("roll.txt"), read("roll.restore.txt")])
}

/// Checks the process against the simulation, and returns the new gain.
fn gain(report: &serde_json::Value, name: &str) -> f64 {
    assert_eq!(report["structure"], "integrator_lag", "{report}");
    let written = &report["log"]["written"];
    let changes = written["changes"].as_array().unwrap();
    assert_eq!(
        (changes.len(), &changes[0]["name"]),
        (1, &name.into()),
        "{written}"
    );
    assert_eq!(changes[0]["old"], IN_FORCE);
    // P on an integrator with the lag T has a damping ratio of 1/(2 sqrt(P T)): 0.690 for 5 % of overshoot, so P T = 0.525. Half
    // of the 5 ms between the rows is lag too: P = 8.40.
    let new = changes[0]["new"].as_f64().unwrap();
    assert!((new / 8.40 - 1.0).abs() < 0.01, "{written}");
    assert!(written["ms"].as_f64().unwrap() <= 1.61, "{written}");
    assert_eq!(written["stable_share"], 1.0, "{written}");
    new
}

#[test]
fn ardupilot_attitude_gain() {
    let (report, [new, old]) = written(&ardupilot(&flight()));
    let value = gain(&report, "ATC_ANG_RLL_P");
    let expected = format!("# ATC_ANG_RLL_P: 4.5 -> {value}\nATC_ANG_RLL_P,{value}\n");
    assert_eq!(new, expected);
    assert!(old.ends_with("\nATC_ANG_RLL_P,4.5\n"), "{old}");
}

#[test]
fn px4_attitude_gain() {
    let (report, [new, old]) = written(&px4(&flight()));
    let value = gain(&report, "MC_ROLL_P");
    assert!(
        new.ends_with(&format!("\n1\t1\tMC_ROLL_P\t{value}\t9\n")),
        "{new}"
    );
    assert!(old.ends_with("\n1\t1\tMC_ROLL_P\t4.5\t9\n"), "{old}");
}

// Betaflight logs no angle.
#[test]
fn betaflight_has_no_attitude_loop() {
    let folder = Scratch::new();
    let log = format!(
        "{}/../examples/logs/betaflight_acro.bfl",
        env!("CARGO_MANIFEST_DIR")
    );
    let path = folder.name("roll.txt");
    let outcome = run(&["identify", &log, "--loop", "attitude", "--write", &path]);
    assert_ne!(outcome.code, Some(0));
    assert!(outcome.stderr.contains("attitude"), "{outcome:?}");
    assert_eq!(folder.files(), Vec::<String>::new());
}
