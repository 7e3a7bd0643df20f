//! Flight logs: equal to other programs, whole and damaged.

use std::fs;
use std::path::PathBuf;

use onecycle_link::{
    Axis, ControlLoop, FirmwareKind, FlightLog, LogError, LogFormat, LogTables, MarkKind, Wanted,
    read_tables,
};

const LOGS: [&str; 6] = [
    "ap_sysid_roll.bin",
    "betaflight_acro.bfl",
    "betaflight_two_flights.bbl",
    "px4_chirps.ulg",
    "px4_dropout.ulg",
    "px4_motor_failure.ulg",
];

fn bytes(name: &str) -> Vec<u8> {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "..", "examples", "logs", name]
        .iter()
        .collect();
    fs::read(path).expect("an example of the repository")
}

fn all(name: &str) -> LogTables {
    read_tables(&*bytes(name), &Wanted::everything()).expect("a log")
}

// Rows, sums, extremes, first and last values of all columns as pyulog, pymavlink and orangebox give them. Sums differ
// by rounding: 1e-9 of the sum of magnitudes is allowed.
#[test]
fn columns_equal_those_of_other_programs() {
    let oracle = include_str!("../oracles/logs.txt");
    let mut compared = 0;
    for name in LOGS {
        let rows: Vec<&str> = oracle
            .lines()
            .filter(|line| line.starts_with(name))
            .collect();
        if rows.is_empty() {
            continue;
        }
        let tables = all(name);
        for line in rows {
            let cells: Vec<&str> = line.split(' ').collect();
            let topic = tables.flights[0].topic(cells[2]).unwrap();
            let values = topic.column(cells[3]).unwrap();
            let expected: Vec<f64> = cells[4..]
                .iter()
                .map(|cell| cell.parse().unwrap())
                .collect();
            let finite = || values.iter().copied().filter(|value| value.is_finite());
            let found = [
                values.len() as f64,
                finite().sum(),
                finite().fold(f64::INFINITY, f64::min),
                finite().fold(f64::NEG_INFINITY, f64::max),
                values[0],
                values[values.len() - 1],
            ];
            let rounding = 1e-9 * finite().map(f64::abs).sum::<f64>();
            for (at, (found, expected)) in found.iter().zip(&expected).enumerate() {
                let tolerance = if at == 1 {
                    rounding
                } else {
                    1e-12 * expected.abs()
                };
                let is_equal = (found - expected).abs() <= tolerance
                    || found == expected
                    || found.is_nan() && expected.is_nan();
                assert!(is_equal, "{line}: {found} at {at}");
            }
            compared += 1;
        }
    }
    assert_eq!(compared, oracle.lines().count() - 1);
}

#[test]
fn whole_logs_lose_nothing_and_cut_ones_say_so() {
    for name in LOGS {
        let log = FlightLog::scan(&*bytes(name)).unwrap();
        let is_cut = name == "px4_dropout.ulg";
        assert_eq!(log.loss.is_truncated, is_cut, "{name}");
        // The rest of a message that was cut.
        assert_eq!(
            log.loss.bytes_skipped,
            if is_cut { 84 } else { 0 },
            "{name}"
        );
        assert_eq!(log.loss.dropouts, u64::from(is_cut), "{name}");
    }
}

// SYSTEMID ran once, on roll (axis 10, the mixer), from 66.65 to 92.67 s.
#[test]
fn excitation_gains_and_signals_of_ardupilot() {
    let bytes = bytes("ap_sysid_roll.bin");
    let log = FlightLog::scan(&*bytes).unwrap();
    assert_eq!(log.format, LogFormat::DataFlash);
    let flight = &log.flights[0];
    let [mark] = flight.marks[..] else {
        panic!("{:?}", flight.marks);
    };
    assert_eq!(
        (mark.kind, mark.axis),
        (MarkKind::ArduPilotSystemId, Some(Axis::Roll))
    );
    assert!((mark.span.from_s - 66.65).abs() < 0.01 && (mark.span.to_s - 92.67).abs() < 0.01);
    let rate = flight.logged_loop(ControlLoop::Rate(Axis::Roll)).unwrap();
    assert_eq!(
        (rate.gains[0].name.as_str(), rate.gains[0].value as f32),
        ("ATC_RAT_RLL_P", 0.135)
    );
    let signals = log
        .signals(&*bytes, 1, ControlLoop::Rate(Axis::Roll))
        .unwrap();
    let recording = signals.recording().unwrap();
    assert_eq!(recording.set_point().unwrap().len(), recording.len());
    // 400 Hz.
    assert!((recording.sample_period_s() - 0.0025).abs() < 1e-5);
    let missing = log.signals(&*bytes, 1, ControlLoop::Altitude);
    assert!(
        matches!(missing, Err(LogError::NotLogged { .. })),
        "{missing:?}"
    );
    let missing = log.signals(&*bytes, 2, ControlLoop::Rate(Axis::Roll));
    assert!(matches!(
        missing,
        Err(LogError::NoSuchFlight {
            wanted: 2,
            flights: 1
        })
    ));
}

