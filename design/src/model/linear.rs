//! Linear process with dead time as a cascade of stages.
//!
//! ```text
//!                            kappa e^(-tau s)
//! G(s) = --------------------------------------------------------
//!        prod_i (T_i s + 1)  (s + a)^p  (s^2 + c1 s + c0)^q  s^n
//! ```
//!
//! with up to two actuator lags `T_i`, a pole `a = 1/T_body`, a second-order stage and up to two integrators:
//! [`Structure::stages`] says how many of each. In these parameters no damping (`a = 0`, `c0 = 0`) and no dead time are
//! ordinary points.

use num_complex::Complex64;
use onecycle_onboard::Soiptd;

use super::structure::{Parameter, Structure};

/// Linear process with dead time. Its stages are those of [`Structure::stages`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// Structure: number of stages of each kind.
    structure: Structure,
    /// `kappa`: gain in front of the stages.
    gain: f64,
    /// `T_i` (s): the first `stages.lags` are used.
    lags_s: [f64; 2],
    /// `a` (1/s).
    pole_per_s: f64,
    /// `c1` (1/s) and `c0` (1/s^2).
    pair: [f64; 2],
    /// `tau` (s).
    tau_s: f64,
}

/// A parameter of a linear process that is out of range, with its value.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{} must be {requirement}, but is {value}", parameter.symbol())]
pub struct LinearError {
    /// The parameter.
    pub parameter: Parameter,
    /// The range it must lie in.
    pub requirement: &'static str,
    /// Its value.
    pub value: f64,
}

impl Linear {
    /// Process of `structure` with all stages at rest values: gain 1, lags of 1 s, no damping, no dead time.
    #[must_use]
    pub fn new(structure: Structure) -> Self {
        Self {
            structure,
            gain: 1.0,
            lags_s: [1.0; 2],
            pole_per_s: 0.0,
            pair: [0.0; 2],
            tau_s: 0.0,
        }
    }

    /// Sets `kappa`, the gain in front of the stages.
    #[must_use]
    pub fn with_gain(self, gain: f64) -> Self {
        Self { gain, ..self }
    }

    /// The same stages, as far as `structure` has them.
    #[must_use]
    pub fn with_structure(self, structure: Structure) -> Self {
        Self { structure, ..self }
    }

    /// Sets the actuator lags (s). Lags that the structure does not have are not used.
    #[must_use]
    pub fn with_lags_s(self, lags_s: [f64; 2]) -> Self {
        Self { lags_s, ..self }
    }

    /// Sets the pole `a = 1/T_body` (1/s).
    #[must_use]
    pub fn with_pole_per_s(self, pole_per_s: f64) -> Self {
        Self { pole_per_s, ..self }
    }

    /// Sets the coefficients `c1` (1/s) and `c0` (1/s^2) of the second-order stage.
    #[must_use]
    pub fn with_pair(self, c1_per_s: f64, c0_per_s2: f64) -> Self {
        Self {
            pair: [c1_per_s, c0_per_s2],
            ..self
        }
    }

    /// Sets the dead time (s).
    #[must_use]
    pub fn with_tau_s(self, tau_s: f64) -> Self {
        Self { tau_s, ..self }
    }

    /// Process of `structure` from the values of its [parameters](Structure::parameters). `value` returns a parameter
    /// in its unit, `None` if it is not given. The gain may be given as `K` or as `K/T_body`, the damping as `T_body`
    /// (infinite without damping) or as `1/T_body`.
    ///
    /// # Errors
    /// The first parameter that is missing or out of range.
    pub fn from_parameters(
        structure: Structure,
        value: impl Fn(Parameter) -> Option<f64>,
    ) -> Result<Self, LinearError> {
        let stages = structure.stages();
        let get = |parameter, requirement, holds: fn(f64) -> bool| {
            let value = value(parameter).unwrap_or(f64::NAN);
            if holds(value) {
                Ok(value)
            } else {
                Err(LinearError {
                    parameter,
                    requirement,
                    value,
                })
            }
        };
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let mut process = Self::new(structure);
        if stages.lags > 0 {
            process.lags_s[0] = get(Parameter::TProp, "a positive time", positive)?;
        }
        if stages.lags > 1 {
            process.lags_s[1] = get(Parameter::TProp2, "a positive time", positive)?;
        }
        if stages.poles > 0 {
            // Beside an integrator a negative time is a sign error rather than an unstable process.
            let is_alone = stages.integrators == 0;
            let of_inverse = value(Parameter::InverseTBody).is_some();
            process.pole_per_s = match (of_inverse, is_alone) {
                (true, true) => get(Parameter::InverseTBody, "finite", f64::is_finite)?,
                (true, false) => get(Parameter::InverseTBody, "zero or positive", |v| {
                    v.is_finite() && v >= 0.0
                })?,
                (false, true) => {
                    let requirement = "a time, negative for an unstable process";
                    1.0 / get(Parameter::TBody, requirement, |v| v != 0.0 && !v.is_nan())?
                }
                (false, false) => 1.0 / get(Parameter::TBody, "a positive time", |v| v > 0.0)?,
            };
        }
        let mut gain_of_k = process.pole_per_s;
        if stages.pairs > 0 {
            let w0 = get(Parameter::NaturalFrequency, "positive", positive)?;
            let zeta = get(Parameter::Zeta, "zero or positive", |v| {
                v.is_finite() && v >= 0.0
            })?;
            process.pair = [2.0 * zeta * w0, w0 * w0];
            gain_of_k = w0 * w0;
        } else if stages.poles == 0 {
            gain_of_k = 1.0;
        }
        process.tau_s = get(Parameter::Tau, "zero or a positive time", |v| {
            v.is_finite() && v >= 0.0
        })?;
        let finite = |v: f64| v.is_finite() && v != 0.0;
        process.gain = if value(Parameter::KOverTBody).is_some() {
            get(Parameter::KOverTBody, "finite and not zero", finite)?
        } else {
            gain_of_k * get(Parameter::K, "finite and not zero", finite)?
        };
        if finite(process.gain) {
            Ok(process)
        } else {
            Err(LinearError {
                parameter: Parameter::K,
                requirement: "given as K/T_body if there is no damping",
                value: value(Parameter::K).unwrap_or(f64::NAN),
            })
        }
    }

