//! Campaigns: many random relay experiments, each with its seed, and what became of them.
//!
//! A case is a process of the domain, an input bias, a noise; the experiment runs the relay of the
//! board on the exact process. Case `n` of seed `s` is the same whatever else is run.

use std::f64::consts::TAU;

use onecycle_onboard::cycle::{Cycle, CycleDetector, SteadyRun};
use onecycle_onboard::process::{Soiptd, SoiptdError};
use onecycle_onboard::refine::{Refined, coordinate};
use onecycle_onboard::relay::{Relay, RelayError, RelaySettings};
use onecycle_plant::{Experiment, Noise, Trace};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::experiments::{Family, Recipe};
use crate::judge::evaluate::{Judge, PHASE_MARGIN_DEG, in_order};
use crate::space::{FieldError, Space, first_out_of_range};
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_identify::{Identification, MOST_CYCLES, Method, Options, identify};

/// A campaign as a file describes it.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Campaign {
    /// What is measured.
    pub measure: Measure,
    /// Number of cases.
    pub cases: u64,
    /// Seed of the first case; the others follow.
    pub seed: u64,
    /// Input bias, uniform between plus and minus this part of the relay's amplitude.
    pub bias: f64,
    /// Noise, as a part of the amplitude of the noise-free oscillation: this, or uniform up to it.
    pub sigma: f64,
    /// Whether the noise is uniform from zero.
    #[serde(default)]
    pub sigma_uniform: bool,
    /// Offset at the start, in amplitudes of the oscillation.
    #[serde(default)]
    pub offset: f64,
    /// Whether the relay follows the bias.
    pub trim: bool,
    /// Asymmetry that the trim leaves, see [`RelaySettings::asymmetry`].
    #[serde(default)]
    pub asymmetry: f32,
    /// Cycles to fit.
    #[serde(default = "one")]
    pub cycles: usize,
    /// Times of all processes and of the sample period, over those of the paper's.
    #[serde(default = "unscaled")]
    pub time_scale: f64,
    /// How processes are found.
    #[serde(default)]
    pub method: Method,
    /// Parameter of the relay.
    #[serde(default = "distinguishing_beta")]
    pub beta: f64,
}

/// Most cases of a campaign: a day's work.
pub const MOST_CASES: u64 = 10_000_000;

fn unscaled() -> f64 {
    1.0
}

fn one() -> usize {
    1
}

fn distinguishing_beta() -> f64 {
    Space::MULTIROTOR.beta
}

/// What a campaign measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Whether the relay comes to a steady oscillation.
    Relay,
    /// Errors, intervals and deterioration of the identified process.
    Identification,
    /// What is made of processes out of the family: `cases` of each [kind](crate::experiments::outsiders::Kind), and
    /// five times as many of the family. Noise is uniform from zero.
    Unknown,
}

/// One experiment, before it is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// The process, with a velocity gain of one.
    pub process: Soiptd,
    /// Constant added to the input; the relay's amplitude is one.
    pub bias: f64,
    /// Noise of the sensor (output unit).
    pub sigma: f64,
    /// Period of the oscillation by the describing function (s).
    pub period_s: f64,
    /// Amplitude of its steady oscillation without noise and bias (output unit).
    pub amplitude: f64,
    seed: u64,
}

/// Sample period of unscaled experiments (s): the paper's.
const SAMPLE_S: f64 = 1e-3;
/// Periods after which a perfect oscillation has settled, with a few to spare.
const SETTLING_PERIODS: f64 = 15.0;
/// The relay of an unscaled experiment measures its noise for this long (s).
const PREROLL_S: f64 = 0.1;

