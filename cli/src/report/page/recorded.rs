//! The recording, with the part that was used.

use onecycle::{Excitation, Identification, Oscillation, Recording};
use onecycle_link::Column;

use super::significant;
use super::thin::thinned;
use crate::pages::page::{self, Section};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Panel, Series};
use crate::report::record::{self, Fact};
use crate::report::units::Units;
use crate::words;

pub(super) fn section(recording: &Recording, found: &Identification, units: &Units) -> Section {
    let columns = recording.columns();
    let (used, facts) = match &found.excitation {
        Some(Excitation::Relay { oscillation, .. }) => (
            Some((
                "cycles are those that were",
                (oscillation.start_s, oscillation.end_s),
            )),
            facts(oscillation)
                .into_iter()
                .chain(record::of_relay(found))
                .collect(),
        ),
        Some(Excitation::Recorded(recorded)) => (
            Some(("part was", (recorded.start_s, recorded.end_s))),
            record::of_recording(found, recorded, units),
        ),
        _ => (None, vec![]),
    };
    let panel = |column: &Column, values: &[f64], marks, hue| {
        let points = recording.time_s().iter().zip(values);
        let points = thinned(points.map(|(&time_s, &value)| (time_s, value)));
        let series = Series::of_points("", marks, points).hue(hue);
        Panel::new(Axis::titled(titled(column)), vec![series])
    };
    let caption = used.map_or("Output and input as recorded.".to_owned(), |(what, _)| {
        format!("Output and input as recorded; the shaded {what} used.")
    });
    let mut figure = Figure::stacked(
        &caption,
        Axis::titled("time (s)"),
        vec![
            panel(
                &columns.output,
                recording.output(),
                Marks::Line,
                Hue::Measured,
            ),
            panel(&columns.input, recording.input(), Marks::Steps, Hue::Input),
        ],
    );
    figure.span = used.map(|(_, span)| span);
    let mut body = page::figure(&figure);
    if !facts.is_empty() {
        body += &page::facts(&facts);
    }
    let notes: Vec<String> = recording
        .notes()
        .iter()
        .map(words::recording::note)
        .collect();
    body += &page::list(&notes);
    Section {
        id: "recording".to_owned(),
        title: "Recording".to_owned(),
        body,
    }
}

fn facts(found: &Oscillation) -> Vec<Fact> {
    let noise = 100.0 * found.noise_sigma / found.amplitude;
    [
        (
            "cycles",
            format!(
                "the last {} of {} steady cycles, {:.3} to {:.3} s",
                found.cycles_used, found.cycles_steady, found.start_s, found.end_s
            ),
        ),
        ("period", format!("{} s", significant(found.period_s))),
        ("amplitude", significant(found.amplitude)),
        (
            "noise",
            format!(
                "{}, {noise:.1} % of the amplitude",
                significant(found.noise_sigma)
            ),
        ),
        (
            "relay",
            format!(
                "{} about {}, high {:.0} % of the time",
                significant(found.relay_amplitude),
                significant(found.relay_centre),
                100.0 * found.duty
            ),
        ),
    ]
    .into()
}

/// Longest name beside an axis: that of several signals of a log is cut.
const LONGEST_NAME: usize = 18;

fn titled(column: &Column) -> String {
    let mut name = column.name.clone();
    if name.chars().count() > LONGEST_NAME {
        name = name.chars().take(LONGEST_NAME).chain(['…']).collect();
    }
    match &column.unit {
        Some(unit) => format!("{name} ({unit})"),
        None => name,
    }
}
