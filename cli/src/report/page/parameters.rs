//! The parameters of the process with their distributions.

use onecycle::{Identified, Interval, Model, Parameter, Posterior};
use onecycle_identify::density;

use super::significant;
use crate::pages::page::{self, Cell, Section};
use crate::pages::plot::{
    Axis, Field, FieldKind, Figure, Hue, Marks, Panel, Places, Series, Shape,
};
use crate::report::family;
use crate::report::number::bounded;
use crate::report::units::Units;
use crate::results::family::OfOscillation;

/// Cells along either side of the contours.
const CELLS: usize = 64;
/// Bars of a marginal.
const BARS: usize = 36;
/// What is cut off either end of a marginal.
const TAIL: f64 = 0.005;

/// Parameters of a model without intervals.
pub(super) fn of_model(model: &Model) -> Vec<(&'static str, String)> {
    let units = Units::default();
    let structure = model.structure();
    let shown = |&parameter: &Parameter| {
        let value = model.parameter(parameter).filter(|value| value.is_finite());
        let value = value.map_or("infinite".to_owned(), significant);
        let unit = units.parameter(structure, parameter);
        (
            parameter.symbol_in(structure),
            format!("{value} {unit}").trim_end().to_owned(),
        )
    };
    let formula = ("process", structure.transfer_function().to_owned());
    std::iter::once(formula)
        .chain(structure.parameters().iter().map(shown))
        .collect()
}

/// What is known of an oscillation, the parameters of the processes that agree with it, and the margins over them.
pub(super) fn of_family(middle: &Model, of: &OfOscillation) -> Vec<(&'static str, String)> {
    let (units, structure) = (Units::default(), middle.structure());
    let shown = |(parameter, value, range): (Parameter, String, String)| {
        let unit = units.parameter(structure, parameter);
        let words = format!("{value} (all that agree: {range}) {unit}");
        (parameter.symbol_in(structure), words.trim_end().to_owned())
    };
    let mut facts = family::known(of);
    facts.push(("process", structure.transfer_function().to_owned()));
    facts.extend(family::parameters(middle, of).into_iter().map(shown));
    facts.push(("family", family::margins(of.margins.as_ref())));
    facts
}

pub(super) fn section(identified: &Identified, units: &Units) -> Section {
    let posterior = &identified.posterior;
    let formula = identified.model.structure().transfer_function();
    let mut body = page::paragraph("lead", formula);
    body += &table(identified, units);
    let marginals = marginals(identified, units);
    if !marginals.is_empty() {
        body += &page::row(&marginals);
        body += &page::paragraph(
            "source",
            "Distribution of each parameter and of the phase margin. The solid line is the estimate, the dashed lines \
             are the ends of the 90 % interval.",
        );
    }
    let planes: Vec<Figure> = [surface(identified, posterior), correlations(posterior)]
        .into_iter()
        .flatten()
        .collect();
    body += &page::row(&planes);
    Section {
        id: "process".to_owned(),
        title: "Process".to_owned(),
        body,
    }
}

fn table(identified: &Identified, units: &Units) -> String {
    let cells: Vec<(&str, [String; 4])> = (identified.estimate.iter())
        .map(|(parameter, interval)| {
            let structure = identified.model.structure();
            let (name, unit) = (
                parameter.symbol_in(structure),
                units.parameter(structure, parameter),
            );
            let (low, high) = (bounded(interval.low), bounded(interval.high));
            if identified.estimate.is_below(parameter) {
                let below = [format!("below {high}"), String::new(), String::new(), unit];
                return (name, below);
            }
            let estimate = interval.estimate.map_or("infinite".to_owned(), significant);
            (name, [estimate, low, high, unit])
        })
        .collect();
    let cell = |value| Cell { value, below: None };
    let rows: Vec<_> = (cells.iter())
        .map(|(name, values)| {
            (
                *name,
                values.iter().map(|value| cell(value.as_str())).collect(),
            )
        })
        .collect();
    let columns = ["", "estimate", "90 % from", "to", "unit"].map(str::to_owned);
    let joint = identified
        .joint_probability
        .map_or(String::new(), |probability| {
            format!(
                "; all intervals of the process hold at once with {:.0} %",
                100.0 * probability
            )
        });
    page::table(
        &format!("Parameters with their 90 % intervals{joint}"),
        &columns,
        &rows,
    )
}

/// One marginal for each finite parameter, and one for the phase margin.
fn marginals(identified: &Identified, units: &Units) -> Vec<Figure> {
    let degrees = 1_f64.to_degrees();
    let margin = (identified.design.as_ref())
        .zip(identified.phase_margin_rad)
        .map(|(design, interval)| {
            let margins = (identified.posterior).phase_margins_rad(&design.controller);
            (
                "phase margin (deg)".to_owned(),
                margins.iter().map(|margin| degrees * margin).collect(),
                scaled(&interval, degrees),
            )
        });
    (identified.estimate.iter())
        .map(|(parameter, interval)| distribution(parameter, &interval, identified, units))
        .chain(margin)
        // Without damping the velocity gain is infinite.
        .filter(|(_, _, interval)| interval.high.is_some())
        .filter_map(|(title, values, interval)| marginal(&title, values, &interval))
        .collect()
}

