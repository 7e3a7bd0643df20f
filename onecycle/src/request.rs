//! What is asked of a recording and of a controller.
//!
//! With the feature `serde` a request is read from a map of its settings, each a number or a text: `{"style": "calm",
//! "phase_margin": 45, "noise": "10%"}`. The names are those that sentences give in backticks.

mod checks;
#[cfg(feature = "serde")]
mod map;
pub mod values;

use std::fs::File;
use std::io::Read;
use std::path::PathBuf;

use onecycle_design::{
    Execution, Form, MeasurementNoise, Pid, Spans, Specification, Style, Vendor,
};
use onecycle_identify::{Hold, MOST_CYCLES, Method, USUAL_CYCLES};
use onecycle_link::{Axis, ColumnRef, ControlLoop, CsvOptions};

use self::values::choice;
use crate::Structure;
use crate::error::Error;

/// Name and version of the settings. It changes with every change that a caller could notice, added settings excepted.
pub const SCHEMA: &str = "onecycle.request/1";

/// Share of the way from the gains in force to the proposed ones that is written unless another one is asked for.
pub const HALF_STEP: f64 = 0.5;

/// Largest size of a pack file (bytes): a thousand times that of a real one.
pub const MOST_OF_A_PACK: u64 = 1 << 24;

/// Gains in force.
#[derive(Clone, Debug, PartialEq)]
pub enum Against {
    /// As given.
    Gains(Pid),
    /// As they stand in a configuration or a log, of this loop.
    File(PathBuf, Option<String>),
}

/// Requirements on a controller, and the gains to compare it with.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Requirements {
    /// Compromise between speed and robustness.
    pub style: Style,
    /// Form of the controller. `None`: that of the style.
    pub controller: Option<Form>,
    /// Limit of `Ms` and `Mt`. `None`: that of the style, as of all further limits.
    pub ms: Option<f64>,
    /// Least phase margin (rad).
    pub phase_margin_rad: Option<f64>,
    /// Least gain margin, as a factor.
    pub gain_margin: Option<f64>,
    /// Largest output of the controller after a unit step of the reference.
    pub input_peak: Option<f64>,
    /// Largest overshoot, as a share of the step.
    pub overshoot: Option<f64>,
    /// Sample period of the controller (s); its output leaves one period after the sample.
    pub sample_period_s: Option<f64>,
    /// The gains in force.
    pub against: Option<Against>,
    /// Controller that takes the gains.
    pub vendor: Option<Vendor>,
    /// Span of the measurement in that controller, if it counts in percent.
    pub output_range: Option<f64>,
    /// Span of its output, in the unit of the recorded input. `None`: that of the controller.
    pub input_range: Option<f64>,
}

impl Requirements {
    /// The controller in which the gains are typed, and its ranges.
    pub(crate) fn plant(&self) -> Result<Option<(Vendor, Spans)>, Error> {
        match self.vendor {
            Some(vendor) if vendor.has_range_of_measurement() && self.output_range.is_none() => {
                Err(Error::Request(format!(
                    "`vendor={}` counts in percent: add the range of its measurement, such as `output_range=0..200`",
                    vendor.name()
                )))
            }
            None if self.output_range.is_some() => Err(Error::request(
                "`output_range` is that of a controller: add `vendor`",
            )),
            vendor => Ok(vendor.map(|vendor| (vendor, self.spans(vendor)))),
        }
    }

    /// The ranges of a controller.
    pub(crate) fn spans(&self, vendor: Vendor) -> Spans {
        let output = self.input_range.unwrap_or_else(|| vendor.full_input());
        Spans::new(self.output_range.unwrap_or(1.0), output)
    }

    /// The requirements, without noise.
    ///
    /// # Errors
    /// The style has no such limit, or the range of the measurement is missing.
    pub fn specification(&self) -> Result<Specification, Error> {
        self.plant()?;
        if self.style == Style::Paper {
            return self.paper();
        }
        let form = self.controller.unwrap_or(Specification::default().form);
        let mut asked = Specification::new(form, self.style);
        if let Some(peak) = self.ms {
            asked = asked.with_peak(peak);
        }
        if let Some(margin_rad) = self.phase_margin_rad {
            asked = asked.with_phase_margin_rad(margin_rad);
        }
        asked.gain_margin = self.gain_margin.unwrap_or(asked.gain_margin);
        asked.input_peak = self.input_peak;
        asked.overshoot = self.overshoot.unwrap_or(asked.overshoot);
        Ok(asked.with_execution(self.execution()))
    }

