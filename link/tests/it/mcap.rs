//! MCAP logs of ROS 2: equal to the ULog from which `oracles/mcap_logs.py` wrote them, whole and damaged.

use std::fs;
use std::path::PathBuf;

use onecycle_link::{Axis, ControlLoop, FirmwareKind, FlightLog, LogFormat, Wanted, read_tables};

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
