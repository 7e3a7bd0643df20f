//! Controllers to choose from, as text: a table, the forms of a controller, its margins.

use std::fmt::Write;

use onecycle::{Assessment, Controller, Design, Interval};
use onecycle_design::{Spans, TypedGain, Vendor};

use super::number::{seconds, short, significant};
use super::units::Units;
use super::wrap::{TOGETHER, width, wrapped};
use crate::results::controllers::{Controllers, Row};
use crate::style::{HOLDS, headed, painted};
use crate::words::controllers::{self as words, brief, change, judgement};
use crate::words::sentence;

/// Titles of the columns in the text.
const COLUMNS: [&str; 11] = [
    "Kp", "Ki", "Kd", "filter", "phase", "gain", "Ms", "over-", "settling", "load", "noise",
];

/// The column that the text leaves out, for lines of 80 columns: the gain margin stands below the table.
const LEFT_OUT: usize = 5;

/// Titles of the columns on a page.
pub(super) const TITLES: [&str; 11] = [
    "Kp",
    "Ki",
    "Kd",
    "filter Tf",
    "phase margin (deg)",
    "gain margin",
    "Ms",
    "overshoot (%)",
    "settling",
    "load",
    "noise",
];

/// Second line of the titles.
const UNITS: [&str; 11] = ["", "", "", "Tf", "deg", "", "", "shoot", "", "IAE", "share"];

/// The table of all styles and the gains in force.
pub(super) fn table(choice: &Controllers) -> String {
    let mut text = headed("\nControllers\n");
    let against =
        (choice.against.as_ref()).map(|of| cells(choice, &of.controller, of.figures.as_ref()));
    let rows: Vec<(&Row, Result<[String; 11], String>)> = (choice.rows.iter())
        .map(|row| {
            let of = |design: &Design| cells(choice, &design.controller, row.figures.as_ref());
            let outcome = row.proposal.outcome.as_ref();
            (row, outcome.map(of).map_err(brief))
        })
        .collect();
    let titles = [COLUMNS, UNITS].map(|titles| titles.map(str::to_owned));
    let designed = rows.iter().filter_map(|(_, cells)| cells.as_ref().ok());
    let widths = widths(titles.iter().chain(&against).chain(designed));
    for titles in &titles {
        let _ = writeln!(text, "{}", line("", titles, &widths));
    }
    if let Some(cells) = &against {
        let _ = writeln!(text, "{}", line("  yours", cells, &widths));
    }
    for (row, cells) in &rows {
        let name = name(choice, row);
        let shown = match cells {
            Ok(cells) => line(&name, cells, &widths),
            Err(reason) => format!("{name:<NAMES$}  {reason}"),
        };
        let is_chosen = choice.is_chosen(row) && row.figures.is_some();
        let _ = match is_chosen {
            true => writeln!(text, "{}", painted(HOLDS, &shown)),
            false => writeln!(text, "{shown}"),
        };
    }
    if let Some(against) = &choice.against {
        wrapped(
            &mut text,
            "  ",
            &sentence(&judgement(against, choice.source)),
        );
        if let Some(change) = change(choice) {
            wrapped(&mut text, "  ", &sentence(&change));
        }
    }
    text
}

/// Name of a row; the chosen one is marked.
fn name(choice: &Controllers, row: &Row) -> String {
    let mark = if choice.is_chosen(row) { ">" } else { " " };
    format!("{mark} {}", row.proposal.specification.style.name())
}

/// Widths of the columns: two blanks before the widest cell, or one where the lines were too long.
fn widths<'a>(rows: impl Iterator<Item = &'a [String; 11]>) -> [usize; 11] {
    let mut widths = [0; 11];
    for row in rows {
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = cell.chars().count().max(*width);
        }
    }
    widths[LEFT_OUT] = 0;
    let all = NAMES + widths.iter().sum::<usize>() + 2 * (widths.len() - 1);
    let blanks = if all > width() { 1 } else { 2 };
    widths.map(|width| width + blanks)
}

/// Columns of the names of styles.
const NAMES: usize = 10;

fn line(name: &str, cells: &[String; 11], widths: &[usize; 11]) -> String {
    let mut line = format!("{name:<NAMES$}");
    for (at, (cell, width)) in cells.iter().zip(widths).enumerate() {
        if at != LEFT_OUT {
            let _ = write!(line, "{cell:>width$}");
        }
    }
    line.trim_end().to_owned()
}

