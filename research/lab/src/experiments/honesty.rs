//! Campaigns of wrong data: recordings with a fault, whose plant is known, to see whether the identification notices.
//!
//! ```toml
//! measure = "honesty"
//! cases = 25                       # random plants of each kind
//! seed = 18
//! noise = [0, 0.03]                # of one sample, in a
//! bias = 0.5                       # largest input bias, in h
//! periods = 20                     # length of a test, in T
//! samples_per_period = [60, 400]
//! process = { structure = "soiptd", k_over_t_body = 1, t_prop_s = [0.015, 0.3], t_body_s = [0.2, 2], tau_s = [0.0005, 0.1] }
//!
//! [[kinds]]
//! name = "input late"
//! fault = "input_late"             # see `fault`; or defect = "resonance", see `DefectKind`
//! strength = [0.01, 0.04]
//! named_by = ["clock_offset"]      # remarks that tell the user what is wrong
//! ```
//!
//! `T` and `a` are period and amplitude of the oscillation that the describing function gives the process under the relay
//! of the test (the distinguishing one for another test); `h`, the amplitude of the test signal, is one. Optional in a kind:
//! `test` (default: the relay), `process`, `noise`, `bias`, `periods`, `samples_per_period`, `wind`; `control = true` for right data. A value is a
//! number, or two numbers between which it is uniform.
//!
//! Plant, noise and bias of case `n` of a kind depend on the seed and `n` only, so that every kind is tried on the same
//! plants.

pub mod fault;
mod kind;
mod plant;
mod run;

use onecycle_design::Parameter::{InverseTBody, KOverTBody, TBody, TProp};
use onecycle_design::{Linear, Model};
use onecycle_plant::Noise;
use rand::{Rng, RngExt};
use serde::Deserialize;

pub use self::fault::{DrawnFault, Fault};
pub use self::kind::{Kind, Test};
pub use self::plant::{RealPlant, TruePlant};
use self::run::Run;

use super::campaign::{MOST_CASES, Measure};
use super::defect::Defect;
use super::draw::stream;
use super::experiment::ExperimentError;
use super::oscillation::Oscillation;
use super::recording::{ProcessRange, RecordingError, Span, within};
use crate::space::{FieldError, first_out_of_range};

/// A campaign of wrong data as a file describes it. See the [module](self).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HonestyCampaign {
    /// Always [`Measure::Honesty`].
    pub measure: Measure,
    /// Number of random plants of each kind.
    pub cases: u64,
    /// Seed of the first plant.
    pub seed: u64,
    /// Standard deviation of the noise of one sample, in `a`.
    pub noise: Span,
    /// Largest input bias, in `h`; uniform from minus to plus this value.
    pub bias: f64,
    /// Length of a test, in `T`.
    pub periods: f64,
    /// Samples in a period `T`.
    pub samples_per_period: Span,
    /// Processes.
    pub process: ProcessRange,
    /// Kinds of data.
    pub kinds: Vec<Kind>,
}

/// Why a campaign of wrong data cannot run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HonestyError {
    /// A field of the campaign is out of its range.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// A part of a kind is wrong.
    #[error("kind \"{kind}\": {error}")]
    Part {
        /// Name of the kind.
        kind: String,
        /// What is wrong.
        error: RecordingError,
    },
    /// The relay with two fixed levels is out of its range.
    #[error("kind \"{kind}\": {error}")]
    Relay {
        /// Name of the kind.
        kind: String,
        /// What is wrong.
        error: ExperimentError,
    },
    /// A defect of another process than an integrator with two lags, or beside what its simulation does not have.
    #[error("kind \"{kind}\": a defect needs the structure soiptd, no wind and no jitter")]
    Defect {
        /// Name of the kind.
        kind: String,
    },
    /// A fault without a strength.
    #[error("kind \"{kind}\": strength must be given for this fault")]
    Strength {
        /// Name of the kind.
        kind: String,
    },
    /// The process has no oscillation, which is the unit of everything.
    #[error(
        "kind \"{kind}\", case {case}: the relay does not make the process oscillate; give it a dead time or more lags"
    )]
    NoOscillation {
        /// Name of the kind.
        kind: String,
        /// Number of the case.
        case: u64,
    },
}

/// Columns of a file with even stamps.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    /// Sample period (s).
    pub sample_s: f64,
    /// Time (s).
    pub time_s: Vec<f64>,
    /// Input (input unit).
    pub input: Vec<f64>,
    /// Output (output unit).
    pub output: Vec<f64>,
}

