//! The oscillation in a recording: its cycles, the run that is steady, the window to fit.

use std::ops::Range;

use onecycle_onboard::cycle::{Cycle, CycleDetector, SteadyRun};
use onecycle_onboard::refine::{Refined, residuals};
use onecycle_onboard::window::Window;

use super::relay_input::RelayInput;
use super::{FitPoint, Signals, Verdict};

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

/// The steady oscillation of a recording.
#[derive(Clone, Debug)]
pub(super) struct Oscillation {
    /// The cycles to fit, in order.
    pub(super) cycles: Vec<Cycle>,
    /// Cycles of the whole steady run.
    pub(super) steady: usize,
    /// Mean period of the cycles to fit (s).
    pub(super) period_s: f64,
}

/// The oscillations to try, `most` cycles at most: the end of the longest steady run, then that of
/// the last one; of each, half as many cycles and half again, as far as two.
pub(super) fn candidates(
    signals: &Signals<'_>,
    relay: &RelayInput,
    most: usize,
) -> Result<Vec<Oscillation>, Verdict> {
    let cycles = all_cycles(signals, relay);
    let count = cycles.len();
    if count < 2 {
        return Err(Verdict::TooShort { cycles: count });
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
            candidates.push(Oscillation::of(&cycles[run.end - size..run.end], run.len()));
            if size <= 2 {
                break;
            }
            size = (size / 2).max(2);
        }
    }
    Ok(candidates)
}

/// Complete cycles of the relay, none across a break of the recording.
fn all_cycles(signals: &Signals<'_>, relay: &RelayInput) -> Vec<Cycle> {
    let mut cycles = Vec::new();
    let mut detector = CycleDetector::new();
    let mut breaks = signals.breaks.iter().peekable();
    let levels = relay.levels(&signals.input[relay.span.clone()]);
    for (index, high) in relay.span.clone().zip(levels) {
        while breaks.next_if(|&&at| at <= index).is_some() {
            detector = CycleDetector::new();
        }
        let (time_s, output) = (signals.time_s[index], signals.output[index]);
        cycles.extend(detector.push(time_s, high, output));
    }
    cycles
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

impl Oscillation {
    fn of(cycles: &[Cycle], steady: usize) -> Self {
        let period_s = cycles.iter().map(|cycle| cycle.period_s).sum::<f64>() / cycles.len() as f64;
        Self {
            cycles: cycles.to_vec(),
            steady,
            period_s,
        }
    }

    /// Its last cycle alone.
    pub(super) fn last(&self) -> Self {
        Self::of(&self.cycles[self.cycles.len() - 1..], self.steady)
    }

    /// The points of the recording from the first cycle's beginning to the last one's end.
    pub(super) fn points(&self, signals: &Signals<'_>) -> Range<usize> {
        let (first, last) = (self.cycles[0], self.cycles[self.cycles.len() - 1]);
        let index = |time_s: f64| signals.time_s.partition_point(|&t| t < time_s - 1e-9);
        index(first.start_s)..index(last.start_s + last.period_s)
    }

    /// The cycles and the input before them in a window for the estimator.
    pub(super) fn window(&self, signals: &Signals<'_>, relay: &RelayInput) -> FitWindow {
        let points = self.points(signals);
        self.exact_window(signals, &points)
            .unwrap_or_else(|| self.two_level_window(signals, &points, relay))
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

    /// The window with every change of the input; `None` where it changes too often.
    fn exact_window(&self, signals: &Signals<'_>, points: &Range<usize>) -> Option<FitWindow> {
        let mut window = self.output_window(signals, points);
        for index in self.past(signals, points)..points.end {
            window
                .push_input(signals.time_s[index], signals.input[index])
                .ok()?;
        }
        Some(window)
    }

    /// The window with the input's mean between the switches of the relay.
    fn two_level_window(
        &self,
        signals: &Signals<'_>,
        points: &Range<usize>,
        relay: &RelayInput,
    ) -> FitWindow {
        let mut window = self.output_window(signals, points);
        let past = self.past(signals, points);
        let input = &signals.input[past..points.end];
        let levels: Vec<bool> = relay.levels(input).collect();
        let mut begin = 0;
        for stretch in levels.chunk_by(|a, b| a == b) {
            let values = &input[begin..begin + stretch.len()];
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            // Two switches a cycle and at most eight cycles: there is room.
            let _ = window.push_input(signals.time_s[past + begin], mean);
            begin += stretch.len();
        }
        window
    }
}
