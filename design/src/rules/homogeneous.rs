//! Homogeneous tuning rules: a PID from one relay oscillation, with a given phase margin.
//!
//! ```text
//! Kc = c1/|G|,   Ti = c2 P,   Td = c3 P                      |G| = pi a/(4 h), period P of the oscillation
//! beta = sin(PM + arctan(1/(2 pi c2) - 2 pi c3))             parameter of the relay
//! c1 sqrt(1 + (2 pi c3 - 1/(2 pi c2))^2) = 1
//! ```
//!
//! The relay oscillates where `arg G = -pi + asin(beta)`. There `C = Kc (1 + 1/(s Ti) + s Td)` has the magnitude `1/|G|` and
//! the phase that is missing to the phase margin `PM`: the oscillation is the gain crossover of the PID, for any process.
//!
//! Of the two free numbers `c2` and `c3` the paper takes those of least ISE after a step of the reference. With an integrating
//! process that makes `c2` infinite, a PD: an integral term only adds overshoot. So [`Style::Paper`](crate::Style::Paper)
//! designs a PD.
//!
//! Reference: the paper's equations 11 to 13, from I. Boiko, "Non-parametric Tuning of PID Controllers" (Springer, 2013).

use std::f64::consts::TAU;

use crate::controller::{Ideal, Pid};

/// Parameter of the relay and the three numbers of a rule.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Homogeneous {
    /// Parameter of the relay, -1 to 1; negative for a leading relay.
    pub beta: f64,
    /// Gain times the amplitude ratio of the oscillation.
    pub c1: f64,
    /// Integral time as a share of the period. Infinite without integral.
    pub c2: f64,
    /// Derivative time as a share of the period.
    pub c3: f64,
}

impl Homogeneous {
    /// Rule with this phase margin (rad) and these integral and derivative times (shares of the period).
    ///
    /// `None` if the integral time is not positive or the derivative time negative, or if no relay oscillates at the gain
    /// crossover: its phase must lie between -270 and -90 degrees.
    #[must_use]
    pub fn new(phase_margin_rad: f64, c2: f64, c3: f64) -> Option<Self> {
        let slope = TAU * c3 - 1.0 / (TAU * c2);
        let relay_rad = phase_margin_rad - slope.atan();
        let is_possible = c2 > 0.0 && c3 >= 0.0 && relay_rad.abs() < TAU / 4.0;
        is_possible.then(|| Self {
            beta: relay_rad.sin(),
            c1: 1.0 / 1.0_f64.hypot(slope),
            c2,
            c3,
        })
    }

    /// Rule of a PD with this lead and this phase margin (rad), both from 0 to `pi/2`.
    #[must_use]
    pub fn from_lead(lead_rad: f64, phase_margin_rad: f64) -> Self {
        Self {
            beta: (phase_margin_rad - lead_rad).sin(),
            c1: lead_rad.cos(),
            c2: f64::INFINITY,
            c3: lead_rad.tan() / TAU,
        }
    }