/// A recording with its fault, and the plant that it was made on.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultyRecording {
    /// What the file holds.
    pub columns: Columns,
    /// The plant.
    pub truth: TruePlant,
    /// Strength of the fault. `None` for a defect and for right data.
    pub strength: Option<f64>,
    /// Standard deviation of the noise of one sample (output unit).
    pub noise_sigma: f64,
    /// Input bias (input unit).
    pub input_bias: f64,
}

/// Most samples of a test.
const MOST_SAMPLES: f64 = 1e6;

impl HonestyCampaign {
    /// Checks every field.
    ///
    /// # Errors
    /// The first one that is missing or out of its range.
    pub fn validate(&self) -> Result<(), HonestyError> {
        first_out_of_range([
            (
                "cases",
                "1 to 10,000,000",
                self.cases as f64,
                (1..=MOST_CASES).contains(&self.cases),
            ),
            ("bias", "0 to 100", self.bias, within(0.0, 100.0, self.bias)),
            (
                "kinds",
                "a list of one entry or more",
                0.0,
                !self.kinds.is_empty(),
            ),
        ])?;
        self.kinds.iter().try_for_each(|kind| self.check(kind))
    }

    fn check(&self, kind: &Kind) -> Result<(), HonestyError> {
        let name = || kind.name.clone();
        let periods = kind.periods.unwrap_or(self.periods);
        let (low, high) = kind.strength.map_or((0.0, 0.0), Span::ends);
        let steps = match kind.fault {
            Some(Fault::Decimated) => high.max(1.0),
            _ => 1.0,
        };
        let bias = kind.bias.unwrap_or(self.bias);
        let noise = kind.noise.unwrap_or(self.noise).ends();
        let (fewest, most) = self.samples_per_period_of(kind).ends();
        first_out_of_range([
            (
                "samples_per_period",
                "10 to 10,000, the lower value first",
                fewest,
                within(10.0, most, fewest) && most <= 1e4,
            ),
            (
                "periods",
                "1 to 1000, and at most a million steps of the relay",
                periods,
                within(1.0, 1e3, periods) && periods * most * steps <= MOST_SAMPLES,
            ),
            ("bias", "0 to 100", bias, within(0.0, 100.0, bias)),
            (
                "noise",
                "0 to 100, the lower value first",
                noise.0,
                within(0.0, noise.1, noise.0) && noise.1 <= 100.0,
            ),
        ])?;
        if kind.fault.is_some_and(Fault::has_strength) && kind.strength.is_none() {
            return Err(HonestyError::Strength { kind: name() });
        }
        let second = kind.test.second_amplitude.unwrap_or(1.0);
        first_out_of_range([(
            "second_amplitude",
            "0.01 to 100",
            second,
            within(0.01, 100.0, second),
        )])?;
        first_out_of_range([(
            "strength",
            "0 to 10,000, the lower value first",
            low,
            within(0.0, high, low) && high <= 1e4,
        )])?;
        let part = |error| HonestyError::Part {
            kind: name(),
            error,
        };
        let process = kind.process.as_ref().unwrap_or(&self.process);
        process.check(1.0).map_err(part)?;
        if kind.defect.is_some() && !kind.allows_defect(process) {
            return Err(HonestyError::Defect { kind: name() });
        }
        kind.wind.check().map_err(|error| part(error.into()))?;
        // In units of the period; the sample rate is the least.
        let excitation = kind.test.excitation(1.0);
        excitation.check(periods, fewest).map_err(part)?;
        kind.test
            .controller(kind, periods, 1.0, (1.0, 0.0))
            .map(|_| ())
    }

    fn samples_per_period_of(&self, kind: &Kind) -> Span {
        kind.samples_per_period.unwrap_or(self.samples_per_period)
    }

