//! Gains as controllers take them: those of process control systems, printers, thermostats, PLCs, drives and robots.
//!
//! Those of process control systems work with percent of the ranges of measurement and output, so a gain `Kp` (input unit / output unit)
//! becomes `Kc = Kp * span of the measurement / span of the output` (% per %).
//!
//! | controller | form | gain | integral | derivative | source |
//! |------------|------|------|----------|------------|--------|
//! | [`Vendor::DeltaVStandard`], [`Vendor::DeltaVSeries`] | ideal, series | `GAIN` | `RESET` (s) | `RATE` (s) | Emerson, DeltaV Books Online, "PID function block parameters"; `FORM` chooses |
//! | [`Vendor::Tdc3000`] | series | `K` | `T1` (min) | `T2` (min) | pidtuning.net, controller table: Honeywell TDC 3000, type A |
//! | [`Vendor::Centum`] | ideal | `P = 100/Kc` (%) | `I` (s) | `D` (s) | Yokogawa, IM 21B04C01-01E, section 16.5 (`K = 100/PB`); CS 3000 and Centum VP: the same with times in seconds |
//! | [`Vendor::PideDependent`] | ideal | `PGain` | `IGain` (min) | `DGain` (min) | Rockwell Automation, 1756-RM006K, p. 80, dependent gains |
//! | [`Vendor::PideIndependent`] | parallel | `PGain` | `IGain` (1/min) | `DGain` (min) | the same, independent gains |
//! | [`Vendor::ControlExpert`] | ideal | `KP` | `TI` (s) | `TD` (s) | Schneider Electric, Control Expert, "PID parameters": mixed structure, `PV_INF` to `PV_SUP`, `OUT_INF` to `OUT_SUP` |
//! | [`Vendor::Isa`] | ideal | `Kc` | `Ti` (s) | `Td` (s) | Astrom and Hagglund (2006), section 3.2 |
//! | [`Vendor::ProportionalBand`] | ideal | `PB = 100/Kc` (%) | repeats per minute | `Td` (min) | Astrom and Hagglund (2006), section 3.2 |
//! | [`Vendor::Klipper`] | parallel, power 0 to 255 | `pid_kp` | `pid_ki` (1/s) | `pid_kd` (s) | `klippy/extras/heaters.py`: `PID_PARAM_BASE` |
//! | [`Vendor::Marlin`], [`Vendor::MarlinBed`] | parallel, power 0 to 255 | `P` | `I` (1/s) | `D` (s) | marlinfw.org: M301, M304 |
//! | [`Vendor::EspHome`] | parallel, output 0 to 1 | `kp` | `ki` (1/s) | `kd` (s) | esphome.io, PID climate |
//! | [`Vendor::HomeAssistant`] | parallel, output 0 to 100 % | `kp` | `ki` (1/s) | `kd` (s) | HASmartThermostat, README |
//! | [`Vendor::Arduino`] | parallel, own units | `Kp` | `Ki` (1/s) | `Kd` (s) | PID_v1 and QuickPID, README |
//! | [`Vendor::WpiLib`] | parallel, own units | `kP` | `kI` (1/s) | `kD` (s) | WPILib, `PIDController` |
//! | [`Vendor::ODrive`] | parallel, own units | `vel_gain` | `vel_integrator_gain` (1/s) | none | ODrive reference, `Controller.Config` |
//! | [`Vendor::SimpleFoc`] | parallel, own units | `PID_velocity.P` | `PID_velocity.I` (1/s) | `PID_velocity.D` (s) | SimpleFOC docs, PID controller |
//! | [`Vendor::Codesys`] | ideal, own units | `KP` | `TN` (s) | `TV` (s) | CODESYS library Util, `PID` |
//! | [`Vendor::TwinCat`] | ideal, own units | `fKp` | `tTn` (s) | `tTv` (s) | Beckhoff, Tc2_ControllerToolbox, `FB_CTRL_PID` |
//! | [`Vendor::PidCompact`] | ideal, output 0 to 100 % | `Gain` | `Ti` (s) | `Td` (s) | Siemens, S7-1200 manual, section 9.2.2 |
//! | [`Vendor::Interacting`] | series | `Kc` | `Ti` (s) | `Td` (s) | the same |

use super::pid::{Ideal, Pid, Series};