// Torque and gyro of PX4 are joined on the stamp of the sample: the input of a row is that of the very gyro sample.
#[test]
fn torque_and_gyro_share_their_sample() {
    let bytes = bytes("px4_chirps.ulg");
    let log = FlightLog::scan(&*bytes).unwrap();
    let signals = log
        .signals(&*bytes, 1, ControlLoop::Rate(Axis::Pitch))
        .unwrap();
    let tables = all("px4_chirps.ulg");
    let pairs = |name: &str| {
        let topic = tables.flights[0].topic(name).unwrap();
        let stamps = topic.column("timestamp_sample").unwrap().iter();
        let pairs = stamps
            .map(|stamp| *stamp as u64)
            .zip(topic.column("xyz[1]").unwrap().to_vec());
        pairs.collect::<std::collections::BTreeMap<u64, f64>>()
    };
    let (torque, gyro) = (
        pairs("vehicle_torque_setpoint"),
        pairs("vehicle_angular_velocity"),
    );
    assert!(signals.time_s.len() > 5000);
    for (row, time_s) in signals.time_s.iter().enumerate() {
        let stamp = (time_s * 1e6).round() as u64;
        assert_eq!(
            (signals.input[row], signals.output[row]),
            (torque[&stamp], gyro[&stamp])
        );
    }
}

// The proportional term in the log, 0.032029 P (r - y) per deg/s in thousandths, tells unit, scale and sign of set-point
// and gyro: P / 544.9 (r - y) must be axisP / 1000. The firmware cuts off the decimals of
// the term: half a unit on average. The second flight of
// this log has no throttle, at which the firmware would lower P.
#[test]
fn betaflight_gains_and_units_agree_with_its_proportional_term() {
    let bytes = bytes("betaflight_two_flights.bbl");
    let log = FlightLog::scan(&*bytes).unwrap();
    let tables = all("betaflight_two_flights.bbl");
    let main = tables.flights[1].topic("main").unwrap();
    for axis in [Axis::Roll, Axis::Pitch] {
        let control_loop = ControlLoop::Rate(axis);
        let signals = log.signals(&*bytes, 2, control_loop).unwrap();
        let gain = log.flights[1].logged_loop(control_loop).unwrap().gains[0]
            .si
            .unwrap();
        let terms = main.column(&format!("axisP[{}]", axis.index())).unwrap();
        let errors = signals
            .set_point
            .as_ref()
            .unwrap()
            .iter()
            .zip(&signals.output)
            .map(|(r, y)| r - y);

        let (mut products, mut squares) = (0.0, 0.0);
        for (error, term) in errors.zip(terms) {
            if term.abs() >= 10.0 {
                products += error * (term + 0.5 * term.signum()) * 1e-3;
                squares += error * error;
            }
        }
        let ratio = products / squares / gain;
        assert!((ratio - 1.0).abs() < 0.02, "{axis:?}: {ratio}");
    }
    // The motors' yaw has the sign of the controller's output, whatever the direction of the propellers.
    let yaw = log
        .signals(&*bytes, 2, ControlLoop::Rate(Axis::Yaw))
        .unwrap();
    let errors = yaw
        .set_point
        .as_ref()
        .unwrap()
        .iter()
        .zip(&yaw.output)
        .map(|(r, y)| r - y);
    assert!(
        errors
            .zip(&yaw.input)
            .map(|(error, input)| error * input)
            .sum::<f64>()
            > 0.0
    );
}

