//! Units of results, made of those of the recording's columns.

use onecycle::{Parameter, Recording, Structure};
use onecycle_design::Unit;

/// Units of input and output; empty where the recording gives none.
#[derive(Default)]
pub(super) struct Units {
    pub(super) input: String,
    pub(super) output: String,
}

impl Units {
    pub(super) fn of(recording: &Recording) -> Self {
        let unit = |column: &onecycle_link::Column| column.unit.clone().unwrap_or_default();
        Self {
            input: unit(&recording.columns().input),
            output: unit(&recording.columns().output),
        }
    }

    /// Unit of a parameter; empty where it needs units that the recording does not give.
    pub(super) fn parameter(&self, structure: Structure, parameter: Parameter) -> String {
        match structure.unit(parameter) {
            Unit::OutputPerInput => self.gain(""),
            Unit::RadianPerSecond => "rad/s".to_owned(),
            Unit::OutputPerInputSecond => self.gain("s"),
            Unit::OutputPerInputSecondSquared => self.gain("s^2"),
            Unit::Second => "s".to_owned(),
            Unit::PerSecond => "1/s".to_owned(),
            Unit::Input => self.input.clone(),
            _ => String::new(),
        }
    }

    /// `output/(input per)`, or `output/input` without `per`.
    fn gain(&self, per: &str) -> String {
        if self.input.is_empty() || self.output.is_empty() {
            return String::new();
        }
        if per.is_empty() {
            return format!("{}/{}", self.output, self.input);
        }
        format!("{}/({} {per})", self.output, self.input)
    }

    /// Unit of a controller's gain, with a blank before it: ` input/output`, or ` input times/output`.
    pub(super) fn controller(&self, times: &str) -> String {
        if self.input.is_empty() || self.output.is_empty() {
            return String::new();
        }
        format!(" {}{times}/{}", self.input, self.output)
    }

    /// Unit of an integral gain, with a blank before it: ` input/(output s)`.
    pub(super) fn integral(&self) -> String {
        if self.input.is_empty() || self.output.is_empty() {
            return String::new();
        }
        format!(" {}/({} s)", self.input, self.output)
    }

    /// Title of an axis: a name with its unit in brackets, where there is one.
    pub(super) fn titled(name: &str, unit: &str) -> String {
        if unit.is_empty() {
            name.to_owned()
        } else {
            format!("{name} ({unit})")
        }
    }
}
