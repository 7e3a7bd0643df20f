//! Evaluation of flights: as text, and as a page with figures.

use std::fmt::Write;

use onecycle::{Controller, Model, margins};
use onecycle_design::soiptd_pd::deterioration::{Deterioration, PHASE_MARGIN_DEG};
use onecycle_identify::cycles::Cycles;
use onecycle_onboard::judgement::HALF_90_PERCENT;
use onecycle_plant::multirotor::{Axis, FlightRecord, Flown, Mission, Tuned};

use super::cycles::cross_table;
use super::number::percent;
use super::page::stability::Loop;
use crate::pages::page::{self, Cell, Section, page};
use crate::pages::plot::{self, Figure, Hue, Marks, Note, Panel, Series};
use crate::results::fly::{Flight, MissionFlights};
use crate::style::{HEADING, painted, verdict};

/// Number of points of a series: the width of a wide screen.
const POINTS: usize = 2000;

/// Names of the lines that say whether all missions were flown.
const FLOWN: &str = "flown";
const ENDED_EARLY: &str = "ended early";

fn title(mission: Mission) -> &'static str {
    match mission {
        Mission::Altitude => "Altitude: take-off without a controller",
        Mission::Payload => "Altitude with a payload of 400 g, 30 % of the mass",
        Mission::Cycles => "Five cycles of one run, each identified alone (the paper's Table VII)",
        Mission::Roll => "Roll with an input bias, compensated",
        Mission::RollUncompensated => "Roll with an input bias, not compensated",
        Mission::Disturbed => "Added weight, impact and wind on the tuned vehicle",
        Mission::DisturbedUntuned => "Added weight, impact and wind on a vehicle that is not tuned",
        Mission::Vehicle => "Take-off and tuning of all four axes",
    }
}

/// The numbers of a mission, each with a name.
fn figures(campaign: &MissionFlights) -> Vec<(String, String)> {
    let flights = &campaign.flights;
    let done = flights
        .iter()
        .filter(|flight| flight.flown.failure.is_none())
        .count();
    let mut figures = vec![(FLOWN.to_owned(), format!("{done} of {}", flights.len()))];
    for axis in Axis::ALL {
        let of_axis: Vec<&(Tuned, Deterioration)> = (flights.iter())
            .flat_map(|flight| &flight.judged)
            .filter(|(tuned, _)| tuned.axis == axis)
            .collect();
        if !of_axis.is_empty() {
            axis_figures(axis, &of_axis, &mut figures);
        }
    }
    of_mission(campaign, &mut figures);
    let failures = flights.iter().filter_map(|flight| flight.flown.failure);
    figures.extend(
        failures
            .take(3)
            .map(|failure| (ENDED_EARLY.to_owned(), failure.to_string())),
    );
    figures
}

/// The numbers that a mission is flown for.
fn of_mission(campaign: &MissionFlights, figures: &mut Vec<(String, String)>) {
    let flights = &campaign.flights;
    let longest = |value: &dyn Fn(&Flight) -> Option<f64>| {
        flights
            .iter()
            .filter_map(value)
            .fold(None, |most: Option<f64>, value| {
                Some(most.map_or(value, |most| most.max(value)))
            })
    };
    if let Some(drift_m) = longest(&|flight| drift_m(&flight.flown))
        && matches!(campaign.mission, Mission::Roll | Mission::RollUncompensated)
    {
        figures.push((
            "sideways drift, test and 3 s after it".to_owned(),
            format!("{:.0} cm", 100.0 * drift_m),
        ));
    }
    if let Some(largest) = longest(&|flight| flight.cycles.as_ref().map(|cycles| cycles.largest()))
    {
        let told = flights
            .iter()
            .filter(|flight| flight.cycles.is_some())
            .count();
        figures.push((
            "runs with five identified cycles".to_owned(),
            format!("{told} of {}", flights.len()),
        ));
        figures.push(("largest J_ij of two cycles".to_owned(), percent(largest)));
    }
    if campaign.mission == Mission::Vehicle
        && let Some(until_s) = longest(&|flight| Some(flight.flown.tuned.last()?.until_s))
    {
        figures.push((
            "all four axes tuned after take-off".to_owned(),
            format!("within {until_s:.1} s"),
        ));
    }
    if matches!(
        campaign.mission,
        Mission::Disturbed | Mission::DisturbedUntuned
    ) && let Some(first) = flights.first()
    {
        for (name, altitude_m, tilt_rad) in departures(&first.flown) {
            figures.push((
                format!("after {name}"),
                format!(
                    "altitude changes by up to {:.1} cm, roll and pitch by {:.1} deg",
                    100.0 * altitude_m,
                    tilt_rad.to_degrees()
                ),
            ));
        }
    }
}

