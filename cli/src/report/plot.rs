//! Plot of the end of a recording in the terminal: measurement as dots, fit as a line, input below.
//!
//! A braille character has two columns of four dots, so a plot of 80 by 12 characters has 160 by 48 dots.

use std::fmt::Write;

use onecycle::{Excitation, Identification, Oscillation, Recorded, Recording};
use onecycle_identify::Fit;

use super::number::{seconds, significant};
use crate::style::{FIT, HEADING, PLAIN, painted};

/// Largest width of the plot: that of the report.
const WIDTH: usize = 96;
/// Smallest width of the plot, for any terminal.
const LEAST_WIDTH: usize = 40;
/// Height of the plot in characters.
const ROWS: usize = 12;
/// Characters left of the plot: a number, a blank and the frame.
const MARGIN: usize = 13;
/// Largest number of cycles drawn; with more cycles the dots would hide the line.
const MOST_CYCLES: usize = 2;

/// Columns and rows of dots of a character.
const ACROSS: usize = 2;
const DOWN: usize = 4;
/// Bit of each dot by row and column, as in the Unicode braille block.
const BITS: [[u8; ACROSS]; DOWN] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
/// The character without a dot.
const BRAILLE: u32 = 0x2800;

/// Characters of the input, from its least value to its largest.
const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// The plot for a terminal with this number of columns; without a terminal, in full width. Drawn are the last cycles of
/// an oscillation; of another recording, as many of the last points of the fit as there are columns of dots. The fit is
/// drawn if there is one, also a refused one. `None` if nothing was found that excites the process.
pub(crate) fn end(
    recording: &Recording,
    found: &Identification,
    columns: Option<usize>,
) -> Option<String> {
    let width = columns.unwrap_or(WIDTH).clamp(LEAST_WIDTH, WIDTH) - MARGIN;
    let (from_s, end_s, heading) = match found.excitation.as_ref()? {
        Excitation::Relay { oscillation, .. } => last_cycles(oscillation),
        Excitation::Recorded(recorded) => last_points(found, recorded, width * ACROSS),
        _ => return None,
    };
    let shown = |time_s: f64| (from_s..=end_s).contains(&time_s);
    let (measured, fitted): (Vec<Point>, Vec<Point>) = match fit_of(found) {
        Some(fit) => (fit.points.iter())
            .filter(|point| shown(point.time_s))
            .map(|point| {
                let of = |value| (point.time_s, value);
                (of(point.measured), of(point.fitted))
            })
            .unzip(),
        None => {
            let points = recording.time_s().iter().zip(recording.output());
            let points = points.map(|(time_s, output)| (*time_s, *output));
            (points.filter(|point| shown(point.0)).collect(), vec![])
        }
    };
    let frame = Frame::around(&measured, &fitted, width)?;
    let mut text = title(recording, &heading, fit_name(found, &fitted));
    frame.write(&mut text, &measured, &fitted);
    text += &match found.oscillation() {
        Some(oscillation) => frame.relay(recording, oscillation),
        None => frame.input(recording),
    };
    text += &frame.times();
    Some(text)
}

/// Start and end (s) of the last cycles, and the heading.
fn last_cycles(found: &Oscillation) -> (f64, f64, String) {
    let cycles = found.cycles_used.clamp(1, MOST_CYCLES);
    let heading = match cycles {
        1 => "Last cycle",
        _ => "Last two cycles",
    };
    let from_s = found.end_s - cycles as f64 * found.period_s;
    (from_s, found.end_s, heading.to_owned())
}

/// Start and end (s) of the last `most` points of the fit, or of the part that was used, and the heading.
fn last_points(found: &Identification, record: &Recorded, most: usize) -> (f64, f64, String) {
    let points = fit_of(found).map_or(&[][..], |fit| &fit.points);
    let first = points.len().saturating_sub(most);
    let from_s = (points.get(first).filter(|_| first > 0)).map_or(record.start_s, |at| at.time_s);
    let heading = if from_s > record.start_s {
        format!("Last {}", seconds(record.end_s - from_s))
    } else {
        "Recording".to_owned()
    };
    (from_s, record.end_s, heading)
}

