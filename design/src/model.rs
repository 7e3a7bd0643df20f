//! Process models: structure and parameter values.
//!
//! | structure | transfer function | parameters |
//! |-----------|-------------------|------------|
//! | [`Structure::Soiptd`] | `K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))` | `K`, `K/T_body`, `T_prop`, `T_body`, `tau` |
//!
//! Symbols and units: [`Parameter`]. A [`Structure`] is named in reports, JSON and packs. A function that takes a
//! [`Model`] chooses its method by the structure.

use num_complex::Complex64;
use onecycle_onboard::Soiptd;

/// Structure of a process: number of integrators and lags, dead time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Structure {
    /// Second order plus integrator plus dead time: an integrator with two lags and dead time.
    Soiptd,
}

impl Structure {
    /// Every structure.
    pub const ALL: [Self; 1] = [Self::Soiptd];

    /// Name in JSON, on command lines and in packs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Soiptd => "soiptd",
        }
    }

    /// Transfer function as text, in the symbols of [`Parameter::symbol`].
    #[must_use]
    pub fn transfer_function(self) -> &'static str {
        match self {
            Self::Soiptd => "K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))",
        }
    }

    /// Parameters to report for this structure, in the order of a report.
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

/// Physical parameter of a model, or of the experiment that identified it. For its unit see [`Parameter::unit`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Parameter {
    /// Velocity gain `K`: rate of the output per unit of input in steady state. Infinite without damping.
    K,
    /// Acceleration gain `K/T_body`. Finite without damping.
    KOverTBody,
    /// Actuator lag `T_prop`, the shorter of the two lags.
    TProp,
    /// Body lag `T_body`, the longer of the two lags. Infinite without damping.
    TBody,
    /// Damping `1/T_body`. Zero for a double integrator.
    InverseTBody,
    /// Dead time `tau`.
    Tau,
    /// Constant disturbance at the process input, which the recording does not show.
    InputBias,
}

/// Unit of a parameter, in terms of the units of the recorded input and output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// Output unit / (input unit s).
    OutputPerInputSecond,
    /// Output unit / (input unit s^2).
    OutputPerInputSecondSquared,
    /// s.
    Second,
    /// 1/s.
    PerSecond,
    /// Input unit.
    Input,
}

impl Parameter {
    /// Key in JSON. It ends in the unit where the unit is one of time: `tau_s`.
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

    /// Unit of the parameter.
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

/// Process model: a structure and its parameter values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Model {
    /// [`Structure::Soiptd`]: an integrator with two lags and dead time.
    Soiptd(Soiptd),
}

impl From<Soiptd> for Model {
    fn from(process: Soiptd) -> Self {
        Self::Soiptd(process)
    }
}

impl Model {
    /// Structure of the model.
    #[must_use]
    pub fn structure(&self) -> Structure {
        match self {
            Self::Soiptd(_) => Structure::Soiptd,
        }
    }

    /// The integrator with two lags and dead time. `None` for another structure.
    #[must_use]
    pub fn soiptd(&self) -> Option<Soiptd> {
        match self {
            Self::Soiptd(process) => Some(*process),
        }
    }

    /// Value of a parameter in its [unit](Parameter::unit). `K` and `T_body` are infinite without damping. `None` if
    /// the model does not have the parameter.
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

    /// Frequency response `G(jw)` (output unit / input unit) at the frequency `w` (rad/s).
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

    // K = 2, T_prop = T_body = 1 s, tau = pi s, at 1 rad/s: e^(-j pi) = -1 and j (1 + j)^2 = -2, so
    // G = 2 * -1 / -2 = 1.
    #[test]
    fn frequency_response_by_hand() {
        let model = Model::from(Soiptd::new(2.0, 1.0, 1.0, std::f64::consts::PI).unwrap());
        let response = model.frequency_response(1.0);
        assert!((response - 1.0).norm() < 1e-15, "{response}");
    }

    // K and T_body of a double integrator are infinite. The input bias belongs to the experiment, not to the model.
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
