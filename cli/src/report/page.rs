//! Identifications and designs as pages: what was measured, what was found, what the controller will do.

mod card;
mod controller;
mod fit;
mod overlay;
mod parameters;
mod recorded;
pub(crate) mod stability;
mod step;
mod structures;
mod thin;

use std::fmt::Write;

use onecycle::{
    Design, Excitation, Identification, Identified, Model, Parameter, Recording, StepMetrics,
    StepResponse, load_response, step_response, with_signals,
};
use onecycle_design::bands::{load_bands, step_bands};
use onecycle_identify::{Harmonic, harmonics};

use self::stability::Loop;
use super::number::significant;
use super::units::Units;
use crate::pages::page::{self, Section, page};
use crate::pages::plot::Figure;
use crate::results::answer::Answer;
use crate::results::controllers::Controllers;
use crate::results::family::OfOscillation;
use crate::results::log_gains::LogGains;
use crate::words;

/// Processes of the posterior that bands are drawn from: the ends of a 90 % band are then the tenth from either side.
const DRAWS: usize = 200;
/// Processes of the posterior whose responses are simulated: the ends of the band are the fourth from either side.
const RESPONSES: usize = 80;
/// Harmonics that are looked for in a recording: the fundamental, and what a relay adds to it.
const HARMONICS: usize = 5;
/// Times at which a step is drawn.
const STEP_POINTS: usize = 400;

/// The page of an identification.
/// `choice`: the controllers of an identified process.
pub(crate) fn identification(
    title: &str,
    recording: &Recording,
    found: &Identification,
    (choice, answer): (Option<&Controllers>, &Answer),
    gains: Option<&LogGains>,
) -> String {
    let units = Units::of(recording);
    let mut sections = vec![];
    let recorded = recorded::section(recording, found, &units);
    let mut lead = made_by("identify");
    match &found.outcome {
        Ok(identified) => {
            let view = View {
                units: &units,
                identified,
                choice,
            };
            // One cycle may be one of no steady oscillation, which has no harmonics.
            let steady = (found.oscillation()).filter(|oscillation| oscillation.cycles_used > 1);
            let measured = steady.map_or(vec![], |oscillation| {
                with_signals(recording, |signals| {
                    harmonics(signals, oscillation, HARMONICS)
                })
            });
            let (figure, answered) = view.answer(&measured);
            lead += &card::card(answer, figure.as_ref());
            sections.extend(answered);
            sections.push(recorded);
            sections.extend(view.evidence());
        }
        Err(_) => {
            lead += &card::card(answer, None);
            sections.push(recorded);
            sections.extend(found.refused.as_ref().map(|refused| {
                let structure = refused.model.structure();
                fit::section("Fit that was refused", structure, &refused.fit, &units)
            }));
        }
    }
    sections.extend(gains.and_then(overlay::section));
    sections.extend(remarks(found));
    let kind = match found.excitation {
        Some(Excitation::Recorded(_)) => "Recording",
        _ => "Relay test",
    };
    page(&format!("{kind}: {title}"), &lead, &sections)
}

/// The page of a design. `oscillation`: what is known of the process, if its parameters are not.
pub(crate) fn design(
    model: &Model,
    (choice, design): (&Controllers, &Design),
    response: Option<&StepResponse>,
    oscillation: Option<&OfOscillation>,
) -> String {
    let mut lead = made_by("tune");
    let mut text = gains(choice, design);
    let _ = write!(
        text,
        "phase margin {}",
        stability::phase_margin(&design.margins, None)
    );
    text += &predicted(
        choice
            .design()
            .and_then(|(_, figures)| figures.step)
            .as_ref(),
    );
    lead += &page::verdict(true, &(text + "."));
    lead += &page::facts(&match oscillation {
        Some(of) => parameters::of_family(model, of),
        None => parameters::of_model(model),
    });
    let own = Loop::new(*model, design.controller, design.margins).outside(peak(choice));
    let load = load_response(model, &design.controller).ok();
    let sections = [
        Some(controller::section(
            choice,
            design,
            None,
            (&Units::default(), None),
        )),
        response.map(|response| {
            let load = load.as_ref().map(|load| (load, None));
            step::section(response, None, &times_s(response), load)
        }),
        controller::trade_off(choice),
        Some(own.section()),
    ];
    let sections: Vec<Section> = sections.into_iter().flatten().collect();
    page("Controller of a process", &lead, &sections)
}

