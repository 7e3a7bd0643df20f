//! The recording, with the cycles that were used.

use onecycle::{Oscillation, Recording};
use onecycle_link::Column;

use super::significant;
use crate::pages::page::{self, Section};
use crate::pages::plot::{Axis, Figure, Hue, Marks, Panel, Series};
use crate::words;

/// Pieces that a long recording is cut into, each drawn by its extremes: more than a screen is wide.
const PIECES: usize = 1500;

pub(super) fn section(recording: &Recording, found: Option<&Oscillation>) -> Section {
    let columns = recording.columns();
    let panel = |column: &Column, values: &[f64], marks, hue| {
        let points = thinned(recording.time_s(), values);
        let series = Series::of_points("", marks, points).hue(hue);
        Panel::new(Axis::titled(titled(column)), vec![series])
    };
    let mut figure = Figure::stacked(
        if found.is_some() {
            "Output and input as recorded; the shaded cycles are those that were used."
        } else {
            "Output and input as recorded."
        },
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
    figure.span = found.map(|found| (found.start_s, found.end_s));
    let mut body = page::figure(&figure);
    if let Some(found) = found {
        body += &page::facts(&facts(found));
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

fn facts(found: &Oscillation) -> Vec<(&'static str, String)> {
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

fn titled(column: &Column) -> String {
    match &column.unit {
        Some(unit) => format!("{} ({unit})", column.name),
        None => column.name.clone(),
    }
}

/// All points, or of each piece the first, the least, the greatest and the last, in their order.
fn thinned(time_s: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let points = time_s.iter().copied().zip(values.iter().copied());
    if time_s.len() <= 4 * PIECES {
        return points.collect();
    }
    let points: Vec<(f64, f64)> = points.collect();
    let of_piece = |piece: &[(f64, f64)]| {
        let place = |of: fn(f64, f64) -> bool| {
            (0..piece.len()).reduce(|best, at| {
                if of(piece[at].1, piece[best].1) {
                    at
                } else {
                    best
                }
            })
        };
        let (least, most) = (place(|a, b| a < b), place(|a, b| a > b));
        let mut kept: Vec<usize> = [Some(0), least, most, piece.len().checked_sub(1)]
            .into_iter()
            .flatten()
            .collect();
        kept.sort_unstable();
        kept.dedup();
        kept.into_iter().map(|at| piece[at]).collect::<Vec<_>>()
    };
    points
        .chunks(points.len().div_ceil(PIECES))
        .flat_map(of_piece)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    // A million points with one spike each way: at most four of a piece are left, both spikes among them, and time
    // never goes back.
    #[test]
    fn spikes_are_drawn() {
        let time_s: Vec<f64> = (0..1_000_000).map(f64::from).collect();
        let mut values = vec![0.0; time_s.len()];
        values[123_457] = 5.0;
        values[654_321] = -7.0;
        let points = thinned(&time_s, &values);
        assert!(points.len() <= 4 * PIECES);
        assert!(points.contains(&(123_457.0, 5.0)) && points.contains(&(654_321.0, -7.0)));
        assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(points.last(), Some(&(999_999.0, 0.0)));
        assert_eq!(thinned(&time_s[..100], &values[..100]).len(), 100);
    }
}