/// The fit that was accepted, or the one that was refused.
fn fit_of(found: &Identification) -> Option<&Fit> {
    let accepted = found.outcome.as_ref().map(|identified| &identified.fit);
    accepted
        .ok()
        .or(found.refused.as_ref().map(|refused| &refused.fit))
}

/// What the line is: disturbances move the output of a recording away from that of the model alone.
fn fit_name(found: &Identification, fitted: &[Point]) -> Option<&'static str> {
    let name = match (found.oscillation(), &found.outcome) {
        (Some(_), Ok(_)) => "fit",
        (Some(_), Err(_)) => "fit that was refused",
        (None, Ok(_)) => "model without disturbances",
        (None, Err(_)) => "refused model without disturbances",
    };
    (!fitted.is_empty()).then_some(name)
}

/// The heading: quantity and unit.
fn title(recording: &Recording, heading: &str, fit: Option<&str>) -> String {
    let column = &recording.columns().output;
    let unit = (column.unit.as_ref()).map_or(String::new(), |unit| format!(" ({unit})"));
    let what = match fit {
        Some(fit) => format!(
            "{}{unit} in dots, the {} as a line",
            column.name,
            painted(FIT, fit)
        ),
        None => format!("{}{unit}", column.name),
    };
    format!("\n{}  {what}\n", painted(HEADING, heading))
}

/// Time (s) and value.
type Point = (f64, f64);

/// Ranges and width of the plot.
struct Frame {
    times_s: [f64; 2],
    values: [f64; 2],
    width: usize,
}

impl Frame {
    /// The frame around all points; `None` if they have no extent.
    fn around(measured: &[Point], fitted: &[Point], width: usize) -> Option<Self> {
        let all = || measured.iter().chain(fitted);
        let range = |values: &mut dyn Iterator<Item = f64>| {
            let [low, high] = values
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                    [low.min(value), high.max(value)]
                });
            (low < high && (high - low).is_finite()).then_some([low, high])
        };
        Some(Self {
            times_s: range(&mut all().map(|point| point.0))?,
            values: range(&mut all().map(|point| point.1))?,
            width,
        })
    }

    /// Dot column of a time.
    fn across(&self, time_s: f64) -> usize {
        place(time_s, self.times_s, self.width * ACROSS)
    }

    /// Dot row of a value, from the top.
    fn down(&self, value: f64) -> usize {
        ROWS * DOWN - 1 - place(value, self.values, ROWS * DOWN)
    }

    /// Time at the centre of a column.
    fn time_s(&self, column: usize, columns: usize) -> f64 {
        let [from, to] = self.times_s;
        from + (to - from) * (column as f64 + 0.5) / columns as f64
    }

    /// The rows of the plot.
    fn write(&self, text: &mut String, measured: &[Point], fitted: &[Point]) {
        let mut dots = Canvas::new(self.width);
        for &(time_s, value) in measured {
            dots.set(self.across(time_s), self.down(value));
        }
        let mut line = Canvas::new(self.width);
        let mut last = None;
        for column in 0..self.width * ACROSS {
            let Some(value) = interpolated(fitted, self.time_s(column, self.width * ACROSS)) else {
                continue;
            };
            let row = self.down(value);
            // Connect to the column before, so that a steep line has no gaps.
            let begin = match last {
                Some(last) if last < row => last + 1,
                Some(last) if last > row => last - 1,
                _ => row,
            };
            for row in begin.min(row)..=begin.max(row) {
                line.set(column, row);
            }
            last = Some(row);
        }
        for row in 0..ROWS {
            let label = match row {
                0 => significant(self.values[1]),
                _ if row == ROWS - 1 => significant(self.values[0]),
                _ => String::new(),
            };
            let edge = if label.is_empty() { '│' } else { '┤' };
            let row = merged(&dots.rows[row], &line.rows[row]);
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{label:>margin$} {edge}{row}", margin = MARGIN - 2);
        }
    }

    /// The relay: an upper stroke is high, a lower stroke is low.
    fn relay(&self, recording: &Recording, found: &Oscillation) -> String {
        let stroke = |column| {
            let time_s = self.time_s(column, self.width);
            let next = recording.time_s().partition_point(|&at_s| at_s <= time_s);
            let is_high = recording.input()[next.saturating_sub(1)] > found.relay_centre;
            if is_high { '▔' } else { '▁' }
        };
        let strokes: String = (0..self.width).map(stroke).collect();
        format!("{:>margin$} │{strokes}\n", "relay", margin = MARGIN - 2)
    }

    /// The input, each column at the value it begins with, from the least value that is shown to the largest.
    fn input(&self, recording: &Recording) -> String {
        let value = |column| {
            let time_s = self.time_s(column, self.width);
            let next = recording.time_s().partition_point(|&at_s| at_s <= time_s);
            recording.input()[next.saturating_sub(1)]
        };
        let values: Vec<f64> = (0..self.width).map(value).collect();
        let bars = levels(&values);
        format!("{:>margin$} │{bars}\n", "input", margin = MARGIN - 2)
    }

    /// The time axis with its ends.
    fn times(&self) -> String {
        let [from, to] = self.times_s;
        // Three digits of the range of the axis; casts saturate.
        let decimals = (2.0 - (to - from).log10().floor()).clamp(0.0, 9.0) as usize;
        let [from, to] = self.times_s.map(|time_s| format!("{time_s:.decimals$} s"));
        format!(
            "{:MARGIN$}{}\n{:MARGIN$}{from}{to:>rest$}\n",
            format!("{:>margin$}", '└', margin = MARGIN),
            "─".repeat(self.width),
            "",
            rest = self.width.saturating_sub(from.len()),
        )
    }
}

