//! Which parts of a flight to identify a loop from.

use super::flight::{Flight, Span};
use super::loops::ControlLoop;
use super::plan::Signals;

/// Most parts of a flight.
const MOST: usize = 4;
/// Length of a part without deliberate excitation (s), the shortest that is used, and the step between starts.
const LENGTH_S: (f64, f64, f64) = (20.0, 5.0, 5.0);
/// Time over which changes of the set-point are counted (s): about the response of a rate loop.
const CHANGE_S: f64 = 0.05;
/// A part whose set-point changes by less than this share of the best one's, in mean squares, is not used.
const LEAST_SHARE: f64 = 0.05;
/// Largest share of samples with the input at one of its extremes: above it the actuator saturated.
const MOST_SATURATED: f64 = 0.02;

impl Flight {
    /// Parts of the flight to identify the loop of `signals` from, in order of time: the deliberate excitation of its axis,
    /// or those in the air whose set-point changes most. At most four; none if the vehicle was never armed and in the air.
    #[must_use]
    pub fn stretches(&self, signals: &Signals) -> Vec<Span> {
        let usable = self.usable(signals);
        let marked = self.marked(signals.control_loop, &usable);
        if !marked.is_empty() {
            return marked;
        }
        let (length_s, shortest_s, step_s) = LENGTH_S;
        let mut candidates: Vec<(f64, Span)> = Vec::new();
        for span in usable {
            let mut from_s = span.from_s;
            while from_s + shortest_s <= span.to_s {
                let to_s = (from_s + length_s).min(span.to_s);
                let part = Span { from_s, to_s };
                candidates.extend(signals.activity(part).map(|activity| (activity, part)));
                if to_s >= span.to_s {
                    break;
                }
                from_s += step_s;
            }
        }
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
        let least = candidates.first().map_or(0.0, |best| LEAST_SHARE * best.0);
        let mut chosen: Vec<Span> = Vec::new();
        for (activity, span) in candidates {
            let overlaps = |other: &Span| span.from_s < other.to_s && other.from_s < span.to_s;
            if activity >= least && chosen.len() < MOST && !chosen.iter().any(overlaps) {
                chosen.push(span);
            }
        }
        chosen.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        chosen
    }

    /// Largest standard deviation (unit of the output) of the set-point of a loop within a part worth using, or of the output
    /// where the set-point was not logged. `None`: there is no such part.
    #[must_use]
    pub fn movement(&self, signals: &Signals) -> Option<f64> {
        let moved = |span: &Span| {
            let part = signals.part(*span);
            let values = part.set_point.unwrap_or(part.output);
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count;
            let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
            (square / count).sqrt()
        };
        let spans = self.stretches(signals);
        spans.iter().map(moved).max_by(f64::total_cmp)
    }

    /// Armed and in the air, as far as the log tells.
    fn usable(&self, signals: &Signals) -> Vec<Span> {
        let whole = match (signals.time_s.first(), signals.time_s.last()) {
            (Some(&from_s), Some(&to_s)) => vec![Span { from_s, to_s }],
            _ => vec![],
        };
        [&self.armed, &self.airborne]
            .into_iter()
            .flatten()
            .fold(whole, |usable, spans| overlaps(&usable, spans))
            .into_iter()
            .map(Span::in_tenths)
            .collect()
    }

    /// Deliberate excitation of the axis of a rate or attitude loop.
    fn marked(&self, of: ControlLoop, usable: &[Span]) -> Vec<Span> {
        let Some(axis) = of.axis() else {
            return vec![];
        };
        let own = self.marks.iter().filter(|mark| mark.axis == Some(axis));
        let spans: Vec<Span> = own.map(|mark| mark.span.in_tenths()).collect();
        let mut marked = overlaps(usable, &spans);
        marked.retain(|span| span.to_s - span.from_s >= LENGTH_S.1);
        marked.truncate(MOST);
        marked
    }
}

/// Where both are.
fn overlaps(one: &[Span], other: &[Span]) -> Vec<Span> {
    let pairs = one.iter().flat_map(|a| other.iter().map(move |b| (a, b)));
    pairs
        .map(|(a, b)| Span {
            from_s: a.from_s.max(b.from_s),
            to_s: a.to_s.min(b.to_s),
        })
        .filter(|span| span.to_s > span.from_s)
        .collect()
}

impl Signals {
    /// Mean square change of the set-point within [`CHANGE_S`], or of the input where the set-point was not logged. `None` if
    /// there are no samples, or the actuator saturated.
    fn activity(&self, span: Span) -> Option<f64> {
        let rows = self.rows(span);
        let time_s = self.time_s.get(rows.clone())?;
        let count = time_s.len();
        let step_s = (time_s.last()? - time_s.first()?) / count.max(2) as f64;
        let ahead = ((CHANGE_S / step_s).round() as usize).max(1);
        let moved = self.set_point.as_ref().unwrap_or(&self.input);
        let moved = &moved[rows.clone()];
        if count <= 2 * ahead {
            return None;
        }
        let changes = moved[ahead..].iter().zip(moved);
        let square: f64 = changes
            .map(|(after, before)| (after - before).powi(2))
            .sum();
        let input = &self.input[rows];
        let extreme = |choose: fn(f64, f64) -> f64| self.input.iter().copied().reduce(choose);
        let (low, high) = (extreme(f64::min)?, extreme(f64::max)?);
        let saturated = input.iter().filter(|u| **u <= low || **u >= high).count();
        let is_usable = (saturated as f64) < MOST_SATURATED * count as f64;
        is_usable.then_some(square / (count - ahead) as f64)
    }

    fn rows(&self, span: Span) -> std::ops::Range<usize> {
        let before = |time_s: f64| self.time_s.partition_point(|t| *t < time_s);
        let first = before(span.from_s);
        first..before(span.to_s).max(first)
    }

    /// The signals within a part of the flight.
    #[must_use]
    pub fn part(&self, span: Span) -> Self {
        let rows = self.rows(span);
        let of = |column: &Option<Vec<f64>>| column.as_ref().map(|v| v[rows.clone()].to_vec());
        Self {
            time_s: self.time_s[rows.clone()].to_vec(),
            input: self.input[rows.clone()].to_vec(),
            output: self.output[rows.clone()].to_vec(),
            set_point: of(&self.set_point),
            throttle: of(&self.throttle),
            names: self.names.clone(),
            ..*self
        }
    }
}
