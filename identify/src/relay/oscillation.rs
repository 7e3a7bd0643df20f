//! The oscillation in a recording: its cycles, the run that is steady, the window to fit.

use std::ops::Range;

use onecycle_onboard::cycle::{Cycle, CycleDetector, SteadyRun};
use onecycle_onboard::refine::{Refined, residuals};
use onecycle_onboard::window::Window;

use super::input::RelayInput;
use crate::outcome::FitPoint;
use crate::signals::Signals;
use crate::verdict::Verdict;

/// Bins and edges of the window: with eight cycles, some 30 to 60 bins a cycle.
pub(super) type FitWindow = Window<BINS, EDGES>;
/// Rows of the window: 512 bins, and five that the estimator keeps for itself.
pub(super) const BINS: usize = 517;
/// Edges of the input in the window; a relay makes two a cycle and a trim none of its own.
const EDGES: usize = 128;

/// A steady run has this part of all cycles of the recording at the least: some cycles are alike
/// by chance in any unsteady one.
const LEAST_SHARE: f64 = 0.25;
/// Periods of input before the window that tell its state at the beginning.
const PAST_PERIODS: f64 = 1.5;

/// The switch that a cycle begins and ends with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Beginning {
    /// From low to high.
    Rise,
    /// From high to low.
    Fall,
}

/// The input before the window, where the recording does not reach back far enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Past {
    /// The first that is recorded, for ever.
    Held,
    /// The same as over the window: of an oscillation that is known to be steady.
    Repeated,
}

/// The steady oscillation of a recording.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    /// What its cycles begin with.
    pub(super) beginning: Beginning,
    /// The cycles to fit, in order.
    pub(super) cycles: Vec<Cycle>,
    /// Cycles of the whole steady run.
    pub(super) steady: usize,
    /// Mean period of the cycles to fit (s).
    pub(super) period_s: f64,
}

/// The oscillations to try, `most` cycles at most: the end of the longest steady run, then that of
/// the last one; of each, half as many cycles and half again, as far as two. Where the recording has one
/// complete cycle and no more, this one.
pub(super) fn candidates(
    signals: &Signals<'_>,
    relay: &RelayInput,
    most: usize,
) -> Result<Vec<Stretch>, Verdict> {
    let (beginning, cycles) = all_cycles(signals, relay);
    let count = cycles.len();
    // Among gaps a single cycle only happens to have none: nobody knows what the others are like.
    if count == 0 || count == 1 && has_gap(signals, relay) {
        return Err(Verdict::TooShort { cycles: count });
    }
    if count == 1 {
        return Ok(vec![Stretch::of(beginning, &cycles, 1)]);
    }
    let runs = steady_runs(&cycles);
    let alike = runs.iter().map(Range::len).max().unwrap_or(0);
    // Two cycles that are alike have to do where there are no more.
    let least = if count == 2 {
        2
    } else {
        ((LEAST_SHARE * count as f64).ceil() as usize).max(3)
    };
    // Of equals the last: max_by_key returns it.
    let longest = runs
        .iter()
        .filter(|run| run.len() >= least)
        .max_by_key(|run| run.len());
    let Some(longest) = longest else {
        return Err(match count {
            0..4 => Verdict::TooShort { cycles: count },
            _ => Verdict::NotSteady {
                cycles: count,
                alike,
                needed: least,
            },
        });
    };
    let last = runs
        .iter()
        .rfind(|run| run.len() >= least)
        .filter(|&last| last != longest);
    let mut candidates = Vec::new();
    for run in std::iter::once(longest).chain(last) {
        let mut size = run.len().min(most);
        loop {
            let end = &cycles[run.end - size..run.end];
            candidates.push(Stretch::of(beginning, end, run.len()));
            if size <= 2 {
                break;
            }
            size = (size / 2).max(2);
        }
    }
    Ok(candidates)
}

fn has_gap(signals: &Signals<'_>, relay: &RelayInput) -> bool {
    let inside = relay.span.start + 1..relay.span.end;
    signals.breaks.iter().any(|at| inside.contains(at))
}