    /// The paper's style, which has one limit and one form.
    fn paper(&self) -> Result<Specification, Error> {
        let others = [
            ("ms", self.ms.is_some()),
            ("gain_margin", self.gain_margin.is_some()),
            ("input_peak", self.input_peak.is_some()),
            ("overshoot", self.overshoot.is_some()),
        ];
        if let Some(setting) = given(&others) {
            return Err(Error::Request(format!(
                "`style=paper` limits the phase margin only: leave out `{setting}`, or choose another style"
            )));
        }
        let mut asked = Specification::paper().with_execution(self.execution());
        if let Some(form) = self.controller.filter(|form| *form != asked.form) {
            return Err(Error::Request(format!(
                "`style=paper` designs a PD and no {}: leave out `controller`, or choose another style",
                form.name().replace('_', "-")
            )));
        }
        if let Some(margin_rad) = self.phase_margin_rad {
            asked = asked.with_phase_margin_rad(margin_rad);
        }
        Ok(asked)
    }

    fn execution(&self) -> Execution {
        (self.sample_period_s).map_or_else(Execution::default, Execution::sampled)
    }

    /// Sets a setting by its name. `None`: it is not a setting of the requirements.
    fn set(&mut self, name: &str, value: &str) -> Option<Result<(), String>> {
        let own = |known: Option<Form>| known.ok_or("there is no such controller".to_owned());
        let set = match name {
            "style" => Style::from_name(value)
                .ok_or("there is no such style".to_owned())
                .map(|style| self.style = style),
            "controller" => own(Form::from_name(&value.replace('-', "_")))
                .map(|form| self.controller = Some(form)),
            "ms" => put(&mut self.ms, values::peak(value)),
            "phase_margin" => put(&mut self.phase_margin_rad, values::phase_margin(value)),
            "gain_margin" => put(&mut self.gain_margin, values::gain_margin(value)),
            "input_peak" => put(&mut self.input_peak, values::positive(value)),
            "overshoot" => put(&mut self.overshoot, values::overshoot(value)),
            "sample_period" => put(&mut self.sample_period_s, values::positive(value)),
            "against" => put(&mut self.against, values::against(value)),
            "vendor" => Vendor::from_name(value)
                .ok_or("there is no such controller".to_owned())
                .map(|vendor| self.vendor = Some(vendor)),
            "output_range" => put(&mut self.output_range, values::span(value)),
            "input_range" => put(&mut self.input_range, values::span(value)),
            _ => return None,
        };
        Some(set)
    }
}

/// What a control loop of a vehicle controls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum LoopKind {
    /// Torque to angular rate.
    #[default]
    Rate,
    /// Set-point of the rate to angle.
    Attitude,
    /// Thrust to climb rate.
    Altitude,
}

/// Parameters that are to be written for the firmware of a flight log.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Write {
    /// File for the new values; one with the old values gets a name beside it. `None`: nothing is written.
    pub file: Option<PathBuf>,
    /// Share of the way from the gains in force to the proposed ones.
    pub step: f64,
    /// Whether gains are written that break a limit of the style.
    pub below_limits: bool,
}

impl Default for Write {
    fn default() -> Self {
        Self {
            file: None,
            step: HALF_STEP,
            below_limits: false,
        }
    }
}

/// The pack of an identifier.
#[derive(Clone, Debug, PartialEq)]
pub struct PackFile {
    /// Name of the file, for messages.
    pub name: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl PackFile {
    /// Reads a file. `None`: the name `default` stands for the built-in pack.
    fn read(name: &str) -> Result<Option<Self>, String> {
        if name == "default" {
            return Ok(None);
        }
        let mut bytes = Vec::new();
        let file = File::open(name).map_err(|error| error.to_string())?;
        let read = file.take(MOST_OF_A_PACK + 1).read_to_end(&mut bytes);
        match read.map_err(|error| error.to_string())? as u64 {
            0..=MOST_OF_A_PACK => Ok(Some(Self {
                name: name.to_owned(),
                bytes,
            })),
            _ => Err(format!("the file has more than {MOST_OF_A_PACK} bytes")),
        }
    }
}

/// What is asked of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Request {
    /// Requirements on the controller.
    pub requirements: Requirements,
    /// Largest noise at the actuator, as a share of the amplitude of the input. `None`: that of the style.
    pub noise_share: Option<f64>,
    /// The last cycles of a relay test to fit. `None`: the whole recording.
    pub cycles: Option<usize>,
    /// Method of the fit to cycles. Another than [`Method::Map`], and a pack, take 8 if their number is not given.
    pub method: Method,
    /// Structure of the process. `None`: the simplest that explains the recording.
    pub structure: Option<Structure>,
    /// Whether the process is known to be unstable without its controller.
    pub is_unstable: bool,
    /// First time to use (s). `None`: the start; of a flight log that of the part that tells most.
    pub from_s: Option<f64>,
    /// Last time to use (s).
    pub to_s: Option<f64>,
    /// Input between two samples. `None`: the likelihood decides.
    pub hold: Option<Hold>,
    /// `beta` of the relay.
    pub beta: Option<f64>,
    /// Time by which the input was logged late (s).
    pub input_late_s: Option<f64>,
    /// Input before the first row.
    pub input_before: Option<f64>,
    /// Cutoff (Hz) of a low-pass that the output passed.
    pub output_filter_hz: Option<f64>,
    /// The pack of an identifier. `None`: the built-in one.
    pub pack: Option<PackFile>,
    /// Columns of a table.
    pub columns: CsvOptions,
    /// Axis of a flight log.
    pub axis: Option<Axis>,
    /// What the loop of a flight log controls.
    pub control_loop: Option<LoopKind>,
    /// Flight of a log, from 1. `None`: the longest.
    pub flight: Option<usize>,
    /// Parameters to write.
    pub write: Write,
    /// Whether the process is all that is asked for, and no controllers to choose from.
    pub without_controllers: bool,
}