/// Index of the one of `count` equal parts of a range that contains a value.
fn place(value: f64, [low, high]: [f64; 2], count: usize) -> usize {
    let part = (value - low) / (high - low) * count as f64;
    // Casts saturate.
    (part as usize).min(count - 1)
}

/// A character for each value. A constant is at the lowest level.
fn levels(values: &[f64]) -> String {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let range = [low, if low < high { high } else { low + 1.0 }];
    let level = |&value: &f64| LEVELS[place(value, range, LEVELS.len())];
    values.iter().map(level).collect()
}

/// Linear interpolation at a time; `None` before the first point and after the last.
fn interpolated(points: &[Point], time_s: f64) -> Option<f64> {
    let next = points.partition_point(|point| point.0 < time_s);
    let (before, after) = (points.get(next.checked_sub(1)?)?, points.get(next)?);
    let part = (time_s - before.0) / (after.0 - before.0);
    Some(before.1 + part * (after.1 - before.1))
}

/// A canvas of dots.
struct Canvas {
    rows: Vec<Vec<u8>>,
}

impl Canvas {
    fn new(width: usize) -> Self {
        Self {
            rows: vec![vec![0; width]; ROWS],
        }
    }

    fn set(&mut self, across: usize, down: usize) {
        self.rows[down / DOWN][across / ACROSS] |= BITS[down % DOWN][across % ACROSS];
    }
}

