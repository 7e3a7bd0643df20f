//! Controllers: form and gains.
//!
//! | form | law |
//! |------|-----|
//! | [`Form::Pd`] | `u = Kp (r - y) - Kd dy/dt` |
//!
//! | symbol | meaning | unit |
//! |--------|---------|------|
//! | `r` | reference | output unit |
//! | `y` | output of the process | output unit |
//! | `u` | output of the controller | input unit |
//! | `Kp` | proportional gain | input unit / output unit |
//! | `Kd` | derivative gain | input unit s / output unit |

use num_complex::Complex64;
use onecycle_onboard::Pd;

/// Form of a controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Form {
    /// Proportional on the error, derivative on the measurement.
    #[default]
    Pd,
}

impl Form {
    /// Name in JSON and on command lines.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pd => "pd",
        }
    }

    /// Control law as text.
    #[must_use]
    pub fn law(self) -> &'static str {
        match self {
            Self::Pd => "u = Kp (r - y) - Kd dy/dt",
        }
    }
}

/// Controller: a form and its gains.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Controller {
    /// Proportional on the error, derivative on the measurement.
    Pd(Pd),
}

impl From<Pd> for Controller {
    fn from(pd: Pd) -> Self {
        Self::Pd(pd)
    }
}

impl Controller {
    /// Form of the controller.
    #[must_use]
    pub fn form(&self) -> Form {
        match self {
            Self::Pd(_) => Form::Pd,
        }
    }

    /// Proportional gain (input unit / output unit).
    #[must_use]
    pub fn kp(&self) -> f64 {
        match self {
            Self::Pd(pd) => pd.kp,
        }
    }

    /// Derivative gain (input unit s / output unit).
    #[must_use]
    pub fn kd(&self) -> f64 {
        match self {
            Self::Pd(pd) => pd.kd,
        }
    }

    /// Gains of a PD. `None` for another form.
    #[must_use]
    pub fn pd(&self) -> Option<Pd> {
        match self {
            Self::Pd(pd) => Some(*pd),
        }
    }

    /// Frequency response of the feedback path, from `-y` to `u` (input unit / output unit), at a frequency (rad/s).
    #[must_use]
    pub fn frequency_response(&self, omega_rad_per_s: f64) -> Complex64 {
        Complex64::new(self.kp(), self.kd() * omega_rad_per_s)
    }
}
