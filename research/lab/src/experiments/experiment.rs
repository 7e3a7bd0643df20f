//! One relay experiment: a process under the relay of the board, with bias and noise.
//!
//! Everything that runs a relay in simulation goes through [`RelayExperiment`]: recipes, campaigns, the
//! benchmark and the paper's classifier draw different processes and disturbances, and then all build
//! the relay, its pre-roll, the noise and the plant here.

use onecycle_onboard::{Relay, RelayError, RelaySettings, Soiptd, SoiptdError};
use onecycle_plant::{Controller, Experiment, NoiseSource, Sensed, Sensor, Trace};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::defect::Defect;
use super::defect::plant::DefectPlant;
use super::instruments::Instruments;
use super::oscillation::Oscillation;
use super::recipe::RecipeError;

/// Samples in which the relay measures its noise before it starts: 0.1 s at the paper's 1 kHz.
pub const PREROLL_SAMPLES: f64 = 100.0;

/// Why an experiment cannot be drawn or run.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ExperimentError {
    /// A field of the recipe is out of its range.
    #[error("{0}")]
    Recipe(#[from] RecipeError),
    /// The parameters are outside their physical range.
    #[error("{0}")]
    Process(#[from] SoiptdError),
    /// The settings of the board's relay are out of range.
    #[error("{0}")]
    Relay(#[from] RelayError),
    /// A setting of another relay is out of range: its name and value.
    #[error("{0} is out of range: {1}")]
    Setting(&'static str, f64),
    /// The describing function has no oscillation at the phase of this relay.
    #[error("the process does not oscillate at this phase")]
    NoOscillation,
    /// The relay made fewer cycles than a recording keeps.
    #[error("the relay made only {0} cycles")]
    TooFewCycles(usize),
}

/// How the relay is set and sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaySetup {
    /// Sine of the phase of the oscillation.
    pub beta: f64,
    /// Whether the relay trims the input bias away.
    pub trim: bool,
    /// Sample period (s).
    pub sample_s: f64,
    /// Time for which the relay measures its noise before it starts (s).
    pub preroll_s: f64,
}

/// How the process is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Simulation {
    /// By its exact transition matrix.
    Exact,
    /// By numerical integration, with a defect or with [`Defect::None`].
    Numerical(Defect),
}

/// A relay experiment, drawn and ready to run. The relay's amplitude is one.
#[derive(Clone, Debug, PartialEq)]
pub struct RelayExperiment {
    /// The process, without its defect.
    pub process: Soiptd,
    /// How the process is simulated, and its defect.
    pub simulation: Simulation,
    /// Oscillation without bias, noise and defect.
    pub oscillation: Oscillation,
    /// Settings of the relay.
    pub relay: RelaySettings,
    /// Sample period (s).
    pub sample_s: f64,
    /// Constant added to the input (input unit).
    pub input_bias: f64,
    /// Standard deviation of the noise of a sample (output unit).
    pub noise_sigma: f64,
    /// Output at the start (output unit); numerical simulation starts at rest.
    pub initial_output: f64,
    /// Errors of the instruments of its recording.
    pub instruments: Instruments,
    preroll_s: f64,
    noise: Pcg64Mcg,
}

impl RelayExperiment {
    /// An experiment from rest, without bias and noise, simulated exactly; `noise` is the random stream
    /// that the sensor draws from once [`Self::noise_sigma`] is set.
    #[must_use]
    pub fn new(
        process: Soiptd,
        oscillation: Oscillation,
        setup: RelaySetup,
        noise: Pcg64Mcg,
    ) -> Self {
        let mut relay = RelaySettings::new(1.0, setup.beta as f32);
        relay.preroll_s = setup.preroll_s as f32;
        if setup.trim {
            relay.trim_gain = RelaySettings::TRIM_GAIN;
        }
        Self {
            process,
            simulation: Simulation::Exact,
            oscillation,
            relay,
            sample_s: setup.sample_s,
            input_bias: 0.0,
            noise_sigma: 0.0,
            initial_output: 0.0,
            instruments: Instruments::PERFECT,
            preroll_s: setup.preroll_s,
            noise,
        }
    }

    /// What is wrong with the process or its sensor.
    #[must_use]
    pub fn defect(&self) -> Defect {
        match self.simulation {
            Simulation::Exact => Defect::None,
            Simulation::Numerical(defect) => defect,
        }
    }

    /// Runs the relay for the pre-roll and this many periods of the oscillation. Returns the recording,
    /// and the relay as it is afterwards. The same experiment gives the same bits each time; a longer one
    /// begins as a shorter one does.
    ///
    /// # Errors
    /// [`ExperimentError::Relay`] if the relay's settings are out of range.
    pub fn run(&self, periods: f64) -> Result<(Trace, Relay), ExperimentError> {
        let mut relay = Relay::new(self.relay)?;
        let duration_s = self.preroll_s + periods * self.oscillation.period_s;
        let trace = self.simulate(&mut relay, duration_s);
        Ok((trace, relay))
    }

    /// Runs any controller instead of the relay for a duration (s), on the same process with the same
    /// bias and noise.
    #[must_use]
    pub fn simulate(&self, controller: &mut impl Controller, duration_s: f64) -> Trace {
        let mut generator = self.noise.clone();
        let mut noise = DrawnNoise(&mut generator);
        let sensor = Sensor::noisy(self.noise_sigma);
        let mut experiment = Experiment::new(self.process, self.sample_s, duration_s);
        experiment.input_bias = self.input_bias;
        experiment.sensor = sensor;
        experiment.initial_output = self.initial_output;
        let defect = match self.simulation {
            Simulation::Exact => return experiment.run(controller, &mut noise),
            Simulation::Numerical(defect) => defect,
        };
        let mut plant = DefectPlant::new(&self.process, &defect, self.oscillation, self.sample_s);
        let mut trace = Trace::with_capacity(experiment.samples());
        for sample in 0..experiment.samples() {
            let time_s = sample as f64 * self.sample_s;
            let output = plant.output();
            let since_preroll_s = time_s - self.preroll_s;
            let sensed = Sensed {
                output: defect.sense(output, since_preroll_s, &sensor, &mut noise),
                rate: plant.rate(),
            };
            let input = controller.step(self.sample_s, 0.0, sensed);
            trace.push(time_s, input, sensed.output, output);
            plant.step(input + self.input_bias);
        }
        trace
    }
}

/// Noise from the random generator that the experiment was drawn from: one stream for both.
struct DrawnNoise<'a, R>(&'a mut R);

impl<R: Rng> NoiseSource for DrawnNoise<'_, R> {
    #[inline]
    fn standard_normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }
}
