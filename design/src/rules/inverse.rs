//! The ultimate point behind the gains of a tuning rule.

use crate::controller::{Form, Pid};

use super::{Ultimate, no_overshoot, tyreus_luyben, ziegler_nichols};

/// Rounding changes a derivative gain that a rule computed by at most this share. The gains of other rules differ by 20 % and more.
const ROUNDING: f64 = 0.1;

/// A rule that computes gains from the ultimate gain and period.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum UltimateRule {
    /// [`ziegler_nichols()`]: PI or PID.
    ZieglerNichols,
    /// [`tyreus_luyben()`]: PI or PID.
    TyreusLuyben,
    /// [`no_overshoot()`]: PID.
    NoOvershoot,
}

/// Why gains are not those of a rule.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotOfRule {
    /// The proportional or the integral gain is not positive, or the derivative gain is negative.
    #[error("a rule gives positive gains Kp and Ki, and Kd of zero or more")]
    Sign,
    /// The rule gives no gains of this form.
    #[error("the rule gives no {}", .0.name())]
    Form(Form),
    /// The derivative gain contradicts the others.
    #[error("with these Kp and Ki the rule gives Kd {expected}, but Kd is {given}")]
    Derivative {
        /// The derivative gain that follows from the others.
        expected: f64,
        /// The derivative gain.
        given: f64,
    },
}

impl UltimateRule {
    fn gains(self, ultimate: &Ultimate, form: Form) -> Option<Pid> {
        match self {
            Self::ZieglerNichols => ziegler_nichols(ultimate, form),
            Self::TyreusLuyben => tyreus_luyben(ultimate, form),
            Self::NoOvershoot => no_overshoot(ultimate, form),
        }
    }

    /// Ultimate gain and period (s) from which the rule has computed these gains.
    ///
    /// The gains of the rule for `KU = 1`, `TU = 1` are `p`, `i`, `d`; so `Kp = p KU`, `Ki = i KU/TU`, `Kd = d KU TU`. The first
    /// two give `KU = Kp/p` and `TU = (i/p) Kp/Ki`. The third one is a check.
    ///
    /// # Errors
    /// - [`NotOfRule::Sign`], [`NotOfRule::Form`]: no gains of this rule.
    /// - [`NotOfRule::Derivative`]: `Kd` differs by more than 10 %.
    pub fn ultimate(self, gains: &Pid) -> Result<Ultimate, NotOfRule> {
        let Pid { kp, ki, kd, .. } = *gains;
        if !(kp > 0.0 && ki > 0.0 && kd >= 0.0) {
            return Err(NotOfRule::Sign);
        }
        let form = if kd > 0.0 { Form::Pid } else { Form::Pi };
        let unit = self.gains(&Ultimate::new(1.0, 1.0), form);
        let unit = unit.ok_or(NotOfRule::Form(form))?;
        let found = Ultimate::new(kp / unit.kp, unit.ki / unit.kp * kp / ki);
        let expected = unit.kd * found.gain * found.period_s;
        if (kd - expected).abs() <= ROUNDING * expected {
            Ok(found)
        } else {
            Err(NotOfRule::Derivative {
                expected,
                given: kd,
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Forwards and backwards: the point comes back to rounding.
    #[test]
    fn a_rule_is_inverted() {
        let asked = Ultimate::new(34.92, 27.78);
        for (rule, form) in [
            (UltimateRule::ZieglerNichols, Form::Pi),
            (UltimateRule::ZieglerNichols, Form::Pid),
            (UltimateRule::TyreusLuyben, Form::Pi),
            (UltimateRule::TyreusLuyben, Form::Pid),
            (UltimateRule::NoOvershoot, Form::Pid),
        ] {
            let found = rule.ultimate(&rule.gains(&asked, form).unwrap()).unwrap();
            assert!((found.gain / asked.gain - 1.0).abs() < 1e-14, "{rule:?}");
            assert!(
                (found.period_s / asked.period_s - 1.0).abs() < 1e-14,
                "{rule:?}"
            );
        }
    }

    // A printer printed "Ku: 34.92 Tu: 27.78 Kp: 20.95 Ki: 1.51 Kd: 72.77": Ku = 20.95/0.6 = 34.917, Tu = 2 20.95/1.51 = 27.75.
    #[test]
    fn printed_gains_are_rounded() {
        let printed = Pid::new(20.95, 1.51, 72.77);
        let found = UltimateRule::ZieglerNichols.ultimate(&printed).unwrap();
        assert!((found.gain - 34.917).abs() < 1e-3 && (found.period_s - 27.748).abs() < 1e-3);
    }

    // Ti = 4 Td for Ziegler and Nichols; Kd twice as large is another rule's.
    #[test]
    fn gains_of_another_rule_are_refused() {
        let rule = UltimateRule::ZieglerNichols;
        let other = rule.ultimate(&Pid::new(0.6, 1.2, 0.15));
        let wanted = NotOfRule::Derivative {
            expected: 0.075,
            given: 0.15,
        };
        assert_eq!(other, Err(wanted));
        assert_eq!(
            rule.ultimate(&Pid::new(0.6, 0.0, 0.1)),
            Err(NotOfRule::Sign)
        );
        let pi = UltimateRule::NoOvershoot.ultimate(&Pid::new(0.6, 1.0, 0.0));
        assert_eq!(pi, Err(NotOfRule::Form(Form::Pi)));
    }
}
