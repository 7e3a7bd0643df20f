//! Campaigns of recordings: any process, test signal, disturbance and sensor, in open or closed loop.
//!
//! ```toml
//! measure = "recording"
//! cases = 450                # in all; case n takes combination n of the lists below, in turn
//! seed = 1
//! sample_rate_hz = 100
//! durations_s = [20]
//! noise = 0.01               # of one sample, in parts of the noise-free amplitude
//! structure = "soiptd"       # that the estimator fits; it chooses if this is left out
//! processes = [{ structure = "soiptd", k_over_t_body = 1, t_prop_s = [0.03, 0.08], t_body_s = 0.7, tau_s = 0.02 }]
//! excitations = [{ signal = "chirp", amplitude = 1, band_hz = [0.2, 5] }, { signal = "relay", amplitude = 1 }]
//! disturbances = [{}, { w1_rad_per_s = 3 }]
//! loops = [{ kp = 8, kd = 5, filter_s = 0.02, entry = "setpoint" }]
//! sensors = [{}, { outliers = 0.01, outlier_size = 0.1 }, { drop_outs = 0.05 }]
//! ```
//!
//! A parameter is a number, or two numbers between which it is uniform. Optional: `structure`,
//! `disturbances` (none), `loops` (open loop), `sensors` (no defects), `bias`. The noise-free amplitude is half the span of
//! the output of the same test without bias, noise and disturbances.
//!
//! Case `n` depends on the seed and `n` only.

mod parts;

use onecycle_design::{LinearError, Model, Parameter, Specification, Structure};
use onecycle_identify::{Noise, Options};
use onecycle_onboard::RelayError;
use onecycle_plant as plant;
use onecycle_plant::{Experiment, Sensor, TestSignalError, Trace};
use rand::RngExt;
use serde::Deserialize;

use self::parts::some_structure;
pub use self::parts::{
    ClosedLoop, DisturbanceLevel, EntryName, Excitation, ProcessRange, SensorDefects, Signal, Span,
};
pub(super) use self::parts::{distinguishing_beta, within};

use super::campaign::{MOST_CASES, Measure};
use super::draw::stream;
use crate::space::{FieldError, first_out_of_range};

/// A campaign of recordings as a file describes it. See the [module](self).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingCampaign {
    /// Always [`Measure::Recording`].
    pub measure: Measure,
    /// Number of cases.
    pub cases: u64,
    /// Seed of the first case.
    pub seed: u64,
    /// Sample rate (Hz).
    pub sample_rate_hz: f64,
    /// Durations (s).
    pub durations_s: Vec<f64>,
    /// Standard deviation of the noise of one sample, over the noise-free amplitude.
    pub noise: f64,
    /// Largest input bias over the amplitude of the test signal; uniform from minus to plus this value.
    #[serde(default)]
    pub bias: f64,
    /// Structure that the estimator fits. `None`: it chooses.
    #[serde(default, deserialize_with = "some_structure")]
    pub structure: Option<Structure>,
    /// Processes.
    pub processes: Vec<ProcessRange>,
    /// Test signals.
    pub excitations: Vec<Excitation>,
    /// Disturbances. Empty: none.
    #[serde(default)]
    pub disturbances: Vec<DisturbanceLevel>,
    /// Loops. Empty: open loop.
    #[serde(default)]
    pub loops: Vec<ClosedLoop>,
    /// Defects of the sensor. Empty: none.
    #[serde(default)]
    pub sensors: Vec<SensorDefects>,
}

/// Why a campaign of recordings cannot run.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// A field is out of its range.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// A parameter of a process is missing or out of its range.
    #[error("process {}: {}", structure.name(), match error.value.is_nan() {
        true => format!("{} must be given", error.parameter.key()),
        false => error.to_string(),
    })]
    Parameter {
        /// Structure of the process.
        structure: Structure,
        /// What is wrong.
        error: LinearError,
    },
    /// A parameter that the structure does not have, or a second gain.
    #[error("process {}: {} is one parameter too many", structure.name(), parameter.key())]
    Surplus {
        /// Structure of the process.
        structure: Structure,
        /// The parameter.
        parameter: Parameter,
    },
    /// A signal lacks a setting.
    #[error("signal {}: {field} must be given", signal.name())]
    Setting {
        /// The signal.
        signal: Signal,
        /// Name of the setting.
        field: &'static str,
    },
    /// A setting of a signal is out of its range.
    #[error("signal {}: {error}", signal.name())]
    Signal {
        /// The signal.
        signal: Signal,
        /// What is wrong.
        error: TestSignalError,
    },
    /// A setting of the relay is out of its range.
    #[error("signal relay: {0}")]
    Relay(#[from] RelayError),
    /// The output grows without limit.
    #[error(
        "case {case}: the output exceeds 1e100, because the loop is unstable or the test too long"
    )]
    Diverged {
        /// Number of the case.
        case: u64,
    },
}

/// Combination of a case: indices into the lists of the campaign. Zero where a list is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the lists of RecordingCampaign")]
pub struct Combination {
    pub process: usize,
    pub excitation: usize,
    pub disturbance: usize,
    pub duration: usize,
    pub closed_loop: usize,
    pub sensor: usize,
}

