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
//! `test` (default: the relay), `process`, `noise`, `bias`, `periods`, `wind`; `control = true` for right data. A value is a
//! number, or two numbers between which it is uniform.
//!
//! Plant, noise and bias of case `n` of a kind depend on the seed and `n` only, so that every kind is tried on the same
//! plants.

mod fault;
mod plant;

use onecycle_design::{Linear, Model};
use onecycle_onboard::{Relay, RelaySettings};
use onecycle_plant::{Controller, Noise, NoiseSource, Sensed, Sensor};
use rand::{Rng, RngExt};
use serde::Deserialize;

pub use self::fault::{DrawnFault, Fault};
pub use self::plant::{RealPlant, TruePlant};

use super::campaign::{MOST_CASES, Measure};
use super::defect::{Defect, DefectKind};
use super::draw::stream;
use super::experiment::ExperimentError;
use super::oscillation::Oscillation;
use super::recording::{
    DisturbanceLevel, Excitation, ProcessRange, RecordingError, Signal, Span, distinguishing_beta,
    within,
};
use super::relays::AsymmetricRelay;
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

/// A kind of data. What is `None` is that of the campaign.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kind {
    /// Name in the table.
    pub name: String,
    /// Whether the data are right.
    #[serde(default)]
    pub control: bool,
    /// Fault of the recording or its plant.
    pub fault: Option<Fault>,
    /// Strength of the fault, in its unit.
    pub strength: Option<Span>,
    /// Defect of the process, of random strength. Needs an integrator with two lags.
    pub defect: Option<DefectKind>,
    /// Kinds of the remarks that name the trouble.
    #[serde(default)]
    pub named_by: Vec<String>,
    /// The experiment.
    #[serde(default)]
    pub test: Test,
    /// Processes.
    pub process: Option<ProcessRange>,
    /// Noise.
    pub noise: Option<Span>,
    /// Largest bias.
    pub bias: Option<f64>,
    /// Length of the test.
    pub periods: Option<f64>,
    /// Disturbances; not beside a defect.
    #[serde(default)]
    pub wind: DisturbanceLevel,
}

/// An experiment, in the units `T`, `a` and `h`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Test {
    /// The test signal.
    pub signal: Signal,
    /// Parameter of the relay.
    pub beta: f64,
    /// Asymmetry of the relay, which then trims the bias away.
    pub asymmetry: Option<f32>,
    /// Hysteresis in `a`, of a relay with two fixed levels in place of the board's.
    pub hysteresis: Option<f64>,
    /// Lower level of that relay, below zero.
    pub low: f64,
    /// Lowest and highest frequency of a chirp or a multisine, in `1/T`.
    pub band: Option<[f64; 2]>,
    /// Length of a pulse, in `T`.
    pub pulse: Option<f64>,
}

impl Default for Test {
    fn default() -> Self {
        Self {
            signal: Signal::Relay,
            beta: distinguishing_beta(),
            asymmetry: None,
            hysteresis: None,
            low: -1.0,
            band: None,
            pulse: None,
        }
    }
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
    /// A defect of another process than an integrator with two lags.
    #[error("kind \"{kind}\": a defect needs the structure soiptd")]
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
}

/// Least noise that the relay is told, in `a`: it chatters without.
const LEAST_RELAY_NOISE: f64 = 1e-3;
/// Steps of a wind.
const WIND_STEPS: usize = 3;
/// Most samples of a test.
const MOST_SAMPLES: f64 = 1e6;
/// Largest output, in `a`: beyond it the experiment has failed.
const LARGEST: f64 = 1e6;