/// A row of dots and line combined; characters with a part of the line have its colour.
fn merged(dots: &[u8], line: &[u8]) -> String {
    let character = |bits: u8| match bits {
        0 => ' ',
        bits => char::from_u32(BRAILLE + u32::from(bits)).unwrap_or(' '),
    };
    let cells: Vec<(bool, char)> = (dots.iter().zip(line))
        .map(|(dots, line)| (*line != 0, character(dots | line)))
        .collect();
    let runs = cells.chunk_by(|one, next| one.0 == next.0);
    let painted = runs.map(|run| {
        let characters: String = run.iter().map(|cell| cell.1).collect();
        painted(if run[0].0 { FIT } else { PLAIN }, &characters)
    });
    painted.collect::<String>().trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two seconds, values from -1 to 1, sixteen characters.
    const FRAME: Frame = Frame {
        times_s: [3.0, 5.0],
        values: [-1.0, 1.0],
        width: 16,
    };

    fn rows(measured: &[Point], fitted: &[Point]) -> Vec<String> {
        let mut text = String::new();
        FRAME.write(&mut text, measured, fitted);
        text.lines().map(str::to_owned).collect()
    }

    // The first and lowest dot is the lower left one of the lower left character; the last and highest dot is the upper
    // right one of the upper right character, 15 blanks after the frame.
    #[test]
    fn dots_lie_at_the_corners() {
        let rows = rows(&[(3.0, -1.0), (5.0, 1.0)], &[]);
        assert_eq!(rows.len(), ROWS);
        assert_eq!(rows[ROWS - 1], "     -1.000 ┤⡀");
        assert_eq!(rows[0], format!("      1.000 ┤{}⠈", " ".repeat(15)));
        assert!(
            rows[1..ROWS - 1]
                .iter()
                .all(|row| row.trim_end() == "            │")
        );
    }

    // From corner to corner, 32 dot columns rise by 48 dot rows. All 12 rows of characters have some of the line, in its
    // colour, without gaps.
    #[test]
    fn a_steep_line_has_no_gaps() {
        let points = [(3.0, -1.0), (5.0, 1.0)];
        let mut dots = 0;
        for row in rows(&[], &points) {
            let bits = row
                .chars()
                .filter(|c| ('\u{2801}'..='\u{28ff}').contains(c));
            let in_row: u32 = bits.map(|c| (c as u32 - BRAILLE).count_ones()).sum();
            assert!(in_row >= 4, "{row}");
            assert!(row.contains("\x1b[36m"), "{row}");
            dots += in_row;
        }
        // The centres of the first and the last column are half a column from the corners: up to one row less at each.
        assert!((46..=48).contains(&dots), "{dots}");
    }

    // From -1 to 1 each eighth of the range has its character; a constant has the lowest.
    #[test]
    fn the_input_is_drawn_by_its_level() {
        let values: Vec<f64> = (0..8).map(|k| f64::from(k) / 3.5 - 1.0).collect();
        assert_eq!(levels(&values), LEVELS.iter().collect::<String>());
        assert_eq!(levels(&[1e300, 1e300]), "▁▁");
        assert_eq!(levels(&[]), "");
    }

    // Half way between two points the value is their mean; outside there is none.
    #[test]
    fn only_between_points() {
        let points = [(0.0, 1.0), (2.0, 5.0)];
        assert_eq!(interpolated(&points, 1.0), Some(3.0));
        assert_eq!(interpolated(&points, 2.5), None);
        assert_eq!(interpolated(&points, -0.5), None);
    }

    // Points without extent and NaN have no frame.
    #[test]
    fn nothing_is_drawn_of_nothing() {
        for points in [
            &[][..],
            &[(1.0, 2.0)],
            &[(1.0, 2.0), (2.0, 2.0)],
            &[(1.0, f64::NAN), (2.0, f64::NAN)],
        ] {
            assert!(Frame::around(points, &[], 10).is_none(), "{points:?}");
        }
    }

    // The axis spans 2 s, so its third digit is 0.01 s; it is as wide as the plot.
    #[test]
    fn the_axis_names_its_ends() {
        let times = FRAME.times();
        let lines: Vec<&str> = times.lines().collect();
        assert_eq!(lines[0], format!("            └{}", "─".repeat(16)));
        assert_eq!(lines[1], "             3.00 s    5.00 s");
    }
}
