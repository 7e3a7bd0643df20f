//! The experiment of a recording: test signal, plant and sensor, sample by sample.

use onecycle_plant::{Controller, Noise, NoiseSource, Sensed, Sensor};
use rand::{Rng, RngExt};

use super::fault::{DrawnFault, Fault};
use super::kind::Kind;
use super::plant::TruePlant;
use super::{Columns, HonestyError};

/// Least noise that the relay is told, in `a`: it chatters without.
const LEAST_RELAY_NOISE: f64 = 1e-3;
/// Steps of a wind.
const WIND_STEPS: usize = 3;
/// Largest output, in `a`: beyond it the experiment has failed.
const LARGEST: f64 = 1e6;

/// An experiment that is ready to run.
pub(super) struct Run<'a> {
    pub(super) kind: &'a Kind,
    pub(super) truth: &'a TruePlant,
    pub(super) fault: Option<DrawnFault>,
    pub(super) noise_sigma: f64,
    pub(super) bias: f64,
    pub(super) step_s: f64,
    pub(super) duration_s: f64,
}

impl Run<'_> {
    fn strength(&self, fault: Fault) -> f64 {
        self.fault.map_or(0.0, |drawn| drawn.of(fault))
    }

    /// `None` if the output runs away.
    pub(super) fn run(
        &self,
        noise: &mut Noise,
        rng: &mut impl Rng,
    ) -> Result<Option<Columns>, HonestyError> {
        let TruePlant {
            defect,
            oscillation,
            ..
        } = *self.truth;
        let amplitude = oscillation.amplitude;
        let quantum = self.strength(Fault::Quantised) * amplitude;
        let sensor = Sensor::noisy(self.noise_sigma).with_quantum(quantum);
        let told = (self.noise_sigma).max(quantum) / amplitude;
        let sizes = (amplitude, told.max(LEAST_RELAY_NOISE));
        let mut controller =
            (self.kind.test).controller(self.kind, self.duration_s, oscillation.period_s, sizes)?;
        let disturbances = (self.kind.wind).of(&self.truth.process, self.noise_sigma, self.step_s);
        let jitter = self.strength(Fault::Jitter);
        let mut plant = self
            .truth
            .plant(self.step_s, &disturbances, jitter > 0.0, noise);
        let wind = self.wind(rng);
        let samples = (self.duration_s / self.step_s).round() as usize;
        let mut columns = Columns {
            sample_s: self.step_s,
            time_s: Vec::with_capacity(samples),
            input: Vec::with_capacity(samples),
            output: Vec::with_capacity(samples),
        };
        let second_amplitude = self.kind.test.second_amplitude;
        let feedback = self.strength(Fault::UnloggedFeedback) / amplitude;
        for sample in 0..samples {
            let time_s = sample as f64 * self.step_s;
            let output = plant.output();
            if output.is_nan() || output.abs() > LARGEST * amplitude {
                return Ok(None);
            }
            let sensed = Sensed {
                output: defect.sense(output, time_s, &sensor, noise),
                rate: plant.rate(),
            };
            let part = time_s / self.duration_s;
            let size = second_amplitude.filter(|_| part >= 0.5).unwrap_or(1.0);
            let input = size * controller.step(self.step_s, 0.0, sensed);
            columns.time_s.push(time_s);
            columns.input.push(input);
            columns.output.push(sensed.output);
            plant.gain = 1.0 - (1.0 - self.truth.last_gain) * part;
            let gust: f64 = wind
                .iter()
                .filter(|(from, _)| part >= *from)
                .map(|(_, u)| u)
                .sum();
            let late = if jitter > 0.0 {
                (1.0 + jitter * noise.standard_normal()).clamp(0.1, 1.9)
            } else {
                1.0
            };
            let other = self.bias + gust - feedback * output;
            plant.step(input, other, late * self.step_s, noise);
        }
        Ok(Some(columns))
    }

    /// Steps of the wind: from which part of the test on, and by how much (input unit).
    fn wind(&self, rng: &mut impl Rng) -> Vec<(f64, f64)> {
        let size = self.strength(Fault::WindSteps);
        let count = if size > 0.0 { WIND_STEPS } else { 0 };
        (0..count)
            .map(|_| {
                let sign = if rng.random_bool(0.5) { size } else { -size };
                (rng.random_range(0.1..0.95), sign)
            })
            .collect()
    }
}
