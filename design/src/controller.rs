//! Controllers: their form and gains.
//!
//! | form | law |
//! |------|-----|
//! | [`Form::Pd`] | `u = Kp (r - y) - Kd dy/dt` |

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
    /// Short name, the same in JSON and on command lines.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pd => "pd",
        }
    }

    /// Control law, in the symbols of its gains.
    #[must_use]
    pub fn law(self) -> &'static str {
        match self {
            Self::Pd => "u = Kp (r - y) - Kd dy/dt",
        }
    }
}

/// A controller: a form with its gains, in input unit / output unit and seconds.
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
    /// Its form.
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

    /// The gains of a PD; `None` for another form.
    #[must_use]
    pub fn pd(&self) -> Option<Pd> {
        match self {
            Self::Pd(pd) => Some(*pd),
        }
    }

    /// Frequency response of the feedback path, from `-y` to `u`, at a frequency (rad/s): input unit / output unit.
    #[must_use]
    pub fn frequency_response(&self, omega_rad_per_s: f64) -> Complex64 {
        Complex64::new(self.kp(), self.kd() * omega_rad_per_s)
    }
}
