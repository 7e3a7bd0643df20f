//! A process as a candidate for another one: the cost of its controller there (the `J_ij` of the
//! paper's equation 8, gains matched; Ayyad, Chehadeh, Awad, Zweiri 2020).
//!
//! In an identification the amplitude of the oscillation determines the gain: the gain of any candidate
//! makes its amplitude the measured one. So candidates are compared at gains that give them the same
//! amplitude under the same relay, here one. [`Gains::Equal`] compares at equal velocity gains instead,
//! to show the difference.
//!
//! Scaling: a candidate with times `alpha` times as long has the same amplitude with `1/alpha^2` of the
//! acceleration gain, the same `Kp`, `alpha` times the `Kd` and the cost, and the same margins. Costs
//! between two candidates do not change when both are scaled alike (the paper's property 1).

use std::f64::consts::PI;

use onecycle_onboard::{Pd, Soiptd, SoiptdError};

use crate::space::Space;
use crate::space::limit_cycle::symmetric;
use onecycle_design::soiptd_pd::criterion::Criterion;
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_design::soiptd_pd::margins::margins;
use onecycle_design::soiptd_pd::optimum::{Optimum, OptimumError, pd_by};

/// Gains at which candidates are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gains {
    /// Gains that give the same amplitude under the same relay.
    #[default]
    SameAmplitude,
    /// Equal velocity gains.
    Equal,
    /// Gains that give the same magnitude at the phase of the relay: the authors' published code.
    SameMagnitude,
}

/// How candidates are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Comparison {
    /// Gains of the processes.
    pub gains: Gains,
    /// Cost of a controller.
    pub criterion: Criterion,
}

impl From<Gains> for Comparison {
    /// By the paper's cost, the ISE.
    fn from(gains: Gains) -> Self {
        Self {
            gains,
            criterion: Criterion::Ise,
        }
    }
}

/// A process with a gain according to [`Gains`], and its optimal controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The process.
    pub process: Soiptd,
    /// The optimum with at least the margin of the space.
    pub optimum: Optimum,
    /// Cost of the optimum by the criterion of the comparison.
    pub cost: f64,
    comparison: Comparison,
}

/// Why a process is no candidate.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CandidateError {
    /// The times are out of range.
    #[error("{0}")]
    Process(#[from] SoiptdError),
    /// The process has no optimal controller.
    #[error("{0}")]
    Optimum(#[from] OptimumError),
    /// The relay does not make the process oscillate, so no amplitude determines its gain.
    #[error(
        "T_prop {t_prop_s} s, T_body {t_body_s} s, tau {tau_s} s does not oscillate under a relay \
         with beta {beta}: choose a smaller beta"
    )]
    NoOscillation {
        /// Lag of the actuator (s).
        t_prop_s: f64,
        /// Lag of the body (s).
        t_body_s: f64,
        /// Dead time (s).
        tau_s: f64,
        /// Parameter of the relay.
        beta: f64,
    },
}

