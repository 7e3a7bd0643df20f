//! The answer of the page: the chosen controller in the forms to type in, the others beside it, the trade-off.

use onecycle::{Assessment, Controller, Design, Interval};

use super::significant;
use crate::pages::page::{self, Cell, Section};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Note, Panel, Series};
use crate::report::controllers::{TITLES, cells, forms, in_plant, margins};
use crate::report::units::Units;
use crate::results::controllers::{Controllers, Source};
use crate::words::controllers::{assumed, brief, change, judgement, not_kept, price};
use crate::words::sentence;

/// Gains, margins and assumptions.
///
/// `input_bias`: constant that acts beside the recorded input (input unit).
pub(super) fn section(
    choice: &Controllers,
    design: &Design,
    phase_margin_rad: Option<&Interval>,
    (units, input_bias): (&Units, Option<f64>),
) -> Section {
    let controller = &design.controller;
    let law = controller.form().law().to_owned();
    let mut facts: Vec<(&str, String)> = forms(controller, units);
    facts.extend(in_plant(choice, controller));
    facts.extend(choice.device_model.clone());
    facts.push(("law", law));
    facts.push(("margins", margins(choice, design, phase_margin_rad)));
    facts.extend(
        design
            .robustness
            .as_ref()
            .map(|robustness| ("robustness", price(robustness, choice.source))),
    );
    let assumed = assumed(&choice.asked, choice.source == Source::Recording);
    facts.extend(assumed.map(|assumed| ("assumed", assumed)));
    let mut body = page::facts(&facts);
    let not_kept = not_kept(choice);
    body.extend(
        not_kept
            .iter()
            .map(|sentence| page::paragraph("note", sentence)),
    );
    if let Some(against) = &choice.against {
        body += &page::paragraph("note", &sentence(&judgement(against, choice.source)));
        body += &change(choice).map_or(String::new(), |change| {
            page::paragraph("note", &sentence(&change))
        });
    }
    if let Some(bias) = input_bias.filter(|_| !controller.form().has_integral()) {
        body += &offset(bias, controller.kp(), units);
    }
    Section::new("controller", "Controller", body)
}

/// The table of the styles, with the gains in force.
pub(super) fn styles(choice: &Controllers) -> Section {
    Section::new("styles", "Styles", table(choice))
}

fn offset(bias: f64, kp: f64, units: &Units) -> String {
    let with = |value: f64, unit: &str| {
        format!("{} {unit}", significant(value))
            .trim_end()
            .to_owned()
    };
    page::paragraph(
        "note",
        &format!(
            "The input bias is {}, and there is no integral action: subtract the bias from u, or the output stays {} \
             off the reference.",
            with(bias, &units.input),
            with(bias / kp, &units.output)
        ),
    )
}

fn table(choice: &Controllers) -> String {
    let mut rows: Vec<(String, Vec<String>)> = vec![];
    if let Some(against) = &choice.against {
        let cells = cells(choice, &against.controller, against.figures.as_ref());
        rows.push(("yours".to_owned(), cells.to_vec()));
    }
    for row in &choice.rows {
        let mut name = row.proposal.specification.style.name().to_owned();
        if choice.is_chosen(row) {
            name += " (chosen)";
        }
        let values = match &row.proposal.outcome {
            Ok(design) => cells(choice, &design.controller, row.figures.as_ref()).to_vec(),
            Err(error) => {
                let mut values = vec![String::from("-"); TITLES.len()];
                values[0] = brief(error);
                values
            }
        };
        rows.push((name, values));
    }
    let columns: Vec<String> = std::iter::once("style")
        .chain(TITLES)
        .map(str::to_owned)
        .collect();
    let rows: Vec<(&str, Vec<Cell<'_>>)> = (rows.iter())
        .map(|(name, values)| {
            let cell = |value| Cell { value, below: None };
            let cells = values.iter().map(|value| cell(value.as_str())).collect();
            (name.as_str(), cells)
        })
        .collect();
    page::table(
        "Controllers to choose from. Load: integral of the absolute error after a step of the load, over that of the chosen \
         controller. Noise: its standard deviation at the actuator, as a share of the input amplitude.",
        &columns,
        &rows,
    )
}

/// What more robustness costs: load rejection and noise over the limit of `Ms`.
pub(super) fn trade_off(choice: &Controllers) -> Option<Section> {
    let (_, chosen) = choice.design()?;
    let curve = |value: fn(&Assessment) -> Option<f64>| -> Vec<(f64, f64)> {
        let at = |(peak, figures, _): &(f64, Assessment, Controller)| {
            value(figures)
                .filter(|value| value.is_finite())
                .map(|value| (*peak, value))
        };
        choice.trade_off.iter().filter_map(at).collect()
    };
    let panel =
        |(title, names): (&str, [&str; 2]), hue: Hue, value: fn(&Assessment) -> Option<f64>| {
            let points = curve(value);
            let y = Axis::titled(title);
            let line = Series::of_points(names[0], Marks::LineAndPoints, points.iter().copied());
            let own = value(chosen).filter(|value| value.is_finite());
            let ring = own.map(|own| Series::of_points(names[1], Marks::Rings, [(chosen.ms, own)]));
            let mut panel = Panel::new(y, vec![line.hue(hue)]);
            panel
                .series
                .extend(ring.map(|ring| ring.hue(Hue::Measured)));
            panel
                .notes
                .extend(own.filter(|_| !names[0].is_empty()).map(|own| Note {
                    text: format!("{}, Ms {:.2}", choice.asked.style.name(), chosen.ms),
                    x: chosen.ms,
                    y: own,
                    away: (40.0, -40.0),
                }));
            (points.len() > 1).then_some(panel)
        };
    let load = panel(
        ("load IAE", ["best controller at each Ms", "chosen"]),
        Hue::Model,
        |of| of.load_iae,
    )?;
    let noise = panel(("noise share", [""; 2]), Hue::Input, |of| of.noise_share);
    let caption = "What robustness costs: the error after a step of the load, and the noise at the actuator, of the best \
                   controller for the most probable process at each limit of Ms. The ring is the chosen controller; it \
                   serves all likely processes, so it lies above the curve.";
    let x = Axis::titled("maximum sensitivity Ms");
    let panels: Vec<Panel> = std::iter::once(load).chain(noise).collect();
    let figure = Figure::stacked(caption, x, panels);
    Some(Section::new(
        "trade-off",
        "Trade-off",
        page::figure(&figure),
    ))
}
