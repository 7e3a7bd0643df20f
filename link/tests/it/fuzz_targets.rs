//! The fuzz targets on mutated files, with fixed seeds.

#[path = "../../../fuzz/src/targets.rs"]
mod targets;

use std::path::Path;

use crate::instruments::{tdms, wpilog};
use crate::step::{ROWS, clock, rows, sample};

/// Calls a target with `count` mutations of the first bytes of a file: bytes changed, pieces dropped or doubled.
fn mutated(file: &str, most: usize, count: u32, target: impl Fn(&[u8])) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../examples")
        .join(file);
    let mut seed = std::fs::read(path).expect("an example");
    seed.truncate(most);
    mutated_bytes(&seed, count, target);
}

fn mutated_bytes(seed: &[u8], count: u32, target: impl Fn(&[u8])) {
    target(seed);
    // Linear congruential generator with Knuth's MMIX constants, so that a failure can be repeated.
    let mut state: u64 = 1;
    let mut random = move |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for _ in 0..count {
        let mut bytes = seed.to_vec();
        for _ in 0..1 + random(8) {
            // Half of the mutations hit the header.
            let reach = if random(2) == 0 {
                bytes.len().min(2000)
            } else {
                bytes.len()
            };
            let at = random(reach);
            let end = (at + random(60)).min(bytes.len());
            match random(3) {
                0 => bytes[at] = random(256) as u8,
                1 => drop(bytes.drain(at..end)),
                _ => {
                    let piece = bytes[at..end].to_vec();
                    bytes.splice(at..at, piece);
                }
            }
        }
        target(&bytes);
    }
}

#[test]
fn tables() {
    mutated("plant/lic101_export.csv", 4000, 300, targets::table);
    mutated("plant/tic205_values.csv", 4000, 300, targets::table);
    mutated("simulated_hover.csv", 2000, 100, targets::table);
}

// Logs of lines, JSON, TDMS and WPILOG are read as tables.
#[test]
fn tools() {
    let log = |row: &dyn Fn(u32, f64, f64) -> String| rows(row);
    let texts = [
        format!("pwm: 0.0 0.1\npwm: 6.0 0.5\n{}", log(&|i, _, y| format!("{i}.5 {y}"))),
        log(&|i, u, y| format!("Stats {i}.5: gcodein=0 oven: target=60 temp={y} pwm={u}")),
        log(&|i, u, y| format!("2024-03-12 {} - Recv: ok T:{y} /60.0 @:{u}", clock(i))),
        log(&|i, u, y| format!("{} -> Setpoint:60,Input:{y},Output:{u}", clock(i))),
        log(&|i, u, y| format!("[{0}][D][a]: 'Heater': Sending state {u} %\n[{0}][D][a]: 'Temp' >> {y} \u{b0}C", clock(i))),
        log(&|i, u, y| format!("oven,a=b power={u},temp={y} {}", 1_710_230_400 + i)),
        log(&|i, u, y| format!("{{\"t\": {i}.5, \"u\": {u}, \"y\": {y}}}")),
        log(&|i, u, y| format!("heater;12.03.2024 {0};{u}\ntemp;12.03.2024 {0};{y}", clock(i))),
        format!("Name\ta.out\tName\ta.pv\nSampleTime[ms]\t9\tSampleTime[ms]\t9\n{}", log(&|i, u, y| format!("{i}\t{u}\t{i}\t{y}"))),
        format!("X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1e-3,1e-3\n{}", log(&|i, u, y| format!("{i},{u},{y},"))),
        format!("LabVIEW Measurement\nX_Columns\tNo\n***End_of_Header***\nDelta_X\t1\n***End_of_Header***\nX_Value\tu\ty\n{}",
            log(&|_, u, y| format!("\t{u}\t{y}"))),
        format!("Time,power,temp\n{}", log(&|i, u, y| format!("{},{u} %,{y} \u{b0}C", clock(i)))),
        "[[{\"entity_id\": \"a\", \"state\": \"on\", \"last_changed\": \"2024-03-12T08:00:00Z\"}, {\"state\": \"off\", \
         \"last_changed\": \"2024-03-12T08:00:09Z\"}]]".to_owned(),
        "{\"result\": {\"oven\": {\"temperatures\": [1, 2, 3], \"powers\": [0, 1]}}}".to_owned(),
    ];
    for text in texts {
        mutated_bytes(text.as_bytes(), 60, targets::table);
    }
    let (powers, temps): (Vec<f64>, Vec<f64>) = (0..ROWS).map(sample).unzip();
    let values: Vec<(u64, u8, f64)> = (0..u64::from(ROWS))
        .flat_map(|i| {
            [
                (1000 * i, 1, powers[i as usize]),
                (1000 * i, 2, temps[i as usize]),
            ]
        })
        .collect();
    mutated_bytes(
        &wpilog(&values, &["volts", "velocity"]),
        200,
        targets::table,
    );
    for is_interleaved in [false, true] {
        let channels = [("power", "%", powers.clone()), ("temp", "C", temps.clone())];
        mutated_bytes(&tdms(&channels, 0.5, is_interleaved), 200, targets::table);
    }
}

#[cfg(feature = "matlab")]
#[test]
fn matlab_files() {
    let behind_head = |bytes: &[u8]| targets::matlab(bytes.get(128..).unwrap_or_default());
    for name in ["scipy_plain", "scipy_loops", "octave_struct"] {
        let file = format!("../link/tests/data/{name}.mat");
        mutated(&file, 10_000, 100, behind_head);
    }
}

#[cfg(feature = "mcap")]
#[test]
fn mcap_files() {
    for name in ["px4_none", "px4_lz4", "px4_zstd"] {
        let file = format!("../link/tests/data/{name}.mcap");
        mutated(&file, 60_000, 60, targets::mcap);
    }
}

#[test]
fn logs() {
    mutated("logs/px4_dropout.ulg", 60_000, 60, targets::ulog);
    mutated("logs/ap_sysid_roll.bin", 60_000, 60, targets::dataflash);
    mutated(
        "logs/betaflight_two_flights.bbl",
        60_000,
        60,
        targets::blackbox,
    );
    mutated("plant/tic205_values.csv", 3000, 60, targets::dataflash_text);
}
