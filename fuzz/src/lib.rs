//! What comes from outside must never end in a panic, in NaN, or without end: one function for each kind of it, which takes any
//! bytes. `cargo fuzz` looks for bytes that break a promise (CONTRIBUTING.md says how), and the test of this package replays those in
//! `corpus/` with a stable compiler.

mod files;
mod loops;
mod numbers;
mod readers;
mod tuner;
mod vehicle;

/// What is done with any bytes.
pub type Target = fn(&[u8]);

/// The targets by their names.
pub const TARGETS: &[(&str, Target)] = &[
    ("table", readers::table),
    ("matlab", readers::matlab),
    ("ulog", readers::ulog),
    ("dataflash", readers::dataflash),
    ("dataflash_text", readers::dataflash_text),
    ("blackbox", readers::blackbox),
    ("mcap", readers::mcap),
    ("wpilog", readers::wpilog),
    ("tdms", readers::tdms),
    ("parameters", readers::parameters),
    ("gains", readers::gains),
    ("pack", files::pack),
    ("onnx", files::onnx),
    ("recipe", files::recipe),
    ("request", files::request),
    ("mavlink", vehicle::mavlink),
    ("tuner", tuner::tuner),
    ("estimator", loops::estimator),
    ("design", loops::design),
];

/// Runs the target of this name.
///
/// # Panics
/// A promise is broken, or there is no such target.
pub fn run(name: &str, bytes: &[u8]) {
    let target = TARGETS.iter().find(|(of, _)| *of == name);
    let Some((_, target)) = target else {
        unreachable!("there is no target {name}");
    };
    target(bytes);
}
