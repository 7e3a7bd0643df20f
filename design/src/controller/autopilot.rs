//! Cascade of an autopilot: a proportional angle loop around a rate loop with PI or PID.
//!
//! ```text
//! u = rate_p ((w_ref - w) + rate_i int (w_ref - w) dt - rate_d H dw/dt),    w = d(F y)/dt,    w_ref = angle_p (r - F y)
//! ```
//!
//! `F` is the measurement filter, `H` the derivative filter of the [`Execution`]. Without `rate_d` the cascade is a PID:
//! `kp = rate_p (angle_p + rate_i)`, `ki = rate_p rate_i angle_p`, `kd = rate_p`, set-point weight
//! `angle_p / (angle_p + rate_i)`. In PX4 the gains are `MC_ROLL_P`, and `MC_ROLLRATE_P`, `_I`, `_D` in parallel form with
//! `MC_ROLLRATE_K` = 1: `_P = rate_p`, `_I = rate_p rate_i`, `_D = rate_p rate_d`. ArduPilot's D acts on the error.

use super::execution::Execution;
use super::pid::Pid;
use crate::cascade::Cascade;

/// Cascade with its filters and sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Autopilot {
    /// Gains.
    pub gains: Cascade,
    /// Time `Tf` of the measurement filter (s). Zero: no filter.
    pub filter_s: f64,
    /// Known filters and sampling.
    pub execution: Execution,
}

impl From<Cascade> for Autopilot {
    fn from(gains: Cascade) -> Self {
        Self {
            gains,
            filter_s: 0.0,
            execution: Execution::default(),
        }
    }
}

impl Autopilot {
    /// Sets the time of the measurement filter (s).
    #[must_use]
    pub fn with_filter_s(self, filter_s: f64) -> Self {
        Self { filter_s, ..self }
    }

    /// Sets known filters and sampling.
    #[must_use]
    pub fn with_execution(self, execution: Execution) -> Self {
        Self { execution, ..self }
    }

    /// The PID with the same terms, without `rate_d`.
    #[must_use]
    pub fn pid(&self) -> Pid {
        let Cascade {
            angle_p,
            rate_p,
            rate_i,
            ..
        } = self.gains;
        let sum = angle_p + rate_i;
        let weight = if sum == 0.0 { 1.0 } else { angle_p / sum };
        Pid::new(rate_p * sum, rate_p * rate_i * angle_p, rate_p)
            .with_filter_s(self.filter_s)
            .with_setpoint_weight(weight)
            .with_execution(self.execution)
    }
}
