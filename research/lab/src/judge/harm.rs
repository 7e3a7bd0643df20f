//! Harm: the cost of a controller on the true plant, with its defect, over the cost that was promised.
//!
//! The controller is the optimum of the identified process at the paper's 20 degrees of phase margin; its
//! cost on that process is the promised one. A step of ten amplitudes of the oscillation is simulated on
//! the true plant with its defect. The step is so large that the rest error of friction and backlash
//! hardly counts, but lost phase margin does. Defects of the recording alone (a sensor that saturates, a
//! foreign tone) are left out of the simulation: they spoil the cycle, not the plant.

use std::f64::consts::TAU;

use onecycle_onboard::Soiptd;

use crate::experiments::defect::plant::DefectPlant;
use crate::experiments::{Defect, Oscillation, RelayExperiment};
use onecycle_design::soiptd_pd::optimum::pd_at_phase_margin;

/// Cost of a step on the true plant over its promised cost; infinite if the step does not settle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harm(
    /// The ratio (1).
    pub f64,
);

/// Largest ratio that is not harmful: the 10 % of the paper's grids. A loop with 20 degrees of phase margin
/// costs that much more when it loses 2 degrees.
const MOST: f64 = 1.1;

/// Phase margin of the controllers (degrees): the paper's.
const PHASE_MARGIN_DEG: f64 = 20.0;

/// Size of the step, in amplitudes of the oscillation.
const STEP: f64 = 10.0;

/// Steps of the simulation in a period of the gain crossover: the hold costs 0.2 degrees of margin.
const STEPS_PER_TURN: f64 = 1000.0;

/// Duration in periods of the gain crossover: at 20 degrees `exp(-tan(20 deg) pi 15) = 3e-8` remains.
const TURNS: f64 = 15.0;

/// Mean squared error of the last third over the squared step, above which the step counts as unsettled.
const UNSETTLED: f64 = 0.01;

impl Harm {
    /// Whether the cost is too high.
    #[must_use]
    pub fn is_harmful(self) -> bool {
        // NaN is harmful too.
        !matches!(
            self.0.partial_cmp(&MOST),
            Some(std::cmp::Ordering::Less | std::cmp::Ordering::Equal)
        )
    }

    /// Harm of the controller made for `found` on the true plant of an experiment.
    #[must_use]
    pub fn of(experiment: &RelayExperiment, found: &Soiptd) -> Self {
        let unbounded = Self(f64::INFINITY);
        if experiment.defect().is_undriven() {
            return unbounded;
        }
        let Ok(best) = pd_at_phase_margin(found, PHASE_MARGIN_DEG.to_radians()) else {
            return unbounded;
        };
        let defect = match experiment.defect() {
            Defect::Clipping { .. } | Defect::Tone { .. } => Defect::None,
            defect => defect,
        };
        let turn_s = TAU / best.margins.gain_crossover_rad_per_s;
        let step_s = turn_s / STEPS_PER_TURN;
        // A crossover far from the oscillation means that the process found is far from the true one.
        if !(1e-2..1e2).contains(&(turn_s / experiment.oscillation.period_s)) {
            return unbounded;
        }
        let oscillation = Oscillation {
            period_s: experiment.oscillation.period_s.min(turn_s),
            ..experiment.oscillation
        };
        let mut plant = DefectPlant::new(&experiment.process, &defect, oscillation, step_s);
        let samples = (TURNS * STEPS_PER_TURN) as usize;
        let reference = STEP * experiment.oscillation.amplitude;
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