/// Title of the axis, draws and interval of a parameter, in a unit that suits it.
fn distribution(
    parameter: Parameter,
    interval: &Interval,
    identified: &Identified,
    units: &Units,
) -> (String, Vec<f64>, Interval) {
    let values = |parameter| identified.posterior.values(parameter);
    let symbol = parameter.symbol_in(identified.model.structure());
    match parameter {
        // Unbounded above: its inverse, the damping, is bounded.
        Parameter::TBody if interval.high.is_none() => (
            "damping 1/T_body (1/s)".to_owned(),
            values(Parameter::InverseTBody),
            inverse(interval),
        ),
        Parameter::TBody => (Units::titled(symbol, "s"), values(parameter), *interval),
        Parameter::TProp | Parameter::TProp2 | Parameter::Tau => {
            time(symbol, values(parameter), interval)
        }
        _ => (
            Units::titled(
                symbol,
                &units.parameter(identified.model.structure(), parameter),
            ),
            values(parameter),
            *interval,
        ),
    }
}

fn scaled(interval: &Interval, factor: f64) -> Interval {
    let by = |value: Option<f64>| value.map(|value| factor * value);
    Interval {
        estimate: by(interval.estimate),
        low: by(interval.low),
        high: by(interval.high),
    }
}

/// A time in the unit that suits it.
fn time(name: &str, values_s: Vec<f64>, interval_s: &Interval) -> (String, Vec<f64>, Interval) {
    let (unit, factor) = match interval_s.estimate {
        Some(time_s) if time_s >= 1.0 => ("s", 1.0),
        _ => ("ms", 1e3),
    };
    let values = values_s.into_iter().map(|time_s| factor * time_s).collect();
    (
        Units::titled(name, unit),
        values,
        scaled(interval_s, factor),
    )
}

/// Of the inverse; what is unbounded above ends at zero.
fn inverse(interval: &Interval) -> Interval {
    let of = |value: Option<f64>| value.map_or(0.0, |value| 1.0 / value);
    Interval {
        estimate: Some(of(interval.estimate)),
        low: Some(of(interval.high)),
        high: interval.low.map(|low| 1.0 / low),
    }
}

fn marginal(title: &str, mut values: Vec<f64>, interval: &Interval) -> Option<Figure> {
    values.sort_unstable_by(f64::total_cmp);
    let at =
        |part: f64| values.get(((values.len().checked_sub(1)?) as f64 * part).round() as usize);
    let (low, high) = (*at(TAIL)?, *at(1.0 - TAIL)?);
    let width = (high - low) / BARS as f64;
    if !(width.is_finite() && width > 0.0) {
        return None;
    }
    let mut counts = [0.0; BARS];
    for value in values.iter().filter(|value| (low..=high).contains(*value)) {
        counts[(((value - low) / width) as usize).min(BARS - 1)] += 1.0;
    }
    let most = counts.iter().fold(0.0_f64, |most, &count| most.max(count));
    let bars = counts
        .iter()
        .enumerate()
        .map(|(k, count)| (low + width * (k as f64 + 0.5), count / most));
    let upright = |marks, value: f64| {
        Series::of_points("", marks, [(value, 0.0), (value, 1.05)]).hue(Hue::Reference)
    };
    let mut series = vec![Series::of_points("", Marks::Bars, bars).hue(Hue::Model)];
    series.extend(interval.estimate.map(|value| upright(Marks::Line, value)));
    let ends = [interval.low, interval.high];
    series.extend(
        ends.into_iter()
            .flatten()
            .map(|value| upright(Marks::Dashes, value)),
    );
    let mut y = Axis::titled("").spanning(0.0, 1.08);
    y.is_bare = true;
    let figure = Figure::single("", Axis::titled(title), Panel::new(y, series));
    Some(figure.shaped(Shape::Small))
}

/// The posterior over the two ratios of times that make the shape of the process: a third time scales all of them.
fn surface(identified: &Identified, posterior: &Posterior) -> Option<Figure> {
    let shape = |model: &Model| {
        let t_prop_s = model.parameter(Parameter::TProp)?;
        let damping_per_s = model.parameter(Parameter::InverseTBody)?;
        let tau_s = model.parameter(Parameter::Tau)?;
        Some((t_prop_s * damping_per_s, tau_s / t_prop_s))
    };
    let models = posterior.models(usize::MAX);
    let points: Vec<(f64, f64)> = models.iter().filter_map(shape).collect();
    let density = density(&points, CELLS)?;
    let estimate = shape(&identified.model)?;
    let mut panel = Panel::new(
        Axis::titled("tau / T_prop"),
        vec![Series::of_points("", Marks::Rings, [estimate]).hue(Hue::Input)],
    );
    panel.field = Some(Field {
        kind: FieldKind::Regions,
        x: Places::Numbers(density.x),
        y: Places::Numbers(density.y),
        z: density.content,
    });
    let figure = Figure::single(
        "Ratios of the times: the regions that hold the process with 50, 90 and 99 % probability, and the estimate.",
        Axis::titled("T_prop / T_body (0: no damping)"),
        panel,
    );
    Some(figure.shaped(Shape::Square))
}

fn correlations(posterior: &Posterior) -> Option<Figure> {
    let names: Vec<String> = (posterior.correlated().iter())
        .map(|parameter| parameter.symbol().to_owned())
        .collect();
    let z = posterior.correlations()?;
    let mut panel = Panel::new(Axis::titled(""), vec![]);
    panel.field = Some(Field {
        kind: FieldKind::Correlations,
        x: Places::Names(names.clone()),
        y: Places::Names(names),
        z,
    });
    let figure = Figure::single(
        "Correlation of the errors: near 1 or -1 only a combination of the two is well known.",
        Axis::titled(""),
        panel,
    );
    Some(figure.shaped(Shape::Square))
}