/// Why a case cannot be run; none of the domain's cases ever fails so.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// The drawn parameters are no process.
    #[error("{0}")]
    Process(#[from] SoiptdError),
    /// The relay's settings are out of range.
    #[error("{0}")]
    Relay(#[from] RelayError),
    /// No oscillation by the describing function.
    #[error("the process has no oscillation at this phase")]
    NoOscillation,
}

impl Campaign {
    /// One experiment on the paper's relay, without trim, bias and noise: what a campaign is changed from.
    pub const QUIET: Self = Self {
        measure: Measure::Identification,
        cases: 1,
        seed: 1,
        bias: 0.0,
        sigma: 0.0,
        sigma_uniform: false,
        offset: 0.0,
        trim: false,
        asymmetry: 0.0,
        cycles: 1,
        time_scale: 1.0,
        method: Method::Map,
        beta: Space::MULTIROTOR.beta,
    };

    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn validate(&self) -> Result<(), FieldError> {
        first_out_of_range([
            (
                "cases",
                "1 to 10,000,000",
                self.cases as f64,
                (1..=MOST_CASES).contains(&self.cases),
            ),
            (
                "bias",
                "0 to 100",
                self.bias,
                (0.0..=100.0).contains(&self.bias),
            ),
            (
                "sigma",
                "0 to 100",
                self.sigma,
                (0.0..=100.0).contains(&self.sigma),
            ),
            (
                "offset",
                "-1e6 to 1e6",
                self.offset,
                (-1e6..=1e6).contains(&self.offset),
            ),
            (
                "time_scale",
                "1e-3 to 1e6",
                self.time_scale,
                (1e-3..=1e6).contains(&self.time_scale),
            ),
            (
                "beta",
                "-0.95 to 0.95",
                self.beta,
                (-0.95..=0.95).contains(&self.beta),
            ),
            (
                "cycles",
                "1 to 50",
                self.cycles as f64,
                (1..=MOST_CYCLES).contains(&self.cycles),
            ),
        ])
    }

    /// The recipe of the experiments on processes out of the family.
    #[must_use]
    pub fn recipe(&self) -> Recipe {
        Recipe {
            families: vec![Family {
                space: Space {
                    beta: self.beta,
                    ..Space::MULTIROTOR
                },
                ..Family::default()
            }],
            seed: self.seed,
            bias: self.bias,
            sigma: self.sigma,
            trim: self.trim,
        }
    }

    /// Case number `n`.
    ///
    /// # Errors
    /// A [`CaseError`] for parameters outside their physical range.
    pub fn case(&self, n: u64) -> Result<Case, CaseError> {
        let seed = self.seed + n;
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let times_s = Space::MULTIROTOR.random(&mut rng);
        let [t_prop_s, t_body_s, tau_s] = times_s.map(|time_s| time_s * self.time_scale);
        let bias = rng.random_range(-1.0..1.0) * self.bias;
        let part = if self.sigma_uniform {
            rng.random_range(0.0..1.0)
        } else {
            1.0
        };
        let process = Soiptd::new(1.0, t_prop_s, t_body_s, tau_s)?;
        let mut case = self.quiet_case(process, seed)?;
        case.bias = bias;
        case.sigma = part * self.sigma * case.amplitude;
        Ok(case)
    }

    /// A process with neither bias nor noise; the noise of `seed` is there to be turned up.
    ///
    /// # Errors
    /// [`CaseError::NoOscillation`] where the describing function has none.
    pub fn quiet_case(&self, process: Soiptd, seed: u64) -> Result<Case, CaseError> {
        let (omega, _) = process
            .describing_function_oscillation(1.0, self.beta)
            .ok_or(CaseError::NoOscillation)?;
        let mut case = Case {
            process,
            bias: 0.0,
            sigma: 0.0,
            period_s: TAU / omega,
            amplitude: 0.0,
            seed,
        };
        case.amplitude = self.noise_free_amplitude(&case)?;
        Ok(case)
    }

    fn sample_s(&self) -> f64 {
        SAMPLE_S * self.time_scale
    }

    /// Half the peak-to-peak output over the last two periods of a perfect experiment.
    fn noise_free_amplitude(&self, case: &Case) -> Result<f64, CaseError> {
        let (trace, _) = self.run(case, SETTLING_PERIODS)?;
        Ok(trace.amplitude_of_last((2.0 * case.period_s / self.sample_s()) as usize))
    }

    /// The relay of its experiments.
    #[must_use]
    pub fn relay_settings(&self) -> RelaySettings {
        let mut settings = RelaySettings::new(1.0, self.beta as f32);
        settings.preroll_s = (PREROLL_S * self.time_scale) as f32;
        settings.trim_gain = if self.trim {
            RelaySettings::TRIM_GAIN
        } else {
            0.0
        };
        settings.asymmetry = self.asymmetry;
        settings
    }

    /// The relay experiment of a case over so many periods of the describing function, and the
    /// relay after it.
    ///
    /// # Errors
    /// A [`CaseError`] for settings outside their range.
    pub fn run(&self, case: &Case, periods: f64) -> Result<(Trace, Relay), CaseError> {
        let mut relay = Relay::new(self.relay_settings())?;
        let duration_s = PREROLL_S * self.time_scale + periods * case.period_s;
        let mut experiment = Experiment::new(case.process, self.sample_s(), duration_s);
        experiment.input_bias = case.bias;
        experiment.sensor.noise_sigma = case.sigma;
        experiment.initial_output = self.offset * case.amplitude;
        // The noise has a stream of its own: cases differ in it, not in their draws.
        let trace = experiment.run(&mut relay, &mut Noise::from_seed(!case.seed));
        Ok((trace, relay))
    }
}

/// A jump of the input between the trim's small moves and the relay's own of two.
const JUMP: f64 = 0.5;

/// The cycles of a relay of amplitude one, of its output as measured or as it was.
pub(crate) fn cycles<'a>(
    trace: &'a Trace,
    output: &'a [f64],
) -> impl Iterator<Item = Cycle> + use<'a> {
    let mut detector = CycleDetector::new();
    let mut is_high = false;
    (1..trace.len()).filter_map(move |index| {
        let jump = trace.input[index] - trace.input[index - 1];
        if jump.abs() > JUMP {
            is_high = jump > 0.0;
        }
        detector.push(trace.time_s[index], is_high, output[index])
    })
}

