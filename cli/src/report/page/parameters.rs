//! What the process is, and how well that is known.

use onecycle_identify::density;
use onecycle_identify::{Draw, Identified, Interval, Posterior};
use onecycle_onboard::Soiptd;

use super::significant;
use crate::pages::page::{self, Cell, Section};
use crate::pages::plot::{
    Axis, Field, FieldKind, Figure, Hue, Marks, Panel, Places, Series, Shape,
};
use crate::report::number::bounded;
use crate::report::text::{FORMULA, Units};

/// Cells along either side of the contours.
const CELLS: usize = 64;
/// Bars of a marginal.
const BARS: usize = 36;
/// What is cut off either end of a marginal.
const TAIL: f64 = 0.005;

/// Parameters of a process without intervals.
pub(super) fn of_process(process: &Soiptd) -> Vec<(&'static str, String)> {
    let infinite = |value: Option<f64>| value.map_or("infinite".to_owned(), significant);
    [
        ("process", FORMULA.to_owned()),
        ("K", infinite(process.k())),
        ("K/T_body", significant(process.k_over_t_body())),
        ("T_prop", format!("{} s", significant(process.t_prop_s()))),
        ("T_body", format!("{} s", infinite(process.t_body_s()))),
        ("tau", format!("{} s", significant(process.tau_s()))),
    ]
    .into()
}

pub(super) fn section(identified: &Identified, posterior: &Posterior, units: &Units) -> Section {
    let mut body = page::paragraph("lead", FORMULA);
    body += &table(identified, units);
    let marginals = marginals(identified, posterior, units);
    if !marginals.is_empty() {
        body += &page::row(&marginals);
        body += &page::paragraph(
            "source",
            "What each parameter may be, and the phase margin with it; the solid line is the estimate, the dashes are \
             the ends of the 90 % interval.",
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
    let process = &identified.process;
    let (velocity, acceleration) = (units.gain("s"), units.gain("s^2"));
    let parameters: [(&str, &Interval, &str); 6] = [
        ("K", &process.k, &velocity),
        ("K/T_body", &process.k_over_t_body, &acceleration),
        ("T_prop", &process.t_prop_s, "s"),
        ("T_body", &process.t_body_s, "s"),
        ("tau", &process.tau_s, "s"),
        ("input bias", &process.input_bias, &units.input),
    ];
    let cells = parameters.map(|(name, interval, unit)| {
        let estimate = interval.estimate.map_or("infinite".to_owned(), significant);
        (
            name,
            [
                estimate,
                bounded(interval.low),
                bounded(interval.high),
                unit.to_owned(),
            ],
        )
    });
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
                "; gain, lags and delay are all within at once with {:.0} %",
                100.0 * probability
            )
        });
    page::table(
        &format!("Parameters with their 90 % intervals{joint}"),
        &columns,
        &rows,
    )
}

/// A marginal each: parameters that are finite, and the phase margin.
fn marginals(identified: &Identified, posterior: &Posterior, units: &Units) -> Vec<Figure> {
    let process = &identified.process;
    let values = |of: fn(&Draw) -> f64| -> Vec<f64> { posterior.draws().iter().map(of).collect() };
    let (velocity, acceleration) = (units.gain("s"), units.gain("s^2"));
    let (body, body_interval): (fn(&Draw) -> f64, Interval) = match process.t_body_s.high {
        Some(_) => (|draw| draw.t_body_s, process.t_body_s),
        None => (|draw| 1.0 / draw.t_body_s, inverse(&process.t_body_s)),
    };
    let body_title = match process.t_body_s.high {
        Some(_) => "T_body (s)",
        None => "damping 1/T_body (1/s)",
    };
    let degrees = 1_f64.to_degrees();
    let margins = posterior.phase_margins_rad(identified.controller.pd);
    [
        (
            Units::titled("K", &velocity),
            values(|draw| draw.k),
            process.k,
        ),
        (
            Units::titled("K/T_body", &acceleration),
            values(|draw| draw.k_over_t_body),
            process.k_over_t_body,
        ),
        time("T_prop", values(|draw| draw.t_prop_s), &process.t_prop_s),
        (body_title.to_owned(), values(body), body_interval),
        time("tau", values(|draw| draw.tau_s), &process.tau_s),
        (
            Units::titled("input bias", &units.input),
            values(|draw| draw.input_bias),
            process.input_bias,
        ),
        (
            "phase margin (deg)".to_owned(),
            margins.iter().map(|margin| degrees * margin).collect(),
            scaled(&identified.phase_margin_rad, degrees),
        ),
    ]
    .into_iter()
    // Without damping the velocity gain is infinite.
    .filter(|(_, _, interval)| interval.high.is_some())
    .filter_map(|(title, values, interval)| marginal(&title, values, &interval))
    .collect()
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

/// The posterior over the surface of shapes, which ratios of times say: time scales everything else.
fn surface(identified: &Identified, posterior: &Posterior) -> Option<Figure> {
    let shape = |process: &Soiptd| {
        let t_prop_s = process.t_prop_s();
        (
            t_prop_s * process.inv_t_body_per_s(),
            process.tau_s() / t_prop_s,
        )
    };
    let processes = posterior.processes(usize::MAX);
    let points: Vec<(f64, f64)> = processes.iter().map(shape).collect();
    let density = density(&points, CELLS)?;
    let estimate = shape(&identified.refined.process);
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
        "Where the process lies on the surface of shapes: the regions that hold it with 50, 90 and 99 %, and the \
         estimate.",
        Axis::titled("T_prop / T_body (0: no damping)"),
        panel,
    );
    Some(figure.shaped(Shape::Square))
}

fn correlations(posterior: &Posterior) -> Option<Figure> {
    let names = ["K/T_body", "T_prop", "1/T_body", "tau", "bias"].map(str::to_owned);
    let z = posterior.correlations()?.map(Vec::from).into();
    let mut panel = Panel::new(Axis::titled(""), vec![]);
    panel.field = Some(Field {
        kind: FieldKind::Correlations,
        x: Places::Names(names.clone().into()),
        y: Places::Names(names.into()),
        z,
    });
    let figure = Figure::single(
        "Correlation of the errors: near 1 or -1 only a combination of the two is well known.",
        Axis::titled(""),
        panel,
    );
    Some(figure.shaped(Shape::Square))
}
