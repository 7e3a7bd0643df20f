//! Process models: structure and parameter values.
//!
//! A [`Structure`] is named in reports, JSON and packs. A function that takes a [`Model`] chooses its method by the
//! structure. Symbols: [`Parameter`]; units: [`Structure::unit`].

mod linear;
pub mod state_space;
mod structure;

use num_complex::Complex64;
use onecycle_onboard::Soiptd;

pub use linear::{Linear, LinearError};
pub use structure::{Parameter, Stages, Structure, Unit};

/// Process model: a structure and its parameter values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Model {
    /// [`Structure::Soiptd`]: an integrator with two lags and dead time.
    Soiptd(Soiptd),
    /// Any structure. A stable process of [`Structure::Soiptd`] is [`Model::Soiptd`], which has the exact methods.
    Linear(Linear),
}

impl From<Soiptd> for Model {
    fn from(process: Soiptd) -> Self {
        Self::Soiptd(process)
    }
}

impl From<Linear> for Model {
    fn from(process: Linear) -> Self {
        match process.soiptd() {
            Some(soiptd) if process.structure() == Structure::Soiptd => Self::Soiptd(soiptd),
            _ => Self::Linear(process),
        }
    }
}

impl Model {
    /// Structure of the model.
    #[must_use]
    pub fn structure(&self) -> Structure {
        match self {
            Self::Soiptd(_) => Structure::Soiptd,
            Self::Linear(process) => process.structure(),
        }
    }

    /// The integrator with two lags and dead time. `None` for another structure.
    #[must_use]
    pub fn soiptd(&self) -> Option<Soiptd> {
        match self {
            Self::Soiptd(process) => Some(*process),
            Self::Linear(process) => process.soiptd(),
        }
    }

    /// The model as a cascade of stages.
    #[must_use]
    pub fn linear(&self) -> Linear {
        match self {
            Self::Soiptd(process) => Linear::from(*process),
            Self::Linear(process) => *process,
        }
    }

    /// Value of a parameter in its [unit](Structure::unit). `K` and `T_body` are infinite without damping. `None` if
    /// the model does not have the parameter.
    #[must_use]
    pub fn parameter(&self, parameter: Parameter) -> Option<f64> {
        match (self, parameter) {
            // As the process stores them, to the last bit.
            (Self::Soiptd(process), Parameter::K) => Some(process.k().unwrap_or(f64::INFINITY)),
            (Self::Soiptd(process), Parameter::TBody) => {
                Some(process.t_body_s().unwrap_or(f64::INFINITY))
            }
            _ => self.linear().parameter(parameter),
        }
    }

    /// Frequency response `G(jw)` (output unit / input unit) at the frequency `w` (rad/s).
    #[must_use]
    pub fn frequency_response(&self, omega_rad_per_s: f64) -> Complex64 {
        self.linear().frequency_response(omega_rad_per_s)
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
