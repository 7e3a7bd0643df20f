//! Closed loop of any controller and the process, sample by sample.

use std::ops::ControlFlow;

use onecycle_design::Model;

use crate::controller::{Controller, Sensed};
use crate::delay::VariableStepProcess;
use crate::disturbance::Disturbances;
use crate::exact::FixedStepProcess;
use crate::linear::{FixedStepLinear, VariableStepLinear};
use crate::noise::NoiseSource;
use crate::sensor::Sensor;
use crate::trace::{Row, Trace};

/// Simulated experiment: process and conditions. Start from [`Experiment::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Experiment {
    /// The process.
    pub process: Model,
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
    /// Disturbances of the process.
    pub disturbances: Disturbances,
}

impl Experiment {
    /// An experiment with a perfect sensor, no bias, no disturbances and no jitter, from rest at the reference zero.
    #[must_use]
    pub fn new(process: impl Into<Model>, sample_s: f64, duration_s: f64) -> Self {
        Self {
            process: process.into(),
            sample_s,
            duration_s,
            reference: 0.0,
            input_bias: 0.0,
            sensor: Sensor::default(),
            jitter: 0.0,
            initial_output: 0.0,
            disturbances: Disturbances::default(),
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

    /// The same experiment with these disturbances.
    #[must_use]
    pub fn with_disturbances(self, disturbances: Disturbances) -> Self {
        Self {
            disturbances,
            ..self
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        (self.duration_s / self.sample_s).round() as usize
    }

    /// Runs the experiment and returns all samples that the sensor did not drop.
    #[must_use]
    pub fn run(&self, controller: &mut impl Controller, noise: &mut impl NoiseSource) -> Trace {
        let mut trace = Trace::with_capacity(self.samples());
        self.observe(controller, noise, |row| {
            if let Some(output) = row.output {
                trace.push(row.time_s, row.input, output, row.true_output);
            }
            ControlFlow::Continue(())
        });
        trace
    }

    /// Runs the experiment and passes every sample to `observer`, until it breaks off.
    pub fn observe(
        &self,
        controller: &mut impl Controller,
        noise: &mut impl NoiseSource,
        observer: impl FnMut(&Row) -> ControlFlow<()>,
    ) {
        let jittered = self.jitter > 0.0;
        let is_disturbed = !self.disturbances.is_none();
        let process = match (&self.process, jittered) {
            // On its own: the simulation that campaigns run a million times.
            (Model::Soiptd(process), false) if !is_disturbed => {
                let process = FixedStepProcess::new(process, self.sample_s);
                return self.observe_process(process, controller, noise, observer);
            }
            (Model::Soiptd(process), true) if !is_disturbed => {
                General::VariableStep(VariableStepProcess::new(process))
            }
            (model, false) => General::FixedLinear(Box::new(FixedStepLinear::new(
                &model.linear(),
                &self.disturbances,
                self.sample_s,
                noise,
            ))),
            (model, true) => General::VariableLinear(Box::new(VariableStepLinear::new(
                &model.linear(),
                &self.disturbances,
                noise,
            ))),
        };
        self.observe_process(process, controller, noise, observer);
    }

    fn observe_process(
        &self,
        mut process: impl Process,
        controller: &mut impl Controller,
        noise: &mut impl NoiseSource,
        mut observer: impl FnMut(&Row) -> ControlFlow<()>,
    ) {
        process.displace_output(self.initial_output);
        let (mut time_s, mut dt_s) = (0.0, self.sample_s);
        let mut measured = self.initial_output;
        for sample in 0..self.samples() {
            let true_output = process.output();
            let output = self.sensor.sample(true_output, noise);
            measured = output.unwrap_or(measured);
            let sensed = Sensed {
                output: measured,
                rate: process.rate(),
            };
            let input = controller.step(dt_s, self.reference, sensed);
            let row = Row {
                time_s,
                setpoint: controller.setpoint(self.reference),
                input,
                output,
                true_output,
            };
            if observer(&row).is_break() {
                return;
            }
            if self.jitter > 0.0 {
                let relative = 1.0 + self.jitter * noise.standard_normal();
                dt_s = self.sample_s * relative.clamp(0.1, 1.9);
                time_s += dt_s;
            } else {
                time_s = (sample + 1) as f64 * self.sample_s;
            }
            process.advance(input + self.input_bias, dt_s, noise);
        }
    }
}

/// What an experiment needs of a process. A process with fixed steps advances by one of them, whatever the duration.
trait Process {
    /// Holds the input at `u` for `duration_s`.
    fn advance(&mut self, u: f64, duration_s: f64, noise: &mut impl NoiseSource);
    /// Output (output unit).
    fn output(&self) -> f64;
    /// Rate of the output (output unit / s).
    fn rate(&self) -> f64;
    /// Adds an offset to the output (output unit).
    fn displace_output(&mut self, output: f64);
}

impl Process for FixedStepProcess {
    #[inline]
    fn advance(&mut self, u: f64, _duration_s: f64, _noise: &mut impl NoiseSource) {
        self.step(u);
    }

    #[inline]
    fn output(&self) -> f64 {
        self.output()
    }

    #[inline]
    fn rate(&self) -> f64 {
        self.rate()
    }

    fn displace_output(&mut self, output: f64) {
        self.displace(output, 0.0);
    }
}

/// Any simulation but the fastest one.
enum General {
    VariableStep(VariableStepProcess),
    FixedLinear(Box<FixedStepLinear>),
    VariableLinear(Box<VariableStepLinear>),
}

impl Process for General {
    fn advance(&mut self, u: f64, duration_s: f64, noise: &mut impl NoiseSource) {
        match self {
            Self::VariableStep(process) => process.advance(u, duration_s),
            Self::FixedLinear(process) => process.step(u, noise),
            Self::VariableLinear(process) => process.advance(u, duration_s, noise),
        }
    }

    fn output(&self) -> f64 {
        match self {
            Self::VariableStep(process) => process.output(),
            Self::FixedLinear(process) => process.output(),
            Self::VariableLinear(process) => process.output(),
        }
    }

    fn rate(&self) -> f64 {
        match self {
            Self::VariableStep(process) => process.rate(),
            Self::FixedLinear(process) => process.rate(),
            Self::VariableLinear(process) => process.rate(),
        }
    }

    fn displace_output(&mut self, output: f64) {
        match self {
            Self::VariableStep(process) => process.displace(output, 0.0),
            Self::FixedLinear(process) => process.displace(output),
            Self::VariableLinear(process) => process.displace(output),
        }
    }
}