    /// The PID from an oscillation: its `|G|` (output unit / input unit) and its period (s).
    #[must_use]
    pub fn pid(&self, amplitude_ratio: f64, period_s: f64) -> Pid {
        let gain = self.c1 / amplitude_ratio;
        Ideal::new(gain, self.c2 * period_s, self.c3 * period_s).pid()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use onecycle_onboard::Soiptd;

    use super::*;
    use crate::soiptd_pd::optimum::pd_at_phase_margin;
    use crate::{Model, ise, margins};

    fn process() -> Soiptd {
        Soiptd::new(3.0, 0.3, 2.0, 0.1).unwrap()
    }

    /// The PID of a rule on a process, at the oscillation of the describing function.
    fn on(process: &Soiptd, rule: &Homogeneous) -> (Pid, f64) {
        let omega = process.frequency_at_phase(-PI + rule.beta.asin()).unwrap();
        (rule.pid(process.magnitude(omega), TAU / omega), omega)
    }

    // The paper's PD has a phase margin of 20 deg and its relay a distinguishing phase of -46.9 deg, beta = -0.73: then
    // arctan(2 pi c3) = 66.9 deg, so c1 = cos(66.9 deg) = 0.392, c3 = tan(66.9 deg)/(2 pi) = 0.373.
    #[test]
    fn the_papers_pd() {
        let c3 = 66.89_f64.to_radians().tan() / TAU;
        let rule = Homogeneous::new(20_f64.to_radians(), f64::INFINITY, c3).unwrap();
        assert!((rule.beta + 0.73).abs() < 1e-3, "{rule:?}");
        assert!((rule.c1 - 0.3925).abs() < 1e-4, "{rule:?}");
        assert!((rule.c3 - 0.3730).abs() < 1e-3, "{rule:?}");
        let best = pd_at_phase_margin(&process(), 20_f64.to_radians()).unwrap();
        let (pid, _) = on(&process(), &rule);
        assert!((pid.kp / best.pd.kp - 1.0).abs() < 2e-3, "{pid:?} {best:?}");
        assert_eq!(pid.ki, 0.0);
    }

    // The relay of the optimum's rule oscillates, by the describing function, at the optimum's crossover, so the rule gives
    // back the optimum: for (0.3, 2, 0.1) asin(beta) = -46.88 deg. It is the rule with this derivative time.
    #[test]
    fn a_lead_gives_back_the_optimum() {
        let margin_rad = 20_f64.to_radians();
        let best = pd_at_phase_margin(&process(), margin_rad).unwrap();
        let rule = Homogeneous::from_lead(best.lead_rad, margin_rad);
        let beta_deg = rule.beta.asin().to_degrees();
        assert!((beta_deg + 46.88).abs() < 0.005, "{beta_deg}");
        let (pid, _) = on(&process(), &rule);
        assert!((pid.kp / best.pd.kp - 1.0).abs() < 1e-12);
        assert!((pid.kd / best.pd.kd - 1.0).abs() < 1e-12);
        let same = Homogeneous::new(margin_rad, f64::INFINITY, rule.c3).unwrap();
        assert!((same.c1 - rule.c1).abs() < 1e-15 && (same.beta - rule.beta).abs() < 1e-15);
    }

    // Equations 12 and 13 make the oscillation the gain crossover, with the specified phase margin: to rounding.
    #[test]
    fn the_loop_has_the_phase_margin() {
        let process = process();
        for (margin_deg, c2, c3) in [(20.0_f64, 1.0, 0.37), (45.0, 2.0, 0.4), (30.0, 0.5, 0.6)] {
            let rule = Homogeneous::new(margin_deg.to_radians(), c2, c3).unwrap();
            let (pid, omega) = on(&process, &rule);
            let found = margins(&Model::from(process), &pid.into()).unwrap();
            let off_rad = found.phase_margin_rad - margin_deg.to_radians();
            assert!(off_rad.abs() < 1e-9, "{found:?}");
            assert!((found.gain_crossover_rad_per_s / omega - 1.0).abs() < 1e-9);
        }
        assert_eq!(Homogeneous::new(0.35, 0.0, 0.37), None);
        assert_eq!(Homogeneous::new(1.5, 0.1, 0.0), None);
    }

    // The least ISE at a phase margin of 20 deg falls with the integral time towards that of the PD.
    #[test]
    fn the_pid_of_least_ise_is_the_pd() {
        let margin_rad = 20_f64.to_radians();
        let least = |c2: f64| {
            let of = |step: i32| {
                let lead_rad = (40.0 + 0.5 * f64::from(step)).to_radians();
                let c3 = (lead_rad.tan() + 1.0 / (TAU * c2)) / TAU;
                let rule = Homogeneous::new(margin_rad, c2, c3)?;
                ise(&process().into(), &on(&process(), &rule).0.into())
            };
            (0..80).filter_map(of).fold(f64::INFINITY, f64::min)
        };
        let found = [1.0, 2.0, 4.0, 8.0, 16.0].map(least);
        assert!(found.is_sorted_by(|a, b| a > b), "{found:?}");
        let best = pd_at_phase_margin(&process(), margin_rad).unwrap();
        assert!(
            found[4] > best.ise && found[4] < 1.05 * best.ise,
            "{found:?} {best:?}"
        );
    }
}
