//! Identifications and designs as pages: what was measured, what was found, what the controller will do.

mod card;
mod controller;
mod fit;
#[cfg(feature = "program")]
mod flight;
mod overlay;
mod parameters;
mod recorded;
pub(crate) mod stability;
mod step;
mod structures;
mod thin;

use onecycle::{
    Design, Excitation, Identification, Identified, Model, Parameter, Recording, StepResponse,
    load_response, step_response, with_signals,
};
use onecycle_design::bands::{load_bands, step_bands};
use onecycle_identify::{Harmonic, harmonics};

#[cfg(feature = "program")]
pub(crate) use self::flight::flight;
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
    let kind = match found.excitation {
        Some(Excitation::Recorded(_)) => "Recording",
        _ => "Relay test",
    };
    let subject = Subject {
        recording,
        found,
        choice,
        answer,
        gains,
    };
    page::whole(
        &format!("{kind}: {title}"),
        &(subject.body("") + &made_by("identify")),
    )
}

/// What is told of a recording: the answer, and folded what it rests on, what else there is, and all figures.
struct Subject<'a> {
    recording: &'a Recording,
    found: &'a Identification,
    /// The controllers of an identified process.
    choice: Option<&'a Controllers>,
    answer: &'a Answer,
    gains: Option<&'a LogGains>,
}

impl Subject<'_> {
    /// Components of a page. `prefix` stands before all identifiers.
    fn body(&self, prefix: &str) -> String {
        let units = Units::of(self.recording);
        let mut evidence = vec![recorded::section(self.recording, self.found, &units)];
        let mut all = Found::default();
        let refused = self.found.refused.as_ref();
        match &self.found.outcome {
            Ok(identified) => {
                let view = View {
                    units: &units,
                    identified,
                    choice: self.choice,
                };
                all = view.answer(&self.measured());
                evidence.extend(view.evidence());
            }
            Err(_) => evidence.extend(refused.map(|refused| {
                let structure = refused.model.structure();
                fit::section("Fit that was refused", structure, &refused.fit, &units)
            })),
        }
        evidence.extend(self.gains.and_then(overlay::section));
        all.details.extend(remarks(self.found));
        let group = |id, title, about, is_open| page::Group {
            prefix,
            id,
            title,
            about,
            is_open,
        };
        // The picture of a refusal says more than its sentence.
        let is_refused = self.found.outcome.is_err();
        card::card(self.answer, all.figure.as_ref())
            + &page::group(
                group(
                    "evidence",
                    "Evidence",
                    "what was recorded, and what the model explains of it",
                    is_refused,
                ),
                &evidence,
            )
            + &page::group(
                group(
                    "alternatives",
                    "Alternatives",
                    "other styles, and what robustness costs",
                    false,
                ),
                &all.alternatives,
            )
            + &page::group(
                group(
                    "details",
                    "Details",
                    "forms of the controller, responses, stability, remarks",
                    false,
                ),
                &all.details,
            )
    }

    /// Harmonics of a steady oscillation. One cycle may be one of no steady oscillation, which has none.
    fn measured(&self) -> Vec<Harmonic> {
        let steady = (self.found.oscillation()).filter(|oscillation| oscillation.cycles_used > 1);
        steady.map_or(vec![], |oscillation| {
            with_signals(self.recording, |signals| {
                harmonics(signals, oscillation, HARMONICS)
            })
        })
    }
}

/// What is told of a controller.
#[derive(Default)]
struct Found {
    /// Responses beside the card.
    figure: Option<Figure>,
    alternatives: Vec<Section>,
    details: Vec<Section>,
}

/// The page of a design. `oscillation`: what is known of the process, if its parameters are not.
pub(crate) fn design(
    model: &Model,
    (choice, design, answer): (&Controllers, &Design, &Answer),
    response: Option<&StepResponse>,
    oscillation: Option<&OfOscillation>,
) -> String {
    let mut lead = made_by("tune") + &card::card(answer, None);
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
        Some(controller::styles(choice)),
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
    fn answer(&self, measured: &[Harmonic]) -> Found {
        match (self.choice, &self.identified.design) {
            (Some(choice), Some(design)) => self.of_controller(choice, design, measured),
            (Some(choice), None) => Found {
                alternatives: vec![controller::styles(choice)],
                ..Found::default()
            },
            _ => Found::default(),
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
    fn of_controller(&self, choice: &Controllers, design: &Design, measured: &[Harmonic]) -> Found {
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
        let controller = controller::section(choice, design, margin, (self.units, bias));
        let styles = std::iter::once(controller::styles(choice));
        Found {
            figure: first,
            alternatives: styles.chain(controller::trade_off(choice)).collect(),
            details: [Some(controller), step, Some(own.section())]
                .into_iter()
                .flatten()
                .collect(),
        }
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
