//! Outcomes of a campaign of wrong data: refused, named, or accepted; and whether what was promised holds on the real plant.
//!
//! The real plant is closed with the controller that the identification proposes, as the firmware runs it, and steps the
//! reference. A promise is broken if
//!
//! - the loop is unstable: it diverges, or ends in a limit cycle;
//! - the phase margin on the real plant is below the low end of its interval by more than 3 degrees;
//! - a parameter lies outside its 90 % interval by more than half of the width of the interval, and by more than 1 % of its
//!   value.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use onecycle_design::{Controller, Model, Parameter, Structure};
use onecycle_identify::{Identification, Identified, Interval, Options, Remark, Signals, identify};
use onecycle_onboard::{PidLaw, PidSettings};
use onecycle_plant::{Disturbances, Noise, Sensed};

use crate::experiments::honesty::{FaultyRecording, TruePlant};

/// Result of one recording.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum HonestyOutcome {
    /// There is no recording: the output ran away during the test.
    NotRecorded,
    /// Refused, with the kind of the verdict.
    Refused(String),
    /// Accepted.
    Accepted(Accepted),
}

/// What was promised about a recording, and what broke.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Accepted {
    /// Kinds of the remarks.
    pub remarks: Vec<String>,
    /// Name of the structure.
    pub structure: String,
    /// Strength of the fault, where it has one.
    pub strength: Option<f64>,
    /// Low end of the interval of the phase margin (degrees).
    pub promised_margin_deg: Option<f64>,
    /// Phase margin on the real plant (degrees). `None` without a controller or a gain crossover.
    pub true_margin_deg: Option<f64>,
    /// Promises that do not hold.
    pub broken: Vec<Broken>,
}

/// A promise that does not hold.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Broken {
    /// The loop with the real plant is unstable.
    Unstable {
        /// Amplitude of its limit cycle, over that of the relay oscillation. `None` if it diverges.
        limit_cycle: Option<f64>,
    },
    /// The phase margin is less than promised (degrees).
    Margin {
        /// Low end of the interval.
        promised_deg: f64,
        /// On the real plant.
        true_deg: f64,
    },
    /// A parameter is not within its interval.
    Parameter {
        /// Key of the parameter.
        key: String,
        /// Low end of the interval, if it has one.
        low: Option<f64>,
        /// High end of the interval, if it has one.
        high: Option<f64>,
        /// True value.
        truth: f64,
    },
}

impl Accepted {
    /// Whether the loop with the real plant is unstable.
    #[must_use]
    pub fn is_unstable(&self) -> bool {
        let is_unstable = |broken: &Broken| matches!(broken, Broken::Unstable { .. });
        self.broken.iter().any(is_unstable)
    }

    /// Whether one of the remarks is of these kinds.
    #[must_use]
    pub fn is_named(&self, kinds: &[String]) -> bool {
        self.remarks.iter().any(|remark| kinds.contains(remark))
    }
}

/// Degrees by which a margin may be below its interval.
const TOLERATED_DEG: f64 = 3.0;
/// Part of a parameter by which its interval may miss it.
const TOLERATED_PART: f64 = 0.01;

/// Identifies a recording as the defaults do, and tries the result on the real plant.
#[must_use]
pub fn honesty_outcome(recording: Option<&FaultyRecording>) -> HonestyOutcome {
    let Some(recording) = recording else {
        return HonestyOutcome::NotRecorded;
    };
    let columns = &recording.columns;
    let signals = Signals {
        time_s: &columns.time_s,
        input: &columns.input,
        output: &columns.output,
        samples_per_point: 1,
        sample_period_s: columns.sample_s,
        breaks: &[],
    };
    let Identification {
        outcome, remarks, ..
    } = identify(&signals, &Options::default());
    match outcome {
        Err(verdict) => HonestyOutcome::Refused(verdict.kind().to_owned()),
        Ok(identified) => HonestyOutcome::Accepted(judge(recording, &identified, &remarks)),
    }
}

fn judge(recording: &FaultyRecording, identified: &Identified, remarks: &[Remark]) -> Accepted {
    let truth = recording.truth.in_flight();
    let mut broken = vec![];
    if truth.has_parameters() {
        broken.extend(parameters(&truth, identified));
    }
    let controller = identified.design.map(|design| design.controller);
    let crossover = identified
        .design
        .map(|design| design.margins.gain_crossover_rad_per_s);
    let promised_deg = identified
        .phase_margin_rad
        .and_then(|margin| Some(margin.low?.to_degrees()));
    let mut true_margin_deg = None;
    if let (Some(controller), Some(crossover)) = (&controller, crossover) {
        let loop_end = run(
            &truth,
            controller,
            crossover,
            columns_step(recording),
            recording.noise_sigma,
        );
        let margin = least_margin_rad(&truth, controller, crossover).map(f64::to_degrees);
        true_margin_deg = margin.map(|margin| match loop_end {
            LoopEnd::Settled => margin,
            _ => margin.min(-margin),
        });
        broken.extend(loop_end.broken());
        if let (Some(promised_deg), Some(true_deg)) = (promised_deg, true_margin_deg)
            && true_deg < promised_deg - TOLERATED_DEG
        {
            broken.push(Broken::Margin {
                promised_deg,
                true_deg,
            });
        }
    }
    Accepted {
        remarks: remarks
            .iter()
            .map(Remark::kind)
            .map(str::to_owned)
            .collect(),
        structure: identified.model.structure().name().to_owned(),
        strength: recording.strength,
        promised_margin_deg: promised_deg,
        true_margin_deg,
        broken,
    }
}