fn axis_figures(
    axis: Axis,
    tuned: &[&(Tuned, Deterioration)],
    figures: &mut Vec<(String, String)>,
) {
    let name = axis.name();
    let (first, _) = tuned[0];
    let (found, truth) = (&first.identified.process, &first.truth);
    figures.push((
        format!("{name}: identified process (true)"),
        format!(
            "K/T_body {:.4} ({:.4}), T_prop {:.1} ms ({:.1}), T_body {} ({}), tau {:.1} ms ({:.1})",
            found.k_over_t_body(),
            truth.k_over_t_body(),
            1e3 * found.t_prop_s(),
            1e3 * truth.t_prop_s(),
            seconds(found.t_body_s()),
            seconds(truth.t_body_s()),
            1e3 * found.tau_s(),
            1e3 * truth.tau_s(),
        ),
    ));
    let pd = &first.identified.pd;
    figures.push((
        format!("{name}: controller"),
        format!("Kp {:.4}, Kd {:.4}", pd.kp, pd.kd),
    ));
    let most = |value: &dyn Fn(&Tuned) -> f64| {
        tuned
            .iter()
            .map(|(tuned, _)| value(tuned))
            .fold(f64::NEG_INFINITY, f64::max)
    };
    figures.push((
        format!("{name}: test"),
        format!(
            "at most {:.1} s",
            most(&|tuned| tuned.until_s - tuned.from_s)
        ),
    ));
    figures.push((
        format!("{name}: on the true process"),
        on_the_vehicle(tuned),
    ));
}

/// Cost and phase margin of the controllers on the true processes.
fn on_the_vehicle(tuned: &[&(Tuned, Deterioration)]) -> String {
    let costs: Option<Vec<(f64, f64)>> = (tuned.iter())
        .map(|(_, cost)| match *cost {
            Deterioration::Stable {
                relative,
                phase_margin_rad,
            } => Some((relative, phase_margin_rad.to_degrees())),
            Deterioration::Unstable => None,
        })
        .collect();
    let Some(costs) = costs else {
        return "unstable".to_owned();
    };
    let mean = costs.iter().map(|(cost, _)| cost.abs()).sum::<f64>() / costs.len() as f64;
    let worst = costs
        .iter()
        .fold(0.0_f64, |most, (cost, _)| most.max(cost.abs()));
    let least = costs
        .iter()
        .fold(f64::INFINITY, |least, (_, margin)| least.min(*margin));
    let width =
        |tuned: &Tuned| HALF_90_PERCENT * tuned.identified.deviations.phase_margin_rad.to_degrees();
    let kept = (tuned.iter().zip(&costs))
        .filter(|((tuned, _), (_, margin))| *margin >= PHASE_MARGIN_DEG - width(tuned))
        .count();
    format!(
        "|J| mean {}, worst {}; phase margin at least {least:.1} deg, above 20 deg minus half its 90 % interval in \
         {kept} of {}",
        percent(mean),
        percent(worst),
        tuned.len(),
    )
}

fn seconds(time_s: Option<f64>) -> String {
    time_s.map_or("none".to_owned(), |time_s| format!("{time_s:.2} s"))
}

/// Largest sideways distance from the position at the start of the test (m).
fn drift_m(flown: &Flown) -> Option<f64> {
    let from_s = flown.events.first()?.0;
    let mut after = flown
        .records
        .iter()
        .filter(|record| record.time_s >= from_s);
    let start = after.next()?.reading.position_m.y;
    after
        .map(|record| (record.reading.position_m.y - start).abs())
        .max_by(f64::total_cmp)
}