/// The recording's cycles from rise to rise. Where these are fewer than two, the last one may end where the
/// recording does, and if there are more from fall to fall, or as many and later, those.
fn all_cycles(signals: &Signals<'_>, relay: &RelayInput) -> (Beginning, Vec<Cycle>) {
    let (mut rises, last) = cycles_from(Beginning::Rise, signals, relay);
    if rises.len() >= 2 {
        return (Beginning::Rise, rises);
    }
    rises.extend(last);
    let (mut falls, last) = cycles_from(Beginning::Fall, signals, relay);
    falls.extend(last);
    for cycle in &mut falls {
        cycle.duty = 1.0 - cycle.duty;
    }
    let worth = |cycles: &[Cycle]| (cycles.len(), cycles.last().map(|cycle| cycle.start_s));
    if worth(&falls) > worth(&rises) {
        (Beginning::Fall, falls)
    } else {
        (Beginning::Rise, rises)
    }
}

/// Complete cycles of the relay, none across a break of the recording, and one more that the recording's
/// end leaves without the samples that would confirm its own.
fn cycles_from(
    beginning: Beginning,
    signals: &Signals<'_>,
    relay: &RelayInput,
) -> (Vec<Cycle>, Option<Cycle>) {
    let mut cycles = Vec::new();
    let mut detector = CycleDetector::new();
    let mut breaks = signals.breaks.iter().peekable();
    let levels = relay.levels(&signals.input[relay.span.clone()]);
    for (index, high) in relay.span.clone().zip(levels) {
        while breaks.next_if(|&&at| at <= index).is_some() {
            detector = CycleDetector::new();
        }
        let (time_s, output) = (signals.time_s[index], signals.output[index]);
        let is_first_half = high == (beginning == Beginning::Rise);
        cycles.extend(detector.push(time_s, is_first_half, output));
    }
    (cycles, detector.finish())
}

/// All runs of consecutive cycles that are alike.
fn steady_runs(cycles: &[Cycle]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut run = SteadyRun::default();
    for (index, cycle) in cycles.iter().enumerate() {
        let follows = (cycle.start_s - run.end_s).abs() <= 1e-9 * cycle.start_s.abs().max(1.0);
        if !follows {
            run = SteadyRun::default();
        }
        match runs.last_mut() {
            Some(last) if run.push(cycle) => last.end = index + 1,
            Some(_) => runs.push(index..index + 1),
            None => {
                run.push(cycle);
                runs.push(index..index + 1);
            }
        }
    }
    runs
}

/// Measured and fitted outputs over the bins of the window.
pub(super) fn fit_points(window: &FitWindow, period_s: f64, refined: &Refined) -> Vec<FitPoint> {
    let mut residual = [0.0; BINS];
    if residuals(window, period_s, &refined.process, &mut residual).is_err() {
        return Vec::new();
    }
    let filled = window
        .bins()
        .iter()
        .zip(&residual)
        .filter(|(bin, _)| bin.count > 0);
    filled
        .map(|(bin, residual)| {
            let count = f64::from(bin.count);
            let measured = window.first_output() + bin.output_sum / count;
            FitPoint {
                time_s: window.start_s() + bin.time_sum_s / count,
                measured,
                fitted: measured - residual,
            }
        })
        .collect()
}

impl Stretch {
    fn of(beginning: Beginning, cycles: &[Cycle], steady: usize) -> Self {
        let period_s = cycles.iter().map(|cycle| cycle.period_s).sum::<f64>() / cycles.len() as f64;
        Self {
            beginning,
            cycles: cycles.to_vec(),
            steady,
            period_s,
        }
    }

    /// Its last cycle alone.
    pub(super) fn last(&self) -> Self {
        let last = &self.cycles[self.cycles.len() - 1..];
        Self::of(self.beginning, last, self.steady)
    }

    /// The points of the recording from the first cycle's beginning to the last one's end.
    pub(super) fn points(&self, signals: &Signals<'_>) -> Range<usize> {
        let (first, last) = (self.cycles[0], self.cycles[self.cycles.len() - 1]);
        let index = |time_s: f64| signals.time_s.partition_point(|&t| t < time_s - 1e-9);
        index(first.start_s)..index(last.start_s + last.period_s)
    }

