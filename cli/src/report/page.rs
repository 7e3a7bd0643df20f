//! Identifications and designs as pages: what was measured, what was found, what the controller will do.

mod controller;
mod fit;
mod parameters;
mod recorded;
pub(crate) mod stability;
mod step;

use std::fmt::Write;

use onecycle::with_signals;
use onecycle_design::soiptd_pd::optimum::Optimum;
use onecycle_design::soiptd_pd::step_response::{StepResponse, step_response};
use onecycle_identify::{Harmonic, harmonics};
use onecycle_identify::{Identification, Identified, Posterior};
use onecycle_link::Recording;
use onecycle_onboard::Soiptd;

use self::stability::Loop;
use super::number::significant;
use super::text::{Units, sentence};
use crate::pages::page::{self, Section, page};

/// Processes of the posterior that bands are drawn from: the ends of a 90 % band are then the tenth from either side.
const DRAWS: usize = 200;
/// Harmonics that are looked for in a recording: the fundamental, and what a relay adds to it.
const HARMONICS: usize = 5;
/// Times at which a step is drawn.
const STEP_POINTS: usize = 400;

/// The page of an identification.
pub(crate) fn identification(file: &str, recording: &Recording, found: &Identification) -> String {
    let units = Units::of(recording);
    let mut sections = vec![recorded::section(recording, found.oscillation.as_ref())];
    let mut lead = made_by("identify");
    match (&found.outcome, &found.oscillation) {
        (Ok(identified), Some(oscillation)) => {
            lead += &identified_lead(identified, found.remarks.len());
            let posterior = Posterior::new(&identified.refined, oscillation.sample_s);
            let view = View {
                units: &units,
                identified,
                posterior: &posterior,
            };
            // One cycle may be one of no steady oscillation, which has no harmonics.
            let measured = if oscillation.cycles_used > 1 {
                with_signals(recording, |signals| {
                    harmonics(signals, oscillation, HARMONICS)
                })
            } else {
                vec![]
            };
            sections.extend(view.sections(&measured));
        }
        (Err(verdict), _) => {
            let words = format!("No process identified. {}", sentence(&verdict.to_string()));
            lead += &page::verdict(false, &words);
            lead += &page::paragraph("lead", verdict.advice());
        }
        (Ok(_), None) => {}
    }
    sections.extend(remarks(found));
    page(&format!("Relay test: {file}"), &lead, &sections)
}

/// The page of a design.
pub(crate) fn design(
    process: &Soiptd,
    optimum: &Optimum,
    response: Option<&StepResponse>,
) -> String {
    let mut lead = made_by("tune");
    lead += &page::facts(&parameters::of_process(process));
    let own = Loop::new(process, optimum.pd, optimum.margins);
    let sections = [
        Some(own.section()),
        response.map(|response| step::section(response, None, &times_s(response))),
        Some(controller::section(optimum, &Units::default(), None)),
    ];
    let sections: Vec<Section> = sections.into_iter().flatten().collect();
    page("Optimal controller of a process", &lead, &sections)
}

/// An identified process and all that there is to show of it.
struct View<'a> {
    units: &'a Units,
    identified: &'a Identified,
    posterior: &'a Posterior,
}

impl View<'_> {
    fn sections(&self, measured: &[Harmonic]) -> Vec<Section> {
        let Identified {
            refined,
            controller,
            phase_margin_rad,
            ..
        } = self.identified;
        let process = &refined.process;
        let draws = self.posterior.processes(DRAWS);
        // Where it may be none there is nothing to take away.
        let bias =
            Some(refined.input_bias).filter(|_| !self.identified.process.input_bias.holds(0.0));
        let own = Loop::new(process, controller.pd, controller.margins)
            .within(&draws, *phase_margin_rad)
            .measured(measured);
        let response = step_response(process, controller.pd).ok();
        let step = response.map(|response| {
            let times_s = times_s(&response);
            let bands = onecycle_design::bands::step_bands(&draws, controller.pd, &times_s);
            step::section(&response, bands.as_ref(), &times_s)
        });
        [
            Some(fit::section(self.identified, self.units)),
            Some(parameters::section(
                self.identified,
                self.posterior,
                self.units,
            )),
            Some(own.section()),
            step,
            Some(controller::section(controller, self.units, bias)),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

/// From the step of the reference until a good while after it has settled.
fn times_s(response: &StepResponse) -> Vec<f64> {
    let end_s = 1.4 * response.metrics.settling_time_s;
    (0..=STEP_POINTS)
        .map(|k| end_s * k as f64 / STEP_POINTS as f64)
        .collect()
}

fn made_by(command: &str) -> String {
    let version = env!("CARGO_PKG_VERSION");
    page::paragraph(
        "source",
        &format!("Made by onecycle {command}, onecycle {version}."),
    )
}

/// What the page comes down to.
fn identified_lead(identified: &Identified, remarks: usize) -> String {
    let Optimum { pd, margins, .. } = &identified.controller;
    let margin = stability::phase_margin(margins, Some(&identified.phase_margin_rad));
    let mut text = format!(
        "Identified. Kp {}, Kd {}: phase margin {margin}",
        significant(pd.kp),
        significant(pd.kd),
    );
    if let Some(step) = &identified.step {
        let (overshoot, settled) = (100.0 * step.overshoot, significant(step.settling_time_s));
        let _ = write!(
            text,
            ", a step overshoots by {overshoot:.0} % and settles in {settled} s"
        );
    }
    text += match remarks {
        0 => ".",
        1 => ". There is a remark below.",
        _ => ". There are remarks below.",
    };
    page::verdict(true, &text)
}

fn remarks(found: &Identification) -> Option<Section> {
    let remarks: Vec<String> = found.remarks.iter().map(ToString::to_string).collect();
    (!remarks.is_empty()).then(|| Section {
        id: "remarks".to_owned(),
        title: "Remarks".to_owned(),
        body: page::list(&remarks),
    })
}