    /// Simulates case `n` of kind number `kind`. `None` if the output runs away.
    ///
    /// # Errors
    /// [`HonestyError::NoOscillation`], or a field that [`Self::validate`] refuses.
    pub fn record(&self, kind: usize, n: u64) -> Result<Option<FaultyRecording>, HonestyError> {
        let kind = &self.kinds[kind];
        let part = |error| HonestyError::Part {
            kind: kind.name.clone(),
            error,
        };
        let mut rng = stream(self.seed, n);
        let range = kind.process.as_ref().unwrap_or(&self.process);
        let process = ordered(range.draw(&mut rng).map_err(part)?);
        let beta = match kind.test {
            Test {
                hysteresis: Some(_),
                ..
            } => 0.0,
            test => test.beta,
        };
        let oscillation =
            Oscillation::of_linear(&process, beta).ok_or_else(|| HonestyError::NoOscillation {
                kind: kind.name.clone(),
                case: n,
            })?;
        let amplitude = oscillation.amplitude;
        let noise_sigma = kind.noise.unwrap_or(self.noise).draw(&mut rng) * amplitude;
        let bias = kind.bias.unwrap_or(self.bias) * rng.random_range(-1.0..=1.0);
        let sample_s = oscillation.period_s / self.samples_per_period_of(kind).draw(&mut rng);
        let fault = kind.fault.map(|fault| DrawnFault {
            fault,
            strength: kind
                .strength
                .map_or(0.0, |strength| strength.draw(&mut rng)),
        });
        let truth = TruePlant {
            process,
            defect: drawn_defect(kind, &process, oscillation, &mut rng)?,
            actuator: fault.map_or_else(Default::default, |fault| fault.actuator()),
            last_gain: 1.0 - fault.map_or(0.0, |fault| fault.of(Fault::GainDrift)),
            oscillation,
        };
        let experiment = Run {
            kind,
            truth: &truth,
            fault,
            noise_sigma,
            bias,
            step_s: sample_s / fault.map_or(1.0, |fault| fault.of(Fault::Decimated).max(1.0)),
            duration_s: kind.periods.unwrap_or(self.periods) * oscillation.period_s,
        };
        // The noise has a stream of its own, so that it does not depend on how many numbers were drawn.
        let mut noise = Noise::from_seed(!self.seed.wrapping_add(n));
        let Some(mut columns) = experiment.run(&mut noise, &mut rng)? else {
            return Ok(None);
        };
        if let Some(fault) = fault {
            fault.spoil(&mut columns, oscillation, &mut rng);
        }
        Ok(Some(FaultyRecording {
            columns,
            truth,
            strength: fault.map(|fault| fault.strength),
            noise_sigma,
            input_bias: bias,
        }))
    }
}

/// The same process with its lags in order: `T_body` is the longer one, as an identification reports it.
fn ordered(process: Linear) -> Linear {
    let (lag_s, body_s) = (process.parameter(TProp), process.parameter(TBody));
    let (Some(lag_s), Some(body_s)) = (lag_s, body_s) else {
        return process;
    };
    if lag_s <= body_s || process.structure().stages().lags > 1 {
        return process;
    }
    let swapped = |parameter| match parameter {
        TProp => Some(body_s),
        TBody => Some(lag_s),
        InverseTBody | KOverTBody => None,
        other => process.parameter(other),
    };
    Linear::from_parameters(process.structure(), swapped).unwrap_or(process)
}

fn drawn_defect(
    kind: &Kind,
    process: &Linear,
    oscillation: Oscillation,
    rng: &mut impl Rng,
) -> Result<Defect, HonestyError> {
    let Some(defect) = kind.defect else {
        return Ok(Defect::None);
    };
    let soiptd = Model::from(*process).soiptd();
    let soiptd = soiptd.ok_or_else(|| HonestyError::Defect {
        kind: kind.name.clone(),
    })?;
    Ok(Defect::draw(defect, &soiptd, oscillation, rng))
}

#[cfg(test)]
mod tests {
    use onecycle_design::{Parameter, Structure};

    use super::*;

    // K = 3, lags of 0.3 and 0.2 s: the longer one is T_body, and the frequency response is the same.
    #[test]
    fn the_longer_lag_is_that_of_the_body() {
        let value = |parameter| {
            Some(match parameter {
                Parameter::K => 3.0,
                TProp => 0.3,
                TBody => 0.2,
                Parameter::Tau => 0.01,
                _ => return None,
            })
        };
        for structure in [Structure::Soiptd, Structure::Soptd] {
            let drawn = Linear::from_parameters(structure, value).unwrap();
            let ordered = ordered(drawn);
            let of = |parameter| ordered.parameter(parameter).unwrap();
            assert!((of(TProp) - 0.2).abs() < 1e-15 && (of(TBody) - 0.3).abs() < 1e-15);
            let difference = ordered.frequency_response(4.0) - drawn.frequency_response(4.0);
            assert!(difference.norm() < 1e-12, "{difference}");
        }
    }
}
