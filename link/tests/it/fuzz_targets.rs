//! The fuzz targets on mutated files, with fixed seeds.

#[path = "../../../fuzz/src/targets.rs"]
mod targets;

use std::path::Path;

/// Calls a target with `count` mutations of the first bytes of a file: bytes changed, pieces dropped or doubled.
fn mutated(file: &str, most: usize, count: u32, target: impl Fn(&[u8])) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../examples")
        .join(file);
    let mut seed = std::fs::read(path).expect("an example");
    seed.truncate(most);
    target(&seed);
    // Linear congruential generator with Knuth's MMIX constants, so that a failure can be repeated.
    let mut state: u64 = 1;
    let mut random = move |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for _ in 0..count {
        let mut bytes = seed.clone();
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
