//! Criteria of a controller: integrals of the error of a unit step of the reference.
//!
//! ```text
//! ISE  = int e^2 dt   (output unit^2 s)
//! IAE  = int |e| dt   (output unit s)
//! ITAE = int t |e| dt (output unit s^2)
//! ```
//!
//! The ISE has a [closed form](mod@crate::soiptd_pd::cost). The other two are integrated over the exact response
//! ([`mod@crate::soiptd_pd::step_response`]), at 16 steps per radian of the gain crossover. Between two nodes the
//! integrand is the Hermite cubic through its values and slopes; where the error changes its sign, two triangles. Their
//! relative error is below 1e-4.
//!
//! The paper leaves the cost open ("IAE, ISE, etc.", its equation 8) and uses the ISE.

use onecycle_onboard::{Pd, Soiptd};

use crate::soiptd_pd::cost::ise;
use crate::soiptd_pd::open_loop::OpenLoop;
use crate::soiptd_pd::propagation::State;
use crate::soiptd_pd::step_response::{Grid, simulate};

/// Steps per radian of the gain crossover: the error of the response is `(1/16)^4 / 384` = 4e-8.
const STEPS_PER_RADIAN: f64 = 16.0;

/// The integral of the error that a controller minimises. See the [module](self).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Criterion {
    /// Integral of the squared error: the paper's.
    #[default]
    Ise,
    /// Integral of the absolute error.
    Iae,
    /// Integral of the absolute error, weighted by time.
    Itae,
}

impl Criterion {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Ise, Self::Iae, Self::Itae];

    /// Name in arguments and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ise => "ise",
            Self::Iae => "iae",
            Self::Itae => "itae",
        }
    }

    /// Power of a unit of time in the cost: stretching time by `a` multiplies the cost by `a` to this power.
    #[must_use]
    pub fn power_of_time(self) -> i32 {
        match self {
            Self::Ise | Self::Iae => 1,
            Self::Itae => 2,
        }
    }

    /// Cost of a unit step of the reference. `None` if the closed loop is unstable or takes too long to settle.
    #[must_use]
    pub fn cost(self, process: &Soiptd, pd: Pd) -> Option<f64> {
        match self {
            Self::Ise => ise(process, pd),
            Self::Iae => absolute_error(process, pd, 0),
            Self::Itae => absolute_error(process, pd, 1),
        }
    }
}

/// `int t^power |e| dt` of a unit step.
fn absolute_error(process: &Soiptd, pd: Pd, power: i32) -> Option<f64> {
    let open_loop = OpenLoop::new(process, pd)?;
    let crossover = open_loop.gain_crossover();
    let phase_margin_rad = open_loop.phase_above_minus_pi(crossover);
    if phase_margin_rad.is_nan() || phase_margin_rad <= 0.0 {
        return None;
    }
    let grid = Grid::of(&open_loop, crossover, STEPS_PER_RADIAN);
    let states = simulate(&open_loop, crossover, grid).ok()?;
    // Value and slope of t^power e, per step.
    let node = |(n, state): (usize, &State)| {
        let t_s = open_loop.tau_s + n as f64 * grid.step_s;
        let (error, slope) = (1.0 - state[0], -state[1]);
        match power {
            0 => (error, slope),
            _ => (t_s * error, grid.step_s * error + t_s * slope),
        }
    };
    // The error is one during the dead time.
    let start = open_loop.tau_s.powi(power + 1) / f64::from(power + 1);
    let nodes: Vec<(f64, f64)> = states.iter().enumerate().map(node).collect();
    let cells = nodes.windows(2).map(|ends| cell(ends[0], ends[1]));
    Some(start + grid.step_s * cells.sum::<f64>())
}

