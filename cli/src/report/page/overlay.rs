//! The simulated closed loop over the logged output, and the gains read back.

use super::thin::thinned;
use crate::pages::page::{self, Section};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Panel, Series};
use crate::results::log_gains::{LogGains, Overlay};
use crate::words::log_gains as words;

/// The section of a flight log. `None`: the log shows neither.
pub(super) fn section(gains: &LogGains) -> Option<Section> {
    let mut body = String::new();
    if let Some(read) = &gains.read_back {
        body += &page::paragraph("note", &words::read_back(read));
        let term = |term: &onecycle_link::ReadTerm| (term.name.clone(), words::term(term));
        let facts: Vec<(String, String)> = read.terms.iter().map(term).collect();
        body += &page::facts(&facts);
    }
    if let Some(overlay) = &gains.overlay {
        body += &figure(overlay);
    }
    (!body.is_empty()).then(|| Section {
        id: "gains".to_owned(),
        title: "Gains in force".to_owned(),
        body,
    })
}

fn figure(overlay: &Overlay) -> String {
    let series = |name: &str, values: &[f64], hue| {
        let points = overlay.time_s.iter().zip(values);
        let points = thinned(points.map(|(&time_s, &value)| (time_s, value)));
        Series::of_points(name, Marks::Line, points).hue(hue)
    };
    let all = vec![
        series("set-point", &overlay.set_point, Hue::Reference),
        series("logged", &overlay.logged, Hue::Measured),
        series("simulated", &overlay.simulated, Hue::Model),
    ];
    let panel = Panel::new(Axis::titled("rate (rad/s)"), all);
    let caption = words::overlay(overlay.explained);
    page::figure(&Figure::single(&caption, Axis::titled("time (s)"), panel))
}