/// Maximum sensitivity of the chosen controller.
fn peak(choice: &Controllers) -> Option<f64> {
    choice.design().map(|(_, figures)| figures.ms)
}

/// An identified process and the units of its recording.
struct View<'a> {
    units: &'a Units,
    identified: &'a Identified,
    choice: Option<&'a Controllers>,
}

impl View<'_> {
    /// The controller: what to type in, and what it will do.
    fn answer(&self, measured: &[Harmonic]) -> (Option<Figure>, Vec<Section>) {
        match (self.choice, &self.identified.design) {
            (Some(choice), Some(design)) => self.of_controller(choice, design, measured),
            (Some(choice), None) => (None, vec![controller::without(choice)]),
            _ => (None, vec![]),
        }
    }

    /// What the model rests on.
    fn evidence(&self) -> Vec<Section> {
        let mut sections = vec![
            fit::section(
                "Fit",
                self.identified.model.structure(),
                &self.identified.fit,
                self.units,
            ),
            parameters::section(self.identified, self.units),
        ];
        if let Some(innovations) = self.identified.fit.innovations() {
            let chosen = self.identified.model.structure();
            sections.push(structures::section(chosen, innovations, self.units));
        }
        sections
    }

    /// Gains, responses, trade-off and stability of the controller.
    fn of_controller(
        &self,
        choice: &Controllers,
        design: &Design,
        measured: &[Harmonic],
    ) -> (Option<Figure>, Vec<Section>) {
        let identified = self.identified;
        let draws = identified.posterior.models(DRAWS);
        // Where the interval holds zero there is nothing to subtract.
        let bias = (identified.estimate.get(Parameter::InputBias))
            .filter(|bias| !bias.holds(0.0))
            .and_then(|bias| bias.estimate);
        let own = Loop::new(identified.model, design.controller, design.margins)
            .within(&draws, identified.phase_margin_rad)
            .outside(peak(choice))
            .measured(measured);
        let (model, controller) = (&identified.model, &design.controller);
        let step = step_response(model, controller).ok().map(|response| {
            let times_s = times_s(&response);
            let few = &draws[..draws.len().min(RESPONSES)];
            let bands = step_bands(few, controller, &times_s);
            let load = load_response(model, controller).ok();
            let around = load_bands(few, controller, &times_s);
            let load = load.as_ref().map(|load| (load, around.as_ref()));
            let now = choice.against.as_ref().filter(|now| now.figures.is_some());
            let both = (model, now.map(|now| &now.controller));
            let first = step::compared(both, (&response, bands.as_ref()), load, &times_s);
            (
                first,
                step::section(&response, bands.as_ref(), &times_s, load),
            )
        });
        let (first, step) = step.unzip();
        let margin = identified.phase_margin_rad.as_ref();
        let sections = [
            Some(controller::section(
                choice,
                design,
                margin,
                (self.units, bias),
            )),
            step,
            controller::trade_off(choice),
            Some(own.section()),
        ];
        (first, sections.into_iter().flatten().collect())
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

/// The style and the gains to type in.
fn gains(choice: &Controllers, design: &Design) -> String {
    let pid = design.controller.pid();
    let gain = |name: &str, value: f64| {
        if value == 0.0 {
            String::new()
        } else {
            format!("{name} {}, ", significant(value))
        }
    };
    let filter = gain("filter Tf", pid.filter_s).replace(", ", " s, ");
    format!(
        "{} {}: {}{}{}{filter}",
        words::capital(words::controllers::style(choice.asked.style)),
        design
            .controller
            .form()
            .name()
            .replace('_', " ")
            .to_uppercase(),
        gain("Kp", pid.kp),
        gain("Ki", pid.ki),
        gain("Kd", pid.kd),
    )
}

/// The predicted step, as the end of a sentence.
fn predicted(step: Option<&StepMetrics>) -> String {
    step.map_or(String::new(), |step| {
        let (overshoot, settled) = (100.0 * step.overshoot, significant(step.settling_time_s));
        format!(", a step overshoots by {overshoot:.0} % and settles in {settled} s")
    })
}

fn remarks(found: &Identification) -> Option<Section> {
    let groups = words::remark::grouped(found);
    let body = |(heading, sentences): &(&str, Vec<String>)| match *heading {
        words::remark::REASONS => page::list(sentences),
        _ => page::folded(heading, &page::list(sentences)),
    };
    (!groups.is_empty()).then(|| Section {
        id: "remarks".to_owned(),
        title: words::remark::REASONS.to_owned(),
        body: groups.iter().map(body).collect(),
    })
}
