//! Requirements on a controller, for `identify` and `tune`.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use onecycle::{Execution, Form, MeasurementNoise, Pid, Specification, Style};
use onecycle_design::{Spans, Vendor};

use super::{phase_margin, share_within};
use crate::failure::Failure;

/// Why the paper's style takes no noise.
pub(crate) const PAPER_HAS_NO_NOISE: &str =
    "--style paper does not limit the noise: leave out --noise, or choose another style";

/// Heading of the requirements on a controller.
pub(super) const CONTROLLER: &str = "Controller";

/// Gains in force.
#[derive(Clone, Debug)]
pub(crate) enum Against {
    /// As given.
    Gains(Pid),
    /// As they stand in a configuration or a log, of this loop.
    File(PathBuf, Option<String>),
}

/// Requirements on a controller, and the gains to compare it with.
#[derive(Clone, Debug, Args)]
pub(crate) struct DesignArguments {
    /// Compromise between speed and robustness: sharp (Ms 2.0), balanced (Ms 1.6), calm (Ms 1.4), or the paper's PD of
    /// least squared error (paper)
    #[arg(long, value_name = "STYLE", default_value = "balanced", value_parser = style())]
    style: Style,
    /// Form of the controller: p, pi, pd, pid, cascade-pi or cascade-pid [default: pid; pd with --style paper]
    #[arg(long, help_heading = CONTROLLER, value_name = "FORM", value_parser = form())]
    controller: Option<Form>,
    /// Maximum sensitivity Ms, and maximum complementary sensitivity Mt [default: that of the style]
    #[arg(long, help_heading = CONTROLLER, value_name = "MS", allow_negative_numbers = true, value_parser = peak)]
    ms: Option<f64>,
    /// Minimum phase margin, in degrees, beside the limits of the style [default: 20 with --style paper, else none]
    #[arg(long, help_heading = CONTROLLER, value_name = "DEG", allow_negative_numbers = true, value_parser = phase_margin)]
    phase_margin: Option<f64>,
    /// Minimum gain margin, as a factor, beside the limits of the style
    #[arg(long, help_heading = CONTROLLER, value_name = "FACTOR", allow_negative_numbers = true, value_parser = gain_margin)]
    gain_margin: Option<f64>,
    /// Maximum output of the controller after a unit step of the reference, in the unit of the input
    #[arg(long, help_heading = CONTROLLER, value_name = "INPUT", allow_negative_numbers = true, value_parser = positive)]
    input_peak: Option<f64>,
    /// Largest overshoot after a step of the reference, such as 15% or 0.15. PI and PID keep it by the set-point weight b as
    /// far as b = 0 can; the report says where it cannot. The loops of a flight log, whose weight is 1, keep it by less
    /// integral action [default: 5%; none with --style paper]
    #[arg(long, help_heading = CONTROLLER, value_name = "SHARE", allow_negative_numbers = true, value_parser = overshoot)]
    overshoot: Option<f64>,
    /// Sample period of the controller, in seconds; its output leaves one period after the sample [default: that of the
    /// recording, and the output leaves at once; continuous without a recording]
    #[arg(long, help_heading = CONTROLLER, value_name = "S", allow_negative_numbers = true, value_parser = positive)]
    sample_period: Option<f64>,
    /// Judge these gains of a controller in parallel form too: Kp,Ki,Kd or Kp,Ki,Kd,Tf with the time Tf of the
    /// measurement filter in seconds; or those in this file: printer.cfg or klippy.log (FILE:extruder), a
    /// log with M301 or M304, YAML of ESPHome, a sketch of an Arduino
    #[arg(long, value_name = "KP,KI,KD", allow_hyphen_values = true, value_parser = against)]
    against: Option<Against>,
    /// Gains as a controller takes them. In percent of the ranges: isa, proportional-band, interacting, deltav, deltav-series,
    /// tdc3000, centum, pide, pide-independent or control-expert. In their own units: klipper, marlin, marlin-bed, esphome,
    /// home-assistant, arduino, wpilib, odrive, simplefoc, codesys, twincat or pid-compact
    #[arg(long, help_heading = CONTROLLER, value_name = "NAME", value_parser = vendor(), hide_possible_values = true)]
    vendor: Option<Vendor>,
    /// With --vendor in percent: range of the measurement in the controller, in the unit of the output, such as 0..200
    #[arg(long, help_heading = CONTROLLER, value_name = "LOW..HIGH", allow_hyphen_values = true, value_parser = span, requires = "vendor")]
    output_range: Option<f64>,
    /// With --vendor: range of the controller's output, in the unit of the input [default: 0..100; klipper 0..1, marlin 0..127]
    #[arg(long, help_heading = CONTROLLER, value_name = "LOW..HIGH", allow_hyphen_values = true, value_parser = span)]
    input_range: Option<f64>,
}

