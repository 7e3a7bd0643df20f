//! The experiments: a random process, bias and noise under the relay of the board, and one steady
//! cycle of what is recorded at 1 kHz.
//!
//! Trial `n` of a seed is the same whatever else is run.

use onecycle_onboard::cycle::Cycle;
use onecycle_onboard::{Relay, RelaySettings, Soiptd};
use onecycle_plant::{Experiment, Trace};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::ClassifierError;
use crate::experiments::DrawnNoise;
use crate::learn::dataset::last_steady_cycle;
use crate::space::limit_cycle::symmetric;
use crate::space::{FieldError, Space, first_out_of_range};

/// Sample period (s): the paper's.
pub const SAMPLE_S: f64 = 1e-3;

/// The relay measures its noise for this long (s).
const PREROLL_S: f64 = 0.1;

/// Periods of the noise-free oscillation that an experiment lasts, and that it lasts where it was not
/// steady by then.
const PERIODS: [f64; 2] = [14.0, 60.0];
/// The same under a bias that is not trimmed: cycles are up to three times as long, and what is left of
/// a deviation after one is more.
const UNTRIMMED_PERIODS: [f64; 2] = [50.0, 150.0];

/// A cycle of a relay that follows the bias is steady only up to this many periods of the noise-free
/// oscillation: on the way there, while the trim still moves, three cycles of five periods can be alike. Of 32,000
/// random experiments none that had settled was longer than 1.13.
const LONGEST_TRIMMED: f64 = 1.5;

/// Whether the relay follows the bias.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// It does: cycles are symmetric.
    Trimmed,
    /// It does not, as in the paper: the bias is in the cycle.
    Untrimmed,
    /// The one and the other in turn.
    Both,
}

impl Protocol {
    /// Whether trial `n` is trimmed.
    fn is_trimmed(self, n: u64) -> bool {
        match self {
            Self::Trimmed => true,
            Self::Untrimmed => false,
            Self::Both => n.is_multiple_of(2),
        }
    }
}

/// How trials are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trials {
    /// Where processes come from, and the relay.
    pub space: Space,
    /// Seed of the first; the others follow.
    pub seed: u64,
    /// Input bias, uniform between plus and minus this part of the relay's amplitude.
    pub bias: f64,
    /// Noise of a sample, uniform up to this part of the amplitude of the noise-free oscillation.
    pub sigma: f64,
    /// Whether the relay follows the bias.
    pub protocol: Protocol,
}

/// Both signals of a whole cycle, from a rise of the relay to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledCycle {
    /// Sample period (s).
    pub sample_s: f64,
    /// Input as commanded (input unit).
    pub input: Vec<f32>,
    /// Output as measured (output unit).
    pub output: Vec<f32>,
    /// How much higher the output is where the cycle ends than where it began (output unit), averaged
    /// about both: what a steady state would not have.
    pub drift: f64,
}

/// Part of the cycle on either side of its ends over which the drift is averaged.
const DRIFT_PART: f64 = 1.0 / 32.0;

/// A trial that came to a steady oscillation.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The process, its velocity gain one.
    pub process: Soiptd,
    /// Its last steady cycle.
    pub cycle: SampledCycle,
}

impl Trials {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        self.space.validate()?;
        let share = |field, value: f64, most: f64, range| {
            (field, range, value, (0.0..=most).contains(&value))
        };
        first_out_of_range([
            share("bias", self.bias, 0.9, "0 to 0.9"),
            share("sigma", self.sigma, 1.0, "0 to 1"),
        ])
    }

    /// Trial number `n`, of a process with these times (s) or of a random one; `None` where the
    /// oscillation does not become steady.
    ///
    /// # Errors
    /// Where the times are no process.
    pub fn trial(
        &self,
        n: u64,
        times_s: Option<[f64; 3]>,
    ) -> Result<Option<Trial>, ClassifierError> {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed.wrapping_add(n));
        let random = self.space.random(&mut rng);
        let bias = self.bias * rng.random_range(-1.0..=1.0);
        let sigma = self.sigma * rng.random_range(0.0..=1.0);
        let [t_prop_s, t_body_s, tau_s] = times_s.unwrap_or(random);
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)?;
        let Some(quiet) = symmetric(&process, self.space.beta) else {
            return Ok(None);
        };
        let mut settings = RelaySettings::new(1.0, self.space.beta as f32);
        settings.preroll_s = PREROLL_S as f32;
        let is_trimmed = self.protocol.is_trimmed(n);
        if is_trimmed {
            settings.trim_gain = RelaySettings::TRIM_GAIN;
        }
        let (lengths, longest_s) = if is_trimmed {
            (PERIODS, LONGEST_TRIMMED * quiet.period_s())
        } else {
            (UNTRIMMED_PERIODS, f64::INFINITY)
        };
        for periods in lengths {
            let duration_s = PREROLL_S + periods * quiet.period_s();
            let mut experiment = Experiment::new(process, SAMPLE_S, duration_s);
            experiment.input_bias = bias;
            experiment.sensor.noise_sigma = sigma * quiet.amplitude;
            // The longer experiment begins as the shorter one did.
            let trace = experiment.run(
                &mut Relay::new(settings)?,
                &mut DrawnNoise(&mut rng.clone()),
            );
            let settled = last_steady_cycle(&trace).filter(|cycle| cycle.period_s < longest_s);
            if let Some(cycle) = settled.and_then(|cycle| sampled(&trace, &cycle)) {
                return Ok(Some(Trial { process, cycle }));
            }
        }
        Ok(None)
    }
}

fn sampled(trace: &Trace, cycle: &Cycle) -> Option<SampledCycle> {
    let first = (cycle.start_s / SAMPLE_S).round() as usize;
    let last = first + (cycle.period_s / SAMPLE_S).round() as usize;
    let single = |signal: &[f64]| {
        let values = signal.get(first..last)?;
        Some(values.iter().map(|&value| value as f32).collect())
    };
    let around = ((DRIFT_PART * (last - first) as f64) as usize).clamp(1, first.max(1));
    let mean_about = |k: usize| {
        let end = (k + around).min(trace.len());
        let values = &trace.output[k - around..end];
        values.iter().sum::<f64>() / values.len() as f64
    };
    let is_inside = first >= around && last < trace.len();
    Some(SampledCycle {
        drift: if is_inside {
            mean_about(last) - mean_about(first)
        } else {
            0.0
        },
        sample_s: SAMPLE_S,
        input: single(&trace.input)?,
        output: single(&trace.output)?,
    })
}
