//! What the tuning rules cost depends on how the amplitude is measured, and at which noise and bias.

use std::f64::consts::{PI, TAU};

use onecycle_cli::failure::Failure;
use onecycle_cli::report::number::{degrees, percent};
use onecycle_design::Pid;
use onecycle_design::rules::Homogeneous;
use onecycle_design::soiptd_pd::deterioration::Deterioration;
use onecycle_lab::experiments::{Campaign, IDENTIFICATION_PERIODS, SAMPLE_S, signals_of};
use onecycle_lab::judge::baselines::rules::{Rule, calibrated, identify};
use onecycle_lab::judge::evaluate::{Judge, PHASE_MARGIN_DEG, quantile};
use onecycle_lab::space::Space;
use onecycle_lab::space::grid::{Grid, GridSettings};
use onecycle_onboard::{Pd, Soiptd};
use serde::Deserialize;

use crate::results::reproduction::{Numbers, Row, or_dash};
use crate::workers::Workers;

/// The experiments and their variants.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RuleSettings {
    /// Number of random processes, and their seed.
    systems: u64,
    seed: u64,
    /// One row each.
    variants: Vec<Variant>,
}

/// Conditions of a test and how its cycle is read.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Variant {
    name: String,
    rule: RuleName,
    /// Largest noise over the amplitude of the oscillation, drawn uniformly from zero.
    sigma: f64,
    /// Largest input bias over the relay's amplitude.
    bias: f64,
    /// Whether the relay trims the bias away.
    trim: bool,
    /// The members of the paper's grid instead of random processes.
    #[serde(default)]
    members: bool,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RuleName {
    /// The paper's, from half the peak-to-peak output.
    PeakToPeak,
    /// The paper's, from the first harmonic of the output.
    OutputHarmonic,
    /// Its two numbers from exact limit cycles, from half the peak-to-peak output.
    Exact,
    /// From the first harmonics of output and input.
    BothHarmonics,
    /// The paper's, from the exact magnitude and frequency of the process at the rule's phase. Nothing is measured.
    OnProcess,
}

/// Shapes from which the exact rule takes its numbers, rows and columns.
const RULE_SHAPES: usize = 8;

impl RuleName {
    /// The rule for a recorded cycle. `None` if nothing is measured.
    fn rule(self) -> Result<Option<Rule>, Failure> {
        Ok(Some(match self {
            Self::PeakToPeak => Rule::Amplitude(of_the_paper()),
            Self::OutputHarmonic => Rule::OutputHarmonic(of_the_paper()),
            Self::Exact => {
                let rule = calibrated(&Space::MULTIROTOR, RULE_SHAPES, RULE_SHAPES);
                Rule::Amplitude(rule.map_err(Failure::usage)?)
            }
            Self::BothHarmonics => Rule::FirstHarmonic {
                phase_margin_rad: PHASE_MARGIN_DEG.to_radians(),
            },
            Self::OnProcess => return Ok(None),
        }))
    }
}

/// The paper's rule: that of a relay with beta -0.73, by the describing function.
fn of_the_paper() -> Homogeneous {
    let (beta, margin_rad) = (Space::MULTIROTOR.beta, PHASE_MARGIN_DEG.to_radians());
    Homogeneous::from_lead(margin_rad - beta.asin(), margin_rad)
}

/// The PD of the paper's rule from the exact magnitude and frequency of the process at the rule's phase.
fn on_process(process: &Soiptd) -> Option<Pd> {
    let rule = of_the_paper();
    let omega_rad_per_s = process.frequency_at_phase(rule.beta.asin() - PI)?;
    let Pid { kp, kd, .. } = rule.pid(process.magnitude(omega_rad_per_s), TAU / omega_rad_per_s);
    Some(Pd { kp, kd })
}

pub(super) fn find(settings: &RuleSettings, workers: &Workers) -> Result<Numbers, Failure> {
    let members = Grid::build(&GridSettings::default(), workers).map_err(Failure::usage)?;
    let members: Vec<Soiptd> = (members.members.iter())
        .map(|member| member.candidate.process)
        .collect();
    let rows = settings.variants.iter().map(|variant| {
        let rule = variant.rule.rule()?;
        let members = variant.members.then_some(&members[..]);
        let count = members.map_or(settings.systems as usize, <[Soiptd]>::len);
        let judged = workers.map(count, |k| {
            judged(settings, variant, members, rule.as_ref(), k as u64)
        });
        let judged: Vec<Option<Deterioration>> = judged.into_iter().collect::<Result<_, _>>()?;
        Ok(row(&variant.name, &judged))
    });
    Ok(Numbers {
        tables: vec![rows.collect::<Result<_, Failure>>()?],
        figures: vec![],
    })
}

/// What the rule costs on one process. `None` if it has no answer.
fn judged(
    settings: &RuleSettings,
    variant: &Variant,
    members: Option<&[Soiptd]>,
    rule: Option<&Rule>,
    number: u64,
) -> Result<Option<Deterioration>, Failure> {
    let campaign = Campaign {
        seed: settings.seed,
        bias: variant.bias,
        sigma: variant.sigma,
        sigma_uniform: true,
        trim: variant.trim,
        ..Campaign::QUIET
    };
    // The processes of the trimmed half of Table IV.
    let mut experiment = campaign
        .experiment(2 * number + 1)
        .map_err(Failure::usage)?;
    if let Some(members) = members {
        let part = experiment.noise_sigma / experiment.oscillation.amplitude;
        let own = campaign.quiet_experiment(members[number as usize], settings.seed + number);
        let mut own = own.map_err(Failure::usage)?;
        own.input_bias = experiment.input_bias;
        own.noise_sigma = part * own.oscillation.amplitude;
        experiment = own;
    }
    let judge = Judge::new(&experiment.process).map_err(Failure::usage)?;
    let Some(rule) = rule else {
        return Ok(on_process(&experiment.process).map(|pd| judge.deterioration(pd)));
    };
    let (trace, _) = experiment
        .run(IDENTIFICATION_PERIODS)
        .map_err(Failure::usage)?;
    let answer = identify(&signals_of(&trace, SAMPLE_S), rule, 1);
    Ok(answer.ok().map(|answer| judge.deterioration(answer.pd)))
}

fn row(name: &str, judged: &[Option<Deterioration>]) -> Row {
    let stable = judged.iter().flatten().filter_map(|cost| match *cost {
        Deterioration::Stable {
            relative,
            phase_margin_rad,
        } => Some((relative, phase_margin_rad)),
        Deterioration::Unstable => None,
    });
    let stable: Vec<(f64, f64)> = stable.collect();
    let mut costs: Vec<f64> = stable.iter().map(|(cost, _)| cost.abs()).collect();
    let median = quantile(&mut costs, 0.5);
    let count = costs.len().max(1) as f64;
    let mean = |sum: f64| percent(sum / count);
    let least_rad = stable
        .iter()
        .map(|(_, margin_rad)| *margin_rad)
        .reduce(f64::min);
    Row::new(
        name,
        [
            mean(costs.iter().sum()),
            or_dash(median, percent),
            or_dash(costs.last().copied(), percent),
            mean(stable.iter().map(|(cost, _)| cost).sum()),
            or_dash(least_rad, degrees),
            (judged.len() - stable.len()).to_string(),
        ],
    )
}
