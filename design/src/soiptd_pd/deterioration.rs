//! Deterioration: cost of a controller on a process, relative to the optimum of that process.
//!
//! ```text
//! deterioration = (J(process, controller) - J*) / J*,    J* = J(process, its optimum)
//! ```
//!
//! `J` is the ISE of a unit step (output unit^2 s). `J*` is the least cost *at a phase margin*, so the deterioration
//! can be negative: a controller that leaves less margin may follow a step faster. Read it together with the phase
//! margin.
//!
//! Reference: the `J_ij` of the paper's equation 8 (Ayyad, Chehadeh, Awad, Zweiri 2020).

use onecycle_onboard::{Pd, Soiptd};

use crate::soiptd_pd::cost::ise;
use crate::soiptd_pd::margins::margins;
use crate::soiptd_pd::optimum::{Optimum, OptimumError, pd};

/// Least phase margin of the controllers that are compared (degrees): the paper's.
pub const PHASE_MARGIN_DEG: f64 = 20.0;

/// Performance of a controller on a process that it was not designed for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Deterioration {
    /// The loop is stable.
    Stable {
        /// Cost minus the cost of the optimum, as a fraction of the cost of the optimum.
        relative: f64,
        /// Phase margin of the loop (rad).
        phase_margin_rad: f64,
    },
    /// The loop is unstable, so it has no finite cost.
    Unstable,
}

impl Deterioration {
    /// Cost minus the cost of the optimum, as a fraction of the cost of the optimum. `None` if the loop is unstable.
    #[must_use]
    pub fn relative(&self) -> Option<f64> {
        match *self {
            Self::Stable { relative, .. } => Some(relative),
            Self::Unstable => None,
        }
    }
}

/// Deterioration of `controller` on `process`. `optimum` is the optimum of the same process, at the phase margin of the
/// comparison.
#[must_use]
pub fn deterioration(controller: Pd, process: &Soiptd, optimum: &Optimum) -> Deterioration {
    match (ise(process, controller), margins(process, controller)) {
        (Some(cost), Some(margins)) => Deterioration::Stable {
            relative: (cost - optimum.ise) / optimum.ise,
            phase_margin_rad: margins.phase_margin_rad,
        },
        _ => Deterioration::Unstable,
    }
}

/// A process with its optimum at [`PHASE_MARGIN_DEG`]: what controllers on it are compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// The process.
    pub process: Soiptd,
    /// Its PD of least ISE.
    pub optimum: Optimum,
}

impl Reference {
    /// The reference for controllers on this process.
    ///
    /// # Errors
    /// [`OptimumError`]: the process is too extreme to have an optimum.
    pub fn new(process: &Soiptd) -> Result<Self, OptimumError> {
        Ok(Self {
            process: *process,
            optimum: pd(process, PHASE_MARGIN_DEG.to_radians())?,
        })
    }

    /// Deterioration of a controller on the process.
    #[must_use]
    pub fn deterioration(&self, controller: Pd) -> Deterioration {
        deterioration(controller, &self.process, &self.optimum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::soiptd_pd::optimum::pd_at_phase_margin;

    // The deterioration of the optimum itself is zero. Five times its gains exceed the gain margin of 2.26: unstable.
    #[test]
    fn own_optimum_and_unstable_gain() {
        let process = Soiptd::new(1.0, 0.3, 2.0, 0.1).unwrap();
        let margin = 20_f64.to_radians();
        let best = pd_at_phase_margin(&process, margin).unwrap();
        match deterioration(best.pd, &process, &best) {
            Deterioration::Stable {
                relative,
                phase_margin_rad,
            } => {
                assert!(relative.abs() < 1e-14, "{relative}");
                assert!((phase_margin_rad - margin).abs() < 1e-14);
            }
            Deterioration::Unstable => panic!("the optimum is stable"),
        }
        let hot = Pd {
            kp: 5.0 * best.pd.kp,
            kd: 5.0 * best.pd.kd,
        };
        assert_eq!(deterioration(hot, &process, &best), Deterioration::Unstable);
        assert_eq!(Deterioration::Unstable.relative(), None);
    }

    // T_prop, T_body, tau = 0.3, 2, 0.1 s: the optimum at 15 deg costs 6.02 % less than the optimum at 20 deg, because
    // it leaves less phase margin.
    #[test]
    fn less_margin_may_cost_less() {
        let process = Soiptd::new(1.0, 0.3, 2.0, 0.1).unwrap();
        let [at_15, at_20] = [15_f64, 20.0]
            .map(|margin_deg| pd_at_phase_margin(&process, margin_deg.to_radians()).unwrap());
        match deterioration(at_15.pd, &process, &at_20) {
            Deterioration::Stable {
                relative,
                phase_margin_rad,
            } => {
                assert!((relative + 0.0602).abs() < 5e-5, "{relative}");
                assert!((phase_margin_rad.to_degrees() - 15.0).abs() < 1e-12);
            }
            Deterioration::Unstable => panic!("15 deg is stable"),
        }
    }
}
