//! Controllers: form and gains.
//!
//! | form | law |
//! |------|-----|
//! | [`Form::P`] | `u = Kp (r - yf)` |
//! | [`Form::Pi`] | `u = Kp (b r - yf) + Ki int (r - yf)` |
//! | [`Form::Pd`] | `u = Kp (r - y) - Kd dy/dt` |
//! | [`Form::Pid`] | `u = Kp (b r - yf) + Ki int (r - yf) - Kd dyf/dt` |
//! | [`Form::CascadePi`], [`Form::CascadePid`] | a proportional angle loop around a rate loop: see [`Autopilot`] |
//!
//! | symbol | meaning | unit |
//! |--------|---------|------|
//! | `r` | reference | output unit |
//! | `y` | output of the process | output unit |
//! | `yf` | `y` behind the measurement filter | output unit |
//! | `u` | output of the controller | input unit |
//! | `Kp` | proportional gain | input unit / output unit |
//! | `Ki` | integral gain | input unit / (output unit s) |
//! | `Kd` | derivative gain | input unit s / output unit |
//! | `b` | set-point weight | 1 |

mod autopilot;
mod execution;
mod pid;
mod vendor;

use num_complex::Complex64;
use onecycle_onboard::Pd;

pub use autopilot::Autopilot;
pub use execution::{Execution, LowPass};
pub use pid::{Ideal, Pid, Series};
pub use vendor::{Spans, TypedGain, Vendor, VendorError, VendorLaw};

/// Form of a controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Form {
    /// Proportional.
    P,
    /// Proportional and integral.
    Pi,
    /// Proportional on the error, derivative on the measurement.
    Pd,
    /// Proportional, integral, and derivative on the measurement.
    #[default]
    Pid,
    /// Proportional angle loop around a rate loop with PI.
    CascadePi,
    /// Proportional angle loop around a rate loop with PID, derivative on the measured rate.
    CascadePid,
}

impl Form {
    /// Every form.
    pub const ALL: [Self; 6] = [
        Self::P,
        Self::Pi,
        Self::Pd,
        Self::Pid,
        Self::CascadePi,
        Self::CascadePid,
    ];

    /// Name in JSON and on command lines.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::P => "p",
            Self::Pi => "pi",
            Self::Pd => "pd",
            Self::Pid => "pid",
            Self::CascadePi => "cascade_pi",
            Self::CascadePid => "cascade_pid",
        }
    }

    /// Form of this [name](Self::name).
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|form| form.name() == name)
    }

    /// Control law as text.
    #[must_use]
    pub fn law(self) -> &'static str {
        match self {
            Self::P => "u = Kp (r - yf)",
            Self::Pi => "u = Kp (b r - yf) + Ki int (r - yf)",
            Self::Pd => "u = Kp (r - y) - Kd dy/dt",
            Self::Pid => "u = Kp (b r - yf) + Ki int (r - yf) - Kd dyf/dt",
            Self::CascadePi => "u = Kr ((w_ref - w) + Ki int (w_ref - w)), w_ref = Ka (r - yf)",
            Self::CascadePid => {
                "u = Kr ((w_ref - w) + Ki int (w_ref - w) - Kd dw/dt), w_ref = Ka (r - yf)"
            }
        }
    }

    /// Whether the controller has an integral term.
    #[must_use]
    pub fn has_integral(self) -> bool {
        !matches!(self, Self::P | Self::Pd)
    }
}

/// Controller: a form and its gains.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Controller {
    /// Proportional on the error, derivative on the measurement, continuous and without filter.
    Pd(Pd),
    /// P, PI, PD or PID with filters and sampling.
    Pid(Pid),
    /// Cascade of an autopilot with filters and sampling.
    Autopilot(Autopilot),
}

impl From<Pd> for Controller {
    fn from(pd: Pd) -> Self {
        Self::Pd(pd)
    }
}

impl From<Pid> for Controller {
    fn from(pid: Pid) -> Self {
        Self::Pid(pid)
    }
}

impl From<Autopilot> for Controller {
    fn from(autopilot: Autopilot) -> Self {
        Self::Autopilot(autopilot)
    }
}

impl Controller {
    /// Form of the controller. The terms with a gain of zero are left out.
    #[must_use]
    pub fn form(&self) -> Form {
        match self {
            Self::Pd(_) => Form::Pd,
            Self::Pid(pid) => match (pid.ki != 0.0, pid.kd != 0.0) {
                (false, false) => Form::P,
                (true, false) => Form::Pi,
                (false, true) => Form::Pd,
                (true, true) => Form::Pid,
            },
            Self::Autopilot(autopilot) if autopilot.gains.rate_d != 0.0 => Form::CascadePid,
            Self::Autopilot(_) => Form::CascadePi,
        }
    }

    /// The controller as a PID in parallel form. A cascade loses its derivative of the rate.
    #[must_use]
    pub fn pid(&self) -> Pid {
        match self {
            Self::Pd(pd) => Pid::new(pd.kp, 0.0, pd.kd),
            Self::Pid(pid) => *pid,
            Self::Autopilot(autopilot) => autopilot.pid(),
        }
    }

    /// Proportional gain (input unit / output unit).
    #[must_use]
    pub fn kp(&self) -> f64 {
        self.pid().kp
    }

    /// Integral gain (input unit / (output unit s)).
    #[must_use]
    pub fn ki(&self) -> f64 {
        self.pid().ki
    }

    /// Derivative gain (input unit s / output unit).
    #[must_use]
    pub fn kd(&self) -> f64 {
        self.pid().kd
    }

    /// Gains of a PD without filter. `None` for another form.
    #[must_use]
    pub fn pd(&self) -> Option<Pd> {
        match self {
            Self::Pd(pd) => Some(*pd),
            _ => None,
        }
    }

    /// Known filters and sampling.
    #[must_use]
    pub fn execution(&self) -> Execution {
        self.pid().execution
    }

    /// Frequency response of the feedback path, from `-y` to `u` (input unit / output unit), at a frequency (rad/s):
    /// filters and the dead time of sampling included.
    #[must_use]
    pub fn frequency_response(&self, omega_rad_per_s: f64) -> Complex64 {
        let omega = omega_rad_per_s;
        if let Self::Pd(pd) = self {
            return Complex64::new(pd.kp, pd.kd * omega);
        }
        let s = Complex64::new(0.0, omega);
        let pid = self.pid();
        let filtered = |filter: Option<LowPass>| {
            filter.map_or(Complex64::ONE, |low_pass| {
                low_pass.frequency_response(omega)
            })
        };
        let derivative = filtered(pid.execution.derivative_filter);
        let terms = match self {
            Self::Autopilot(Autopilot { gains, .. }) => {
                s * pid.kd + s * s * gains.rate_p * gains.rate_d * derivative
            }
            _ => s * pid.kd * derivative,
        } + pid.kp;
        let integral = if pid.ki == 0.0 {
            Complex64::ZERO
        } else {
            pid.ki / s
        };
        let measurement = LowPass::SecondOrder(pid.filter_s).frequency_response(omega)
            * filtered(pid.execution.sensor_filter)
            * filtered(pid.execution.recorded_filter);
        let recorded_s = pid.execution.recorded_filter.map_or(0.0, LowPass::time_s);
        let dead_time_s = pid.execution.dead_time_s() - recorded_s;
        (terms + integral) * measurement * Complex64::cis(-omega * dead_time_s)
    }
}