/// The cells of a controller, without units.
pub(super) fn cells(
    choice: &Controllers,
    controller: &Controller,
    figures: Option<&Assessment>,
) -> [String; 11] {
    let pid = controller.pid();
    let none = || "-".to_owned();
    let or_none = |value: Option<String>| value.unwrap_or_else(none);
    let gain = |value: f64| if value == 0.0 { none() } else { short(value) };
    let filter = if pid.filter_s == 0.0 {
        none()
    } else {
        seconds(pid.filter_s)
    };
    let phase = figures.map(|of| format!("{:.1}", of.margins.phase_margin_rad.to_degrees()));
    let step = figures.and_then(|figures| figures.step);
    [
        gain(pid.kp),
        gain(pid.ki),
        gain(pid.kd),
        filter,
        phase.unwrap_or_else(|| "unstable".to_owned()),
        or_none(figures.and_then(|of| Some(format!("{:.2}", of.margins.gain_margin?)))),
        or_none(figures.map(|of| format!("{:.2}", of.ms))),
        or_none(step.map(|step| format!("{:.0} %", 100.0 * step.overshoot))),
        or_none(step.map(|step| seconds(step.settling_time_s))),
        or_none(figures.and_then(|of| load(choice, of))),
        or_none(figures.and_then(|of| Some(format!("{:.0} %", 100.0 * of.noise_share?)))),
    ]
}

/// Load IAE relative to that of the chosen controller.
fn load(choice: &Controllers, figures: &Assessment) -> Option<String> {
    let iae = figures.load_iae?;
    if iae.is_infinite() {
        return Some("offset".to_owned());
    }
    Some(format!("{:.2}", iae / choice.load_reference()?))
}

/// Names and values of the forms in which a controller is typed in.
pub(super) fn forms(controller: &Controller, units: &Units) -> Vec<(&'static str, String)> {
    let pid = controller.pid();
    let (gain, rate, integral) = (
        units.controller(""),
        units.controller(" s"),
        units.integral(),
    );
    let mut forms = vec![];
    if let Controller::Autopilot(autopilot) = controller {
        let of = autopilot.gains;
        forms.push((
            "cascade",
            format!(
                "angle P {} 1/s, rate P {}{rate}, rate I {} 1/s, rate D {} s",
                significant(of.angle_p),
                significant(of.rate_p),
                significant(of.rate_i),
                significant(of.rate_d)
            ),
        ));
    }
    if !matches!(controller, Controller::Autopilot(of) if of.gains.rate_d != 0.0) {
        let mut parallel = format!("Kp {}{gain}", significant(pid.kp));
        if pid.ki != 0.0 {
            let _ = write!(parallel, ", Ki {}{integral}", significant(pid.ki));
        }
        if pid.kd != 0.0 {
            let _ = write!(parallel, ", Kd {}{rate}", significant(pid.kd));
        }
        forms.push(("parallel", parallel));
        if pid.ki != 0.0 {
            forms.extend(with_times(&pid, &gain));
        }
    }
    if let Some(pd) = controller.pd() {
        let (angle_p, rate_p) = (significant(pd.angle_p()), significant(pd.rate_p()));
        forms.push((
            "cascade",
            format!("angle P {angle_p} 1/s, rate P {rate_p}{rate}"),
        ));
    }
    forms.extend(filter(&pid));
    forms
}

/// The gains as the controller of a process control system takes them: its name and their values.
pub(super) fn in_plant(
    choice: &Controllers,
    controller: &Controller,
) -> Option<(&'static str, String)> {
    let (vendor, spans) = choice.plant?;
    let value = match vendor.typed(&controller.pid(), &spans) {
        Ok(gains) => typed(vendor, &gains, &spans),
        Err(error) => format!("none: {}", words::no_gains(error)),
    };
    Some((vendor.name(), value))
}

