//! Every input that a fuzz target has kept, the heads of real files, and mutations of both, with fixed seeds.

use std::path::{Path, PathBuf};

use onecycle_fuzz::{TARGETS, run};

/// Files of the repository with which targets begin, how many of their bytes, and how many mutations are tried.
const FILES: [(&str, &str, usize, u32); 16] = [
    ("table", "examples/plant/lic101_export.csv", 4000, 300),
    ("table", "examples/plant/tic205_values.csv", 4000, 300),
    ("table", "examples/simulated_hover.csv", 2000, 100),
    ("matlab", "link/tests/data/scipy_plain.mat", 10_000, 100),
    ("matlab", "link/tests/data/scipy_loops.mat", 10_000, 100),
    ("matlab", "link/tests/data/octave_struct.mat", 10_000, 100),
    ("mcap", "link/tests/data/px4_none.mcap", 60_000, 60),
    ("mcap", "link/tests/data/px4_lz4.mcap", 60_000, 60),
    ("mcap", "link/tests/data/px4_zstd.mcap", 60_000, 60),
    ("ulog", "examples/logs/px4_dropout.ulg", 60_000, 60),
    ("dataflash", "examples/logs/ap_sysid_roll.bin", 60_000, 60),
    (
        "blackbox",
        "examples/logs/betaflight_two_flights.bbl",
        60_000,
        60,
    ),
    (
        "dataflash_text",
        "examples/plant/tic205_values.csv",
        3000,
        60,
    ),
    ("pack", "onboard/packs/default.pack", usize::MAX, 40),
    ("recipe", "experiments/honesty.toml", 4000, 20),
    ("recipe", "experiments/any_open.toml", 4000, 20),
];

/// Mutations of a kept input; fewer where one takes tens of milliseconds.
fn mutations(target: &str) -> u32 {
    match target {
        "estimator" | "design" | "tuner" => 2,
        "wpilog" | "tdms" => 200,
        _ => 60,
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn bytes_of(file: &Path) -> Vec<u8> {
    std::fs::read(file).expect("a file of the repository")
}

/// The files of a folder, in the order of their names.
fn files_in(folder: &str) -> Vec<PathBuf> {
    let listed = std::fs::read_dir(root().join("fuzz").join(folder)).into_iter();
    let mut files: Vec<PathBuf> = (listed.flatten().flatten())
        .map(|file| file.path())
        .collect();
    files.sort();
    files
}

/// The inputs of a target, each with the number of its mutations.
fn inputs(target: &str) -> Vec<(Vec<u8>, u32)> {
    let kept = files_in(&format!("corpus/{target}"));
    let kept = (kept.iter()).map(|file| (bytes_of(file), mutations(target)));
    let begun = FILES.iter().filter(|(of, ..)| *of == target);
    let begun = begun.map(|(_, file, most, mutations)| {
        let mut bytes = bytes_of(&root().join(file));
        bytes.truncate(*most);
        (bytes, *mutations)
    });
    kept.chain(begun).collect()
}

/// Linear congruential generator with Knuth's MMIX constants, so that a failure can be repeated.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = (self.0)
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % limit
    }
}

/// Bytes changed, pieces dropped or doubled; half of the places are in the head.
fn mutated(seed: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..1 + random.below(8) {
        let reach = match random.below(2) {
            0 => bytes.len().min(2000),
            _ => bytes.len(),
        };
        if reach == 0 {
            break;
        }
        let at = random.below(reach);
        let end = (at + random.below(60)).min(bytes.len());
        match random.below(3) {
            0 => bytes[at] = random.below(256) as u8,
            1 => drop(bytes.drain(at..end)),
            _ => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
        }
    }
    bytes
}

fn replay(targets: impl Fn(&str) -> bool) {
    for (target, _) in TARGETS.iter().filter(|(name, _)| targets(name)) {
        let mut random = Random(1);
        for (seed, mutations) in inputs(target) {
            run(target, &seed);
            for _ in 0..mutations {
                run(target, &mutated(&seed, &mut random));
            }
        }
    }
}

// Two tests, so that two cores share the work.
#[test]
fn loops_break_no_promise() {
    replay(|name| ["estimator", "design", "tuner"].contains(&name));
}

#[test]
fn files_break_no_promise() {
    replay(|name| !["estimator", "design", "tuner"].contains(&name));
}

// A folder of a target that is gone, or a target without a program, would be run by nobody.
#[test]
fn every_target_has_its_program_and_its_inputs() {
    let name = |path: &PathBuf| path.file_stem().map(|of| of.to_string_lossy().into_owned());
    let names = |folder| -> Vec<String> { files_in(folder).iter().filter_map(name).collect() };
    let mut targets: Vec<&str> = TARGETS.iter().map(|(name, _)| *name).collect();
    targets.sort_unstable();
    assert_eq!(names("fuzz_targets"), targets);
    assert_eq!(names("corpus"), targets);
}
