//! The distinguishing phase: the tuning rule that costs the processes of a space least, and the phase
//! at which a relay should make them oscillate (section III-A of the paper; Ayyad, Chehadeh, Awad,
//! Zweiri 2020; I. Boiko, "Non-parametric Tuning of PID Controllers", 2013).
//!
//! The paper's six steps:
//!
//! 1. to 3. processes all over a space and a phase margin;
//! 4. each process's optimal PD as a tuning rule, [`LocalOptima`];
//! 5. each rule on every process: the relay with the rule's `beta` oscillates where
//!    `arg G = -pi + asin(beta)`, and the rule makes that oscillation a PD. Its crossover is there,
//!    its lead and its margin are the rule's, so nothing is left to search for but the crossover;
//! 6. the rule whose worst deterioration is least, [`distinguishing_phase`].
//!
//! A rule is homogeneous: it takes its gains from the amplitude of the oscillation and measures time in
//! its period. So neither the gain nor the time scale of a process changes its deterioration, and one
//! process of every shape, here the slowest, represents its whole ray.
//!
//! At a given margin the rules have one parameter, the lead `psi`, with `asin(beta) = PM - psi`. As a
//! function of the lead, a process's deterioration falls to zero at its own optimum and rises beyond
//! it. So the worst deterioration of the processes with larger leads falls with the lead, that of the
//! others rises, and the best rule of all is where both are equal, whether or not it is any process's
//! own: [`LocalOptima::minimax`].

use onecycle_onboard::{Soiptd, SoiptdError};

use crate::space::{Range, Space};
use onecycle_design::roots::{falling_root, root};
use onecycle_design::rules::Homogeneous;
use onecycle_design::soiptd_pd::cost::ise_at_crossover;
use onecycle_design::soiptd_pd::open_loop::{OpenLoop, lead_for_margin};
use onecycle_design::soiptd_pd::optimum::{Optimum, OptimumError, pd_at_phase_margin};

/// Precision of the best lead (rad): ten times the rounding error of a deterioration, whose slope over
/// the lead is of the order of one.
const LEAD_TOLERANCE_RAD: f64 = 1e-12;

/// A tuning rule and its costs on the processes it is applied to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AppliedRule {
    /// The rule.
    pub rule: Homogeneous,
    /// Lead of the controllers at the gain crossover (rad).
    pub lead_rad: f64,
    /// Phase of the relay's oscillation, `asin(beta)` (rad).
    pub phase_rad: f64,
    /// Largest deterioration, as a fraction of the optimal cost; infinite if the relay does not make a
    /// process oscillate.
    pub worst: f64,
    /// Mean deterioration over all processes.
    pub mean: f64,
    /// `T_prop`, `T_body`, `tau` (s) of the process with the largest deterioration.
    pub worst_on_s: [f64; 3],
}

/// A process's own optimum as a rule for all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalRule {
    /// `T_prop`, `T_body`, `tau` (s) of the process.
    pub times_s: [f64; 3],
    /// The rule, applied to every process.
    pub applied: AppliedRule,
}

/// Result of the six steps.
#[derive(Clone, Debug, PartialEq)]
pub struct DistinguishingPhase {
    /// The rule of every process, in the order of [`Space::shapes`].
    pub rules: Vec<LocalRule>,
    /// The rule with the least worst deterioration: the paper's distinguishing rule.
    pub best: LocalRule,
    /// The best rule of all, whether local or not.
    pub minimax: AppliedRule,
}