/// Integral over a cell of length one of the absolute value of a function with these values and slopes at its ends.
fn cell((before, slope_before): (f64, f64), (after, slope_after): (f64, f64)) -> f64 {
    if before * after < 0.0 {
        let (before, after) = (before.abs(), after.abs());
        0.5 * (before * before + after * after) / (before + after)
    } else {
        (0.5 * (before + after) + (slope_before - slope_after) / 12.0).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::soiptd_pd::optimum::pd_at_phase_margin;

    fn loop_at(margin_deg: f64) -> (Soiptd, Pd) {
        let process = Soiptd::new(2.0, 0.3, 2.0, 0.1).unwrap();
        let pd = pd_at_phase_margin(&process, margin_deg.to_radians()).unwrap();
        (process, pd.pd)
    }

    // A response that does not overshoot has an error of one sign, so the integrals are those of e itself, which follow
    // from E(s) = (1 + Kd s G) / (s (1 + (Kp + Kd s) G)) at s = 0. With s G = K (1 - a s + ..), a = T_prop + T_body + tau:
    //   E = (1 + Kd K - Kd K a s) / (Kp K + (1 + Kd K - Kp K a) s + ..),  int e = E(0) = (1 + Kd K) / (Kp K),
    //   int t e = -E'(0) = (Kd K a + E(0) (1 + Kd K - Kp K a)) / (Kp K).
    #[test]
    fn a_response_without_overshoot_by_hand() {
        let (process, _) = loop_at(20.0);
        let pd = Pd { kp: 0.05, kd: 0.02 };
        let (kp, kd, a) = (2.0 * pd.kp, 2.0 * pd.kd, 0.3 + 2.0 + 0.1);
        let iae = (1.0 + kd) / kp;
        let itae = (kd * a + iae * (1.0 + kd - kp * a)) / kp;
        let response = crate::soiptd_pd::step_response(&process, pd).unwrap();
        assert!(response.metrics.overshoot < 1e-4, "{:?}", response.metrics);
        let found = [Criterion::Iae, Criterion::Itae].map(|one| one.cost(&process, pd).unwrap());
        assert!((found[0] / iae - 1.0).abs() < 1e-4, "{found:?} {iae}");
        assert!((found[1] / itae - 1.0).abs() < 1e-3, "{found:?} {itae}");
    }

    // An oscillating response: against the trapezoidal rule on the samples of the step response, four times as dense.
    #[test]
    fn an_oscillating_response_by_quadrature() {
        for margin_deg in [5.0, 20.0, 60.0] {
            let (process, pd) = loop_at(margin_deg);
            let response = crate::soiptd_pd::step_response(&process, pd).unwrap();
            for (criterion, power) in [(Criterion::Iae, 0), (Criterion::Itae, 1)] {
                let g = |sample: &crate::soiptd_pd::Sample| {
                    sample.t_s.powi(power) * (1.0 - sample.y).abs()
                };
                let cells = response.samples.windows(2);
                let sum: f64 = cells
                    .map(|ends| 0.5 * (ends[1].t_s - ends[0].t_s) * (g(&ends[0]) + g(&ends[1])))
                    .sum();
                let found = criterion.cost(&process, pd).unwrap();
                assert!(
                    (found / sum - 1.0).abs() < 5e-4,
                    "{criterion:?} {found} {sum}"
                );
            }
        }
    }

    // Times three times as long: three times the IAE, nine times the ITAE. Powers of two would be exact.
    #[test]
    fn time_scales() {
        let (process, pd) = loop_at(20.0);
        let slow = Soiptd::new(2.0 / 3.0, 0.9, 6.0, 0.3).unwrap();
        let slower = Pd {
            kp: pd.kp,
            kd: 3.0 * pd.kd,
        };
        for criterion in Criterion::ALL {
            let [one, other] = [(&process, pd), (&slow, slower)]
                .map(|(process, pd)| criterion.cost(process, pd).unwrap());
            let factor = 3.0_f64.powi(criterion.power_of_time());
            assert!((other / one / factor - 1.0).abs() < 1e-8, "{criterion:?}");
        }
    }

    #[test]
    fn unstable_loops_have_no_cost() {
        let (process, pd) = loop_at(20.0);
        let hot = Pd {
            kp: 5.0 * pd.kp,
            kd: 5.0 * pd.kd,
        };
        assert_eq!(Criterion::ALL.map(|one| one.cost(&process, hot)), [None; 3]);
    }
}