#[test]
fn a_blackbox_holds_several_flights() {
    let log = FlightLog::scan(&*bytes("betaflight_two_flights.bbl")).unwrap();
    let rows: Vec<u64> = log
        .flights
        .iter()
        .map(|flight| flight.tables.topics[0].rows)
        .collect();
    assert_eq!((rows.len(), rows[0]), (2, 98));
}

#[test]
fn the_text_form_of_dataflash() {
    let text = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
                FMT, 1, 31, PARM, QNff, TimeUS,Name,Value,Default\n\
                FMT, 2, 19, RATE, Qff, TimeUS,RDes,R\n\
                FMT, 3, 75, MSG, QZ, TimeUS,Message\n\
                PARM, 100, ATC_RAT_RLL_P, 0.135, 0\n\
                MSG, 150, ArduCopter V4.5.1, custom\n\
                RATE, 2000, 1.5, -2\nRATE, 4500, nonsense\nRATE, 4500, 2.5, -3\nWHAT, 1\n";
    let tables = read_tables(text.as_bytes(), &Wanted::everything()).unwrap();
    assert_eq!(tables.format, LogFormat::DataFlashText);
    let flight = &tables.flights[0];
    assert_eq!(
        flight.topic("RATE").unwrap().column("R"),
        Some(&[-2.0, -3.0][..])
    );
    assert_eq!(flight.topic("RATE").unwrap().time_s, [0.002, 0.0045]);
    assert_eq!(flight.parameter("ATC_RAT_RLL_P"), Some(0.135));
    assert_eq!(flight.messages[0].1, "ArduCopter V4.5.1, custom");
    // The row with two cells, and the unknown topic.
    assert_eq!(tables.loss.rows_dropped, 2);
}

/// The text form of DataFlash with this message and rows of `RATE` at these times (us).
fn text_of(message: &str, times_us: &[u64]) -> String {
    let mut text = format!(
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
         FMT, 2, 19, RATE, Qff, TimeUS,RDes,R\n\
         FMT, 3, 75, MSG, QZ, TimeUS,Message\n\
         FMT, 4, 19, STRT, ff, A,B\nMSG, 150, {message}\n"
    );
    for time_us in times_us {
        text += &format!("RATE, {time_us}, 1, 2\n");
    }
    text
}

// Before release 3.6 the vehicle stood behind `APM:`.
#[test]
fn ardupilot_names_vehicle_and_release() {
    let firmware = |message| {
        let log = FlightLog::scan(text_of(message, &[1000, 2000]).as_bytes()).unwrap();
        log.flights[0].firmware.clone()
    };
    let old = firmware("APM:Copter V3.4.6 (e707341b)");
    assert_eq!(old.version, "ArduCopter V3.4.6 (e707341b)");
    assert_eq!(old.release(), Some(("ArduCopter", [3, 4])));
    let new = firmware("ArduPlane V4.7.0-dev (55685c43)");
    assert_eq!(new.release(), Some(("ArduPlane", [4, 7])));
    assert_eq!(firmware("Frame: QUAD").release(), None);
}

// The clock goes back by 3 ms, and a damaged stamp is years ahead: the flight lasts from the earliest to the latest row. More rows of
// a topic without a clock do not count.
#[test]
fn a_flight_does_not_end_before_it_begins() {
    let span = |times_us: &[u64]| {
        let log = FlightLog::scan(text_of("ArduCopter V4.5.1", times_us).as_bytes()).unwrap();
        let span = log.flights[0].span;
        [span.from_s, span.to_s]
    };
    assert_eq!(span(&[5000, 6000, 3000, 4000]), [0.003, 0.006]);
    assert_eq!(span(&[3000, 4000, 1 << 50, 5000]), [0.003, 0.005]);
    let stopped = text_of("ArduCopter V4.5.1", &[3000, 4000]) + &"STRT, 1, 2\n".repeat(9);
    let log = FlightLog::scan(stopped.as_bytes()).unwrap();
    assert_eq!(log.flights[0].span.to_s, 0.004);
}