    /// Whether it is the only complete cycle of its recording.
    pub(super) fn is_alone(&self) -> bool {
        self.steady == 1
    }

    /// The cycles and the input before them in a window for the estimator.
    pub(super) fn window(
        &self,
        signals: &Signals<'_>,
        relay: &RelayInput,
        past: Past,
    ) -> FitWindow {
        let points = self.points(signals);
        let inputs = self.inputs(signals, &points, past);
        let outputs = self.output_window(signals, &points);
        exact_window(outputs.clone(), &inputs)
            .unwrap_or_else(|| two_level_window(outputs, &inputs, relay))
    }

    /// The outputs of the cycles, without any input yet.
    fn output_window(&self, signals: &Signals<'_>, points: &Range<usize>) -> FitWindow {
        let times_s = &signals.time_s[points.clone()];
        // The mean increment here, so that stamps do not drift off the even grid.
        let whole_s = times_s[times_s.len() - 1] - times_s[0];
        let instants = (whole_s / (signals.sample_period_s * f64::from(signals.samples_per_point)))
            .round()
            .max(1.0);
        let sample_s = whole_s / (instants * f64::from(signals.samples_per_point));
        let mut window = Window::of_groups(times_s[0], sample_s, signals.samples_per_point);
        for index in points.clone() {
            window.push_output(signals.time_s[index], signals.output[index]);
        }
        window
    }

    /// First point of the past: a period and a half before the window, or behind a break.
    fn past(&self, signals: &Signals<'_>, points: &Range<usize>) -> usize {
        let from_s = signals.time_s[points.start] - PAST_PERIODS * self.period_s;
        let index = signals.time_s.partition_point(|&t| t < from_s);
        let behind = signals.breaks.iter().rev().find(|&&at| at <= points.start);
        index.max(behind.copied().unwrap_or(0))
    }

    /// Times and values of the input, from the past to the end of the window.
    fn inputs(&self, signals: &Signals<'_>, points: &Range<usize>, past: Past) -> Vec<(f64, f64)> {
        let begin = self.past(signals, points);
        let at = |index: usize| (signals.time_s[index], signals.input[index]);
        let recorded = (begin..points.end).map(at);
        if past == Past::Held {
            return recorded.collect();
        }
        let cycles = self.cycles.len() as f64;
        let missing_s =
            signals.time_s[points.start] - PAST_PERIODS * self.period_s..signals.time_s[begin];
        let copies = 1..=(PAST_PERIODS / cycles).ceil() as u32;
        let repeated = copies.rev().flat_map(|copy| {
            let before_s = f64::from(copy) * cycles * self.period_s;
            let earlier = move |(time_s, input)| (time_s - before_s, input);
            points.clone().map(at).map(earlier)
        });
        let unrecorded = repeated.filter(|(time_s, _)| missing_s.contains(time_s));
        unrecorded.chain(recorded).collect()
    }
}

/// The window with every change of the input; `None` where it changes too often.
fn exact_window(mut window: FitWindow, inputs: &[(f64, f64)]) -> Option<FitWindow> {
    for &(time_s, input) in inputs {
        window.push_input(time_s, input).ok()?;
    }
    Some(window)
}

/// The window with the input's mean between the switches of the relay.
fn two_level_window(mut window: FitWindow, inputs: &[(f64, f64)], relay: &RelayInput) -> FitWindow {
    let values: Vec<f64> = inputs.iter().map(|&(_, input)| input).collect();
    let levels: Vec<bool> = relay.levels(&values).collect();
    let mut begin = 0;
    for stretch in levels.chunk_by(|a, b| a == b) {
        let stretch = begin..begin + stretch.len();
        let mean = values[stretch.clone()].iter().sum::<f64>() / stretch.len() as f64;
        // Two switches a cycle and at most eight cycles: there is room.
        let _ = window.push_input(inputs[begin].0, mean);
        begin = stretch.end;
    }
    window
}
