//! Closed loop of any controller and the process, sample by sample.

use onecycle_onboard::relay::Relay;
use onecycle_onboard::{Pd, Soiptd};

use crate::{FixedStepProcess, NoiseSource, Sensor, Trace, VariableStepProcess};

/// Measurement of a controller at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensed {
    /// Measured output (output unit).
    pub output: f64,
    /// Rate of the output (output unit / s) from its own sensor, for example a gyroscope.
    pub rate: f64,
}

/// A sampled controller.
pub trait Controller {
    /// Returns the input to hold until the next sample (input unit). Takes the time since the last call (s), the
    /// reference (output unit) and the measurement.
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64;
}

impl Controller for Relay {
    #[inline]
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        f64::from(Self::step(
            self,
            (reference - sensed.output) as f32,
            dt_s as f32,
        ))
    }
}

/// PD controller `u = kp (r - y) - kd dy/dt` at every sample, with the rate from its own sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledPd(
    /// Gains.
    pub Pd,
);

impl Controller for SampledPd {
    #[inline]
    fn step(&mut self, _dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        self.0.kp * (reference - sensed.output) - self.0.kd * sensed.rate
    }
}

/// Simulated experiment: process and conditions. Start from [`Experiment::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Experiment {
    /// The process.
    pub process: Soiptd,
    /// Sample period (s).
    pub sample_s: f64,
    /// Duration (s).
    pub duration_s: f64,
    /// Reference of the output (output unit).
    pub reference: f64,
    /// Constant added to the input and not recorded (input unit).
    pub input_bias: f64,
    /// The sensor of the output.
    pub sensor: Sensor,
    /// Standard deviation of the sample period as a fraction of it. Every increment is limited to 0.1 to 1.9
    /// periods.
    pub jitter: f64,
    /// Output at the start (output unit).
    pub initial_output: f64,
}

impl Experiment {
    /// An experiment with a perfect sensor, no bias and no jitter, from rest at the reference zero.
    #[must_use]
    pub fn new(process: Soiptd, sample_s: f64, duration_s: f64) -> Self {
        Self {
            process,
            sample_s,
            duration_s,
            reference: 0.0,
            input_bias: 0.0,
            sensor: Sensor::default(),
            jitter: 0.0,
            initial_output: 0.0,
        }
    }

    /// The same experiment with this reference (output unit).
    #[must_use]
    pub fn with_reference(self, reference: f64) -> Self {
        Self { reference, ..self }
    }

    /// The same experiment with this input bias (input unit).
    #[must_use]
    pub fn with_input_bias(self, input_bias: f64) -> Self {
        Self { input_bias, ..self }
    }

    /// The same experiment with this sensor.
    #[must_use]
    pub fn with_sensor(self, sensor: Sensor) -> Self {
        Self { sensor, ..self }
    }

    /// The same experiment with this jitter of the sample period (a fraction of it).
    #[must_use]
    pub fn with_jitter(self, jitter: f64) -> Self {
        Self { jitter, ..self }
    }

    /// The same experiment with this output at the start (output unit).
    #[must_use]
    pub fn with_initial_output(self, initial_output: f64) -> Self {
        Self {
            initial_output,
            ..self
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        (self.duration_s / self.sample_s).round() as usize
    }

    /// Runs the experiment and returns all samples.
    #[must_use]
    pub fn run(&self, controller: &mut impl Controller, noise: &mut impl NoiseSource) -> Trace {
        let mut trace = Trace::with_capacity(self.samples());
        self.observe(controller, noise, |time_s, input, output, true_output| {
            trace.push(time_s, input, output, true_output);
        });
        trace
    }

    /// Runs the experiment and passes every sample to `observer`: time (s), commanded input, measured output,
    /// true output.
    pub fn observe(
        &self,
        controller: &mut impl Controller,
        noise: &mut impl NoiseSource,
        mut observer: impl FnMut(f64, f64, f64, f64),
    ) {
        if self.jitter > 0.0 {
            return self.observe_jittered(controller, noise, observer);
        }
        let mut process = FixedStepProcess::new(&self.process, self.sample_s);
        process.displace(self.initial_output, 0.0);
        for sample in 0..self.samples() {
            let output = process.output();
            let sensed = Sensed {
                output: self.sensor.read(output, noise),
                rate: process.rate(),
            };
            let input = controller.step(self.sample_s, self.reference, sensed);
            observer(sample as f64 * self.sample_s, input, sensed.output, output);
            process.step(input + self.input_bias);
        }
    }

    fn observe_jittered(
        &self,
        controller: &mut impl Controller,
        noise: &mut impl NoiseSource,
        mut observer: impl FnMut(f64, f64, f64, f64),
    ) {
        let mut process = VariableStepProcess::new(&self.process);
        process.displace(self.initial_output, 0.0);
        let (mut time_s, mut dt_s) = (0.0, self.sample_s);
        for _ in 0..self.samples() {
            let output = process.output();
            let sensed = Sensed {
                output: self.sensor.read(output, noise),
                rate: process.rate(),
            };
            let input = controller.step(dt_s, self.reference, sensed);
            observer(time_s, input, sensed.output, output);
            let relative = 1.0 + self.jitter * noise.standard_normal();
            dt_s = self.sample_s * relative.clamp(0.1, 1.9);
            process.advance(input + self.input_bias, dt_s);
            time_s += dt_s;
        }
    }
}
