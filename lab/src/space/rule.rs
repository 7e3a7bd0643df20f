//! The optimum as a homogeneous tuning rule (the paper's equations 11 to 13; Ayyad, Chehadeh, Awad,
//! Zweiri 2020): three numbers that turn one relay oscillation into a PD.
//!
//! A relay with parameter `beta` oscillates where `arg G = -pi + asin(beta)`. If that is the gain
//! crossover of the PD, its lead there is `psi = PM - asin(beta)`, and with the amplitude ratio
//! `|G| = pi a / (4 h)` and the period `2 pi / w` of the oscillation
//!
//! ```text
//! beta = sin(PM - psi),   Kp = c1 / |G|,   Kd = c3 Kp 2 pi / w,   c1 = cos(psi),   c3 = tan(psi)/(2 pi)
//! ```

use std::f64::consts::PI;

use onecycle_onboard::Pd;

/// A homogeneous tuning rule. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TuningRule {
    /// Parameter of the relay, -1 to 1; negative for a leading relay.
    pub beta: f64,
    /// Proportional gain times the amplitude ratio of the oscillation.
    pub c1: f64,
    /// Derivative time as a fraction of the period.
    pub c3: f64,
}

impl TuningRule {
    /// The rule whose PD has this lead and this phase margin (rad), both from 0 to `pi/2`.
    #[must_use]
    pub fn from_lead(lead_rad: f64, phase_margin_rad: f64) -> Self {
        Self {
            beta: (phase_margin_rad - lead_rad).sin(),
            c1: lead_rad.cos(),
            c3: lead_rad.tan() / (2.0 * PI),
        }
    }

    /// Gains from an oscillation: its `|G|` (output unit / input unit) and its period (s).
    #[must_use]
    pub fn pd(&self, amplitude_ratio: f64, period_s: f64) -> Pd {
        let kp = self.c1 / amplitude_ratio;
        Pd {
            kp,
            kd: self.c3 * period_s * kp,
        }
    }
}

#[cfg(test)]
mod tests {
    use onecycle_onboard::Soiptd;

    use super::*;
    use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;

    // The relay of the optimum's rule oscillates, by the describing function, at the optimum's
    // crossover, so the rule gives back the optimum: for (0.3, 2, 0.1) asin(beta) = -46.88 deg.
    #[test]
    fn rule_gives_back_the_optimum() {
        let process = Soiptd::new(3.0, 0.3, 2.0, 0.1).unwrap();
        let phase_margin_rad = 20_f64.to_radians();
        let best = pd_at_phase_margin(&process, phase_margin_rad).unwrap();
        let rule = TuningRule::from_lead(best.lead_rad, phase_margin_rad);
        assert!(
            (rule.beta.asin().to_degrees() + 46.88).abs() < 0.005,
            "{}",
            rule.beta.asin()
        );

        let omega = process.frequency_at_phase(-PI + rule.beta.asin()).unwrap();
        let pd = rule.pd(process.magnitude(omega), 2.0 * PI / omega);
        assert!((pd.kp / best.pd.kp - 1.0).abs() < 1e-12);
        assert!((pd.kd / best.pd.kd - 1.0).abs() < 1e-12);
    }
}