// A thousand bytes missing in the middle cost what they held, and at most some rows beside them.
#[test]
fn reading_goes_on_after_damage() {
    let topics = [
        ("ap_sysid_roll.bin", "RATE", 40),
        ("px4_chirps.ulg", "vehicle_angular_velocity", 40),
        // Up to the next I frame: 32 frames, and those that the bytes held.
        ("betaflight_acro.bfl", "main", 150),
    ];
    for (name, topic, most) in topics {
        let whole = bytes(name);
        let rows = |bytes: &[u8]| {
            let tables = read_tables(bytes, &Wanted::nothing()).unwrap();
            (tables.flights[0].topic(topic).unwrap().rows, tables.loss)
        };
        let mut cut = whole.clone();
        cut.drain(whole.len() / 2 + 7..whole.len() / 2 + 1007);
        let ((before, _), (after, loss)) = (rows(&whole), rows(&cut));
        assert!(
            before - after <= most && after < before,
            "{name}: {before} {after} {loss:?}"
        );
        assert!(
            loss.rows_dropped + loss.bytes_skipped > 0,
            "{name}: {loss:?}"
        );
    }
}

/// A number as blackbox writes it: seven bits a byte.
fn unsigned(bytes: &mut Vec<u8>, mut value: u32) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// The same of a number with a sign, which the lowest bit holds.
fn signed(bytes: &mut Vec<u8>, value: i32) {
    unsigned(bytes, (value << 1 ^ value >> 31) as u32);
}

/// A log as INAV 7 and later writes it, of whole frames only: headers, fields and encodings follow the public source of its
/// blackbox; no real log of it was at hand. Roll follows `rate`, in deg/s.
fn inav(rate: impl Fn(i32) -> i32) -> Vec<u8> {
    let names = "loopIteration,time,axisRate[0],axisRate[1],axisRate[2],axisP[0],axisP[1],axisP[2],axisI[0],axisI[1],axisI[2],\
        axisD[0],axisD[1],axisF[0],axisF[1],axisF[2],gyroADC[0],gyroADC[1],gyroADC[2],motor[0],motor[1],motor[2],motor[3]";
    let count = names.split(',').count();
    let list = |of: &dyn Fn(usize) -> u8| {
        let all: Vec<String> = (0..count).map(|at| of(at).to_string()).collect();
        all.join(",")
    };
    let motor = count - 4;
    let is_unsigned = |at: usize| u8::from(at < 2 || at == motor);
    // Motors are predicted by minthrottle and by the first one.
    let predictor = |at: usize| match at {
        at if at == motor => 4,
        at if at > motor => 5,
        _ => 0,
    };
    let mut bytes = format!(
        "H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\nH I interval:1\nH P interval:1/1\n\
         H Field I name:{names}\nH Field I signed:{}\nH Field I predictor:{}\nH Field I encoding:{}\n\
         H Field P predictor:{}\nH Field P encoding:{}\nH Firmware type:Cleanflight\n\
         H Firmware revision:INAV 8.0.1 (cc4f5a2e) KAKUTEH7\nH minthrottle:1100\nH maxthrottle:1950\nH gyro_scale:0x3f800000\n\
         H motorOutput:1100,1950\nH looptime:1000\nH rollPID:33,30,20,0\n",
        list(&|at| 1 - is_unsigned(at)),
        list(&predictor),
        list(&is_unsigned),
        list(&|at| u8::from(at != 0)),
        list(&|at| if at == 0 { 9 } else { 0 }),
    )
    .into_bytes();
    for row in 0..2000 {
        bytes.push(b'I');
        unsigned(&mut bytes, row as u32);
        unsigned(&mut bytes, 1_000_000 + 1000 * row as u32);
        for value in [rate(row), 0, 0] {
            signed(&mut bytes, value);
        }
        (5..motor - 3).for_each(|_| signed(&mut bytes, 5));
        for value in [rate(row - 10), 0, 0] {
            signed(&mut bytes, value);
        }
        // Roll to the right slows the motors of the right down.
        let push = (rate(row) - rate(row - 10)) / 4;
        unsigned(&mut bytes, (300 - push) as u32);
        for value in [0, 2 * push, 2 * push] {
            signed(&mut bytes, value);
        }
    }
    bytes.extend(b"E\xffEnd of log\0");
    bytes
}

