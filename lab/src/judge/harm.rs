//! What a controller made from a cycle does on the process that the cycle was of.
//!
//! The controller is the best one of the process that was found, with the paper's 20 degrees of phase
//! margin, and its cost there is what it promises. A step of ten times the oscillation is simulated on
//! the true plant, defect included: large enough that what friction and play leave at rest, under any
//! controller of this kind, hardly counts, and that the margin lost does. Only the defects of the
//! recording (a sensor that clips, a foreign tone) are left out: they spoil the cycle, not the plant.

use std::f64::consts::TAU;

use onecycle_onboard::Soiptd;

use crate::experiments::outsiders::plant::{Plant, Scale};
use crate::experiments::outsiders::{Case, Defect};
use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;

/// What a step costs on the true plant over what it was to cost; infinite where it never settles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harm(
    /// The ratio.
    pub f64,
);

/// A cost that much above the promised one is harm: the 10 % of the paper's grids. The resonance of a
/// loop of 20 degrees costs that much more when 2 degrees are lost.
const MOST: f64 = 1.1;

/// Phase margin of the controllers compared: the paper's.
const PHASE_MARGIN_DEG: f64 = 20.0;

/// Size of the step, in amplitudes of the oscillation.
const STEP: f64 = 10.0;

/// Steps of the simulation in a turn at the gain crossover: the hold costs 0.2 degrees of margin.
const STEPS_PER_TURN: f64 = 1000.0;

/// Turns at the gain crossover: at 20 degrees what is left is `exp(-tan(20 deg) pi 15) = 3e-8`.
const TURNS: f64 = 15.0;

/// Mean squared error of the last third over the step's square, above which it does not settle.
const UNSETTLED: f64 = 0.01;

impl Harm {
    /// Whether it is one.
    #[must_use]
    pub fn is_harmful(self) -> bool {
        // No number is no promise kept.
        !matches!(
            self.0.partial_cmp(&MOST),
            Some(std::cmp::Ordering::Less | std::cmp::Ordering::Equal)
        )
    }

    /// Of the controller for `found` on the true plant of a case.
    #[must_use]
    pub fn of(case: &Case, found: &Soiptd) -> Self {
        let unbounded = Self(f64::INFINITY);
        if case.defect.is_undriven() {
            return unbounded;
        }
        let Ok(best) = pd_at_phase_margin(found, PHASE_MARGIN_DEG.to_radians()) else {
            return unbounded;
        };
        let defect = match case.defect {
            Defect::Clipping { .. } | Defect::Tone { .. } => Defect::None,
            defect => defect,
        };
        let turn_s = TAU / best.margins.gain_crossover_rad_per_s;
        let step_s = turn_s / STEPS_PER_TURN;
        // A crossover far from the oscillation is a process far from the true one.
        if !(1e-2..1e2).contains(&(turn_s / case.scale.period_s)) {
            return unbounded;
        }
        let scale = Scale {
            period_s: case.scale.period_s.min(turn_s),
            ..case.scale
        };
        let mut plant = Plant::new(&case.process, &defect, scale, step_s);
        let samples = (TURNS * STEPS_PER_TURN) as usize;
        let reference = STEP * case.scale.amplitude;
        let (mut sum, mut last) = (0.0, 0.0);
        for sample in 0..samples {
            let error = reference - plant.output();
            let squared = (error / reference) * (error / reference);
            sum += squared;
            if 3 * sample >= 2 * samples {
                last += squared;
            }
            plant.step(best.pd.kp * error - best.pd.kd * plant.rate());
        }
        if last > UNSETTLED * samples as f64 / 3.0 || !last.is_finite() {
            return unbounded;
        }
        Self(sum * step_s / best.ise)
    }
}
