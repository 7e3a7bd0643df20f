//! Controllers to choose from, in JSON.

use onecycle_design::{Assessment, LeastMargins, Limit, Missed, Robustness, Specification};
use serde::Serialize;

use super::{Controller, MarginsReport, Step, controller, margins, of_style, step};
use crate::results::controllers::{Controllers, Row};
use crate::words::controllers as words;

/// What noise and sampling a design counts with.
#[derive(Serialize)]
pub(super) struct Assumed {
    noise_sigma: Option<f64>,
    noise_sample_s: Option<f64>,
    input_amplitude: Option<f64>,
    sample_period_s: f64,
    computation_delay_s: f64,
}

/// A limit that the chosen controller does not keep.
#[derive(Serialize)]
pub struct NotKept {
    limit: &'static str,
    asked: f64,
    reached: f64,
    message: String,
}

/// One style: its controller with margins and step, or the error that prevented a design.
#[derive(Serialize)]
pub(super) struct Proposed<'a> {
    style: &'static str,
    is_chosen: bool,
    controller: Option<Controller>,
    #[serde(flatten)]
    figures: Figures,
    robustness: Option<&'a Robustness>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

/// Figures of a controller.
#[derive(Serialize)]
pub struct Figures {
    margins: Option<MarginsReport>,
    step: Option<Step>,
    load_iae: Option<f64>,
    load_peak: Option<f64>,
    noise_share: Option<f64>,
}

/// The gains in force.
#[derive(Serialize)]
pub(super) struct AgainstReport {
    controller: Controller,
    is_stable: bool,
    #[serde(flatten)]
    figures: Figures,
    least: Option<Least>,
}

/// Margins at the bad end of the central 90 % of the posterior.
#[derive(Serialize)]
pub struct Least {
    stable: f64,
    ms: Option<f64>,
    phase_margin_deg: f64,
    gain_margin: Option<f64>,
    delay_margin_s: f64,
}

pub fn not_kept(choice: &Controllers) -> Vec<NotKept> {
    let of = |(missed, message): (&Missed, String)| {
        let (limit, scale) = match missed.limit {
            Limit::Overshoot => ("overshoot", 1.0),
            Limit::PhaseMargin => ("phase_margin_deg", 1_f64.to_degrees()),
            Limit::GainMargin => ("gain_margin", 1.0),
            Limit::DelayMargin => ("delay_margin_s", 1.0),
            Limit::Ms => ("ms", 1.0),
            Limit::Mt => ("mt", 1.0),
            Limit::Noise => ("noise_share", 1.0),
            Limit::InputPeak => ("peak_input", 1.0),
            _ => ("gain_crossover_rad_per_s", 1.0),
        };
        NotKept {
            limit,
            asked: scale * missed.asked,
            reached: scale * missed.reached,
            message,
        }
    };
    let sentences = words::not_kept(choice);
    choice.missed.iter().zip(sentences).map(of).collect()
}

pub(super) fn proposed<'a>(choice: &'a Controllers) -> Vec<Proposed<'a>> {
    let of = |row: &'a Row| {
        let specification = &row.proposal.specification;
        let design = row.proposal.outcome.as_ref();
        Proposed {
            style: specification.style.name(),
            is_chosen: choice.is_chosen(row),
            controller: (design.ok()).map(|design| of_style(design, specification.style)),
            figures: Figures::of(row.figures.as_ref()),
            robustness: design.ok().and_then(|design| design.robustness.as_ref()),
            error: design.err().map(ToString::to_string),
        }
    };
    choice.rows.iter().map(of).collect()
}

pub(super) fn against(choice: &Controllers) -> Option<AgainstReport> {
    choice.against.as_ref().map(|against| AgainstReport {
        controller: controller(&against.controller),
        is_stable: against.figures.is_some(),
        figures: Figures::of(against.figures.as_ref()),
        least: against.least.as_ref().map(Into::into),
    })
}

impl Figures {
    pub fn of(figures: Option<&Assessment>) -> Self {
        let finite = |value: f64| value.is_finite().then_some(value);
        Self {
            margins: figures.map(|of| margins(&of.margins, None, Some(of))),
            step: figures
                .and_then(|of| of.step.as_ref())
                .map(|of| step(of, None)),
            load_iae: figures.and_then(|of| of.load_iae).and_then(finite),
            load_peak: figures.and_then(|of| of.load_peak).and_then(finite),
            noise_share: figures.and_then(|of| of.noise_share).and_then(finite),
        }
    }
}

impl From<&Specification> for Assumed {
    fn from(of: &Specification) -> Self {
        Self {
            noise_sigma: of.noise.map(|noise| noise.std),
            noise_sample_s: of.noise.map(|noise| noise.sample_period_s),
            input_amplitude: of.noise.map(|noise| noise.input_amplitude),
            sample_period_s: of.execution.sample_period_s,
            computation_delay_s: of.execution.computation_delay_s,
        }
    }
}

impl From<&LeastMargins> for Least {
    fn from(of: &LeastMargins) -> Self {
        let finite = |value: f64| value.is_finite().then_some(value);
        Self {
            stable: of.stable,
            ms: finite(of.ms),
            phase_margin_deg: of.phase_margin_rad.to_degrees(),
            gain_margin: finite(of.gain_margin),
            delay_margin_s: of.delay_margin_s,
        }
    }
}
