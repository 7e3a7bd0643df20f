//! A controller on the real plant: the end of a step of the reference, and the phase margin.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use onecycle_design::Controller;
use onecycle_onboard::{PidLaw, PidSettings};
use onecycle_plant::{Disturbances, Noise, Sensed};

use super::Broken;
use crate::experiments::honesty::TruePlant;

/// Turns of the gain crossover for which a loop is simulated: at 5 degrees of phase margin `exp(-40 tan(5 deg) pi) = 2e-5`
/// remains.
const TURNS: f64 = 40.0;
/// Fewest and most samples of that.
const SAMPLES: (f64, f64) = (1e3, 1e5);
/// Output over the step at which a loop has diverged.
const DIVERGED: f64 = 1e3;
/// Amplitude of a limit cycle over that of the relay oscillation, and over the noise, that a loop may keep.
const QUIET: (f64, f64) = (0.02, 5.0);
/// Ratio of the amplitudes of the last two quarters above which an oscillation does not decay.
const LASTING: f64 = 0.8;

/// How the step of a loop ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LoopEnd {
    Settled,
    /// Amplitude over that of the relay oscillation.
    LimitCycle(f64),
    Diverged,
}

impl LoopEnd {
    pub(super) fn broken(self) -> Option<Broken> {
        let limit_cycle = match self {
            Self::Settled => return None,
            Self::LimitCycle(amplitude) => Some(amplitude),
            Self::Diverged => None,
        };
        Some(Broken::Unstable { limit_cycle })
    }
}

/// A controller on the real plant.
pub(super) struct Trial {
    pub(super) truth: TruePlant,
    pub(super) controller: Controller,
    /// Gain crossover of the design.
    pub(super) crossover_rad_per_s: f64,
}

impl Trial {
    /// The controller as the firmware runs it.
    fn law(&self) -> Option<PidLaw> {
        let pid = self.controller.pid();
        let settings = PidSettings::new(pid.kp as f32, pid.ki as f32, pid.kd as f32)
            .with_filter_s(pid.filter_s as f32)
            .with_setpoint_weight(pid.setpoint_weight as f32);
        PidLaw::new(settings).ok()
    }

    /// The loop under a step of one amplitude of the oscillation, without noise.
    pub(super) fn run(&self, sample_s: f64, noise_sigma: f64) -> LoopEnd {
        let own_s = self.controller.execution().sample_period_s;
        let step_s = if own_s > 0.0 { own_s } else { sample_s };
        let Some(mut law) = self.law().filter(|_| !self.truth.defect.is_undriven()) else {
            return LoopEnd::Diverged;
        };
        let mut noise = Noise::from_seed(0);
        let quiet = Disturbances::default();
        let mut plant = self.truth.plant(step_s, &quiet, false, &mut noise);
        plant.gain = self.truth.last_gain;
        let amplitude = self.truth.oscillation.amplitude;
        let samples = (TURNS * TAU / self.crossover_rad_per_s / step_s).clamp(SAMPLES.0, SAMPLES.1);
        let mut quarters = [(f64::INFINITY, f64::NEG_INFINITY); 4];
        for sample in 0..samples as usize {
            let output = plant.output();
            if output.is_nan() || output.abs() > DIVERGED * amplitude {
                return LoopEnd::Diverged;
            }
            let (low, high) = &mut quarters[(4 * sample / samples as usize).min(3)];
            (*low, *high) = (low.min(output), high.max(output));
            let sensed = Sensed {
                output,
                rate: plant.rate(),
            };
            let input = onecycle_plant::Controller::step(&mut law, step_s, amplitude, sensed);
            plant.step(input, 0.0, step_s, &mut noise);
        }
        let [.., before, last] = quarters.map(|(low, high)| 0.5 * (high - low));
        let quiet = (QUIET.0 * amplitude).max(QUIET.1 * noise_sigma);
        if last > quiet && last > LASTING * before {
            LoopEnd::LimitCycle(last / amplitude)
        } else {
            LoopEnd::Settled
        }
    }

    /// Least distance of the loop from -1 in phase, over its gain crossovers and over the processes that the plant is near
    /// to (rad). `None` if the loop has no crossover.
    pub(super) fn least_margin_rad(&self) -> Option<f64> {
        let responses = self.truth.responses();
        let margins = responses.iter().flat_map(|response| {
            let at = |k: usize| {
                let part = 2.0 * k as f64 / FREQUENCIES as f64 - 1.0;
                let omega = self.crossover_rad_per_s * AROUND.powf(part);
                self.controller.frequency_response(omega) * response(omega)
            };
            (0..FREQUENCIES).filter_map(move |k| crossing_rad(at(k), at(k + 1)))
        });
        margins.min_by(|a, b| a.abs().total_cmp(&b.abs()))
    }
}

/// Range of frequencies about the designed crossover in which the true one is searched, and their number.
const AROUND: f64 = 100.0;
const FREQUENCIES: usize = 8000;

/// Phase above -180 degrees (rad, -pi to pi) where the magnitude passes 1 between two points of an open loop.
fn crossing_rad(from: Complex64, to: Complex64) -> Option<f64> {
    let (a, b) = (from.norm().ln(), to.norm().ln());
    if (a > 0.0) == (b > 0.0) {
        return None;
    }
    let turn = (to / from).arg();
    let phase = from.arg() + turn * a / (a - b);
    let above = phase + PI;
    Some(above - TAU * (above / TAU).round())
}

#[cfg(test)]
mod tests {
    use super::*;

    // An integrator crosses at 90 degrees, wherever the two points lie; 2/s^2 has no margin; -1/s crosses at -90.
    #[test]
    fn margins_of_integrators() {
        let between = |of: &dyn Fn(Complex64) -> Complex64| {
            let at = |omega| of(Complex64::new(0.0, omega));
            crossing_rad(at(0.9), at(1.7))
        };
        let once = between(&|s| 1.0 / s).unwrap();
        assert!((once - 0.5 * PI).abs() < 1e-15);
        assert!(between(&|s| 2.0 / (s * s)).unwrap().abs() < 1e-15);
        assert!((between(&|s| -1.0 / s).unwrap() + 0.5 * PI).abs() < 1e-15);
        assert_eq!(between(&|s| 5.0 / s), None);
    }
}
