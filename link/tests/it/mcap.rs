//! MCAP logs of ROS 2: equal to the ULog from which `oracles/mcap_logs.py` wrote them, whole and damaged.

use std::fs;
use std::path::PathBuf;

use onecycle_link::{
    Axis, ControlLoop, CsvOptions, FirmwareKind, FlightLog, LogFormat, ReadError, Recording,
    Wanted, read_from, read_tables,
};

use crate::step::{ROWS, assert_names, assert_rows, sample};

const LOGS: [&str; 3] = ["px4_none.mcap", "px4_lz4.mcap", "px4_zstd.mcap"];

fn bytes(name: &str) -> Vec<u8> {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "tests", "data", name]
        .iter()
        .collect();
    fs::read(path).expect("data of the tests")
}

// The second from 203 s on of three topics, plain and with both compressions. The writer is Python's mcap 1.6.0, the bytes of
// the messages are made with struct, the rows are those that pyulog reads.
#[test]
fn rows_equal_those_of_the_ulog() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../examples/logs/px4_chirps.ulg"
    );
    let ulog = fs::read(path).expect("an example of the repository");
    let ulog = read_tables(&*ulog, &Wanted::everything()).expect("a log");
    for name in LOGS {
        let log = read_tables(&*bytes(name), &Wanted::everything()).expect("a log");
        assert_eq!(log.format, LogFormat::Mcap);
        assert_eq!(log.loss, Default::default(), "{name}");
        let topics = &log.flights[0].topics;
        assert_eq!(topics.len(), 3, "{name}");
        assert_eq!(topics.iter().map(|topic| topic.rows).sum::<u64>(), 591);
        for topic in topics {
            let whole = ulog.flights[0].topic(&topic.name).expect("the same topic");
            let from = whole.time_s.partition_point(|time_s| *time_s < 203.0);
            let rows = from..from + topic.rows as usize;
            assert_eq!(topic.time_s, whole.time_s[rows.clone()], "{name}");
            assert!(topic.fields.len() >= 5);
            for field in &topic.fields {
                let expected = &whole.column(field).expect("the same column")[rows.clone()];
                assert_eq!(topic.column(field), Some(expected), "{name} {field}");
            }
        }
    }
}

#[test]
fn loops_are_those_of_px4() {
    for name in LOGS {
        let bytes = bytes(name);
        let log = FlightLog::scan(&*bytes).expect("a log");
        assert_eq!(log.flights[0].firmware.kind, FirmwareKind::Px4);
        let signals = (log.signals(&*bytes, 1, ControlLoop::Rate(Axis::Pitch))).expect("a loop");
        assert!(signals.time_s.len() > 200, "{name}");
        assert!(signals.set_point.is_some());
        assert_eq!(signals.names[0], "vehicle_torque_setpoint.xyz[1]");
        signals.recording().expect("a recording");
    }
}

