//! Models: which process it is, and its numbers.
//!
//! | structure | transfer function | parameters |
//! |-----------|-------------------|------------|
//! | [`Structure::Soiptd`] | `K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))` | `K`, `K/T_body`, `T_prop`, `T_body`, `tau` |
//!
//! A [`Structure`] is a value: reports, JSON and packs name it, and a function that takes a [`Model`] chooses its
//! method by it.

use num_complex::Complex64;
use onecycle_onboard::Soiptd;

/// Which process: its integrators, lags, and dead time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Structure {
    /// Second order plus integrator plus dead time: an integrator with two lags and a delay.
    Soiptd,
}

impl Structure {
    /// Every structure.
    pub const ALL: [Self; 1] = [Self::Soiptd];

    /// Short name, the same in JSON, on command lines and in packs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Soiptd => "soiptd",
        }
    }

    /// Transfer function, in the symbols of [`Structure::parameters`].
    #[must_use]
    pub fn transfer_function(self) -> &'static str {
        match self {
            Self::Soiptd => "K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))",
        }
    }

    /// The parameters that are reported for it, in the order of a report.
    #[must_use]
    pub fn parameters(self) -> &'static [Parameter] {
        match self {
            Self::Soiptd => &[
                Parameter::K,
                Parameter::KOverTBody,
                Parameter::TProp,
                Parameter::TBody,
                Parameter::Tau,
            ],
        }
    }
}

/// A physical parameter of a model, or of the experiment that it was identified in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Parameter {
    /// Velocity gain `K`; infinite without damping.
    K,
    /// Acceleration gain `K/T_body`.
    KOverTBody,
    /// Lag of the actuator, the shorter of the two.
    TProp,
    /// Lag of the body, the longer of the two; infinite without damping.
    TBody,
    /// Damping `1/T_body`; zero for a double integrator.
    InverseTBody,
    /// Dead time.
    Tau,
    /// Constant that the process adds to the recorded input.
    InputBias,
}

/// Unit of a parameter, in the units of the recording's input and output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// Output unit / (input unit s).
    OutputPerInputSecond,
    /// Output unit / (input unit s^2).
    OutputPerInputSecondSquared,
    /// Second.
    Second,
    /// 1/s.
    PerSecond,
    /// Input unit.
    Input,
}

impl Parameter {
    /// Key in JSON, with its unit where that is one of time.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::K => "k",
            Self::KOverTBody => "k_over_t_body",
            Self::TProp => "t_prop_s",
            Self::TBody => "t_body_s",
            Self::InverseTBody => "inv_t_body_per_s",
            Self::Tau => "tau_s",
            Self::InputBias => "input_bias",
        }
    }

    /// Symbol in [`Structure::transfer_function`].
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::K => "K",
            Self::KOverTBody => "K/T_body",
            Self::TProp => "T_prop",
            Self::TBody => "T_body",
            Self::InverseTBody => "1/T_body",
            Self::Tau => "tau",
            Self::InputBias => "input bias",
        }
    }

    /// Its unit.
    #[must_use]
    pub fn unit(self) -> Unit {
        match self {
            Self::K => Unit::OutputPerInputSecond,
            Self::KOverTBody => Unit::OutputPerInputSecondSquared,
            Self::TProp | Self::TBody | Self::Tau => Unit::Second,
            Self::InverseTBody => Unit::PerSecond,
            Self::InputBias => Unit::Input,
        }
    }
}

/// A process model: a structure with its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Model {
    /// An integrator with two lags and a delay.
    Soiptd(Soiptd),
}

impl From<Soiptd> for Model {
    fn from(process: Soiptd) -> Self {
        Self::Soiptd(process)
    }
}

impl Model {
    /// Its structure.
    #[must_use]
    pub fn structure(&self) -> Structure {
        match self {
            Self::Soiptd(_) => Structure::Soiptd,
        }
    }

    /// The integrator with two lags and a delay; `None` for another structure.
    #[must_use]
    pub fn soiptd(&self) -> Option<Soiptd> {
        match self {
            Self::Soiptd(process) => Some(*process),
        }
    }

    /// Value of a parameter in its [unit](Parameter::unit), infinite where the parameter is; `None` where the structure
    /// does not have it.
    #[must_use]
    pub fn parameter(&self, parameter: Parameter) -> Option<f64> {
        let Self::Soiptd(process) = self;
        match parameter {
            Parameter::K => Some(process.k().unwrap_or(f64::INFINITY)),
            Parameter::KOverTBody => Some(process.k_over_t_body()),
            Parameter::TProp => Some(process.t_prop_s()),
            Parameter::TBody => Some(process.t_body_s().unwrap_or(f64::INFINITY)),
            Parameter::InverseTBody => Some(process.inv_t_body_per_s()),
            Parameter::Tau => Some(process.tau_s()),
            Parameter::InputBias => None,
        }
    }

    /// Frequency response `G(jw)` at a frequency (rad/s): output unit / input unit.
    #[must_use]
    pub fn frequency_response(&self, omega_rad_per_s: f64) -> Complex64 {
        let s = Complex64::new(0.0, omega_rad_per_s);
        match self {
            Self::Soiptd(process) => {
                let lags = (s * process.t_prop_s() + 1.0) * (s + process.inv_t_body_per_s());
                (-s * process.tau_s()).exp() * process.k_over_t_body() / (s * lags)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // K = 2, T_prop = 1, T_body = 1, tau = pi at 1 rad/s: e^(-j pi) = -1 and j (1 + j)^2 = -2, so G = 2 * -1 / -2 = 1.
    #[test]
    fn frequency_response_by_hand() {
        let model = Model::from(Soiptd::new(2.0, 1.0, 1.0, std::f64::consts::PI).unwrap());
        let response = model.frequency_response(1.0);
        assert!((response - 1.0).norm() < 1e-15, "{response}");
    }

    // A double integrator has no finite K and T_body, and no input bias belongs to a model.
    #[test]
    fn parameters_of_a_double_integrator() {
        let model = Model::from(Soiptd::from_acceleration_gain(3.0, 0.1, 0.0, 0.02).unwrap());
        assert_eq!(model.structure(), Structure::Soiptd);
        let values: Vec<_> = (Structure::Soiptd.parameters().iter())
            .map(|&parameter| model.parameter(parameter).unwrap())
            .collect();
        assert_eq!(values, [f64::INFINITY, 3.0, 0.1, f64::INFINITY, 0.02]);
        assert_eq!(model.parameter(Parameter::InverseTBody), Some(0.0));
        assert_eq!(model.parameter(Parameter::InputBias), None);
    }
}