// The set-point of INAV is `axisRate` in deg/s; its gains have other units than those of Betaflight, and are not stated.
#[test]
fn rate_loops_of_inav() {
    let rate = |row: i32| if row / 200 % 2 == 1 { 180 } else { -90 };
    let bytes = inav(rate);
    let log = FlightLog::scan(&*bytes).expect("a log");
    let about = &log.flights[0];
    assert_eq!(about.firmware.kind, FirmwareKind::Inav);
    assert_eq!(about.firmware.version, "INAV 8.0.1 (cc4f5a2e) KAKUTEH7");
    assert_eq!(log.loss, Default::default());
    let roll = ControlLoop::Rate(Axis::Roll);
    assert!(about.logged_loop(roll).expect("a loop").gains.is_empty());
    let signals = log.signals(&*bytes, 1, roll).expect("signals");
    assert_eq!(signals.time_s.len(), 2000);
    let set_point = signals.set_point.expect("a set-point");
    for row in [0, 199, 200, 250, 1999] {
        let of = |row: i32| f64::from(rate(row)).to_radians();
        assert!((set_point[row] - of(row as i32)).abs() < 1e-12, "{row}");
        assert!(
            (signals.output[row] - of(row as i32 - 10)).abs() < 1e-12,
            "{row}"
        );
        // Four motors moved by `push` of the range of 850.
        let push = (rate(row as i32) - rate(row as i32 - 10)) / 4;
        assert!(
            (signals.input[row] - f64::from(push) / 850.0).abs() < 1e-12,
            "{row}"
        );
    }
}

// Without its feature an MCAP file is known, and refused.
#[cfg(not(feature = "mcap"))]
#[test]
fn mcap_needs_its_feature() {
    let error = FlightLog::scan(&b"\x89MCAP0\r\n"[..]).unwrap_err();
    assert!(
        matches!(error, LogError::NotBuilt(LogFormat::Mcap)),
        "{error}"
    );
}

/// Random numbers of 64 bits (splitmix64).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) % end as u64) as usize
    }
}

/// The bytes, damaged in one of several ways.
fn damaged(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    match random.below(4) {
        0 => bytes.truncate(random.below(bytes.len())),
        1 => {
            let from = random.below(bytes.len());
            let to = (from + random.below(5000)).min(bytes.len());
            bytes.drain(from..to);
        }
        kind => {
            // Many flips among the definitions at the start, or anywhere.
            let end = if kind == 2 { 20_000 } else { bytes.len() };
            for _ in 0..1 + random.below(50) {
                let at = 24 + random.below(end.min(bytes.len()) - 24);
                bytes[at] = random.below(256) as u8;
            }
        }
    }
    bytes
}

// 500 damaged logs of each format: no panic, no row out of nothing, every loop joins or is refused.
#[test]
fn damaged_logs_do_no_harm() {
    let mut random = Random(1);
    let mut text = String::from(
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
         FMT, 2, 19, RATE, Qfff, TimeUS,RDes,R,ROut\n",
    );
    for row in 0..5000 {
        text += &format!("RATE, {}, {}.5, -{row}, 0.25\n", 2500 * row, row % 7);
    }
    let logs = [
        bytes("ap_sysid_roll.bin"),
        bytes("betaflight_two_flights.bbl"),
        bytes("px4_dropout.ulg"),
        text.into_bytes(),
    ];
    for mut log in logs {
        log.truncate(250_000);
        for _ in 0..500 {
            let bytes = damaged(&log, &mut random);
            let Ok(tables) = read_tables(&*bytes, &Wanted::everything()) else {
                continue;
            };
            let rows = tables
                .flights
                .iter()
                .flat_map(|flight| &flight.topics)
                .map(|topic| topic.rows);
            assert!(rows.sum::<u64>() <= bytes.len() as u64);
            assert!(tables.loss.bytes_skipped <= bytes.len() as u64);
            if random.below(10) == 0
                && let Ok(log) = FlightLog::scan(&*bytes)
            {
                for control_loop in ControlLoop::ALL {
                    if let Ok(signals) = log.signals(&*bytes, 1, control_loop) {
                        assert!(signals.time_s.is_sorted_by(|a, b| a < b));
                        let _ = signals.recording();
                    }
                }
            }
        }
    }
}