/// A simulated recording with its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedRecording {
    /// The true process.
    pub model: Model,
    /// The true input bias (input unit).
    pub input_bias: f64,
    /// Noise and disturbances. `None` if a disturbance is given in physical units.
    pub noise: Option<Noise>,
    /// Sample period (s).
    pub sample_s: f64,
    /// Samples that the sensor did not drop.
    pub trace: Trace,
}

/// Most samples of a recording: half a day at 1 kHz.
const MOST_SAMPLES: f64 = 5e7;
/// Largest output: its square is finite.
const LARGEST: f64 = 1e100;

impl RecordingCampaign {
    /// Checks every field.
    ///
    /// # Errors
    /// The first one that is missing or out of its range.
    pub fn validate(&self) -> Result<(), RecordingError> {
        first_out_of_range([
            (
                "cases",
                "1 to 10,000,000",
                self.cases as f64,
                (1..=MOST_CASES).contains(&self.cases),
            ),
            (
                "sample_rate_hz",
                "1e-6 to 1e6",
                self.sample_rate_hz,
                within(1e-6, 1e6, self.sample_rate_hz),
            ),
            (
                "noise",
                "0 to 100",
                self.noise,
                within(0.0, 100.0, self.noise),
            ),
            ("bias", "0 to 100", self.bias, within(0.0, 100.0, self.bias)),
        ])?;
        let lists = [
            ("durations_s", self.durations_s.len()),
            ("processes", self.processes.len()),
            ("excitations", self.excitations.len()),
        ];
        for (name, length) in lists {
            first_out_of_range([(name, "a list of one entry or more", 0.0, length > 0)])?;
        }
        for &duration_s in &self.durations_s {
            let samples = duration_s * self.sample_rate_hz;
            let is_right = within(2.0, MOST_SAMPLES, samples);
            first_out_of_range([("durations_s", "2 to 5e7 samples", duration_s, is_right)])?;
            for excitation in &self.excitations {
                excitation.check(duration_s, self.sample_rate_hz)?;
            }
        }
        for level in &self.disturbances {
            level.check()?;
        }
        for closed_loop in &self.loops {
            closed_loop.check()?;
        }
        for sensor in &self.sensors {
            sensor.check()?;
        }
        self.processes
            .iter()
            .try_for_each(|process| process.check(self.sample_rate_hz))
    }

    /// Settings of the identification.
    #[must_use]
    pub fn options(&self) -> Options {
        Options::default()
            .structure(self.structure)
            .specification(Specification::paper())
    }

    /// Combination of case `n`. All combinations come in turn.
    #[must_use]
    pub fn combination(&self, n: u64) -> Combination {
        let mut rest = n;
        let mut digit = |length: usize| {
            let length = length.max(1) as u64;
            let digit = rest % length;
            rest /= length;
            digit as usize
        };
        Combination {
            process: digit(self.processes.len()),
            excitation: digit(self.excitations.len()),
            disturbance: digit(self.disturbances.len()),
            duration: digit(self.durations_s.len()),
            closed_loop: digit(self.loops.len()),
            sensor: digit(self.sensors.len()),
        }
    }

    /// Simulates case `n`.
    ///
    /// # Errors
    /// [`RecordingError`]: a field that [`Self::validate`] refuses, or an unstable loop.
    pub fn record(&self, n: u64) -> Result<SimulatedRecording, RecordingError> {
        let at = self.combination(n);
        let mut rng = stream(self.seed, n);
        let process = self.processes[at.process].draw(&mut rng)?;
        let excitation = &self.excitations[at.excitation];
        let input_bias = self.bias * excitation.amplitude * rng.random_range(-1.0..=1.0);
        let sample_s = 1.0 / self.sample_rate_hz;
        let quiet = Experiment::new(process, sample_s, self.durations_s[at.duration]);
        // The noise has a stream of its own, so that it does not depend on how many numbers were drawn.
        let mut noise = plant::Noise::from_seed(!self.seed.wrapping_add(n));
        let closed_loop = self.loops.get(at.closed_loop);
        let mut controller = excitation.controller(closed_loop, quiet.duration_s, 0.0)?;
        let amplitude = quiet
            .run(&mut controller, &mut noise)
            .amplitude_of_last(usize::MAX);
        let noise_sigma = self.noise * amplitude;
        let level = self
            .disturbances
            .get(at.disturbance)
            .copied()
            .unwrap_or_default();
        let defects = self.sensors.get(at.sensor).copied().unwrap_or_default();
        let sensor = Sensor::noisy(noise_sigma)
            .with_drop_outs(defects.drop_outs)
            .with_outliers(defects.outliers, defects.outlier_size * amplitude);
        let experiment = quiet
            .with_sensor(sensor)
            .with_input_bias(input_bias)
            .with_disturbances(level.of(&process, noise_sigma, sample_s));
        let mut controller = excitation.controller(closed_loop, quiet.duration_s, noise_sigma)?;
        let trace = experiment.run(&mut controller, &mut noise);
        let is_usable = |value: &f64| value.abs() <= LARGEST;
        if !trace.output.iter().chain(&trace.input).all(is_usable) {
            return Err(RecordingError::Diverged { case: n });
        }
        Ok(SimulatedRecording {
            model: process.into(),
            input_bias,
            noise: level.relative_noise(noise_sigma),
            sample_s,
            trace,
        })
    }
}