/// A controller by its form, its units and the names of its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Vendor {
    /// Ideal form with times in seconds.
    Isa,
    /// Ideal form with a proportional band and repeats per minute.
    ProportionalBand,
    /// Series form with times in seconds.
    Interacting,
    /// Emerson DeltaV, `FORM` standard.
    DeltaVStandard,
    /// Emerson DeltaV, `FORM` series.
    DeltaVSeries,
    /// Honeywell TDC 3000.
    Tdc3000,
    /// Yokogawa CS 3000 and Centum VP.
    Centum,
    /// Rockwell Logix PIDE with dependent gains.
    PideDependent,
    /// Rockwell Logix PIDE with independent gains.
    PideIndependent,
    /// Schneider Electric Control Expert (Unity Pro) PID, mixed structure.
    ControlExpert,
    /// Klipper and Kalico, heaters.
    Klipper,
    /// Marlin and others with `M301`, hot end.
    Marlin,
    /// Marlin, bed.
    MarlinBed,
    /// ESPHome, PID climate.
    EspHome,
    /// Home Assistant, HASmartThermostat.
    HomeAssistant,
    /// Arduino, PID_v1 and QuickPID.
    Arduino,
    /// WPILib, `PIDController`.
    WpiLib,
    /// ODrive, velocity loop.
    ODrive,
    /// SimpleFOC, velocity loop.
    SimpleFoc,
    /// CODESYS, `PID` of the library Util.
    Codesys,
    /// Beckhoff TwinCAT, `FB_CTRL_PID`.
    TwinCat,
    /// Siemens S7-1200 and S7-1500, `PID_Compact`.
    PidCompact,
}

/// How a controller counts input and output of the process.
#[derive(Clone, Copy, PartialEq)]
enum Scale {
    /// Both in percent of their ranges.
    Percent,
    /// The measurement in its unit; its own output has this value at the end of its range.
    Full(f64),
    /// Both in their units.
    Own,
}

/// What is fixed in a controller besides its gains.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct VendorLaw {
    /// Set-point weight, if it has one that cannot be chosen.
    pub setpoint_weight: Option<f64>,
    /// Sample period (s), if it is the same in all of them.
    pub sample_period_s: Option<f64>,
}

/// Form of a controller with integral and derivative.
#[derive(Clone, Copy, PartialEq)]
enum PidForm {
    Parallel,
    Ideal,
    Series,
}

/// Unit of the integral term.
#[derive(Clone, Copy, PartialEq)]
enum Integral {
    Seconds,
    Minutes,
    PerMinute,
    PerSecond,
}

/// Name and unit of a parameter; a unit is empty where there is none.
type Label = (&'static str, &'static str);

/// What a controller takes.
struct Format {
    form: PidForm,
    scale: Scale,
    is_band: bool,
    integral: Integral,
    derivative_s: f64,
    labels: [Label; 3],
}

/// Ranges of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Spans {
    /// Span of the measurement (output unit of the process).
    pub measurement: f64,
    /// Span of the controller's output (input unit of the process).
    pub output: f64,
}

/// A parameter as it is typed in.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct TypedGain {
    /// Name in the controller.
    pub name: &'static str,
    /// Value in `unit`; infinite or zero where a term is off.
    pub value: f64,
    /// Unit; empty where there is none.
    pub unit: &'static str,
}

/// Why a controller cannot take gains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum VendorError {
    /// The controller has the series form, and the gains have complex zeros: `Ti < 4 Td`.
    ComplexZeros,
    /// The proportional gain is zero, and the form divides by it.
    NoProportional,
    /// A span is not positive and finite.
    Spans,
    /// The controller has no derivative.
    NoDerivative,
}

impl Spans {
    /// Spans of the measurement (output unit of the process) and of the controller's output (input unit of the process).
    #[must_use]
    pub fn new(measurement: f64, output: f64) -> Self {
        Self {
            measurement,
            output,
        }
    }

    /// Gain of the controller for a gain of one (input unit / output unit).
    fn factor(&self, scale: Scale) -> Option<f64> {
        let (measurement, full) = match scale {
            Scale::Percent => (self.measurement, 1.0),
            Scale::Full(full) => (1.0, full),
            Scale::Own => return Some(1.0),
        };
        let factor = full * measurement / self.output;
        (measurement > 0.0 && self.output > 0.0 && factor.is_normal()).then_some(factor)
    }
}