impl Candidate {
    /// The candidate with these times, `T_prop`, `T_body`, `tau` (s).
    ///
    /// # Errors
    /// See [`CandidateError`].
    pub fn new(
        space: &Space,
        comparison: impl Into<Comparison>,
        [t_prop_s, t_body_s, tau_s]: [f64; 3],
    ) -> Result<Self, CandidateError> {
        let comparison = comparison.into();
        let unit = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)?;
        let no_oscillation = CandidateError::NoOscillation {
            t_prop_s,
            t_body_s,
            tau_s,
            beta: space.beta,
        };
        let process = match comparison.gains {
            Gains::Equal => unit,
            Gains::SameMagnitude => {
                let phase_rad = space.beta.asin() - PI;
                let omega = unit.frequency_at_phase(phase_rad).ok_or(no_oscillation)?;
                unit.with_gain_scaled(1.0 / unit.magnitude(omega))?
            }
            Gains::SameAmplitude => {
                let cycle = symmetric(&unit, space.beta).ok_or(no_oscillation)?;
                unit.with_gain_scaled(1.0 / cycle.amplitude)?
            }
        };
        let criterion = comparison.criterion;
        let optimum = pd_by(criterion, &process, space.phase_margin_rad())?;
        let cost = criterion.cost(&process, optimum.pd);
        Ok(Self {
            process,
            optimum,
            cost: cost.ok_or(OptimumError::Overflow)?,
            comparison,
        })
    }

    /// The candidate with times `alpha > 0` times as long; exact.
    ///
    /// # Errors
    /// [`CandidateError::Process`] if a time or the gain leaves the range of `f64`.
    pub fn scaled(&self, alpha: f64) -> Result<Self, CandidateError> {
        // Factor on the acceleration gain; a change other than 1/alpha^2 divides the controller's
        // gains.
        let gain = match self.comparison.gains {
            Gains::SameAmplitude | Gains::SameMagnitude => alpha.powi(-2),
            Gains::Equal => alpha.recip(),
        };
        let controller = (alpha * alpha * gain).recip();
        let process = Soiptd::from_acceleration_gain(
            gain * self.process.k_over_t_body(),
            alpha * self.process.t_prop_s(),
            self.process.inv_t_body_per_s() / alpha,
            alpha * self.process.tau_s(),
        )?;
        let mut optimum = self.optimum;
        optimum.pd = Pd {
            kp: controller * optimum.pd.kp,
            kd: controller * alpha * optimum.pd.kd,
        };
        optimum.ise *= alpha;
        let margins = &mut optimum.margins;
        margins.gain_crossover_rad_per_s /= alpha;
        margins.phase_crossover_rad_per_s = margins.phase_crossover_rad_per_s.map(|w| w / alpha);
        margins.delay_margin_s *= alpha;
        Ok(Self {
            process,
            optimum,
            cost: alpha.powi(self.comparison.criterion.power_of_time()) * self.cost,
            comparison: self.comparison,
        })
    }

    /// `J_ij`: cost of this candidate's controller on `other`, with the margin there.
    #[must_use]
    pub fn on(&self, other: &Self) -> Deterioration {
        let relative = self.cost_on(other);
        match margins(&other.process, self.optimum.pd) {
            Some(margins) if relative.is_finite() => Deterioration::Stable {
                relative,
                phase_margin_rad: margins.phase_margin_rad,
            },
            _ => Deterioration::Unstable,
        }
    }

    /// `J_(ij) = max(J_ij, J_ji)`: distance of two candidates; infinite if either controller is
    /// unstable on the other process.
    ///
    /// At a fixed margin `J_ij` alone can be negative, a faster step bought with margin; then `J_ji` is
    /// usually positive. If both are negative (by some thousandths, seen between shapes far apart) the
    /// distance is zero.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        self.cost_on(other).max(other.cost_on(self)).max(0.0)
    }

    /// The distance if it is below `bound`; half the work if it is not.
    #[must_use]
    pub fn distance_below(&self, other: &Self, bound: f64) -> Option<f64> {
        let there = self.cost_on(other);
        if there >= bound {
            return None;
        }
        let distance = there.max(other.cost_on(self)).max(0.0);
        (distance < bound).then_some(distance)
    }

    /// `J_ij` alone; infinite if unstable.
    #[must_use]
    pub fn cost_on(&self, other: &Self) -> f64 {
        let cost = self
            .comparison
            .criterion
            .cost(&other.process, self.optimum.pd);
        cost.map_or(f64::INFINITY, |cost| (cost - other.cost) / other.cost)
    }

    /// `T_prop`, `T_body`, `tau` (s).
    #[must_use]
    pub fn times_s(&self) -> [f64; 3] {
        [
            self.process.t_prop_s(),
            self.process.inv_t_body_per_s().recip(),
            self.process.tau_s(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Twice the times: with the same amplitude a quarter of the acceleration gain and twice Kd;
    // with equal gains half of it (K is the same) and half of Kp. Factors of two are exact.
    #[test]
    fn twice_as_slow() {
        let times_s = [0.05, 1.0, 0.02];
        for (gains, gain, kp) in [(Gains::SameAmplitude, 0.25, 1.0), (Gains::Equal, 0.5, 0.5)] {
            let one = Candidate::new(&Space::MULTIROTOR, gains, times_s).unwrap();
            let two = one.scaled(2.0).unwrap();
            assert_eq!(two.times_s(), [0.1, 2.0, 0.04]);
            assert_eq!(
                two.process.k_over_t_body(),
                gain * one.process.k_over_t_body()
            );
            let (a, b) = (&one.optimum, &two.optimum);
            assert_eq!((b.pd.kp, b.pd.kd), (kp * a.pd.kp, 2.0 * kp * a.pd.kd));
            assert_eq!(b.ise, 2.0 * a.ise);
            assert_eq!(b.margins.phase_margin_rad, a.margins.phase_margin_rad);
        }
    }

    // By the ITAE the cost grows with the square of the times, and distances stay: its criterion is smooth enough for 1e-6.
    #[test]
    fn twice_as_slow_by_the_itae() {
        let comparison = Comparison {
            criterion: Criterion::Itae,
            ..Comparison::default()
        };
        let new = |times_s| Candidate::new(&Space::MULTIROTOR, comparison, times_s).unwrap();
        let (one, other) = (new([0.05, 1.0, 0.02]), new([0.06, 1.0, 0.03]));
        let [two, two_other] = [one, other].map(|candidate| candidate.scaled(2.0).unwrap());
        assert_eq!(two.cost, 4.0 * one.cost);
        let fresh = new([0.1, 2.0, 0.04]);
        assert!((fresh.cost / two.cost - 1.0).abs() < 1e-6);
        assert!((two.distance(&two_other) / one.distance(&other) - 1.0).abs() < 1e-6);
        assert!(one.cost_on(&one).abs() < 1e-12);
    }

    // A distance is the larger of both costs, below any bound above it and below none under it. The
    // controller made for a process ten times as slow has a Kd ten times as large: unstable.
    #[test]
    fn distances() {
        let new =
            |times_s| Candidate::new(&Space::MULTIROTOR, Gains::SameAmplitude, times_s).unwrap();
        let (one, other) = (new([0.05, 1.0, 0.02]), new([0.06, 1.0, 0.03]));
        let distance = one.distance(&other);
        assert_eq!(distance, one.cost_on(&other).max(other.cost_on(&one)));
        assert_eq!(distance, other.distance(&one));
        assert_eq!(one.on(&other).relative(), Some(one.cost_on(&other)));
        assert_eq!(one.distance_below(&other, 1.01 * distance), Some(distance));
        assert_eq!(one.distance_below(&other, distance), None);
        assert!(one.distance(&one) < 1e-13);
        let fast = one.scaled(0.1).unwrap();
        assert_eq!(one.cost_on(&fast), f64::INFINITY);
        assert_eq!(fast.distance(&one), f64::INFINITY);
    }
}
