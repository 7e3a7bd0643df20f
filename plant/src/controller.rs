//! Controllers of a simulated loop, and where a test signal enters it.

use onecycle_onboard::control::Measurement;
use onecycle_onboard::relay::Relay;
use onecycle_onboard::{Pd, PidLaw};

/// Measurement of a controller at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensed {
    /// Measured output (output unit); the last one if the sensor dropped this sample.
    pub output: f64,
    /// Rate of the output (output unit / s) from its own sensor, for example a gyroscope.
    pub rate: f64,
}

/// A sampled controller.
pub trait Controller {
    /// Returns the input to hold until the next sample (input unit). Takes the time since the last call (s), the
    /// reference (output unit) and the measurement.
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64;

    /// Set-point that the last step followed (output unit): `reference`, unless the controller adds to it.
    fn setpoint(&self, reference: f64) -> f64 {
        reference
    }
}

impl<C: Controller + ?Sized> Controller for Box<C> {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        (**self).step(dt_s, reference, sensed)
    }

    fn setpoint(&self, reference: f64) -> f64 {
        (**self).setpoint(reference)
    }
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

/// The PID law of the firmware, with the rate from the measured output.
impl Controller for PidLaw {
    #[inline]
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        let measured = Measurement::of(sensed.output as f32);
        f64::from(Self::step(self, dt_s as f32, reference as f32, &measured))
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

/// PD controller `u = kp (r - y) - kd v`, where `v` is the difference quotient of the measured output behind a low-pass
/// filter `1/(T_f s + 1)`, discretised by backward differences. The rate is zero at the first sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilteredPd {
    gains: Pd,
    filter_s: f64,
    /// Measured output of the last sample and the filtered rate.
    last: Option<(f64, f64)>,
}

impl FilteredPd {
    /// Controller with these gains and the filter's time constant `filter_s >= 0` (s).
    #[must_use]
    pub fn new(gains: Pd, filter_s: f64) -> Self {
        Self {
            gains,
            filter_s,
            last: None,
        }
    }
}

impl Controller for FilteredPd {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        let rate = match self.last {
            Some((output, rate)) => {
                (self.filter_s * rate + (sensed.output - output)) / (self.filter_s + dt_s)
            }
            None => 0.0,
        };
        self.last = Some((sensed.output, rate));
        self.gains.kp * (reference - sensed.output) - self.gains.kd * rate
    }
}

/// Where an excitation enters a closed loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Entry {
    /// Added to the output of the controller.
    Input,
    /// Added to the reference of the controller.
    Setpoint,
}

/// A loop that `controller` closes while `excitation` disturbs it: a [`Stimulus`](crate::Stimulus) or a relay.
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitedLoop<E, C> {
    excitation: E,
    controller: C,
    entry: Entry,
    /// Last value of the excitation.
    value: f64,
}

impl<E: Controller, C: Controller> ExcitedLoop<E, C> {
    /// Loop of `controller` with `excitation` at `entry`.
    #[must_use]
    pub fn new(excitation: E, controller: C, entry: Entry) -> Self {
        Self {
            excitation,
            controller,
            entry,
            value: 0.0,
        }
    }
}

impl<E: Controller, C: Controller> Controller for ExcitedLoop<E, C> {
    fn step(&mut self, dt_s: f64, reference: f64, sensed: Sensed) -> f64 {
        self.value = self.excitation.step(dt_s, reference, sensed);
        match self.entry {
            Entry::Input => self.value + self.controller.step(dt_s, reference, sensed),
            Entry::Setpoint => {
                let setpoint = self.setpoint(reference);
                self.controller.step(dt_s, setpoint, sensed)
            }
        }
    }

    fn setpoint(&self, reference: f64) -> f64 {
        match self.entry {
            Entry::Input => reference,
            Entry::Setpoint => reference + self.value,
        }
    }
}
