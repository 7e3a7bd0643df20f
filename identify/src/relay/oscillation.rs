//! Steady oscillation in a recording: cycles of the relay, steady runs of cycles, stretches to fit and their windows.
//!
//! A *cycle* runs from one switch of the relay to the next switch in the same direction. A *steady run* is a sequence
//! of cycles that are alike in period and amplitude (`onecycle_onboard::cycle`). A *stretch* is the end of a steady
//! run: the cycles that one attempt fits.

use std::iter;
use std::ops::Range;

use onecycle_onboard::cycle::{Cycle, CycleDetector, SteadyRun};
use onecycle_onboard::refine::{Refined, residuals};
use onecycle_onboard::window::Window;

use super::input::RelayInput;
use crate::excitation::Oscillation;
use crate::outcome::FitPoint;
use crate::signals::Signals;
use crate::verdict::Verdict;

/// Window that is fitted. With eight cycles it has 30 to 60 bins per cycle.
pub(super) type FitWindow = Window<BINS, EDGES>;
/// Rows of the window: 512 bins, and 5 rows that the window reserves for the estimator.
const BINS: usize = 517;
/// Room for edges of the input: two for each of [`MOST_CYCLES`](crate::MOST_CYCLES) = 50 cycles and for the input
/// before them, with a margin. A trim of the relay changes the levels at the switches, so it adds no edge.
const EDGES: usize = 128;

/// Least length of a steady run as a share of all cycles in the recording. In an unsteady oscillation some consecutive
/// cycles are alike by chance.
const LEAST_SHARE: f64 = 0.25;
/// Length of the input before the window, in periods. It determines the state of the process at the start of the
/// window.
const PAST_PERIODS: f64 = 1.5;

/// Switch of the relay at which a cycle begins and ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Beginning {
    /// From low to high.
    Rise,
    /// From high to low.
    Fall,
}

/// Assumption on the input before the recording begins, if the recording starts less than [`PAST_PERIODS`] before the
/// window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Past {
    /// The input has always had its first recorded value.
    Held,
    /// The input is periodic: the cycles of the window preceded the recording.
    Repeated,
}

/// Consecutive cycles of a steady oscillation that one attempt fits.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    /// Switch at which the cycles begin.
    pub(super) beginning: Beginning,
    /// Cycles to fit, in order of time.
    pub(super) cycles: Vec<Cycle>,
    /// Number of cycles in the steady run to which they belong.
    steady: usize,
    /// Mean period of the cycles to fit (s).
    pub(super) period_s: f64,
}

/// Stretches of the recording to try, in this order: ends of the longest steady run, then ends of the last steady run.
/// The first stretch of a run has `most` cycles or, if these are fewer, all cycles of the run; each further stretch has
/// half as many, down to two. If the recording has a single complete cycle, the only stretch is that cycle.
///
/// # Errors
/// [`Verdict::TooShort`] or [`Verdict::NotSteady`].
pub(super) fn stretches(
    signals: &Signals<'_>,
    relay: &RelayInput,
    most: usize,
) -> Result<Vec<Stretch>, Verdict> {
    let (beginning, cycles) = all_cycles(signals, relay);
    let count = cycles.len();
    // With gaps in the data, a single cycle does not prove steadiness: the cycles with gaps may differ from it.
    if count == 0 || count == 1 && has_gap(signals, relay) {
        return Err(Verdict::TooShort { cycles: count });
    }
    if count == 1 {
        return Ok(vec![Stretch::of(beginning, &cycles, 1)]);
    }
    let mut stretches = Vec::new();
    for run in longest_and_last_run(&cycles)? {
        let halved = |size: &usize| (*size > 2).then(|| (size / 2).max(2));
        let sizes = iter::successors(Some(run.len().min(most)), halved);
        stretches.extend(
            sizes.map(|size| Stretch::of(beginning, &cycles[run.end - size..run.end], run.len())),
        );
    }
    Ok(stretches)
}

/// The longest steady run and, if that is another one, the last steady run. Runs that are too short do not count.
fn longest_and_last_run(cycles: &[Cycle]) -> Result<Vec<Range<usize>>, Verdict> {
    let count = cycles.len();
    // A recording with two cycles only must do with two that are alike.
    let needed = match count {
        2 => 2,
        _ => ((LEAST_SHARE * count as f64).ceil() as usize).max(3),
    };
    let mut runs = steady_runs(cycles);
    let alike = runs.iter().map(Range::len).max().unwrap_or(0);
    runs.retain(|run| run.len() >= needed);
    // Among runs of equal length max_by_key returns the last.
    let Some(longest) = runs.iter().max_by_key(|run| run.len()).cloned() else {
        return Err(match count {
            0..4 => Verdict::TooShort { cycles: count },
            _ => Verdict::NotSteady {
                cycles: count,
                alike,
                needed,
            },
        });
    };
    let last = runs.pop().filter(|last| *last != longest);
    Ok(iter::once(longest).chain(last).collect())
}