fn columns_step(recording: &FaultyRecording) -> f64 {
    recording.columns.sample_s
}

/// Parameters whose intervals miss the truth by too much.
fn parameters(truth: &TruePlant, identified: &Identified) -> Vec<Broken> {
    let model = Model::from(truth.process);
    if !is_comparable(model.structure(), identified.model.structure()) {
        return vec![];
    }
    let of = |(parameter, interval): (Parameter, Interval)| {
        // The inverse values of these go through zero.
        if matches!(parameter, Parameter::TBody | Parameter::InputBias)
            || parameter == Parameter::K && model.structure() == Structure::Soiptd
        {
            return None;
        }
        let value = model.parameter(parameter)?;
        let is_gain = matches!(parameter, Parameter::K | Parameter::KOverTBody);
        let last = if is_gain {
            value * truth.last_gain
        } else {
            value
        };
        let scale = match parameter {
            // A dead time of nearly nothing matters beside the lags only.
            Parameter::Tau => value + truth.process.lags_s().iter().sum::<f64>(),
            _ => value.abs(),
        };
        let misses = |value| misses(&interval, value, scale);
        (misses(value) && misses(last)).then(|| Broken::Parameter {
            key: parameter.key().to_owned(),
            low: interval.low,
            high: interval.high,
            truth: value,
        })
    };
    identified.estimate.iter().filter_map(of).collect()
}

/// Whether the parameters of a structure mean the same in another one: a lag of one structure is dead time in a simpler
/// one.
fn is_comparable(truth: Structure, found: Structure) -> bool {
    use Structure::{DoubleIntegratorLag, Soiptd};
    truth == found || matches!((truth, found), (Soiptd, DoubleIntegratorLag))
}

/// Whether a value lies outside an interval by more than half its width, and by more than a hundredth of `scale`.
fn misses(interval: &Interval, value: f64, scale: f64) -> bool {
    let below = interval.low.map_or(0.0, |low| low - value);
    let above = interval.high.map_or(0.0, |high| value - high);
    let half = match (interval.low, interval.high) {
        (Some(low), Some(high)) => 0.5 * (high - low),
        _ => 0.0,
    };
    below.max(above) > half.max(TOLERATED_PART * scale)
}

/// Turns of the gain crossover for which a loop is simulated: at 5 degrees of phase margin `exp(-40 tan(5 deg) pi) = 2e-5`
/// remains.
const TURNS: f64 = 40.0;
/// Fewest and most samples of that.
const SAMPLES: (f64, f64) = (1e3, 1e5);
/// Output over the step at which a loop has diverged.
const DIVERGED: f64 = 1e3;
/// Amplitude of a limit cycle over that of the relay oscillation, and over the noise, that a loop may keep.
const QUIET: (f64, f64) = (0.02, 5.0);
/// Ratio of the amplitudes of the last two quarters above which an oscillation does not decay.
const LASTING: f64 = 0.8;

/// How the step of a loop ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum LoopEnd {
    Settled,
    /// Amplitude over that of the relay oscillation.
    LimitCycle(f64),
    Diverged,
}

impl LoopEnd {
    fn broken(self) -> Option<Broken> {
        let limit_cycle = match self {
            Self::Settled => return None,
            Self::LimitCycle(amplitude) => Some(amplitude),
            Self::Diverged => None,
        };
        Some(Broken::Unstable { limit_cycle })
    }
}

