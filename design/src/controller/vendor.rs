//! Gains as the controllers of process control systems take them.
//!
//! These controllers work with percent of the ranges of measurement and output, so a gain `Kp` (input unit / output unit)
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
}

/// Name and unit of a parameter; a unit is empty where there is none.
type Label = (&'static str, &'static str);

/// What a controller takes.
struct Format {
    form: PidForm,
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

    /// Gain in percent per percent of a gain of one (input unit / output unit).
    fn factor(&self) -> Option<f64> {
        let factor = self.measurement / self.output;
        (self.measurement > 0.0 && self.output > 0.0 && factor.is_normal()).then_some(factor)
    }
}

impl Vendor {
    /// All controllers.
    pub const ALL: [Self; 10] = [
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
        }
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
            is_band: false,
            integral,
            derivative_s: if integral == Seconds { 1.0 } else { 60.0 },
            labels,
        };
        let band = |format| Format {
            is_band: true,
            ..format
        };
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
            Self::ControlExpert => of(
                PidForm::Ideal,
                Seconds,
                [("KP", ""), ("TI", "s"), ("TD", "s")],
            ),
        }
    }

    /// Gains as this controller takes them, without filter and set-point weight: proportional, integral, derivative. Without
    /// integral its time is infinite. A gain that acts downwards is negative: the controller takes its size, and the action
    /// as a switch.
    ///
    /// # Errors
    /// See [`VendorError`].
    pub fn typed(self, pid: &Pid, spans: &Spans) -> Result<[TypedGain; 3], VendorError> {
        let factor = spans.factor().ok_or(VendorError::Spans)?;
        let format = self.format();
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
        let factor = spans.factor().ok_or(VendorError::Spans)?;
        let format = self.format();
        let [gain, integral, derivative] = values;
        let gain = if format.is_band { 100.0 / gain } else { gain } / factor;
        let integral_s = match format.integral {
            Integral::Seconds => integral,
            Integral::Minutes => 60.0 * integral,
            Integral::PerMinute => 60.0 / integral,
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

    #[test]
    fn every_controller_gives_the_gains_back() {
        let spans = Spans::new(35.0, 7.0);
        for pid in [
            Pid::new(3.0, 0.02, 20.0),
            Pid::new(-3.0, -0.02, -20.0),
            Pid::new(3.0, 0.02, 0.0),
        ] {
            for vendor in Vendor::ALL {
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