impl Vendor {
    /// All controllers.
    pub const ALL: [Self; 22] = [
        Self::Isa,
        Self::ProportionalBand,
        Self::Interacting,
        Self::DeltaVStandard,
        Self::DeltaVSeries,
        Self::Tdc3000,
        Self::Centum,
        Self::PideDependent,
        Self::PideIndependent,
        Self::ControlExpert,
        Self::Klipper,
        Self::Marlin,
        Self::MarlinBed,
        Self::EspHome,
        Self::HomeAssistant,
        Self::Arduino,
        Self::WpiLib,
        Self::ODrive,
        Self::SimpleFoc,
        Self::Codesys,
        Self::TwinCat,
        Self::PidCompact,
    ];

    /// Its name in lower case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Isa => "isa",
            Self::ProportionalBand => "proportional-band",
            Self::Interacting => "interacting",
            Self::DeltaVStandard => "deltav",
            Self::DeltaVSeries => "deltav-series",
            Self::Tdc3000 => "tdc3000",
            Self::Centum => "centum",
            Self::PideDependent => "pide",
            Self::PideIndependent => "pide-independent",
            Self::ControlExpert => "control-expert",
            Self::Klipper => "klipper",
            Self::Marlin => "marlin",
            Self::MarlinBed => "marlin-bed",
            Self::EspHome => "esphome",
            Self::HomeAssistant => "home-assistant",
            Self::Arduino => "arduino",
            Self::WpiLib => "wpilib",
            Self::ODrive => "odrive",
            Self::SimpleFoc => "simplefoc",
            Self::Codesys => "codesys",
            Self::TwinCat => "twincat",
            Self::PidCompact => "pid-compact",
        }
    }

    /// Whether gains depend on the range of the measurement.
    #[must_use]
    pub fn has_range_of_measurement(self) -> bool {
        self.format().scale == Scale::Percent
    }

    /// Whether gains depend on the range of the controller's output.
    #[must_use]
    pub fn counts_output(self) -> bool {
        self.format().scale != Scale::Own
    }

    /// End of the range of the input in recordings of this controller: Klipper logs a power up to 1, Marlin up to 127, others
    /// percent.
    #[must_use]
    pub fn full_input(self) -> f64 {
        match self {
            Self::Klipper => 1.0,
            Self::Marlin | Self::MarlinBed => 127.0,
            _ => 100.0,
        }
    }

    /// What is fixed besides the gains. Klipper takes a sample of a thermistor every 0.3 s (`REPORT_TIME`), Marlin every
    /// 0.164 s (`PID_dT`), WPILib every 20 ms.
    #[must_use]
    pub fn law(self) -> VendorLaw {
        let weight = match self.format().scale {
            Scale::Percent => None,
            _ if self == Self::PidCompact => None,
            _ => Some(1.0),
        };
        let period_s = match self {
            Self::Klipper => Some(0.3),
            Self::Marlin | Self::MarlinBed => Some(0.164),
            Self::WpiLib => Some(0.02),
            _ => None,
        };
        VendorLaw {
            setpoint_weight: weight,
            sample_period_s: period_s,
        }
    }

    /// The line, or lines, in which gains are typed; `None` where they are fields of a screen.
    #[must_use]
    pub fn lines(self, gains: &[TypedGain; 3]) -> Option<String> {
        // Six significant digits, as the configurations of printers have them.
        let value = |of: &TypedGain| {
            let rounded: f64 = format!("{:.5e}", of.value.abs()).parse().unwrap_or(0.0);
            rounded.to_string()
        };
        let [kp, ki, kd] = [0, 1, 2].map(|at| value(&gains[at]));
        Some(match self {
            Self::Klipper => format!("pid_kp: {kp}\npid_ki: {ki}\npid_kd: {kd}"),
            Self::Marlin => format!("M301 P{kp} I{ki} D{kd}"),
            Self::MarlinBed => format!("M304 P{kp} I{ki} D{kd}"),
            Self::EspHome => format!("control_parameters:\n  kp: {kp}\n  ki: {ki}\n  kd: {kd}"),
            Self::HomeAssistant => format!("kp: {kp}\nki: {ki}\nkd: {kd}"),
            Self::Arduino => format!("myPID.SetTunings({kp}, {ki}, {kd});"),
            Self::WpiLib => format!("new PIDController({kp}, {ki}, {kd})"),
            Self::ODrive => format!("config.vel_gain = {kp}\nconfig.vel_integrator_gain = {ki}"),
            Self::SimpleFoc => format!(
                "motor.PID_velocity.P = {kp};\nmotor.PID_velocity.I = {ki};\nmotor.PID_velocity.D = {kd};"
            ),
            _ => return None,
        })
    }

    /// The controller of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|vendor| vendor.name() == name)
    }

    fn format(self) -> Format {
        use Integral::{Minutes, PerMinute, Seconds};
        let of = |form, integral, labels| Format {
            form,
            scale: Scale::Percent,
            is_band: false,
            integral,
            derivative_s: if integral == Seconds { 1.0 } else { 60.0 },
            labels,
        };
        let band = |format| Format {
            is_band: true,
            ..format
        };
        if let Some(format) = self.format_of_device() {
            return format;
        }
        match self {
            Self::Isa => of(
                PidForm::Ideal,
                Seconds,
                [("Kc", ""), ("Ti", "s"), ("Td", "s")],
            ),
            Self::ProportionalBand => band(of(
                PidForm::Ideal,
                PerMinute,
                [("PB", "%"), ("reset", "repeats/min"), ("Td", "min")],
            )),
            Self::Interacting => of(
                PidForm::Series,
                Seconds,
                [("Kc", ""), ("Ti", "s"), ("Td", "s")],
            ),
            Self::DeltaVStandard => of(PidForm::Ideal, Seconds, DELTA_V),
            Self::DeltaVSeries => of(PidForm::Series, Seconds, DELTA_V),
            Self::Tdc3000 => of(
                PidForm::Series,
                Minutes,
                [("K", ""), ("T1", "min"), ("T2", "min")],
            ),
            Self::Centum => band(of(
                PidForm::Ideal,
                Seconds,
                [("P", "%"), ("I", "s"), ("D", "s")],
            )),
            Self::PideDependent => of(
                PidForm::Ideal,
                Minutes,
                [("PGain", ""), ("IGain", "min"), ("DGain", "min")],
            ),
            Self::PideIndependent => of(
                PidForm::Parallel,
                PerMinute,
                [("PGain", ""), ("IGain", "1/min"), ("DGain", "min")],
            ),
            _ => of(
                PidForm::Ideal,
                Seconds,
                [("KP", ""), ("TI", "s"), ("TD", "s")],
            ),
        }
    }

    /// The format of a controller outside of process control systems.
    fn format_of_device(self) -> Option<Format> {
        let parallel = |scale, [kp, ki, kd]: [&'static str; 3]| Format {
            form: PidForm::Parallel,
            scale,
            is_band: false,
            integral: Integral::PerSecond,
            derivative_s: 1.0,
            labels: [(kp, ""), (ki, "1/s"), (kd, "s")],
        };
        let ideal = |scale, [gain, integral, derivative]: [&'static str; 3]| Format {
            form: PidForm::Ideal,
            integral: Integral::Seconds,
            labels: [(gain, ""), (integral, "s"), (derivative, "s")],
            ..parallel(scale, [""; 3])
        };
        Some(match self {
            Self::Klipper => parallel(Scale::Full(255.0), ["pid_kp", "pid_ki", "pid_kd"]),
            Self::Marlin | Self::MarlinBed => parallel(Scale::Full(255.0), ["P", "I", "D"]),
            Self::EspHome => parallel(Scale::Full(1.0), ["kp", "ki", "kd"]),
            Self::HomeAssistant => parallel(Scale::Full(100.0), ["kp", "ki", "kd"]),
            Self::Arduino => parallel(Scale::Own, ["Kp", "Ki", "Kd"]),
            Self::WpiLib => parallel(Scale::Own, ["kP", "kI", "kD"]),
            Self::ODrive => parallel(Scale::Own, ["vel_gain", "vel_integrator_gain", ""]),
            Self::SimpleFoc => parallel(
                Scale::Own,
                ["PID_velocity.P", "PID_velocity.I", "PID_velocity.D"],
            ),
            Self::Codesys => ideal(Scale::Own, ["KP", "TN", "TV"]),
            Self::TwinCat => ideal(Scale::Own, ["fKp", "tTn", "tTv"]),
            Self::PidCompact => ideal(Scale::Full(100.0), ["Gain", "Ti", "Td"]),
            Self::Isa
            | Self::ProportionalBand
            | Self::Interacting
            | Self::DeltaVStandard
            | Self::DeltaVSeries
            | Self::Tdc3000
            | Self::Centum
            | Self::PideDependent
            | Self::PideIndependent
            | Self::ControlExpert => return None,
        })
    }

    /// Gains as this controller takes them, without filter and set-point weight: proportional, integral, derivative. Without
    /// integral its time is infinite. A gain that acts downwards is negative: the controller takes its size, and the action
    /// as a switch.
    ///
    /// # Errors
    /// See [`VendorError`].
    pub fn typed(self, pid: &Pid, spans: &Spans) -> Result<[TypedGain; 3], VendorError> {
        let format = self.format();
        let factor = spans.factor(format.scale).ok_or(VendorError::Spans)?;
        if self == Self::ODrive && pid.kd != 0.0 {
            return Err(VendorError::NoDerivative);
        }
        let ideal = pid.ideal().ok_or(VendorError::NoProportional);
        let (gain, integral_s, derivative_s) = match format.form {
            PidForm::Parallel => (pid.kp, 1.0 / (factor * pid.ki), factor * pid.kd),
            PidForm::Ideal => {
                let of = ideal?;
                (of.gain, of.integral_time_s, of.derivative_time_s)
            }
            PidForm::Series => {
                ideal?;
                let of = pid.series().ok_or(VendorError::ComplexZeros)?;
                (of.gain, of.integral_time_s, of.derivative_time_s)
            }
        };
        let gain = factor * gain;
        let values = [
            if format.is_band { 100.0 / gain } else { gain },
            match format.integral {
                Integral::Seconds => integral_s,
                Integral::Minutes => integral_s / 60.0,
                Integral::PerMinute => 60.0 / integral_s,
                Integral::PerSecond => 1.0 / integral_s,
            },
            derivative_s / format.derivative_s,
        ];
        let mut typed = values.iter().zip(format.labels);
        let mut next = || {
            let (value, (name, unit)) = typed.next().unwrap_or((&0.0, ("", "")));
            TypedGain {
                name,
                value: *value,
                unit,
            }
        };
        Ok([next(), next(), next()])
    }

    /// The controller with these typed values: proportional, integral, derivative.
    ///
    /// # Errors
    /// [`VendorError::Spans`].
    pub fn pid(self, values: [f64; 3], spans: &Spans) -> Result<Pid, VendorError> {
        let format = self.format();
        let factor = spans.factor(format.scale).ok_or(VendorError::Spans)?;
        let [gain, integral, derivative] = values;
        let gain = if format.is_band { 100.0 / gain } else { gain } / factor;
        let integral_s = match format.integral {
            Integral::Seconds => integral,
            Integral::Minutes => 60.0 * integral,
            Integral::PerMinute => 60.0 / integral,
            Integral::PerSecond => 1.0 / integral,
        };
        let derivative_s = derivative * format.derivative_s;
        Ok(match format.form {
            PidForm::Parallel => Pid::new(gain, 1.0 / (factor * integral_s), derivative_s / factor),
            PidForm::Ideal => Ideal::new(gain, integral_s, derivative_s).pid(),
            PidForm::Series => Series::new(gain, integral_s, derivative_s).pid(),
        })
    }
}