// Cut at every 97th byte: the rows before are read, none of them is another.
#[test]
fn cut_logs_keep_their_rows() {
    for name in LOGS {
        let whole = bytes(name);
        let tables = read_tables(&*whole, &Wanted::everything()).expect("a log");
        let mut most = 0;
        for end in (8..whole.len()).step_by(97) {
            let cut = read_tables(&whole[..end], &Wanted::everything()).expect("a log");
            let rows = (cut.flights[0].topics.iter())
                .map(|topic| topic.rows)
                .sum::<u64>();
            assert!(rows >= most, "{name} {end}");
            most = rows;
            for topic in &cut.flights[0].topics {
                let own = tables.flights[0]
                    .topic(&topic.name)
                    .expect("the same topic");
                assert_eq!(
                    topic.time_s,
                    own.time_s[..topic.time_s.len()],
                    "{name} {end}"
                );
            }
        }
        assert_eq!(most, 591, "{name}");
    }
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

// 500 damaged logs of each compression: flips at the start or anywhere, missing bytes. No panic, and loops join or are refused.
#[test]
fn damaged_logs_do_no_harm() {
    let mut random = Random(3);
    for name in LOGS {
        let whole = bytes(name);
        for _ in 0..500 {
            let mut bytes = whole.clone();
            if random.below(4) == 0 {
                let from = 8 + random.below(bytes.len() - 8);
                let to = (from + random.below(5000)).min(bytes.len());
                bytes.drain(from..to);
            }
            let end = [1000, bytes.len()][random.below(2)].min(bytes.len());
            for _ in 0..1 + random.below(20) {
                let at = 8 + random.below(end - 8);
                bytes[at] = random.below(256) as u8;
            }
            let tables = read_tables(&*bytes, &Wanted::everything()).expect("a log");
            let rows = tables.flights[0].topics.iter().map(|topic| topic.rows);
            assert!(rows.sum::<u64>() <= 591);
            if let Ok(log) = FlightLog::scan(&*bytes) {
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

/// A record: kind, size, payload.
fn record(kind: u8, payload: &[u8]) -> Vec<u8> {
    [&[kind][..], &(payload.len() as u64).to_le_bytes(), payload].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// A log with channels of this type and text, and messages: channel from 1, time (ns), bytes behind the header of CDR.
fn log(channels: &[(&str, &str, &str)], messages: &[(u16, u64, Vec<u8>)]) -> Vec<u8> {
    let mut log = b"\x89MCAP0\r\n".to_vec();
    for ((topic, name, definition), id) in channels.iter().zip(1_u16..) {
        let id = id.to_le_bytes();
        log.extend(record(
            3,
            &[&id[..], &text(name), &text("ros2msg"), &text(definition)].concat(),
        ));
        let channel = [&id[..], &id, &text(topic), &text("cdr"), &[0; 4]].concat();
        log.extend(record(4, &channel));
    }
    for (id, time_ns, body) in messages {
        let times = [time_ns.to_le_bytes(), time_ns.to_le_bytes()].concat();
        log.extend(record(
            5,
            &[&id.to_le_bytes()[..], &[0; 4], &times, &[0, 1, 0, 0], body].concat(),
        ));
    }
    log.extend(record(2, &[0; 20]));
    log
}

const JOINT_STATE: &str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n\
    ================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

/// A message of type JointState at second `i` with joints of these names.
fn joints(i: u32, names: [&str; 2], position: [f64; 2], effort: [f64; 2]) -> Vec<u8> {
    let mut body = [
        &(1000 + i).to_le_bytes()[..],
        &0_u32.to_le_bytes(),
        &1_u32.to_le_bytes(),
        &[0],
    ]
    .concat();
    let put = |body: &mut Vec<u8>, size: usize, value: &[u8]| {
        body.resize(body.len().next_multiple_of(size), 0);
        body.extend(value);
    };
    put(&mut body, 4, &2_u32.to_le_bytes());
    for name in names {
        put(&mut body, 4, &(name.len() as u32 + 1).to_le_bytes());
        body.extend(name.as_bytes());
        body.push(0);
    }
    for values in [&position[..], &[], &effort[..]] {
        put(&mut body, 4, &(values.len() as u32).to_le_bytes());
        values
            .iter()
            .for_each(|value| put(&mut body, 8, &value.to_le_bytes()));
    }
    body
}

fn seconds(i: u32) -> u64 {
    1_000_000_000 * u64::from(1000 + i)
}

fn read(log: &[u8], input: &str, output: &str) -> Result<Recording, ReadError> {
    read_from(
        log,
        &CsvOptions::default()
            .input_column(input)
            .output_column(output),
    )
}

// The header is on the second, the recorder up to 9 ms late.
#[test]
fn joint_states_have_the_names_of_their_joints() {
    let rows = |names: [&'static str; 2]| {
        (0..ROWS).map(move |i| {
            let (u, y) = sample(i);
            let late_ns = 1_000_000 * u64::from(i % 10);
            (
                1,
                seconds(i) + late_ns,
                joints(i, names, [y, 0.5], [u, 0.25]),
            )
        })
    };
    let channels = [(
        "/arm/joint_states",
        "sensor_msgs/msg/JointState",
        JOINT_STATE,
    )];
    let mut messages: Vec<_> = rows(["shoulder", "elbow"]).collect();
    let bytes = log(&channels, &messages);
    let recording = read(
        &bytes,
        "joint_states.effort.shoulder",
        "joint_states.position.shoulder",
    );
    assert_rows(&recording.expect("a recording"), 1.0, 1.0);
    // Which joint is not guessed.
    let error = read_from(&*bytes, &CsvOptions::default())
        .expect_err("two joints")
        .to_string();
    assert!(error.contains("joint_states.position.elbow"), "{error}");
    // Joints in another order are other signals.
    messages.truncate(40);
    messages.extend(rows(["elbow", "shoulder"]).skip(40));
    let bytes = log(&channels, &messages);
    let recording = read(
        &bytes,
        "joint_states.effort.shoulder",
        "joint_states.position.shoulder",
    );
    assert_eq!(recording.expect("a recording").len(), 40);
    // Cut within the messages.
    let cut = read(
        &bytes[..bytes.len() / 2],
        "joint_states.effort.shoulder",
        "joint_states.position.shoulder",
    );
    assert!(cut.is_ok_and(|cut| (10..40).contains(&cut.len())));
}

#[test]
fn topics_of_numbers() {
    let number = |id: u16, i: u32, value: f64| (id, seconds(i), value.to_le_bytes().to_vec());
    let messages: Vec<_> = (0..ROWS)
        .flat_map(|i| [number(1, i, sample(i).0), number(2, i, sample(i).1)])
        .collect();
    let float = ("std_msgs/msg/Float64", "float64 data");
    let channels = [
        ("/oven/command", float.0, float.1),
        ("/oven/temperature", float.0, float.1),
    ];
    let bytes = log(&channels, &messages);
    let recording = read_from(&*bytes, &CsvOptions::default()).expect("a recording");
    assert_rows(&recording, 1.0, 1.0);
    assert_names(&recording, "command.data", "temperature.data");
    let none = log(
        &[("/oven/command", "std_msgs/msg/String", "string data")],
        &[],
    );
    let error = read_from(&*none, &CsvOptions::default())
        .expect_err("no numbers")
        .to_string();
    assert!(error.contains("no channel of numbers"), "{error}");
}
