//! The real plant of a recording: an actuator, then a linear process or one with a defect.

use num_complex::Complex64;
use onecycle_design::{Linear, Model};
use onecycle_plant::{Disturbances, FixedStepLinear, NoiseSource, VariableStepLinear};

use crate::experiments::actuator::Actuator;
use crate::experiments::defect::Defect;
use crate::experiments::defect::plant::DefectPlant;
use crate::experiments::oscillation::Oscillation;

/// The plant of a recording. Faults of the log alone are not part of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruePlant {
    /// Its linear process.
    pub process: Linear,
    /// Defect of the process.
    pub defect: Defect,
    /// Its actuator.
    pub actuator: Actuator,
    /// Gain at the end of the recording over that at its start.
    pub last_gain: f64,
    /// Oscillation of the process alone: units of time and output.
    pub oscillation: Oscillation,
}

impl TruePlant {
    /// The plant at rest, to be stepped by `step_s`, or by any duration where it has no defect and the steps vary.
    #[must_use]
    pub fn plant(
        &self,
        step_s: f64,
        disturbances: &Disturbances,
        varies: bool,
        noise: &mut impl NoiseSource,
    ) -> RealPlant {
        let soiptd = Model::from(self.process).soiptd();
        let body = match soiptd {
            Some(soiptd) if self.defect != Defect::None => Body::Defect(Box::new(
                DefectPlant::new(&soiptd, &self.defect, self.oscillation, step_s),
            )),
            _ if varies => Body::Varying(Box::new(VariableStepLinear::new(
                &self.process,
                disturbances,
                noise,
            ))),
            _ => Body::Fixed(Box::new(FixedStepLinear::new(
                &self.process,
                disturbances,
                step_s,
                noise,
            ))),
        };
        RealPlant {
            actuator: self.actuator,
            position: 0.0,
            gain: 1.0,
            body,
        }
    }

    /// The plant without what spoils the recording alone: a clipped sensor, a foreign tone.
    #[must_use]
    pub fn in_flight(&self) -> Self {
        let defect = match self.defect {
            Defect::Clipping { .. } | Defect::Tone { .. } => Defect::None,
            defect => defect,
        };
        Self { defect, ..*self }
    }

    /// Linear processes that the plant is near to, as functions of the frequency (rad/s): one, or the two ends of what
    /// varies. Empty if the input does not drive the output.
    #[must_use]
    pub fn responses(&self) -> Vec<Box<dyn Fn(f64) -> Complex64>> {
        let (process, defect) = (self.process, self.defect);
        if defect.is_undriven() {
            return vec![];
        }
        let of = move |process: Linear, gain: f64| -> Box<dyn Fn(f64) -> Complex64> {
            Box::new(move |omega| {
                let factor = defect.response(omega).unwrap_or(Complex64::ONE);
                gain * process.frequency_response(omega) * factor
            })
        };
        let mut ends = vec![of(process, 1.0)];
        if self.last_gain != 1.0 {
            ends.push(of(process, self.last_gain));
        }
        if let Defect::AsymmetricLag { falling_s } = defect {
            let mut lags_s = [1.0; 2];
            lags_s[..process.lags_s().len()].copy_from_slice(process.lags_s());
            lags_s[0] = falling_s;
            ends.push(of(process.with_lags_s(lags_s), 1.0));
        }
        ends
    }

    /// Whether the parameters of [`Self::process`] are those that an identification should find.
    #[must_use]
    pub fn has_parameters(&self) -> bool {
        !matches!(
            self.defect,
            Defect::Resonance { .. }
                | Defect::ExtraLag { .. }
                | Defect::SecondPath { .. }
                | Defect::SlowSensor { .. }
                | Defect::RateSensor
                | Defect::AsymmetricLag { .. }
                | Defect::VanDerPol { .. }
                | Defect::OtherLoop { .. }
        )
    }
}

/// A plant in motion.
#[derive(Clone, Debug)]
pub struct RealPlant {
    actuator: Actuator,
    position: f64,
    /// Gain in front of the process; it belongs to a recording during which it drifts.
    pub gain: f64,
    body: Body,
}

#[derive(Clone, Debug)]
enum Body {
    Fixed(Box<FixedStepLinear>),
    Varying(Box<VariableStepLinear>),
    Defect(Box<DefectPlant>),
}

impl RealPlant {
    /// Holds the command and another input behind the actuator, for a step: the one of the plant, or this duration (s)
    /// where the steps vary.
    pub fn step(
        &mut self,
        command: f64,
        other: f64,
        duration_s: f64,
        noise: &mut impl NoiseSource,
    ) {
        self.position = self.actuator.position(self.position, command);
        let input = self.gain * self.position + other;
        match &mut self.body {
            Body::Fixed(process) => process.step(input, noise),
            Body::Varying(process) => process.advance(input, duration_s, noise),
            Body::Defect(process) => process.step(input),
        }
    }

    /// Output of the plant (output unit).
    #[must_use]
    pub fn output(&self) -> f64 {
        match &self.body {
            Body::Fixed(process) => process.output(),
            Body::Varying(process) => process.output(),
            Body::Defect(process) => process.output(),
        }
    }

    /// Rate of the output (output unit / s).
    #[must_use]
    pub fn rate(&self) -> f64 {
        match &self.body {
            Body::Fixed(process) => process.rate(),
            Body::Varying(process) => process.rate(),
            Body::Defect(process) => process.rate(),
        }
    }
}