/// For each disturbance: its name, the largest change of the altitude after it (m), and that of roll and pitch (rad).
fn departures(flown: &Flown) -> Vec<(&'static str, f64, f64)> {
    let disturbances: Vec<_> = (flown.events.iter())
        .filter(|(_, name)| !matches!(*name, "test begins" | "tuned"))
        .collect();
    let end_s = flown.records.last().map_or(0.0, |record| record.time_s);
    let mut departures = vec![];
    for (index, (from_s, name)) in disturbances.iter().enumerate() {
        let until_s = disturbances
            .get(index + 1)
            .map_or(end_s, |(until_s, _)| *until_s);
        let mut inside =
            (flown.records.iter()).filter(|record| (*from_s..until_s).contains(&record.time_s));
        let Some(before) = inside.next() else {
            continue;
        };
        let (mut altitude_m, mut tilt_rad) = (0.0_f64, 0.0_f64);
        for record in inside {
            let (there, here) = (&before.reading, &record.reading);
            altitude_m = altitude_m.max((here.position_m.z - there.position_m.z).abs());
            tilt_rad = tilt_rad
                .max((here.angles_rad.x - there.angles_rad.x).abs())
                .max((here.angles_rad.y - there.angles_rad.y).abs());
        }
        departures.push((*name, altitude_m, tilt_rad));
    }
    departures
}

/// Ratio of the gains with and without payload.
fn inflation(campaigns: &[MissionFlights]) -> Option<(f64, f64)> {
    let gains = |wanted: Mission| {
        let campaign = campaigns
            .iter()
            .find(|campaign| campaign.mission == wanted)?;
        let (tuned, _) = campaign.flights.first()?.judged.first()?;
        Some(tuned.identified.pd)
    };
    let (without, with) = (gains(Mission::Altitude)?, gains(Mission::Payload)?);
    Some((with.kp / without.kp, with.kd / without.kd))
}

fn inflated(campaigns: &[MissionFlights]) -> Option<(String, String)> {
    let (kp, kd) = inflation(campaigns)?;
    Some((
        "gains with payload over those without".to_owned(),
        format!("Kp {kp:.2}, Kd {kd:.2} (the paper: 1.19 and 1.22)"),
    ))
}

fn figures_of(campaign: &MissionFlights, campaigns: &[MissionFlights]) -> Vec<(String, String)> {
    let mut figures = figures(campaign);
    if campaign.mission == Mission::Payload {
        figures.extend(inflated(campaigns));
    }
    figures
}

/// All missions as text.
pub(crate) fn text(campaigns: &[MissionFlights]) -> String {
    let mut text = String::new();
    for campaign in campaigns {
        let (name, title) = (campaign.mission.name(), title(campaign.mission));
        let is_flown = (campaign.flights.iter()).all(|flight| flight.flown.failure.is_none());
        let _ = writeln!(text, "{}: {title}", painted(HEADING, name));
        for (name, value) in figures_of(campaign, campaigns) {
            let line = format!("  {name:<40} {value}\n");
            text.push_str(&match name.as_str() {
                FLOWN | ENDED_EARLY => verdict(is_flown, &line),
                _ => line,
            });
        }
    }
    text
}

/// All missions as a page.
pub(crate) fn html(campaigns: &[MissionFlights]) -> String {
    let lead = page::paragraph(
        "lead",
        "A simulated quadrotor of the size of the paper's (section IV-D). Each axis is controlled by the on-board tuner, \
         the same code that firmware links. The figures show the first seed.",
    ) + &page::paragraph(
        "source",
        &format!(
            "Made by onecycle fly, onecycle {}.",
            env!("CARGO_PKG_VERSION")
        ),
    );
    let sections: Vec<Section> = (campaigns.iter())
        .map(|campaign| section(campaign, campaigns))
        .collect();
    page("Flights", &lead, &sections)
}

fn section(campaign: &MissionFlights, campaigns: &[MissionFlights]) -> Section {
    let mut body = page::facts(&figures_of(campaign, campaigns));
    if let Some(first) = campaign.flights.first() {
        if let Some(cycles) = &first.cycles {
            body += &cycles_table(cycles);
        }
        body.extend(
            pictures(campaign.mission, &first.flown)
                .iter()
                .map(page::figure),
        );
        let loops = first.flown.tuned.iter().filter_map(open_loop);
        body += &page::row(&loops.collect::<Vec<_>>());
    }
    Section {
        id: campaign.mission.name().to_owned(),
        title: title(campaign.mission).to_owned(),
        body,
    }
}

