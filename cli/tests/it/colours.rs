//! Runs with and without colours.

use std::process::Stdio;

use crate::common::program;

pub(crate) const ESCAPE: char = '\u{1b}';

/// Standard output and error output of a run with only this colour variable set.
pub(crate) fn coloured(arguments: &[&str], variable: Option<&str>) -> [String; 2] {
    let mut command = program(arguments[0]);
    for other in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
        command.env_remove(other);
    }
    let output = command
        .args(arguments)
        .envs(variable.map(|variable| (variable, "1")))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap())
}

/// The text without colour codes: an escape, a bracket, numbers and an m. Asserts that there are no other codes.
pub(crate) fn stripped(text: &str) -> String {
    let mut parts = text.split(ESCAPE);
    let mut plain = parts.next().unwrap().to_owned();
    for part in parts {
        let (code, rest) = part.split_once('m').expect("a code of colours ends in m");
        let numbers = code
            .strip_prefix('[')
            .expect("a code begins with a bracket");
        assert!(
            numbers.chars().all(|c| c.is_ascii_digit() || c == ';'),
            "{code}"
        );
        plain.push_str(rest);
    }
    plain
}

/// All lines but that of the time.
fn timeless(text: &str) -> Vec<&str> {
    text.lines()
        .filter(|line| !line.starts_with("Time"))
        .collect()
}

/// Asserts that a run has colours where they are forced, and that nothing else changes.
pub(crate) fn only_colours_differ(command: &[&str]) {
    let [plain, _] = coloured(command, None);
    let [forced, _] = coloured(command, Some("CLICOLOR_FORCE"));
    assert!(!plain.contains(ESCAPE), "{plain}");
    assert!(forced.contains(ESCAPE), "{forced}");
    let forced = stripped(&forced);
    assert_eq!(timeless(&forced), timeless(&plain), "{command:?}");
}
