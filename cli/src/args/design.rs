//! Requirements on a controller, for `identify` and `tune`.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use onecycle::request::Against;
use onecycle::request::values::{
    against, gain_margin, overshoot, peak, phase_margin, positive, span,
};
use onecycle::{DesignRequest, Form, Requirements, Style};
use onecycle_design::Vendor;

/// Heading of the requirements on a controller.
pub(super) const CONTROLLER: &str = "Controller";

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
    /// The requirements, and the gains in force.
    pub(crate) fn requirements(&self) -> Requirements {
        let mut asked = Requirements::default();
        asked.style = self.style;
        asked.controller = self.controller;
        asked.ms = self.ms;
        asked.phase_margin_rad = self.phase_margin;
        asked.gain_margin = self.gain_margin;
        asked.input_peak = self.input_peak;
        asked.overshoot = self.overshoot;
        asked.sample_period_s = self.sample_period;
        asked.against.clone_from(&self.against);
        asked.vendor = self.vendor;
        asked.output_range = self.output_range;
        asked.input_range = self.input_range;
        asked
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
    /// What is asked of a controller with these requirements.
    pub(crate) fn request(&self, requirements: Requirements) -> DesignRequest {
        let mut request = DesignRequest::default();
        request.requirements = requirements;
        request.noise = self.noise;
        request.input_amplitude = self.input_amplitude;
        request
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

fn form() -> impl TypedValueParser<Value = Form> {
    let names = ["p", "pi", "pd", "pid", "cascade-pi", "cascade-pid"];
    PossibleValuesParser::new(names).try_map(|name| {
        Form::from_name(&name.replace('-', "_")).ok_or("there is no such controller")
    })
}