/// Nyquist plot of the controller of an axis, on the identified process and on the true one.
fn open_loop(tuned: &Tuned) -> Option<Figure> {
    let model = Model::from(tuned.identified.process);
    let controller = Controller::from(tuned.identified.pd);
    let figure = Loop::new(model, controller, margins(&model, &controller)?)
        .beside(&tuned.truth.into())
        .nyquist();
    let caption = format!("{}: {}", tuned.axis.name(), figure.caption);
    Some(Figure { caption, ..figure })
}

/// Cost of the controller of each cycle on the processes of the other cycles.
fn cycles_table(cycles: &Cycles) -> String {
    let rows = cross_table(cycles);
    let columns: Vec<String> = std::iter::once("controller of cycle".to_owned())
        .chain((1..=rows.len()).map(|number| format!("on cycle {number}")))
        .collect();
    let cell = |value| Cell { value, below: None };
    let names: Vec<String> = (1..=rows.len()).map(|number| number.to_string()).collect();
    let rows: Vec<_> = (rows.iter())
        .zip(&names)
        .map(|(row, name)| (name.as_str(), row.iter().map(|value| cell(value)).collect()))
        .collect();
    page::table("J_ij", &columns, &rows)
}

/// A panel over time with a vertical line and the name at each event.
fn with_events(mut panel: Panel, flown: &Flown) -> Panel {
    let values = || panel.series.iter().flat_map(|series| &series.y);
    let low = values().copied().fold(f64::INFINITY, f64::min);
    let high = values().copied().fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return panel;
    }
    for (index, (time_s, name)) in flown.events.iter().enumerate() {
        let line = [(*time_s, low), (*time_s, high)];
        let line = Series::of_points("", Marks::Dashes, line).hue(Hue::Reference);
        panel.series.push(line);
        // Names of events that follow each other closely stand at different heights.
        let height = -14.0 - 16.0 * (index % 2) as f64;
        panel.notes.push(Note {
            text: (*name).to_owned(),
            x: *time_s,
            y: high,
            away: (0.0, height),
        });
    }
    panel
}

fn pictures(mission: Mission, flown: &Flown) -> Vec<Figure> {
    let series = |name: &str, value: &dyn Fn(&FlightRecord) -> f64| {
        let every = flown.records.len().div_ceil(POINTS).max(1);
        let points = flown.records.iter().step_by(every);
        Series::of_points(
            name,
            Marks::Line,
            points.map(|record| (record.time_s, value(record))),
        )
    };
    let events: Vec<String> = (flown.events.iter())
        .map(|(time_s, name)| format!("{name} at {time_s:.1} s"))
        .collect();
    let figure = |title: &str, series: Vec<Series>| {
        let panel = with_events(Panel::new(plot::Axis::titled(title), series), flown);
        Figure::single(&events.join(", "), plot::Axis::titled("time (s)"), panel)
    };
    let degrees = |name: &str, axis: Axis| {
        series(name, &move |record| axis.of(&record.reading).0.to_degrees())
    };
    let altitude = figure(
        "altitude (m)",
        vec![series("altitude", &|record| record.reading.position_m.z)],
    );
    let command = |axis: Axis| {
        let title = format!("{} command (fraction of full thrust)", axis.name());
        figure(
            &title,
            vec![series("command", &move |record| {
                record.commands[axis.index()]
            })],
        )
    };
    let tilt = figure(
        "angle (deg)",
        vec![
            degrees("roll", Axis::Roll),
            degrees("pitch", Axis::Pitch),
            degrees("yaw", Axis::Yaw),
        ],
    );
    let side = figure(
        "distance to the left (m)",
        vec![series("y", &|record| record.reading.position_m.y)],
    );
    match mission {
        Mission::Altitude | Mission::Payload | Mission::Cycles => {
            vec![altitude, command(Axis::Altitude)]
        }
        Mission::Roll | Mission::RollUncompensated => {
            vec![
                figure("roll (deg)", vec![degrees("roll", Axis::Roll)]),
                command(Axis::Roll),
                side,
            ]
        }
        Mission::Disturbed | Mission::DisturbedUntuned => vec![altitude, tilt, side],
        Mission::Vehicle => vec![altitude, tilt],
    }
}