impl HonestyCampaign {
    /// Checks every field.
    ///
    /// # Errors
    /// The first one that is missing or out of its range.
    pub fn validate(&self) -> Result<(), HonestyError> {
        let (fewest, most) = self.samples_per_period.ends();
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
            (
                "samples_per_period",
                "10 to 10,000, the lower value first",
                fewest,
                within(10.0, most, fewest) && most <= 1e4,
            ),
        ])?;
        self.kinds.iter().try_for_each(|kind| self.check(kind))
    }

    fn check(&self, kind: &Kind) -> Result<(), HonestyError> {
        let name = || kind.name.clone();
        let periods = kind.periods.unwrap_or(self.periods);
        let bias = kind.bias.unwrap_or(self.bias);
        let noise = kind.noise.unwrap_or(self.noise).ends();
        first_out_of_range([
            (
                "periods",
                "1 to 1000, and at most a million samples",
                periods,
                within(1.0, 1e3, periods)
                    && periods * self.samples_per_period.ends().1 <= MOST_SAMPLES,
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
        let (low, high) = kind.strength.map_or((0.0, 0.0), Span::ends);
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
        kind.wind.check().map_err(|error| part(error.into()))?;
        // In units of the period; the sample rate is the least.
        let rate_hz = self.samples_per_period.ends().0;
        let excitation = kind.test.excitation(1.0);
        excitation.check(periods, rate_hz).map_err(part)?;
        kind.test
            .controller(kind, periods, 1.0, (1.0, 0.0))
            .map(|_| ())
    }

    /// Name, sizes and noise of case `n` of kind number `kind`.
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
        let process = range.draw(&mut rng).map_err(part)?;
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
        let sample_s = oscillation.period_s / self.samples_per_period.draw(&mut rng);
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
        }))
    }
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

/// An experiment that is ready to run.
struct Run<'a> {
    kind: &'a Kind,
    truth: &'a TruePlant,
    fault: Option<DrawnFault>,
    noise_sigma: f64,
    bias: f64,
    step_s: f64,
    duration_s: f64,
}

impl Run<'_> {
    fn strength(&self, fault: Fault) -> f64 {
        self.fault.map_or(0.0, |drawn| drawn.of(fault))
    }

    /// `None` if the output runs away.
    fn run(&self, noise: &mut Noise, rng: &mut impl Rng) -> Result<Option<Columns>, HonestyError> {
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
            let input = controller.step(self.step_s, 0.0, sensed);
            columns.time_s.push(time_s);
            columns.input.push(input);
            columns.output.push(sensed.output);
            let part = time_s / self.duration_s;
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

impl Test {
    /// The test signal for a period of the oscillation (s).
    fn excitation(&self, period_s: f64) -> Excitation {
        Excitation {
            signal: self.signal,
            amplitude: 1.0,
            band_hz: self.band.map(|band| band.map(|edge| edge / period_s)),
            pulse_s: self.pulse.map(|pulse| pulse * period_s),
            beta: self.beta,
        }
    }

    /// What makes the input, for an amplitude (output unit) and a noise (in amplitudes).
    fn controller(
        &self,
        kind: &Kind,
        duration_s: f64,
        period_s: f64,
        (amplitude, noise): (f64, f64),
    ) -> Result<Box<dyn Controller>, HonestyError> {
        let of_recording = |error| HonestyError::Part {
            kind: kind.name.clone(),
            error,
        };
        if let Some(hysteresis) = self.hysteresis {
            let relay = AsymmetricRelay::new(1.0, self.low, hysteresis * amplitude);
            let relay = relay.map_err(|error| HonestyError::Relay {
                kind: kind.name.clone(),
                error,
            })?;
            return Ok(Box::new(relay));
        }
        let noise_sigma = noise * amplitude;
        if let (Signal::Relay, Some(asymmetry)) = (self.signal, self.asymmetry) {
            let relay = Relay::new(RelaySettings {
                noise_sigma: noise_sigma as f32,
                trim_gain: RelaySettings::TRIM_GAIN,
                asymmetry,
                ..RelaySettings::new(1.0, self.beta as f32)
            });
            return Ok(Box::new(relay.map_err(|error| of_recording(error.into()))?));
        }
        (self.excitation(period_s))
            .controller(None, duration_s, noise_sigma)
            .map_err(of_recording)
    }
}