const DELTA_V: [Label; 3] = [("GAIN", ""), ("RESET", "s"), ("RATE", "s")];

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(found: f64, expected: f64) {
        assert!(
            (found - expected).abs() < 1e-12 * expected.abs(),
            "{found} {expected}"
        );
    }

    fn values(vendor: Vendor, pid: &Pid, spans: Spans) -> [f64; 3] {
        vendor.typed(pid, &spans).unwrap().map(|gain| gain.value)
    }

    // Kp 2 %/K, Ti 120 s, Td 15 s on a range of 200 K and 100 %: Kc = 4. Series: 1 - 4 Td/Ti = 0.5, so
    // k' = 4 (1 + sqrt(0.5))/2, Ti' = 120 (1 + sqrt(0.5))/2, Td' = 15/((1 + sqrt(0.5))/2).
    #[test]
    fn gains_by_hand() {
        let pid = Ideal::new(2.0, 120.0, 15.0).pid();
        let spans = Spans::new(200.0, 100.0);
        let half = 0.5 * (1.0 + 0.5_f64.sqrt());
        for (vendor, expected) in [
            (Vendor::Isa, [4.0, 120.0, 15.0]),
            (Vendor::DeltaVStandard, [4.0, 120.0, 15.0]),
            (Vendor::Centum, [25.0, 120.0, 15.0]),
            (Vendor::ProportionalBand, [25.0, 0.5, 0.25]),
            (Vendor::PideDependent, [4.0, 2.0, 0.25]),
            // 4/2 min and 4 * 0.25 min.
            (Vendor::PideIndependent, [4.0, 2.0, 1.0]),
            (Vendor::Interacting, [4.0 * half, 120.0 * half, 15.0 / half]),
            (Vendor::Tdc3000, [4.0 * half, 2.0 * half, 0.25 / half]),
        ] {
            for (found, expected) in values(vendor, &pid, spans).into_iter().zip(expected) {
                assert_close(found, expected);
            }
        }
    }

    // Kp 0.04 of full power per K, Ki 0.002 1/s, Kd 0.3 s: for a power of 255, of 1 where it is logged up to 127 and in percent.
    #[test]
    fn gains_of_devices_by_hand() {
        let pid = Pid::new(0.04, 0.002, 0.3);
        for (vendor, full, expected) in [
            (Vendor::Klipper, 1.0, [10.2, 0.51, 76.5]),
            (Vendor::Marlin, 127.0, [10.2, 0.51, 76.5]),
            (Vendor::EspHome, 100.0, [0.04, 0.002, 0.3]),
            (Vendor::HomeAssistant, 100.0, [4.0, 0.2, 30.0]),
            (Vendor::Arduino, 255.0, [10.2, 0.51, 76.5]),
            (Vendor::Codesys, 100.0, [4.0, 20.0, 7.5]),
            (Vendor::TwinCat, 100.0, [4.0, 20.0, 7.5]),
            (Vendor::PidCompact, 10.0, [4.0, 20.0, 7.5]),
        ] {
            let logged = Pid::new(full * pid.kp, full * pid.ki, full * pid.kd);
            let found = values(vendor, &logged, Spans::new(f64::NAN, full));
            for (found, expected) in found.into_iter().zip(expected) {
                assert_close(found, expected);
            }
        }
        let gains = Vendor::Marlin
            .typed(&Pid::new(0.04, 0.002, 0.3), &Spans::new(1.0, 1.0))
            .unwrap();
        assert_eq!(
            Vendor::Marlin.lines(&gains).unwrap(),
            "M301 P10.2 I0.51 D76.5"
        );
        assert_eq!(
            Vendor::Klipper.lines(&gains).unwrap(),
            "pid_kp: 10.2\npid_ki: 0.51\npid_kd: 76.5"
        );
        assert_eq!(Vendor::Isa.lines(&gains), None);
        assert_eq!(
            Vendor::Klipper.typed(&pid, &Spans::new(1.0, 0.0)),
            Err(VendorError::Spans)
        );
    }

    #[test]
    fn every_controller_gives_the_gains_back() {
        let spans = Spans::new(35.0, 7.0);
        for pid in [
            Pid::new(3.0, 0.02, 20.0),
            Pid::new(-3.0, -0.02, -20.0),
            Pid::new(3.0, 0.02, 0.0),
        ] {
            for vendor in Vendor::ALL {
                if vendor == Vendor::ODrive && pid.kd != 0.0 {
                    assert_eq!(vendor.typed(&pid, &spans), Err(VendorError::NoDerivative));
                    continue;
                }
                let back = vendor.pid(values(vendor, &pid, spans), &spans).unwrap();
                assert_close(back.kp, pid.kp);
                assert_close(back.ki, pid.ki);
                assert!(
                    (back.kd - pid.kd).abs() <= 1e-12 * pid.kd.abs(),
                    "{vendor:?}"
                );
                assert_eq!(Vendor::from_name(vendor.name()), Some(vendor));
            }
        }
    }

    // Ti = 3 Td. A PD has no integral: an infinite time, zero repeats.
    #[test]
    fn what_a_form_cannot_hold() {
        let spans = Spans::new(1.0, 1.0);
        let complex = Ideal::new(1.0, 3.0, 1.0).pid();
        assert_eq!(
            Vendor::Tdc3000.typed(&complex, &spans),
            Err(VendorError::ComplexZeros)
        );
        assert!(Vendor::Isa.typed(&complex, &spans).is_ok());
        let integral = Pid::new(0.0, 1.0, 0.0);
        assert_eq!(
            Vendor::Isa.typed(&integral, &spans),
            Err(VendorError::NoProportional)
        );
        assert_eq!(
            values(Vendor::PideIndependent, &integral, spans),
            [0.0, 60.0, 0.0]
        );
        assert_eq!(
            Vendor::Isa.typed(&complex, &Spans::new(0.0, 1.0)),
            Err(VendorError::Spans)
        );
        let pd = Pid::new(1.0, 0.0, 1.0);
        assert_eq!(values(Vendor::Isa, &pd, spans), [1.0, f64::INFINITY, 1.0]);
        assert_eq!(values(Vendor::ProportionalBand, &pd, spans)[1], 0.0);
    }
}