    /// Structure of the process.
    #[must_use]
    pub fn structure(&self) -> Structure {
        self.structure
    }

    /// `kappa`: gain in front of the stages.
    #[must_use]
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// Actuator lags (s) that the structure has.
    #[must_use]
    pub fn lags_s(&self) -> &[f64] {
        &self.lags_s[..self.structure.stages().lags]
    }

    /// Pole `a = 1/T_body` (1/s). Zero if the structure has none.
    #[must_use]
    pub fn pole_per_s(&self) -> f64 {
        self.pole_per_s
    }

    /// Coefficients `c1` (1/s) and `c0` (1/s^2) of the second-order stage. Zero if the structure has none.
    #[must_use]
    pub fn pair(&self) -> [f64; 2] {
        self.pair
    }

    /// Dead time (s).
    #[must_use]
    pub fn tau_s(&self) -> f64 {
        self.tau_s
    }

    /// Value of a parameter in its [unit](Structure::unit); infinite without damping. `None` if the structure does not
    /// have the parameter.
    #[must_use]
    pub fn parameter(&self, parameter: Parameter) -> Option<f64> {
        let stages = self.structure.stages();
        let has = |condition: bool, value: f64| condition.then_some(value);
        let [c1, c0] = self.pair;
        let body = stages.poles > 0;
        match parameter {
            Parameter::K if body => Some(self.gain / self.pole_per_s),
            Parameter::K if stages.pairs > 0 => Some(self.gain / c0),
            Parameter::K => has(stages.integrators == 1, self.gain),
            Parameter::KOverTBody => has(body || stages.integrators == 2, self.gain),
            Parameter::TProp => has(stages.lags > 0, self.lags_s[0]),
            Parameter::TProp2 => has(stages.lags > 1, self.lags_s[1]),
            Parameter::TBody => has(body, 1.0 / self.pole_per_s),
            Parameter::InverseTBody => has(body, self.pole_per_s),
            Parameter::NaturalFrequency => has(stages.pairs > 0, c0.max(0.0).sqrt()),
            Parameter::Zeta => has(stages.pairs > 0, 0.5 * c1 / c0.max(0.0).sqrt()),
            Parameter::Tau => Some(self.tau_s),
            Parameter::InputBias => None,
        }
    }

    /// Frequency response `G(jw)` (output unit / input unit) at the frequency `w` (rad/s).
    #[must_use]
    pub fn frequency_response(&self, omega_rad_per_s: f64) -> Complex64 {
        let s = Complex64::new(0.0, omega_rad_per_s);
        let stages = self.structure.stages();
        let [c1, c0] = self.pair;
        let mut denominator = s.powu(stages.integrators as u32);
        for lag_s in self.lags_s() {
            denominator *= s * lag_s + 1.0;
        }
        if stages.poles > 0 {
            denominator *= s + self.pole_per_s;
        }
        if stages.pairs > 0 {
            denominator *= s * s + s * c1 + c0;
        }
        (-s * self.tau_s).exp() * self.gain / denominator
    }

    /// The same process as [`Soiptd`]. `None` for another structure, and for parameters that no stable process has.
    #[must_use]
    pub fn soiptd(&self) -> Option<Soiptd> {
        let damping_per_s = match self.structure {
            Structure::Soiptd => self.pole_per_s,
            Structure::DoubleIntegratorLag => 0.0,
            _ => return None,
        };
        Soiptd::from_acceleration_gain(self.gain, self.lags_s[0], damping_per_s, self.tau_s).ok()
    }
}

impl From<Soiptd> for Linear {
    fn from(process: Soiptd) -> Self {
        Self::new(Structure::Soiptd)
            .with_gain(process.k_over_t_body())
            .with_lags_s([process.t_prop_s(), 1.0])
            .with_pole_per_s(process.inv_t_body_per_s())
            .with_tau_s(process.tau_s())
    }
}