/// Why there is no distinguishing phase.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PhaseError {
    /// There is no process.
    #[error("the rule needs at least one process")]
    Empty,
    /// The times are out of range.
    #[error("{0}")]
    Process(#[from] SoiptdError),
    /// A process has no optimal controller.
    #[error("{0}")]
    Optimum(#[from] OptimumError),
}

/// The paper's six steps for `rows` times `columns` shapes of a space, see [`Space::shapes`].
///
/// # Errors
/// [`PhaseError`]: a process is out of range or has no optimal controller.
pub fn distinguishing_phase(
    space: &Space,
    rows: usize,
    columns: usize,
) -> Result<DistinguishingPhase, PhaseError> {
    LocalOptima::of_shapes(space, rows, columns)?.distinguishing_phase()
}

/// Processes and their optima at one phase margin.
#[derive(Clone, Debug)]
pub struct LocalOptima {
    phase_margin_rad: f64,
    members: Vec<Member>,
}

#[derive(Clone, Copy, Debug)]
struct Member {
    times_s: [f64; 3],
    process: Soiptd,
    optimum: Optimum,
}

impl LocalOptima {
    /// The optima of processes with these times, `T_prop`, `T_body`, `tau` (s).
    ///
    /// # Errors
    /// [`PhaseError`]: a process is out of range or has no optimal controller.
    pub fn new(
        times_s: impl IntoIterator<Item = [f64; 3]>,
        phase_margin_rad: f64,
    ) -> Result<Self, PhaseError> {
        let members = times_s
            .into_iter()
            .map(|times_s| Member::new(times_s, phase_margin_rad))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            phase_margin_rad,
            members,
        })
    }

    /// The optima of the slowest process of every shape of a space, see [`Space::shapes`].
    ///
    /// # Errors
    /// [`PhaseError`]: a process is out of range or has no optimal controller.
    pub fn of_shapes(space: &Space, rows: usize, columns: usize) -> Result<Self, PhaseError> {
        let shapes = space.shapes(rows, columns);
        let slowest = shapes.into_iter().filter_map(|shape| {
            let (_, radius_s) = space.radius_range_s(shape)?;
            Some(shape.at(radius_s))
        });
        Self::new(slowest, space.phase_margin_rad())
    }

    /// Least and greatest lead of the optima (rad).
    #[must_use]
    pub fn lead_range_rad(&self) -> Range {
        let leads = self.members.iter().map(|member| member.optimum.lead_rad);
        leads.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), lead| {
            (low.min(lead), high.max(lead))
        })
    }

    /// Deterioration of every process, in order, under the rule with this lead (rad).
    pub fn deteriorations(&self, lead_rad: f64) -> impl Iterator<Item = f64> {
        self.members.iter().map(move |member| {
            member
                .cost(lead_rad, self.phase_margin_rad)
                .map_or(f64::INFINITY, |cost| cost / member.optimum.ise - 1.0)
        })
    }

    /// Applies the rule with this lead (rad) to every process.
    ///
    /// # Errors
    /// [`PhaseError::Empty`]: there is no process.
    pub fn apply(&self, lead_rad: f64) -> Result<AppliedRule, PhaseError> {
        let mut sum = 0.0;
        let mut worst = None;
        for (member, deterioration) in self.members.iter().zip(self.deteriorations(lead_rad)) {
            sum += deterioration;
            if worst.is_none_or(|(most, _)| deterioration > most) {
                worst = Some((deterioration, member.times_s));
            }
        }
        let (worst, worst_on_s) = worst.ok_or(PhaseError::Empty)?;
        Ok(AppliedRule {
            rule: Homogeneous::from_lead(lead_rad, self.phase_margin_rad),
            lead_rad,
            phase_rad: self.phase_margin_rad - lead_rad,
            worst,
            mean: sum / self.members.len() as f64,
            worst_on_s,
        })
    }

    /// The rule of the process at `index`, applied to every process; `None` if there is no such
    /// process.
    #[must_use]
    pub fn local_rule(&self, index: usize) -> Option<LocalRule> {
        let member = self.members.get(index)?;
        Some(LocalRule {
            times_s: member.times_s,
            applied: self.apply(member.optimum.lead_rad).ok()?,
        })
    }

    /// The rule with the least worst deterioration, whatever its lead.
    ///
    /// # Errors
    /// [`PhaseError::Empty`]: there is no process.
    pub fn minimax(&self) -> Result<AppliedRule, PhaseError> {
        let (low, high) = self.lead_range_rad();
        self.apply(root(
            |lead_rad| self.balance(lead_rad),
            low,
            high,
            LEAD_TOLERANCE_RAD,
        ))
    }

    /// Largest loss of the processes that want a larger lead minus that of the others; falls with the
    /// lead. The loss is `1 - J*/J`, which is one for an infinite `J`.
    fn balance(&self, lead_rad: f64) -> f64 {
        let (mut want_more, mut want_less) = (0.0_f64, 0.0_f64);
        for (member, deterioration) in self.members.iter().zip(self.deteriorations(lead_rad)) {
            let lost = 1.0 - 1.0 / (1.0 + deterioration);
            if lead_rad < member.optimum.lead_rad {
                want_more = want_more.max(lost);
            } else {
                want_less = want_less.max(lost);
            }
        }
        want_more - want_less
    }

    /// Steps 5 and 6, and the best rule of all.
    ///
    /// # Errors
    /// [`PhaseError::Empty`]: there is no process.
    pub fn distinguishing_phase(&self) -> Result<DistinguishingPhase, PhaseError> {
        let rules: Vec<_> = (0..self.members.len())
            .filter_map(|index| self.local_rule(index))
            .collect();
        let best = rules
            .iter()
            .min_by(|a, b| a.applied.worst.total_cmp(&b.applied.worst))
            .copied()
            .ok_or(PhaseError::Empty)?;
        Ok(DistinguishingPhase {
            rules,
            best,
            minimax: self.minimax()?,
        })
    }
}

impl Member {
    fn new(times_s: [f64; 3], phase_margin_rad: f64) -> Result<Self, PhaseError> {
        let [t_prop_s, t_body_s, tau_s] = times_s;
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)?;
        Ok(Self {
            times_s,
            process,
            optimum: pd_at_phase_margin(&process, phase_margin_rad)?,
        })
    }

    /// ISE under the rule with this lead and margin; `None` if the rule's relay causes no oscillation:
    /// a process without damping under a relay that does not lead.
    fn cost(&self, lead_rad: f64, phase_margin_rad: f64) -> Option<f64> {
        let omega = falling_root(
            |omega| lead_rad - lead_for_margin(&self.process, omega, phase_margin_rad),
            self.optimum.margins.gain_crossover_rad_per_s,
        )?;
        let open_loop = OpenLoop::crossing_at(&self.process, omega, lead_rad);
        ise_at_crossover(&open_loop, omega, phase_margin_rad)
    }
}
