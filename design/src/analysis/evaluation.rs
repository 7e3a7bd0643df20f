//! A given loop in the units of the user: margins, peaks, integrals, responses.

use std::cell::OnceCell;
use std::f64::consts::PI;

use crate::controller::Controller;
use crate::model::Model;
use crate::soiptd_pd::loop_response::LoopResponse;
use crate::soiptd_pd::margins::Margins;
use crate::soiptd_pd::step_metrics::StepMetrics;
use crate::soiptd_pd::step_response::{Sample, StepResponse, StepResponseError, interpolated};

use super::law::Law;
use super::metrics::{Record, reference_metrics};
use super::noise;
use super::open_loop::OpenLoop;
use super::process::{Process, Stage};
use super::propagator::NODES;
use super::realisation::Excitation;
use super::response::{Ending, STEP_RAD, integrals, run};
use super::sensitivity::{Curve, Sensitivity};
use super::stability::is_stable;

/// Integrals with steps of length `h` and `h/2` must agree to this.
const AGREEMENT: f64 = 3e-9;

/// Most halvings of the step.
const MOST_HALVINGS: usize = 6;

/// A recorded response has settled within this share of its peak: for its samples, and for its characteristics, of which the
/// settling time is that to 2 %.
const RESIDUE: f64 = 1e-5;
const RESIDUE_OF_METRICS: f64 = 2e-3;

/// Most steps of a recorded response, of 7 samples each.
const MOST_STEPS: usize = (1 << 20) / (NODES - 1);

/// Lags and filter make layers after each dead time. They are resolved by at most this many times more steps than the
/// frequency of interest needs.
const MOST_REFINEMENT: f64 = 16.0;

/// Response to a unit step of the load at the input of the process, until it has settled.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LoadResponse {
    /// Samples: one at `t = 0`, when the load steps, then evenly spaced from the end of the dead time on. `u` does not
    /// contain the load.
    pub samples: Vec<Sample>,
    /// Largest magnitude of the output (output unit).
    pub peak: f64,
    /// Integral of the absolute error (output unit s). Infinite without an integral term.
    pub iae: f64,
}

impl LoadResponse {
    /// Process output (output unit) and controller output (input unit) at a time (s), as [`StepResponse::at`].
    #[must_use]
    pub fn at(&self, t_s: f64) -> (f64, f64) {
        interpolated(&self.samples, t_s)
    }
}

/// A loop with its units.
pub(crate) struct Loop {
    process: Process,
    law: Law,
    open_loop: OpenLoop,
    /// Dead time of the process alone (s).
    model_tau_s: f64,
    /// Decided when it is asked for: the open loop alone does not need it.
    is_stable: OnceCell<bool>,
}

impl Loop {
    /// `None` if a number is not finite or out of range.
    pub(crate) fn new(model: &Model, controller: &Controller) -> Option<Self> {
        let linear = model.linear();
        let process = Process::new(&linear, &controller.execution())?;
        let law = Law::new(&process, controller);
        Self::of(process, law, linear.tau_s())
    }

    /// Loop of a law on a process whose own dead time is `model_tau_s` seconds.
    pub(crate) fn of(process: Process, law: Law, model_tau_s: f64) -> Option<Self> {
        let open_loop = OpenLoop::new(&process, &law);
        law.is_finite().then(|| Self {
            process,
            law,
            model_tau_s,
            is_stable: OnceCell::new(),
            open_loop,
        })
    }

    fn is_stable(&self) -> bool {
        *self.is_stable.get_or_init(|| is_stable(&self.open_loop))
    }