/// The loop of a controller with the real plant under a step of one amplitude of the oscillation, without noise.
fn run(
    truth: &TruePlant,
    controller: &Controller,
    crossover_rad_per_s: f64,
    sample_s: f64,
    noise_sigma: f64,
) -> LoopEnd {
    let pid = controller.pid();
    let own_s = pid.execution.sample_period_s;
    let step_s = if own_s > 0.0 { own_s } else { sample_s };
    let settings = PidSettings::new(pid.kp as f32, pid.ki as f32, pid.kd as f32)
        .with_filter_s(pid.filter_s as f32)
        .with_setpoint_weight(pid.setpoint_weight as f32);
    let Ok(mut law) = PidLaw::new(settings) else {
        return LoopEnd::Diverged;
    };
    if truth.defect.is_undriven() {
        return LoopEnd::Diverged;
    }
    let mut noise = Noise::from_seed(0);
    let mut plant = truth.plant(step_s, &Disturbances::default(), false, &mut noise);
    plant.gain = truth.last_gain;
    let amplitude = truth.oscillation.amplitude;
    let samples = (TURNS * TAU / crossover_rad_per_s / step_s).clamp(SAMPLES.0, SAMPLES.1);
    let mut quarters = [(f64::INFINITY, f64::NEG_INFINITY); 4];
    for sample in 0..samples as usize {
        let output = plant.output();
        if output.is_nan() || output.abs() > DIVERGED * amplitude {
            return LoopEnd::Diverged;
        }
        let (low, high) = &mut quarters[(4 * sample / samples as usize).min(3)];
        (*low, *high) = (low.min(output), high.max(output));
        let sensed = Sensed {
            output,
            rate: plant.rate(),
        };
        let input = onecycle_plant::Controller::step(&mut law, step_s, amplitude, sensed);
        plant.step(input, 0.0, step_s, &mut noise);
    }
    let [.., before, last] = quarters.map(|(low, high)| 0.5 * (high - low));
    let quiet = (QUIET.0 * amplitude).max(QUIET.1 * noise_sigma);
    if last > quiet && last > LASTING * before {
        LoopEnd::LimitCycle(last / amplitude)
    } else {
        LoopEnd::Settled
    }
}

/// Range of frequencies about the designed crossover in which the true one is searched, and their number.
const AROUND: f64 = 100.0;
const FREQUENCIES: usize = 8000;

/// Least distance of the loop from -1 in phase, over its gain crossovers and over the processes that the plant is near to
/// (rad). `None` if the loop has no crossover.
fn least_margin_rad(
    truth: &TruePlant,
    controller: &Controller,
    crossover_rad_per_s: f64,
) -> Option<f64> {
    let responses = truth.responses();
    let margins = responses.iter().flat_map(|response| {
        let at = |k: usize| {
            let part = 2.0 * k as f64 / FREQUENCIES as f64 - 1.0;
            let omega = crossover_rad_per_s * AROUND.powf(part);
            controller.frequency_response(omega) * response(omega)
        };
        (0..FREQUENCIES).filter_map(move |k| crossing_rad(at(k), at(k + 1)))
    });
    margins.min_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// Phase above -180 degrees (rad, -pi to pi) where the magnitude passes 1 between two points of an open loop.
fn crossing_rad(from: Complex64, to: Complex64) -> Option<f64> {
    let (a, b) = (from.norm().ln(), to.norm().ln());
    if (a > 0.0) == (b > 0.0) {
        return None;
    }
    let turn = (to / from).arg();
    let phase = from.arg() + turn * a / (a - b);
    let above = phase + PI;
    Some(above - TAU * (above / TAU).round())
}

/// Counts over the recordings of one kind, or of several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct HonestyTally {
    /// Recordings.
    pub cases: usize,
    /// Refused.
    pub refused: usize,
    /// Accepted, with a remark that names the trouble.
    pub named: usize,
    /// Accepted with other remarks, and every promise holds.
    pub remarked_right: usize,
    /// Accepted with other remarks, and a promise is broken.
    pub remarked_wrong: usize,
    /// Accepted without remark, and every promise holds.
    pub silent_right: usize,
    /// Accepted without remark, and a promise is broken.
    pub silent_wrong: usize,
    /// Accepted, and the loop with the real plant is unstable.
    pub unstable: usize,
    /// Of these, those without a remark that names the trouble.
    pub unstable_unnamed: usize,
}

impl HonestyTally {
    /// Adds an outcome of a kind with these naming remarks. Tests that ran away leave no recording, so they do not count.
    pub fn add(&mut self, outcome: &HonestyOutcome, named_by: &[String]) {
        let accepted = match outcome {
            HonestyOutcome::NotRecorded => return,
            HonestyOutcome::Refused(_) => {
                self.cases += 1;
                self.refused += 1;
                return;
            }
            HonestyOutcome::Accepted(accepted) => accepted,
        };
        let is_named = accepted.is_named(named_by);
        let is_right = accepted.broken.is_empty();
        let count = match (is_named, accepted.remarks.is_empty(), is_right) {
            (true, ..) => &mut self.named,
            (_, false, true) => &mut self.remarked_right,
            (_, false, false) => &mut self.remarked_wrong,
            (_, true, true) => &mut self.silent_right,
            (_, true, false) => &mut self.silent_wrong,
        };
        *count += 1;
        self.cases += 1;
        self.unstable += usize::from(accepted.is_unstable());
        self.unstable_unnamed += usize::from(accepted.is_unstable() && !is_named);
    }

    /// The sum of two.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            cases: self.cases + other.cases,
            refused: self.refused + other.refused,
            named: self.named + other.named,
            remarked_right: self.remarked_right + other.remarked_right,
            remarked_wrong: self.remarked_wrong + other.remarked_wrong,
            silent_right: self.silent_right + other.silent_right,
            silent_wrong: self.silent_wrong + other.silent_wrong,
            unstable: self.unstable + other.unstable,
            unstable_unnamed: self.unstable_unnamed + other.unstable_unnamed,
        }
    }
}
