//! Identifications and designs as pages: what was measured, what was found, what the controller will do.

mod controller;
mod fit;
mod parameters;
mod recorded;
pub(crate) mod stability;
mod step;
mod structures;
mod thin;

use std::fmt::Write;

use onecycle::{
    Design, Excitation, Identification, Identified, Model, Parameter, Recording, StepResponse,
    step_response, with_signals,
};
use onecycle_design::bands::step_bands;
use onecycle_identify::{Harmonic, harmonics};

use self::stability::Loop;
use super::number::significant;
use super::units::Units;
use crate::pages::page::{self, Section, page};
use crate::words;

/// Processes of the posterior that bands are drawn from: the ends of a 90 % band are then the tenth from either side.
const DRAWS: usize = 200;
/// Harmonics that are looked for in a recording: the fundamental, and what a relay adds to it.
const HARMONICS: usize = 5;
/// Times at which a step is drawn.
const STEP_POINTS: usize = 400;

/// The page of an identification.
pub(crate) fn identification(file: &str, recording: &Recording, found: &Identification) -> String {
    let units = Units::of(recording);
    let mut sections = vec![recorded::section(recording, found, &units)];
    let mut lead = made_by("identify");
    match &found.outcome {
        Ok(identified) => {
            lead += &identified_lead(identified, found.remarks.len());
            let view = View {
                units: &units,
                identified,
            };
            // One cycle may be one of no steady oscillation, which has no harmonics.
            let steady = (found.oscillation()).filter(|oscillation| oscillation.cycles_used > 1);
            let measured = steady.map_or(vec![], |oscillation| {
                with_signals(recording, |signals| {
                    harmonics(signals, oscillation, HARMONICS)
                })
            });
            sections.extend(view.sections(&measured));
        }
        Err(verdict) => {
            let words = format!(
                "No process identified. {}",
                words::sentence(&verdict.to_string())
            );
            lead += &page::verdict(false, &words);
            lead += &page::paragraph("lead", &words::verdict::advice(verdict));
        }
    }
    sections.extend(remarks(found));
    let kind = match found.excitation {
        Some(Excitation::Recorded(_)) => "Recording",
        _ => "Relay test",
    };
    page(&format!("{kind}: {file}"), &lead, &sections)
}

/// The page of a design.
pub(crate) fn design(model: &Model, design: &Design, response: Option<&StepResponse>) -> String {
    let mut lead = made_by("tune");
    lead += &page::facts(&parameters::of_model(model));
    let own = Loop::new(*model, design.controller, design.margins);
    let sections = [
        Some(own.section()),
        response.map(|response| step::section(response, None, &times_s(response))),
        Some(controller::section(design, &Units::default(), None)),
    ];
    let sections: Vec<Section> = sections.into_iter().flatten().collect();
    page("Optimal controller of a process", &lead, &sections)
}

/// An identified process and the units of its recording.
struct View<'a> {
    units: &'a Units,
    identified: &'a Identified,
}

impl View<'_> {
    fn sections(&self, measured: &[Harmonic]) -> Vec<Section> {
        let mut sections = vec![
            fit::section(self.identified, self.units),
            parameters::section(self.identified, self.units),
        ];
        if let Some(innovations) = self.identified.fit.innovations() {
            let chosen = self.identified.model.structure();
            sections.push(structures::section(chosen, innovations, self.units));
        }
        if let Some(design) = &self.identified.design {
            sections.extend(self.of_controller(design, measured));
        }
        sections
    }

    /// Stability, step and forms of the controller.
    fn of_controller(&self, design: &Design, measured: &[Harmonic]) -> Vec<Section> {
        let identified = self.identified;
        let draws = identified.posterior.models(DRAWS);
        // Where the interval holds zero there is nothing to subtract.
        let bias = (identified.estimate.get(Parameter::InputBias))
            .filter(|bias| !bias.holds(0.0))
            .and_then(|bias| bias.estimate);
        let own = Loop::new(identified.model, design.controller, design.margins)
            .within(&draws, identified.phase_margin_rad)
            .measured(measured);
        let response = step_response(&identified.model, &design.controller).ok();
        let step = response.map(|response| {
            let times_s = times_s(&response);
            let bands = step_bands(&draws, &design.controller, &times_s);
            step::section(&response, bands.as_ref(), &times_s)
        });
        [
            Some(own.section()),
            step,
            Some(controller::section(design, self.units, bias)),
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
    let mut text = "Identified. ".to_owned();
    match &identified.design {
        Some(design) => {
            let margin_rad = identified.phase_margin_rad.as_ref();
            let _ = write!(
                text,
                "Kp {}, Kd {}: phase margin {}",
                significant(design.controller.kp()),
                significant(design.controller.kd()),
                stability::phase_margin(&design.margins, margin_rad)
            );
        }
        None => text += "No controller was designed",
    }
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
    let remarks = words::remark::sentences(found);
    (!remarks.is_empty()).then(|| Section {
        id: "remarks".to_owned(),
        title: "Remarks".to_owned(),
        body: page::list(&remarks),
    })
}