impl DesignArguments {
    /// The controller in which the gains are typed, and its ranges.
    pub(crate) fn plant(&self) -> Result<Option<(Vendor, Spans)>, Failure> {
        match self.vendor {
            Some(vendor) if vendor.has_range_of_measurement() && self.output_range.is_none() => {
                Err(Failure::usage(format!(
                    "--vendor {} counts in percent: add the range of its measurement, such as --output-range 0..200",
                    vendor.name()
                )))
            }
            vendor => Ok(vendor.map(|vendor| (vendor, self.spans(vendor)))),
        }
    }

    /// The ranges of a controller.
    pub(crate) fn spans(&self, vendor: Vendor) -> Spans {
        let output = self.input_range.unwrap_or_else(|| vendor.full_input());
        Spans::new(self.output_range.unwrap_or(1.0), output)
    }

    /// The requirements, without noise.
    pub(crate) fn specification(&self) -> Result<Specification, Failure> {
        if self.style == Style::Paper {
            return self.paper();
        }
        let form = self.controller.unwrap_or(Specification::default().form);
        let mut asked = Specification::new(form, self.style);
        if let Some(peak) = self.ms {
            asked = asked.with_peak(peak);
        }
        if let Some(margin_rad) = self.phase_margin {
            asked = asked.with_phase_margin_rad(margin_rad);
        }
        asked.gain_margin = self.gain_margin.unwrap_or(asked.gain_margin);
        asked.input_peak = self.input_peak;
        asked.overshoot = self.overshoot.unwrap_or(asked.overshoot);
        Ok(asked.with_execution(self.execution()))
    }

    /// The paper's style, which has one limit and one form.
    fn paper(&self) -> Result<Specification, Failure> {
        let others = [
            ("--ms", self.ms.is_some()),
            ("--gain-margin", self.gain_margin.is_some()),
            ("--input-peak", self.input_peak.is_some()),
            ("--overshoot", self.overshoot.is_some()),
        ];
        if let Some((option, _)) = others.iter().find(|(_, is_given)| *is_given) {
            return Err(Failure::usage(format!(
                "--style paper limits the phase margin only: leave out {option}, or choose another style"
            )));
        }
        let mut asked = Specification::paper().with_execution(self.execution());
        if let Some(form) = self.controller.filter(|form| *form != asked.form) {
            return Err(Failure::usage(format!(
                "--style paper designs a PD and no {}: leave out --controller, or choose another style",
                form.name().replace('_', "-")
            )));
        }
        if let Some(margin_rad) = self.phase_margin {
            asked = asked.with_phase_margin_rad(margin_rad);
        }
        Ok(asked)
    }

    fn execution(&self) -> Execution {
        (self.sample_period).map_or_else(Execution::default, Execution::sampled)
    }

    /// Whether the form of the controller was chosen.
    pub(crate) fn is_form_given(&self) -> bool {
        self.controller.is_some()
    }

    /// The gains in force.
    pub(crate) fn against(&self) -> Option<&Against> {
        self.against.as_ref()
    }
}

/// Noise of a known process, which a recording would show.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct NoiseArguments {
    /// Standard deviation of the measurement noise of one sample, in the unit of the output. The style limits the noise at
    /// the actuator to a share of --input-amplitude: sharp 50 %, balanced 25 %, calm 10 %. Needs --sample-period
    #[arg(long, value_name = "STD", allow_negative_numbers = true, value_parser = positive)]
    noise: Option<f64>,
    /// Amplitude that the actuator has for control, in the unit of the input: what --noise is compared with
    #[arg(long, value_name = "INPUT", default_value_t = 1.0, allow_negative_numbers = true,
          value_parser = positive)]
    input_amplitude: f64,
}

impl NoiseArguments {
    /// `asked` with the noise.
    pub(crate) fn complete(&self, asked: Specification) -> Result<Specification, Failure> {
        let Some(std) = self.noise else {
            return Ok(asked);
        };
        if asked.style == Style::Paper {
            return Err(Failure::usage(PAPER_HAS_NO_NOISE));
        }
        let period_s = asked.execution.sample_period_s;
        if period_s == 0.0 {
            return Err(Failure::usage(
                "--noise is that of one sample: add the sample period of the controller, such as --sample-period 0.001",
            ));
        }
        Ok(asked.with_noise(MeasurementNoise::new(std, period_s, self.input_amplitude)))
    }
}