fn typed(vendor: Vendor, gains: &[TypedGain; 3], spans: &Spans) -> String {
    let is_on = |gain: &&TypedGain| gain.value != 0.0 && gain.value.is_finite();
    let shown = gains.iter().filter(is_on).map(|gain| {
        let value = format!(
            "{} {} {}",
            gain.name,
            significant(gain.value.abs()),
            gain.unit
        );
        value.trim_end().to_owned()
    });
    let action = words::action(gains);
    if !vendor.has_range_of_measurement() {
        let values = shown.collect::<Vec<_>>().join(", ");
        // A line to type stays on one line.
        let lines = vendor.lines(gains).map_or(values, |lines| {
            let lines = lines.lines().map(|line| line.trim().replace(' ', TOGETHER));
            lines.collect::<Vec<_>>().join(", ").replace(":, ", ": ")
        });
        let reversed = match action {
            "direct" => "; the sign of the action is reversed",
            _ => "",
        };
        return match vendor.counts_output() {
            true => format!(
                "{lines}; full output is {} in the unit of the input{reversed}",
                significant(spans.output)
            ),
            false => format!("{lines}{reversed}"),
        };
    }
    format!(
        "{}; {action} action; measurement span {}, output span {}; without filter and set-point weight",
        shown.collect::<Vec<_>>().join(", "),
        significant(spans.measurement),
        significant(spans.output)
    )
}

/// The ideal and the series form of a controller with an integral term.
fn with_times(pid: &onecycle::Pid, gain: &str) -> Vec<(&'static str, String)> {
    let times = |k: f64, ti_s: f64, td_s: f64| {
        let derivative = if td_s == 0.0 {
            String::new()
        } else {
            format!(", Td {}", seconds_of(td_s))
        };
        format!(
            "K {}{gain}, Ti {}{derivative}",
            significant(k),
            seconds_of(ti_s)
        )
    };
    let mut forms = vec![];
    if let Some(of) = pid.ideal() {
        let value = times(of.gain, of.integral_time_s, of.derivative_time_s);
        forms.push(("ideal", value));
    }
    if pid.kd != 0.0 {
        let series = pid.series().map_or_else(
            || "none: the zeros are complex (Ti < 4 Td)".to_owned(),
            |of| times(of.gain, of.integral_time_s, of.derivative_time_s),
        );
        forms.push(("series", series));
    }
    forms
}

fn seconds_of(time_s: f64) -> String {
    format!("{} s", significant(time_s))
}

/// The measurement filter and the set-point weight, where there are any.
fn filter(pid: &onecycle::Pid) -> Option<(&'static str, String)> {
    let mut parts = vec![];
    if pid.filter_s > 0.0 {
        let cutoff_hz = std::f64::consts::SQRT_2 / (std::f64::consts::TAU * pid.filter_s);
        parts.push(format!(
            "Tf {}, second order on the measurement (cutoff {} Hz)",
            seconds_of(pid.filter_s),
            short(cutoff_hz)
        ));
    }
    if pid.ki != 0.0 {
        parts.push(format!("set-point weight b {:.2}", pid.setpoint_weight));
    }
    (!parts.is_empty()).then(|| ("filter", parts.join("; ")))
}

/// The margins of the chosen controller, in one line.
pub(super) fn margins(
    choice: &Controllers,
    design: &Design,
    phase_margin_rad: Option<&Interval>,
) -> String {
    let margins = &design.margins;
    let mut text = format!(
        "phase margin {:.1} deg",
        margins.phase_margin_rad.to_degrees()
    );
    if let Some(Interval {
        low: Some(low),
        high: Some(high),
        ..
    }) = phase_margin_rad
    {
        let (low, high) = (low.to_degrees(), high.to_degrees());
        let _ = write!(text, " (90 %: {low:.1} .. {high:.1})");
    }
    if let Some(gain_margin) = margins.gain_margin {
        let decibels = 20.0 * gain_margin.log10();
        let _ = write!(text, ", gain margin {gain_margin:.2} ({decibels:.1} dB)");
    }
    let _ = write!(text, ", delay margin {}", seconds(margins.delay_margin_s));
    if let Some((_, figures)) = choice.design() {
        let _ = write!(text, ", Ms {:.2}, Mt {:.2}", figures.ms, figures.mt);
        if let Some(share) = figures.noise_share {
            let _ = write!(
                text,
                ", noise at the actuator {:.0} % of the input amplitude",
                100.0 * share
            );
        }
    }
    text
}
