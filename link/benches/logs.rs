//! Throughput of the readers of flight logs, with the signals of a rate loop kept.
//!
//! Python readers on the same files, for comparison: pyulog 1.3.0, pymavlink 2.4.50, orangebox 0.5.0.

use std::fs;

use divan::counter::BytesCount;
use onecycle_link::{Wanted, read_tables};

fn main() {
    divan::main();
}

/// The example logs and the columns that identification needs of them.
const LOGS: [(&str, [(&str, &str); 3]); 3] = [
    (
        "px4_chirps.ulg",
        [
            ("vehicle_torque_setpoint", "xyz[0]"),
            ("vehicle_angular_velocity", "xyz[0]"),
            ("vehicle_rates_setpoint", "roll"),
        ],
    ),
    (
        "ap_sysid_roll.bin",
        [("RATE", "RDes"), ("RATE", "R"), ("RATE", "ROut")],
    ),
    (
        "betaflight_acro.bfl",
        [
            ("main", "setpoint[0]"),
            ("main", "gyroADC[0]"),
            ("main", "motor[0]"),
        ],
    ),
];

#[divan::bench(args = [0, 1, 2])]
fn read(bencher: divan::Bencher<'_, '_>, log: usize) {
    let (name, columns) = LOGS[log];
    let path = format!("{}/../examples/logs/{name}", env!("CARGO_MANIFEST_DIR"));
    let bytes = fs::read(path).expect("an example of the repository");
    let wanted = columns
        .iter()
        .fold(Wanted::nothing(), |wanted, (topic, column)| {
            wanted.and(topic, column)
        });
    bencher
        .counter(BytesCount::new(bytes.len()))
        .bench(|| read_tables(&*bytes, &wanted));
}
