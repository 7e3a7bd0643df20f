//! Reads the files that set parameters of PX4 and ArduPilot.

use super::ParameterLine;
use crate::log::FirmwareKind;

/// Longest name of a parameter in MAVLink.
const LONGEST_NAME: usize = 16;

/// `MAV_PARAM_TYPE` of single precision; smaller ones are integers.
const REAL_32: u8 = 9;

/// What a file sets.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ParameterFile {
    /// Firmware that has such files.
    pub firmware: FirmwareKind,
    /// Parameters with their values, in the order of the file.
    pub lines: Vec<ParameterLine>,
}

/// Why a file sets no parameters. Lines count from 1.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterFileError {
    /// No line sets a parameter.
    #[error("the file sets no parameter")]
    Empty,
    /// A line is neither `NAME,VALUE` nor the five columns of PX4.
    #[error("line {0} is neither NAME,VALUE nor the five columns of a PX4 file")]
    Line(usize),
    /// A line has another format than those before.
    #[error("line {0} has another format than the lines before")]
    Mixed(usize),
    /// Not a number, or not finite.
    #[error("line {0}: the value of {1} is not a finite number")]
    Value(usize, String),
    /// A name that MAVLink cannot carry.
    #[error("line {0}: {1:?} is not the name of a parameter (at most 16 letters, digits and _)")]
    Name(usize, String),
    /// The same name twice.
    #[error("line {0} sets {1} a second time")]
    Twice(usize, String),
    /// Commands of Betaflight.
    #[error("line {0} is a command of Betaflight: paste the file into its CLI")]
    Betaflight(usize),
}

/// Reads a file of parameters: that of PX4 (QGroundControl) or of ArduPilot (Mission Planner, MAVProxy).
///
/// # Errors
/// The first line that cannot be understood, a value that is not finite, a name that stands twice, or no parameter at all.
pub fn read_parameters(text: &str) -> Result<ParameterFile, ParameterFileError> {
    let mut file: Option<ParameterFile> = None;
    for (at, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let (firmware, parsed) = parse(at + 1, line)?;
        let file = file.get_or_insert_with(|| ParameterFile {
            firmware,
            lines: Vec::new(),
        });
        if file.firmware != firmware {
            return Err(ParameterFileError::Mixed(at + 1));
        }
        if file.lines.iter().any(|before| before.name == parsed.name) {
            return Err(ParameterFileError::Twice(at + 1, parsed.name));
        }
        file.lines.push(parsed);
    }
    file.ok_or(ParameterFileError::Empty)
}

fn parse(number: usize, line: &str) -> Result<(FirmwareKind, ParameterLine), ParameterFileError> {
    let is_mark = |c: char| c == ',' || c.is_whitespace();
    let words: Vec<&str> = line
        .split(is_mark)
        .filter(|word| !word.is_empty())
        .collect();
    let (firmware, name, value, kind) = match words[..] {
        ["set" | "save" | "profile", ..] => return Err(ParameterFileError::Betaflight(number)),
        [name, value] => (FirmwareKind::ArduPilot, name, value, None),
        [_, _, name, value, kind] => (FirmwareKind::Px4, name, value, Some(kind)),
        _ => return Err(ParameterFileError::Line(number)),
    };
    let is_letter = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if name.len() > LONGEST_NAME || !name.chars().all(is_letter) {
        return Err(ParameterFileError::Name(number, name.to_owned()));
    }
    let value = value
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite() && (*value as f32).is_finite());
    let value = value.ok_or_else(|| ParameterFileError::Value(number, name.to_owned()))?;
    let kind = kind.map(|kind| {
        kind.parse::<u8>()
            .map_err(|_| ParameterFileError::Line(number))
    });
    let line = ParameterLine {
        name: name.to_owned(),
        value,
        is_integer: kind.transpose()?.is_some_and(|kind| kind < REAL_32),
    };
    Ok((firmware, line))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter_files::parameter_text;

    fn line(name: &str, value: f64, is_integer: bool) -> ParameterLine {
        let name = name.to_owned();
        ParameterLine {
            name,
            value,
            is_integer,
        }
    }

    // What is written is read again, to the bit of single precision; 2^24 + 1 needs an integer.
    #[test]
    fn written_and_read() {
        let lines = [
            line("MC_ROLLRATE_P", f64::from(0.1_f32), false),
            line("SYS_AUTOSTART", 16_777_217.0, true),
        ];
        for (firmware, has_kinds) in [(FirmwareKind::Px4, true), (FirmwareKind::ArduPilot, false)] {
            let text = parameter_text(firmware, 1, &lines);
            let read = read_parameters(&text).unwrap();
            assert_eq!(read.firmware, firmware);
            for (one, other) in read.lines.iter().zip(&lines) {
                assert_eq!(one.name, other.name);
                assert_eq!(one.value as f32, other.value as f32);
                assert_eq!(one.is_integer, other.is_integer && has_kinds);
            }
            assert_eq!(read.lines[1].value, 16_777_217.0);
        }
    }

    #[test]
    fn comments_and_blanks() {
        let read = read_parameters("# old\n\nATC_RAT_RLL_P  0.1 # fast\r\nPSC_VELZ_P,5\n").unwrap();
        let names: Vec<&str> = read.lines.iter().map(|line| line.name.as_str()).collect();
        assert_eq!(names, ["ATC_RAT_RLL_P", "PSC_VELZ_P"]);
    }

    #[test]
    fn refusals_name_the_line() {
        let cases = [
            ("", ParameterFileError::Empty),
            ("# P,1\n", ParameterFileError::Empty),
            ("A,1\nB\n", ParameterFileError::Line(2)),
            ("A,1\n1 1 B 2 9\n", ParameterFileError::Mixed(2)),
            ("A,1\nA,2\n", ParameterFileError::Twice(2, "A".to_owned())),
            ("A,nan\n", ParameterFileError::Value(1, "A".to_owned())),
            ("A,1e39\n", ParameterFileError::Value(1, "A".to_owned())),
            ("A,x\n", ParameterFileError::Value(1, "A".to_owned())),
            ("1 1 A 2 x\n", ParameterFileError::Line(1)),
            ("set p_roll = 3\n", ParameterFileError::Betaflight(1)),
            (
                "ABCDEFGHIJKLMNOPQ,1\n",
                ParameterFileError::Name(1, "ABCDEFGHIJKLMNOPQ".to_owned()),
            ),
        ];
        for (text, error) in cases {
            assert_eq!(read_parameters(text), Err(error), "{text:?}");
        }
    }
}