impl Request {
    /// Sets a setting by its name, such as `phase_margin`, to a value as text, such as `45`.
    ///
    /// # Errors
    /// One sentence: there is no such setting, or no such value.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), Error> {
        let set = (self.requirements.set(name, value))
            .or_else(|| self.set_estimation(name, value))
            .or_else(|| self.set_source(name, value));
        match set {
            Some(Ok(())) => Ok(()),
            Some(Err(reason)) => Err(Error::Request(format!("`{name}`: {reason}"))),
            None => Err(Error::Request(format!("there is no setting {name}"))),
        }
    }

    fn set_estimation(&mut self, name: &str, value: &str) -> Option<Result<(), String>> {
        let set = match name {
            "noise" => put(&mut self.noise_share, values::noise(value)),
            "cycles" => (value.parse().ok())
                .filter(|cycles| (1..=MOST_CYCLES).contains(cycles))
                .ok_or_else(|| format!("a number from 1 to {MOST_CYCLES}"))
                .map(|cycles| self.cycles = Some(cycles)),
            "method" => choice(value, &values::METHODS).map(|method| self.method = method),
            "structure" => put(
                &mut self.structure,
                Structure::from_name(value).ok_or("there is no such structure".to_owned()),
            ),
            "unstable" => choice(value, &[("true", true), ("false", false)])
                .map(|is_unstable| self.is_unstable = is_unstable),
            "from" => put(&mut self.from_s, values::time_s(value)),
            "to" => put(&mut self.to_s, values::time_s(value)),
            "hold" => put(&mut self.hold, choice(value, &values::HOLDS)),
            "beta" => put(&mut self.beta, values::beta(value)),
            "input_late" => put(&mut self.input_late_s, values::time_s(value)),
            "input_before" => put(&mut self.input_before, values::finite(value)),
            "pack" => PackFile::read(value).map(|pack| self.pack = pack),
            "output_filter" => put(&mut self.output_filter_hz, values::cutoff_hz(value)),
            "design" => choice(value, &[("true", false), ("false", true)])
                .map(|without| self.without_controllers = without),
            _ => return None,
        };
        Some(set)
    }

    fn set_source(&mut self, name: &str, value: &str) -> Option<Result<(), String>> {
        let column = || Ok(ColumnRef::from(value));
        let columns = &mut self.columns;
        let set = match name {
            "time" => put(&mut columns.time_column, column()),
            "input" => put(&mut columns.input_column, column()),
            "output" => put(&mut columns.output_column, column()),
            "set_point" => put(&mut columns.set_point_column, column()),
            "tag" => put(&mut columns.control_loop, Ok(value.to_owned())),
            "sample_rate" => put(&mut columns.sample_rate_hz, values::sample_rate(value)),
            "time_unit" => put(&mut columns.time_unit, values::time_unit(value)),
            "dbc" => put(&mut columns.dbc, values::dbc(value)),
            "axis" => put(&mut self.axis, choice(value, &values::AXES)),
            "loop" => put(&mut self.control_loop, choice(value, &values::LOOPS)),
            "flight" => put(
                &mut self.flight,
                value
                    .parse()
                    .map_err(|_| "a flight is a number from 1".to_owned()),
            ),
            "step" => values::step(value).map(|step| self.write.step = step),
            "write" => put(&mut self.write.file, Ok(PathBuf::from(value))),
            "below_limits" => choice(value, &[("true", true), ("false", false)])
                .map(|below| self.write.below_limits = below),
            _ => return None,
        };
        Some(set)
    }

    /// The loop of a flight log, or the default one.
    #[must_use]
    pub fn loop_of_log(&self) -> ControlLoop {
        let axis = self.axis.unwrap_or(Axis::Roll);
        match self.control_loop.unwrap_or_default() {
            LoopKind::Rate => ControlLoop::Rate(axis),
            LoopKind::Attitude => ControlLoop::Attitude(axis),
            LoopKind::Altitude => ControlLoop::Altitude,
        }
    }

    /// Whether no loop of a flight log is chosen, and no setting that needs one: then all of them are meant.
    #[must_use]
    pub fn is_of_all_loops(&self) -> bool {
        let is_one = self.axis.is_some()
            || self.control_loop.is_some()
            || self.from_s.is_some()
            || self.to_s.is_some()
            || self.structure.is_some()
            || self.is_unstable
            || self.hold.is_some()
            || self.beta.is_some()
            || self.input_late_s.is_some()
            || self.output_filter_hz.is_some()
            || self.of_cycles().is_some();
        !is_one
    }

    /// The requirements on the controller, after a look for settings that contradict each other.
    ///
    /// # Errors
    /// One sentence: settings contradict each other.
    pub fn specification(&self) -> Result<Specification, Error> {
        self.check_estimator()?;
        if self.columns.sample_rate_hz.is_some()
            && (self.columns.time_column.is_some() || self.columns.time_unit.is_some())
        {
            return Err(Error::request(
                "`sample_rate` stands for the time column: leave out `time` and `time_unit`",
            ));
        }
        if self.without_controllers
            && (self.requirements.against.is_some() || self.write.file.is_some())
        {
            return Err(Error::request(
                "`design=false` leaves no controller for `against` or `write`: leave it out",
            ));
        }
        let mut asked = self.requirements.specification()?;
        if let Some(share) = self.noise_share {
            if asked.style == Style::Paper {
                return Err(Error::request(PAPER_HAS_NO_NOISE));
            }
            asked.noise_share = share;
        }
        Ok(asked)
    }

    /// Number of cycles to fit, which a method and a pack ask for too. `None`: the whole recording.
    pub(crate) fn of_cycles(&self) -> Option<usize> {
        let is_asked = self.method != Method::Map || self.pack.is_some();
        self.cycles.or(is_asked.then_some(USUAL_CYCLES))
    }
}