/// What became of the relay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelayOutcome {
    /// Cycle at which three had been alike, if ever.
    pub steady_at: Option<u32>,
    /// Largest excursion over the amplitude of the oscillation by the describing function.
    pub excursion: f64,
    /// Period at the end over that of the describing function.
    pub period_ratio: f64,
    /// Whether the relay was still switching at the end: not run away.
    pub alive: bool,
    /// Switches taken back.
    pub undone: u32,
}

/// Periods of the describing function that a relay is given: twice what the slowest ones take.
const RELAY_PERIODS: f64 = 40.0;
/// A relay that has not switched for this many periods has run away.
const DEAD_PERIODS: f64 = 8.0;

/// Runs the relay of a case.
///
/// # Errors
/// A [`CaseError`] for parameters outside their range.
pub fn relay_outcome(campaign: &Campaign, case: &Case) -> Result<RelayOutcome, CaseError> {
    let (trace, relay) = campaign.run(case, RELAY_PERIODS)?;
    let mut run = SteadyRun::default();
    let (mut steady_at, mut last_end_s) = (None, 0.0);
    for (cycles, cycle) in (1..).zip(cycles(&trace, &trace.true_output)) {
        run.push(&cycle);
        last_end_s = cycle.start_s + cycle.period_s;
        if run.is_steady() {
            steady_at = steady_at.or(Some(cycles));
        }
    }
    let end_s = trace.time_s.last().copied().unwrap_or(0.0);
    let farthest = trace
        .true_output
        .iter()
        .fold(0.0_f64, |most, y| most.max(y.abs()));
    Ok(RelayOutcome {
        steady_at,
        excursion: farthest / case.amplitude,
        period_ratio: run.period_s / case.period_s,
        alive: end_s - last_end_s < DEAD_PERIODS * case.period_s,
        undone: relay.undone(),
    })
}

/// How the identified process compares with the true one.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentificationOutcome {
    /// What was identified.
    pub found: Identification,
    /// The true process, lags in order.
    pub truth: Soiptd,
    /// The bias there was (input unit).
    pub bias: f64,
    /// Cost of the identified process's controller on the true one.
    pub deterioration: Option<Deterioration>,
    /// Errors of the coordinates of a fit but for the bias, over what the estimator says of them: the
    /// Cramer-Rao bound of the window, narrowed by what was known beforehand. `None` where it found
    /// an error of the model or was not asked.
    pub errors: Option<[f64; SHAPE_AND_GAIN]>,
}

/// Coordinates of a fit but for the bias.
pub const SHAPE_AND_GAIN: usize = 4;

/// Errors of a fit over its standard deviations.
fn errors(refined: &Refined, truth: &Soiptd) -> Option<[f64; SHAPE_AND_GAIN]> {
    let covariance = refined
        .covariance
        .filter(|_| refined.response_error == 0.0)?;
    let coordinates = |process: &Soiptd| {
        let (pole_sum_per_s, ratio) = process.pole_sum();
        let mut at = [0.0; SHAPE_AND_GAIN];
        at[coordinate::LN_POLE_SUM] = pole_sum_per_s.ln();
        at[coordinate::POLE_RATIO] = ratio;
        at[coordinate::TAU_S] = process.tau_s();
        at[coordinate::LN_JERK_GAIN] = process.jerk_gain().abs().ln();
        at
    };
    let (found, truth) = (coordinates(&refined.process), coordinates(truth));
    Some(std::array::from_fn(|k| {
        (found[k] - truth[k]) / covariance[k][k].sqrt()
    }))
}

/// Periods for an identification: the transient and the cycles to fit.
pub(crate) const IDENTIFICATION_PERIODS: f64 = 30.0;

/// Runs the relay of a case and identifies the process from its recording.
///
/// The controllers compared are those of the paper's phase margin, [`PHASE_MARGIN_DEG`].
///
/// # Errors
/// A [`CaseError`] for parameters outside their range.
pub fn identification_outcome(
    campaign: &Campaign,
    case: &Case,
) -> Result<IdentificationOutcome, CaseError> {
    let (trace, _) = campaign.run(case, IDENTIFICATION_PERIODS)?;
    let signals = crate::experiments::signals_of(&trace, campaign.sample_s());
    let options = Options::default()
        .cycles(campaign.cycles)
        .phase_margin_rad(PHASE_MARGIN_DEG.to_radians())
        .method(campaign.method);
    let found = identify(&signals, &options);
    let truth = in_order(&case.process)?;
    let judge = Judge::new(&truth).ok();
    let deterioration = (found.outcome.as_ref().ok().zip(judge)).and_then(|(identified, judge)| {
        Some(judge.deterioration(identified.design.controller.pd()?))
    });
    let errors = (found.outcome.as_ref().ok())
        .and_then(|identified| errors(&identified.fit.refined, &truth));
    Ok(IdentificationOutcome {
        errors,
        found,
        truth,
        bias: case.bias,
        deterioration,
    })
}