/// Whether the relay's part of the recording has a gap.
fn has_gap(signals: &Signals<'_>, relay: &RelayInput) -> bool {
    let inside = relay.span.start + 1..relay.span.end;
    signals.breaks.iter().any(|at| inside.contains(at))
}

/// Cycles of the recording from rise to rise.
///
/// If these are fewer than two, a cycle may also end at the end of the recording, and cycles from fall to fall are used
/// instead if there are more of them, or equally many that start later.
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

/// Complete cycles of the relay that contain no gap; and the cycle whose last switch is so near to the end of the
/// recording that too few samples follow to confirm the new level.
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

/// Runs of consecutive cycles that are alike, as ranges of indices.
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

/// Measured and fitted output in the bins of the window. Empty if the process cannot be fitted to the window.
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

    /// The last cycle alone.
    pub(super) fn last(&self) -> Self {
        let last = &self.cycles[self.cycles.len() - 1..];
        Self::of(self.beginning, last, self.steady)
    }

    /// Points of the recording from the beginning of the first cycle to the end of the last cycle.
    pub(super) fn points(&self, signals: &Signals<'_>) -> Range<usize> {
        let (first, last) = (self.cycles[0], self.cycles[self.cycles.len() - 1]);
        let index = |time_s: f64| signals.time_s.partition_point(|&t| t < time_s - 1e-9);
        index(first.start_s)..index(last.start_s + last.period_s)
    }

    /// Whether it is the only complete cycle of the recording.
    pub(super) fn is_alone(&self) -> bool {
        self.steady == 1
    }

    /// Measured properties of the oscillation over the stretch, whose window is `window`.
    pub(super) fn describe(
        &self,
        signals: &Signals<'_>,
        relay: &RelayInput,
        window: &FitWindow,
    ) -> Oscillation {
        let (first, last) = (self.cycles[0], self.cycles[self.cycles.len() - 1]);
        let mean = |of: fn(&Cycle) -> f64| {
            self.cycles.iter().map(of).sum::<f64>() / self.cycles.len() as f64
        };
        let (low, high) = relay.means(&signals.input[self.points(signals)]);
        Oscillation {
            period_s: self.period_s,
            amplitude: mean(|cycle| cycle.amplitude),
            cycles_used: self.cycles.len(),
            cycles_steady: self.steady,
            start_s: first.start_s,
            end_s: last.start_s + last.period_s,
            duty: mean(|cycle| cycle.duty),
            relay_amplitude: 0.5 * (high - low),
            relay_centre: 0.5 * (high + low),
            noise_sigma: window.noise_sigma(),
            sample_s: window.sample_s(),
        }
    }

    /// Window for the estimator: the outputs of the cycles, and the input over the cycles and before them.
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

    /// Window with the outputs of the cycles and no input.
    fn output_window(&self, signals: &Signals<'_>, points: &Range<usize>) -> FitWindow {
        let times_s = &signals.time_s[points.clone()];
        // The sample period is the mean over the stretch, so that time stamps do not drift off the even grid.
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

    /// First point of the input before the window: [`PAST_PERIODS`] before the window, but not before a gap.
    fn past(&self, signals: &Signals<'_>, points: &Range<usize>) -> usize {
        let from_s = signals.time_s[points.start] - PAST_PERIODS * self.period_s;
        let index = signals.time_s.partition_point(|&t| t < from_s);
        let behind = signals.breaks.iter().rev().find(|&&at| at <= points.start);
        index.max(behind.copied().unwrap_or(0))
    }

    /// Times (s) and values of the input, from [`PAST_PERIODS`] before the window to the end of the window.
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

/// Window with every change of the input. `None` if the input has more than [`EDGES`] changes.
fn exact_window(mut window: FitWindow, inputs: &[(f64, f64)]) -> Option<FitWindow> {
    for &(time_s, input) in inputs {
        window.push_input(time_s, input).ok()?;
    }
    Some(window)
}

/// Window with the mean input between switches of the relay.
fn two_level_window(mut window: FitWindow, inputs: &[(f64, f64)], relay: &RelayInput) -> FitWindow {
    let values: Vec<f64> = inputs.iter().map(|&(_, input)| input).collect();
    let levels: Vec<bool> = relay.levels(&values).collect();
    let mut begin = 0;
    for stretch in levels.chunk_by(|a, b| a == b) {
        let stretch = begin..begin + stretch.len();
        let mean = values[stretch.clone()].iter().sum::<f64>() / stretch.len() as f64;
        // Two switches in each of at most 50 cycles, and 1.5 periods before them: below the room of 128 edges.
        let _ = window.push_input(inputs[begin].0, mean);
        begin = stretch.end;
    }
    window
}
