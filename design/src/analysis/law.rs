//! The controller of a loop, in the units of its process.
//!
//! ```text
//! u = kp (b r - ym) + ki int (r - ym) - kd dym/dt - kf dh/dt - k2 d^2h/dt^2,     ym = F S y,    h = H ym
//! ```
//!
//! `S` is the filter of the measurement and part of the [`Process`], `F` the second-order filter with time `tf`, `H` the
//! filter of the derivative. A PID has `kd`, or `kf` with `H`; a cascade has `kd`, and `k2` for the derivative of the rate.

use crate::controller::{Controller, LowPass, Pid};

use super::polynomial::Polynomial;
use super::process::Process;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Law {
    pub kp: f64,
    pub ki: f64,
    pub kd: f64,
    pub kf: f64,
    pub k2: f64,
    /// Time of the filter `F`. Zero: none.
    pub tf: f64,
    /// The filter `H`.
    pub derivative_filter: Option<LowPass>,
    /// Set-point weight.
    pub b: f64,
}

impl Law {
    /// PID with these gains and this filter time. The derivative filter of the process acts on the derivative.
    pub(crate) fn pid(process: &Process, gains: [f64; 3], tf: f64) -> Self {
        let [kp, ki, kd] = gains;
        let filtered = process.derivative_filter.is_some();
        Self {
            kp,
            ki,
            kd: if filtered { 0.0 } else { kd },
            kf: if filtered { kd } else { 0.0 },
            k2: 0.0,
            tf,
            derivative_filter: process.derivative_filter,
            b: 1.0,
        }
    }

    /// Law of a controller in the units of `process`. With a process of negative gain, the gains change sign.
    pub(crate) fn new(process: &Process, controller: &Controller) -> Self {
        let pid = controller.pid();
        let (k, t) = (process.gain, process.unit_s);
        let tf = pid.filter_s / t;
        let law = match controller {
            Controller::Autopilot(autopilot) => {
                let gains = autopilot.gains;
                Self {
                    kd: pid.kd * k / t,
                    kf: 0.0,
                    k2: gains.rate_p * gains.rate_d * k / (t * t),
                    ..Self::pid(process, [pid.kp * k, pid.ki * k * t, 0.0], tf)
                }
            }
            _ => Self::pid(process, [pid.kp * k, pid.ki * k * t, pid.kd * k / t], tf),
        };
        Self {
            b: pid.setpoint_weight,
            ..law
        }
    }

    /// The controller of this law in the units of the user, as a PID.
    pub(crate) fn controller(&self, process: &Process) -> Pid {
        let (k, t) = (process.gain, process.unit_s);
        Pid::new(self.kp / k, self.ki / (k * t), (self.kd + self.kf) * t / k)
            .with_filter_s(self.tf * t)
            .with_setpoint_weight(self.b)
    }

    /// The law with all gains times `factor`.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        Self {
            kp: self.kp * factor,
            ki: self.ki * factor,
            kd: self.kd * factor,
            kf: self.kf * factor,
            k2: self.k2 * factor,
            ..*self
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        [self.kp, self.ki, self.kd, self.kf, self.k2, self.tf, self.b]
            .iter()
            .all(|value| value.is_finite())
            && self.tf >= 0.0
    }

    /// Whether the filter `H` is in use.
    pub(crate) fn uses_derivative_filter(&self) -> bool {
        self.derivative_filter.is_some() && (self.kf != 0.0 || self.k2 != 0.0)
    }

    /// Numerator and denominator of the feedback path, with `F` and `H`, without the filter of the measurement.
    pub(crate) fn transfer(&self) -> (Polynomial, Polynomial) {
        let one = Polynomial::new(&[1.0]);
        let h = match self.derivative_filter {
            Some(filter) if self.uses_derivative_filter() => Polynomial::new(&filter.denominator()),
            _ => one,
        };
        let integral = usize::from(self.ki != 0.0);
        let direct = if integral == 1 {
            Polynomial::new(&[self.ki, self.kp, self.kd])
        } else {
            Polynomial::new(&[self.kp, self.kd])
        };
        let numerator =
            (direct.times(&h))
                .plus(self.kf, 1 + integral, &one)
                .plus(self.k2, 2 + integral, &one);
        let filter = Polynomial::new(&LowPass::SecondOrder(self.tf).denominator());
        let denominator = Polynomial::new(&[]).plus(1.0, integral, &h).times(&filter);
        (numerator, denominator)
    }
}
