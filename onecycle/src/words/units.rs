//! Units of results, made of those of the recording's columns.

use crate::{Parameter, Recording, Structure};
use onecycle_design::Unit;

/// Unit of a share.
const ONE: &str = "1";

/// Unit of an output over its input and a power of a second: one of `rad/s` over that of a share and a second is `rad/s^2`. Empty if
/// the units cancel.
pub fn ratio(output: &str, input: &str, seconds: usize) -> String {
    let power = |of: &str, power: usize| match power {
        0 => String::new(),
        1 => of.to_owned(),
        power => format!("{of}^{power}"),
    };
    match (input, output.strip_suffix("/s")) {
        (ONE, Some(of)) => format!("{of}/{}", power("s", seconds + 1)),
        (ONE, None) if seconds > 0 => format!("{output}/{}", power("s", seconds)),
        (ONE, None) => output.to_owned(),
        (input, _) if seconds == 1 && input.strip_suffix("/s") == Some(output) => String::new(),
        (input, _) if seconds == 0 && !input.contains('/') => format!("{output}/{input}"),
        (input, _) => {
            let divisor = format!("{input} {}", power("s", seconds));
            format!("{output}/({})", divisor.trim_end())
        }
    }
}

/// Units of input and output; empty where the recording gives none.
#[derive(Default)]
pub struct Units {
    pub input: String,
    pub output: String,
}

impl Units {
    pub fn of(recording: &Recording) -> Self {
        let unit = |column: &onecycle_link::Column| column.unit.clone().unwrap_or_default();
        Self {
            input: unit(&recording.columns().input),
            output: unit(&recording.columns().output),
        }
    }

    /// Unit of a parameter; empty where it needs units that the recording does not give.
    pub fn parameter(&self, structure: Structure, parameter: Parameter) -> String {
        match structure.unit(parameter) {
            Unit::OutputPerInput => self.gain(0),
            Unit::RadianPerSecond => "rad/s".to_owned(),
            Unit::OutputPerInputSecond => self.gain(1),
            Unit::OutputPerInputSecondSquared => self.gain(2),
            Unit::Second => "s".to_owned(),
            Unit::PerSecond => "1/s".to_owned(),
            Unit::Input if self.input == ONE => String::new(),
            Unit::Input => self.input.clone(),
            _ => String::new(),
        }
    }

    fn gain(&self, seconds: usize) -> String {
        if self.input.is_empty() || self.output.is_empty() {
            return String::new();
        }
        ratio(&self.output, &self.input, seconds)
    }

    /// Unit of a controller's gain, with a blank before it: ` input/output`, or ` input times/output`.
    pub fn controller(&self, times: &str) -> String {
        if self.input.is_empty() || self.output.is_empty() {
            return String::new();
        }
        format!(" {}{times}/{}", self.input, self.output)
    }

    /// Unit of an integral gain, with a blank before it: ` input/(output s)`.
    pub fn integral(&self) -> String {
        if self.input.is_empty() || self.output.is_empty() {
            return String::new();
        }
        format!(" {}/({} s)", self.input, self.output)
    }

    /// Title of an axis: a name with its unit in brackets, where there is one.
    pub fn titled(name: &str, unit: &str) -> String {
        if unit.is_empty() {
            name.to_owned()
        } else {
            format!("{name} ({unit})")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Inputs of a vehicle are shares of full deflection or thrust. A set-point of a rate is one of an angle per second.
    #[test]
    fn units_of_gains() {
        for (output, input, seconds, unit) in [
            ("rad/s", "1", 0, "rad/s"),
            ("rad/s", "1", 1, "rad/s^2"),
            ("rad/s", "1", 2, "rad/s^3"),
            ("m/s", "1", 1, "m/s^2"),
            ("rad", "1", 1, "rad/s"),
            ("K", "1", 0, "K"),
            ("rad", "rad/s", 1, ""),
            ("rad", "rad/s", 2, "rad/(rad/s s^2)"),
            ("K", "W", 0, "K/W"),
            ("K", "W", 1, "K/(W s)"),
            ("rad", "rad/s", 0, "rad/(rad/s)"),
        ] {
            assert_eq!(ratio(output, input, seconds), unit);
        }
    }
}