    fn curve(&self) -> Option<Curve<'_>> {
        if self.is_stable() {
            Curve::new(&self.open_loop)
        } else {
            None
        }
    }

    /// `None` if the loop is unstable.
    pub(crate) fn margins(&self) -> Option<Margins> {
        Some(self.curve()?.margins(self.process.unit_s))
    }

    /// `None` if the loop is unstable.
    pub(crate) fn sensitivity(&self) -> Option<Sensitivity> {
        Some(self.curve()?.sensitivity(self.process.unit_s))
    }

    /// IAE and ISE of a unit step of the load (output unit s, output unit^2 s).
    pub(crate) fn load_integrals(&self) -> Option<(f64, f64)> {
        let k = self.process.gain;
        let (iae, ise) = self.integrals(Excitation::Load)?;
        let t = self.process.unit_s;
        Some((iae * t * k.abs(), ise * t * k * k))
    }

    /// IAE and ISE of a unit step of the reference (output unit s, output unit^2 s).
    pub(crate) fn reference_integrals(&self) -> Option<(f64, f64)> {
        let (iae, ise) = self.integrals(Excitation::Reference)?;
        Some((iae * self.process.unit_s, ise * self.process.unit_s))
    }

    /// ISE of a unit step of the reference (output unit^2 s), to a relative 1e-4.
    pub(crate) fn reference_ise(&self) -> Option<f64> {
        let omega = self.fastest(&self.curve()?);
        let ending = Ending {
            squares: true,
            ..Ending::COARSE
        };
        let step = (STEP_RAD / omega, ending);
        let found = integrals(&self.process, &self.law, Excitation::Reference, omega, step)?;
        Some(found.ise * self.process.unit_s)
    }

    fn integrals(&self, excitation: Excitation) -> Option<(f64, f64)> {
        let error_stays = match excitation {
            Excitation::Load => self.law.ki == 0.0,
            Excitation::Reference => (self.final_output() - 1.0).abs() > 1e-12,
        };
        let curve = self.curve()?;
        if error_stays {
            return None;
        }
        let omega = self.fastest(&curve);
        let mut longest = self.longest_step(omega);
        let of = |longest: f64| {
            integrals(
                &self.process,
                &self.law,
                excitation,
                omega,
                (longest, Ending::FINE),
            )
        };
        let mut before = of(longest)?;
        for _ in 0..MOST_HALVINGS {
            longest *= 0.5;
            let found = of(longest)?;
            let agree = |a: f64, b: f64| (a - b).abs() <= AGREEMENT * a.abs();
            if agree(found.iae, before.iae) && agree(found.ise, before.ise) {
                return Some((found.iae, found.ise));
            }
            before = found;
        }
        None
    }

    /// Highest frequency of interest: of the peak of the sensitivity, or the last gain crossover.
    fn fastest(&self, curve: &Curve<'_>) -> f64 {
        let margins = curve.margins(1.0);
        let peak = curve.sensitivity(1.0);
        (peak.ms_rad_per_s)
            .max(margins.gain_crossover_rad_per_s)
            .max(1.0)
    }

    fn longest_step(&self, omega: f64) -> f64 {
        let step = 0.5 * STEP_RAD / omega;
        let times = self.process.times();
        let lag = times.last().filter(|time| time.is_finite());
        let filter = Some(&self.law.tf).filter(|time| **time > 0.0);
        let layers = lag.into_iter().chain(filter);
        let shortest = layers.copied().fold(f64::INFINITY, f64::min);
        step.min(shortest).max(step / MOST_REFINEMENT)
    }

    /// Value at which the output settles after a unit step of the reference.
    fn final_output(&self) -> f64 {
        if self.law.ki != 0.0 {
            return 1.0;
        }
        let zero = self.open_loop.denominator.constant();
        self.law.b * self.law.kp / (zero + self.law.kp)
    }

    /// See [`crate::noise_amplification`].
    pub(crate) fn noise_amplification(&self, sample_period_s: f64) -> Option<f64> {
        let period = sample_period_s / self.process.unit_s;
        (period.is_normal() && period > 0.0 && self.is_stable()).then(|| {
            let kappa = noise::amplification(&self.process, &self.law, period);
            kappa / self.process.gain.abs()
        })
    }

    /// See [`crate::loop_response`].
    pub(crate) fn response_at(&self, omega_rad_per_s: f64) -> Option<LoopResponse> {
        let omega = omega_rad_per_s * self.process.unit_s;
        if !(omega > 0.0 && omega.is_finite()) {
            return None;
        }
        let stages: f64 = (self.process.stages().iter())
            .map(|stage| match *stage {
                Stage::Lag(lag) => (omega * lag).atan(),
                Stage::Pole(pole) => omega.atan2(pole),
                Stage::Pair(c1, c0) => (c1 * omega).atan2(c0 - omega * omega),
            })
            .sum();
        let filters = self.process.sensors.iter().flatten();
        let sensor: f64 = (filters.map(|filter| {
            // Between -pi and 0: continuous.
            let response = filter.frequency_response(omega);
            (-response.im).atan2(response.re)
        }))
        .sum();
        let (numerator, denominator) = self.law.transfer();
        let path = numerator.at(omega) / denominator.at(omega);
        // F lags by less than pi, the rest of the path leads or lags by less than pi.
        let filter = (omega * self.law.tf).atan2(1.0 - 0.5 * (omega * self.law.tf).powi(2));
        let unfiltered = path * num_complex::Complex64::cis(filter);
        Some(LoopResponse {
            magnitude: self.open_loop.at(omega).norm(),
            phase_rad: unfiltered.arg() - filter - sensor - stages - omega * self.process.tau,
        })
    }

    /// Steps of a response until it settles at `goal` to `residue` of its peak, and the time of the first one.
    fn record(
        &self,
        excitation: Excitation,
        (goal, residue): (f64, f64),
    ) -> Result<Record, StepResponseError> {
        if !self.is_stable() {
            return Err(StepResponseError::Unstable);
        }
        let curve = self.curve().ok_or(StepResponseError::TooSlow)?;
        let omega = self.fastest(&curve);
        let mut record = Record::default();
        let (mut quiet, mut peak, mut settled) = (0, 0.0_f64, false);
        let take = |h: f64, start: f64, out: &[f64; 2 * NODES]| {
            (record.h, record.start) = (h, start);
            record.steps.push(*out);
            let off = out[NODES..]
                .iter()
                .fold(0.0, |off: f64, y| off.max((y - goal).abs()));
            peak = peak.max(off);
            quiet = if off <= residue * peak { quiet + 1 } else { 0 };
            let quiet_s = 2.0 * PI / omega + 2.0 * self.process.tau;
            settled = f64::from(quiet) * h >= quiet_s;
            !settled && record.steps.len() < MOST_STEPS && off.is_finite()
        };
        run(
            &self.process,
            &self.law,
            excitation,
            self.longest_step(omega),
            take,
        )
        .ok_or(StepResponseError::NoMethod)?;
        if settled {
            Ok(record)
        } else {
            Err(StepResponseError::TooSlow)
        }
    }

    /// Samples in the units of the user.
    fn samples(
        &self,
        record: &Record,
        output_unit: f64,
        input_unit: f64,
        start_s: f64,
    ) -> Vec<Sample> {
        let spacing_s = record.h * self.process.unit_s / (NODES - 1) as f64;
        let sample = |(n, [u, y]): (usize, [f64; 2])| Sample {
            t_s: start_s + n as f64 * spacing_s,
            y: y * output_unit,
            u: u * input_unit,
        };
        record.nodes().enumerate().map(sample).collect()
    }

    /// See [`crate::step_response`].
    pub(crate) fn step_response(&self) -> Result<StepResponse, StepResponseError> {
        let goal = self.final_output();
        let record = self.record(Excitation::Reference, (goal, RESIDUE))?;
        let unit_s = self.process.unit_s;
        let input_unit = 1.0 / self.process.gain;
        let start_s = self.process.tau * unit_s;
        let first = (start_s > 0.0).then_some(Sample {
            t_s: 0.0,
            y: 0.0,
            u: self.law.b * self.law.kp * input_unit,
        });
        let samples = self.samples(&record, 1.0, input_unit, start_s);
        Ok(StepResponse {
            samples: first.into_iter().chain(samples).collect(),
            metrics: self.metrics(&record, goal),
            ise: self
                .reference_integrals()
                .map_or(f64::INFINITY, |found| found.1),
        })
    }

    /// See [`crate::step_metrics`].
    pub(crate) fn step_metrics(&self) -> Result<StepMetrics, StepResponseError> {
        let goal = self.final_output();
        let record = self.record(Excitation::Reference, (goal, RESIDUE_OF_METRICS))?;
        Ok(self.metrics(&record, goal))
    }

    /// Characteristics of a recorded response to the reference, in the units of the user.
    fn metrics(&self, record: &Record, goal: f64) -> StepMetrics {
        let unit_s = self.process.unit_s;
        let metrics = reference_metrics(record, goal);
        StepMetrics {
            overshoot: metrics.overshoot,
            peak_time_s: metrics.peak_time_s.map(|time| time * unit_s),
            rise_time_s: metrics.rise_time_s * unit_s,
            settling_time_s: metrics.settling_time_s * unit_s,
            peak_input: metrics.peak_input / self.process.gain.abs(),
        }
    }

    /// See [`crate::load_response`].
    pub(crate) fn load_response(&self) -> Result<LoadResponse, StepResponseError> {
        let zero = self.open_loop.denominator.constant();
        let goal = if self.law.ki != 0.0 {
            0.0
        } else {
            1.0 / (zero + self.law.kp)
        };
        let record = self.record(Excitation::Load, (goal, RESIDUE))?;
        let k = self.process.gain;
        let first = Sample {
            t_s: 0.0,
            y: 0.0,
            u: 0.0,
        };
        let after = self.samples(&record, k, 1.0, self.model_tau_s);
        let peak = after
            .iter()
            .fold(0.0, |peak: f64, sample| peak.max(sample.y.abs()));
        let dead_time = (self.model_tau_s > 0.0).then_some(first);
        Ok(LoadResponse {
            samples: dead_time.into_iter().chain(after).collect(),
            peak,
            iae: match self.load_integrals() {
                Some((iae, _)) => iae,
                None if self.law.ki == 0.0 => f64::INFINITY,
                None => return Err(StepResponseError::TooSlow),
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::vectors::VECTORS;
    use crate::controller::{Form, Pid};
    use crate::model::{Linear, Structure};

    // Figures of the given gains: IAE, ISE, Ms, Mt, phase margin, gain margin and delay margin to 1e-8.
    #[test]
    fn figures_of_the_vectors() {
        for (i, vector) in VECTORS.iter().enumerate() {
            let process = vector.process();
            let t = process.unit_s;
            let k = process.gain;
            let [kp, ki, kd] = vector.gains;
            let gains = [kp * k, ki * k * t, kd * k / t];
            let law = Law::pid(&process, gains, vector.filter_s / t);
            let found = Loop::of(process, law, vector.tau_s).unwrap();
            let (iae, ise) = if vector.form == Form::Pd {
                found.reference_integrals().unwrap()
            } else {
                found.load_integrals().unwrap()
            };
            let peaks = found.sensitivity().unwrap();
            let margins = found.margins().unwrap();
            let figures = [
                (iae, vector.integrals[0]),
                (ise, vector.integrals[1]),
                (peaks.ms, vector.peaks[0]),
                (peaks.mt, vector.peaks[1]),
                (margins.phase_margin_rad.to_degrees(), vector.margins[0]),
                (margins.gain_margin.unwrap(), vector.margins[1]),
                (margins.delay_margin_s, vector.margins[2]),
            ];
            for (figure, (found, expected)) in figures.iter().enumerate() {
                let off = (found / expected - 1.0).abs();
                assert!(
                    off < 1e-8,
                    "vector {i}, figure {figure}: {found} {expected} {off:e}"
                );
            }
        }
    }

    // A slow and a slower exponential together look like one for a moment: there the ISE has no end. The output keeps its sign, so
    // the IAE is 1/Ki.
    #[test]
    fn slow_ends_have_integrals() {
        for t_prop_s in [0.03, 0.0419, 0.06] {
            let process = Linear::new(Structure::Soptd)
                .with_gain(114.49 / 1.03)
                .with_pole_per_s(1.0 / 1.03)
                .with_lags_s([t_prop_s, 0.0])
                .with_tau_s(0.0148);
            let model = Model::from(process);
            for kp in [0.12, 0.135, 0.15] {
                for ki in (0..20).map(|i| 0.05 + 0.01 * f64::from(i)) {
                    let controller = Controller::from(Pid::new(kp, ki, 0.000_144));
                    let found = Loop::new(&model, &controller).unwrap().load_integrals();
                    let (iae, _) = found.unwrap_or_else(|| panic!("{t_prop_s} {kp} {ki}"));
                    assert!((iae * ki - 1.0).abs() < 1e-6, "{t_prop_s} {kp} {ki}: {iae}");
                }
            }
        }
    }
}