fn style() -> impl TypedValueParser<Value = Style> {
    PossibleValuesParser::new(Style::ALL.map(Style::name))
        .try_map(|name| Style::from_name(&name).ok_or("there is no such style"))
}

fn vendor() -> impl TypedValueParser<Value = Vendor> {
    PossibleValuesParser::new(Vendor::ALL.map(Vendor::name))
        .try_map(|name| Vendor::from_name(&name).ok_or("there is no such controller"))
}

/// The span of a range such as `0..200`.
fn span(text: &str) -> Result<f64, String> {
    let ends = text.split_once("..");
    let ends = ends.and_then(|(low, high)| Some((number(low)?, number(high)?)));
    ends.map(|(low, high)| high - low)
        .filter(|span| span.is_normal() && *span > 0.0)
        .ok_or_else(|| "write a range as LOW..HIGH, such as 0..200".to_owned())
}

fn form() -> impl TypedValueParser<Value = Form> {
    let names = ["p", "pi", "pd", "pid", "cascade-pi", "cascade-pid"];
    PossibleValuesParser::new(names).try_map(|name| {
        Form::from_name(&name.replace('-', "_")).ok_or("there is no such controller")
    })
}

fn peak(text: &str) -> Result<f64, String> {
    number(text)
        .filter(|peak| (1.05..=10.0).contains(peak))
        .ok_or_else(|| "Ms lies between 1.05 and 10; usual are 1.2 to 2.0".to_owned())
}

fn gain_margin(text: &str) -> Result<f64, String> {
    number(text)
        .filter(|factor| (1.0..=100.0).contains(factor))
        .ok_or_else(|| "a gain margin is a factor between 1 and 100; 2 is 6 dB".to_owned())
}

/// A share of a step, as a number or a percentage.
fn overshoot(text: &str) -> Result<f64, String> {
    let otherwise = "an overshoot lies between 0 % and 100 %, such as 15% or 0.15";
    share_within(text, 0.0..=1.0, otherwise)
}

/// A share of noise, as a number or a percentage.
pub(super) fn noise(text: &str) -> Result<f64, String> {
    let otherwise = "a share of noise lies between 0.0001 % and 10000 %, such as 25% or 0.25";
    share_within(text, 1e-6..=100.0, otherwise)
}

fn positive(text: &str) -> Result<f64, String> {
    number(text)
        .filter(|value| *value > 0.0)
        .ok_or_else(|| "this is a positive number".to_owned())
}

pub(super) fn number(text: &str) -> Option<f64> {
    text.trim()
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite())
}

/// Gains in parallel form, or the name of a file with gains.
fn against(text: &str) -> Result<Against, String> {
    let is_name = !text.contains(',') && number(text).is_none() && !text.trim().is_empty();
    match is_name {
        true => {
            let parts = text
                .rsplit_once(':')
                .filter(|(path, _)| Path::new(path).is_file());
            let (path, name) =
                parts.map_or((text, None), |(path, name)| (path, Some(name.to_owned())));
            Ok(Against::File(PathBuf::from(path), name))
        }
        false => gains(text).map(Against::Gains),
    }
}

/// Gains in parallel form.
fn gains(text: &str) -> Result<Pid, String> {
    let values: Option<Vec<f64>> = text.split(',').map(number).collect();
    let wanted = "write the gains as Kp,Ki,Kd or Kp,Ki,Kd,Tf, such as 40,5,12 or 40,0,12,0.002";
    let (gains, filter_s) = match values.as_deref() {
        Some([kp, ki, kd]) => ([*kp, *ki, *kd], 0.0),
        Some([kp, ki, kd, filter_s]) => ([*kp, *ki, *kd], *filter_s),
        _ => return Err(wanted.to_owned()),
    };
    if gains.iter().all(|gain| *gain == 0.0) {
        return Err("at least one of the gains Kp,Ki,Kd is not zero".to_owned());
    }
    if filter_s < 0.0 {
        return Err("the time Tf of the filter is zero or positive".to_owned());
    }
    Ok(Pid::new(gains[0], gains[1], gains[2]).with_filter_s(filter_s))
}