/// Why the paper's style takes no noise.
const PAPER_HAS_NO_NOISE: &str =
    "`style=paper` does not limit the noise: leave out `noise`, or choose another style";

/// What is asked of a controller for a known process.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct DesignRequest {
    /// Requirements on the controller.
    pub requirements: Requirements,
    /// Standard deviation of the measurement noise of one sample. It needs a sample period.
    pub noise: Option<f64>,
    /// Amplitude of the input with which noise at the actuator is compared.
    pub input_amplitude: f64,
}

impl Default for DesignRequest {
    fn default() -> Self {
        Self {
            requirements: Requirements::default(),
            noise: None,
            input_amplitude: 1.0,
        }
    }
}

impl DesignRequest {
    /// As [`Request::set`].
    ///
    /// # Errors
    /// As [`Request::set`].
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), Error> {
        let set = (self.requirements.set(name, value)).or_else(|| match name {
            "noise" => Some(put(&mut self.noise, values::positive(value))),
            "input_amplitude" => {
                Some(values::positive(value).map(|input| self.input_amplitude = input))
            }
            _ => None,
        });
        match set {
            Some(Ok(())) => Ok(()),
            Some(Err(reason)) => Err(Error::Request(format!("`{name}`: {reason}"))),
            None => Err(Error::Request(format!("there is no setting {name}"))),
        }
    }

    /// The requirements with the noise.
    ///
    /// # Errors
    /// The style does not limit the noise, or the sample period is missing.
    pub fn specification(&self) -> Result<Specification, Error> {
        self.complete(self.requirements.specification()?)
    }

    /// Requirements with the noise.
    pub(crate) fn complete(&self, asked: Specification) -> Result<Specification, Error> {
        let Some(std) = self.noise else {
            return Ok(asked);
        };
        if asked.style == Style::Paper {
            return Err(Error::request(PAPER_HAS_NO_NOISE));
        }
        let period_s = asked.execution.sample_period_s;
        if period_s == 0.0 {
            return Err(Error::request(
                "`noise` is that of one sample: add the sample period of the controller, such as `sample_period=0.001`",
            ));
        }
        Ok(asked.with_noise(MeasurementNoise::new(std, period_s, self.input_amplitude)))
    }
}

fn put<T>(into: &mut Option<T>, value: Result<T, String>) -> Result<(), String> {
    *into = Some(value?);
    Ok(())
}

/// The first setting that was given.
fn given<'a>(settings: &[(&'a str, bool)]) -> Option<&'a str> {
    let found = settings.iter().find(|(_, is_given)| *is_given);
    found.map(|(name, _)| *name)
}
