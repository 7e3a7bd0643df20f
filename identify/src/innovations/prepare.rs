//! From the columns of a recording to a record: the part to use, its grid, lost and stale samples.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use onecycle_design::LowPass;

use super::LONGEST_TAU;
use super::orthogonal::Orthogonal;
use super::record::{Forces, Hold, Record, Rest};
use super::stale::mark_stale;
use super::unfilter::{alike_smooth, unfilter};
use crate::settings::Options;
use crate::signals::{Signals, is_constant, rounding_deviation};
use crate::verdict::Verdict;

/// Fewest samples to fit. With fewer, none of 72 simulated tests was answered; from here on nearly all, rightly
/// (`a_short_step_test_is_answered`).
pub(super) const FEWEST: usize = 30;
/// Increments that differ by less than this share of the sample period are even.
const EVEN: f64 = 1e-4;
/// Mean and largest difference of increments of time from whole steps, in steps, for samples on a grid with some absent.
const OFF_GRID: (f64, f64) = (0.05, 0.45);
/// Most steps of a grid for each sample.
const SPARSE: usize = 6;
/// Uneven time stamps are rounded to this part of the sample period, so that few lengths of step occur. The rounding has a standard
/// deviation of `STAMP / 12^0.5`; behind a lag of five samples it moves the output by less than [`FLOOR`].
const STAMP: f64 = 1.0 / 64.0;

/// Share of the movement of an output to which a sample is believed. No sensor is truer, and no process follows a model to less:
/// without it a simulation without noise has resonances and forces of a ten-thousandth.
pub(super) const FLOOR: f64 = 1e-3;
/// Harmonics of the sawtooth that a rounding error is.
const HARMONICS: u32 = 1000;
/// Parts of a record in which its movement is measured, so that a slow drift does not count as movement.
const PARTS: usize = 8;

/// Record with what was left out of the recording.
pub(super) struct Prepared {
    pub(super) record: Record,
    /// Time of the first sample (s).
    pub(super) start_s: f64,
    /// Share of the samples asked for that the longest part without a gap holds.
    pub(super) part_used: f64,
    /// Delay from the stamp of a point to the mean time of its samples (s): the dead time appears shorter by it.
    pub(super) early_s: f64,
    /// Low-pass that was taken out of the output. `None`: none was.
    pub(super) filter: Option<LowPass>,
    /// Standard deviation of the rounding of an output that repeats more often than it changes (output unit); zero for others.
    pub(super) rounding: f64,
    /// Longest dead time to look for (s).
    pub(super) longest_tau_s: f64,
}

/// Record of the longest part of the recording without a gap, within the span of `options`. `believed`: share of the movement of the
/// output to which a sample is believed, at least [`FLOOR`].
///
/// # Errors
/// [`Verdict::TooFewRows`], [`Verdict::ConstantInput`], [`Verdict::ConstantOutput`] or [`Verdict::Units`].
pub(super) fn prepare(
    signals: &Signals<'_>,
    options: &Options,
    believed: f64,
) -> Result<Prepared, Verdict> {
    let (from_s, to_s) = options.span_s;
    let first = from_s.map_or(0, |at| signals.time_s.partition_point(|t| *t < at));
    let end = to_s.map_or(signals.time_s.len(), |at| {
        signals.time_s.partition_point(|t| *t <= at)
    });
    let asked = first..end.max(first);
    let range = longest_part(&asked, &unknown_gaps(signals));
    if range.len() < FEWEST {
        return Err(Verdict::TooFewRows {
            rows: range.len(),
            needed: FEWEST,
        });
    }
    let (input, output) = (
        &signals.input[range.clone()],
        &signals.output[range.clone()],
    );
    let rest = before(input, output, options.input_before)?;
    check(input, output)?;
    let part_used = range.len() as f64 / asked.len() as f64;
    let times_s = &signals.time_s[range];
    let unfiltered = (options.output_filter_hz)
        .and_then(|hz| unfilter(times_s, output, hz, signals.sample_period_s));
    let mut record = match &unfiltered {
        Some(found) => gridded(times_s, &alike_smooth(input), &found.output, &found.usable),
        None => gridded(times_s, input, output, &vec![true; output.len()]),
    };
    mark_stale(&mut record);
    record.hold = options.hold.unwrap_or(Hold::Held);
    record.rest = rest;
    let (rounding, sharing) = rounding(&record);
    record.floor = (believed * movement(&record)).max(rounding * sharing.sqrt());
    let longest_tau_s = LONGEST_TAU * record.time_s(record.len() - 1);
    let points = f64::from(signals.samples_per_point.saturating_sub(1));
    Ok(Prepared {
        record,
        start_s: times_s[0],
        part_used,
        early_s: 0.5 * points * signals.sample_period_s
            + unfiltered.as_ref().map_or(0.0, |found| found.late_s),
        filter: unfiltered
            .and(options.output_filter_hz)
            .map(LowPass::second_order),
        rounding: if sharing > 1.0 { rounding } else { 0.0 },
        longest_tau_s,
    })
}

/// Standard deviation of the output about a straight line in each of [`PARTS`] parts of a record (output unit).
fn movement(record: &Record) -> f64 {
    let outputs: Vec<f64> = record.present_outputs().collect();
    let count = outputs.len().div_ceil(PARTS).max(1);
    let squares = |part: &[f64]| {
        let ramp = (0..part.len()).map(|k| k as f64).collect();
        Orthogonal::independent(&[vec![1.0; part.len()], ramp]).left(part)
    };
    let sum: f64 = outputs.chunks(count).map(squares).sum();
    (sum / outputs.len().max(1) as f64).sqrt()
}

/// Standard deviation of the rounding error of a sample (output unit), and how many other samples share it on average: beside
/// them a sample is believed to the deviation times the root of their number. The error of an output that never repeats
/// is white, and the fit sees it; so is the part of it that noise makes ([`shared`]).
fn rounding(record: &Record) -> (f64, f64) {
    let outputs: Vec<f64> = record.present_outputs().collect();
    let runs: Vec<&[f64]> = outputs.chunk_by(|a, b| a == b).collect();
    let count = outputs.len() as f64;
    let sharing = count / runs.len() as f64 - 1.0;
    let back = runs
        .windows(3)
        .filter(|runs| runs[1].len() == 1 && runs[0][0] == runs[2][0]);
    let noise = back.count() as f64 / count * PI.sqrt();
    (rounding_deviation(&outputs), sharing * shared(noise))
}

/// Share of the variance of a rounding error that samples near one true output have in common under white noise of
/// standard deviation `noise`, in steps of the rounding.
///
/// The error is a sawtooth of the output, of which harmonic k has a share of the variance like 1/k^2. Its mean under normal noise is
/// smaller by exp(-(2 pi k noise)^2 / 2), and the variance of the mean by the square of that.
fn shared(noise: f64) -> f64 {
    let harmonics = |noise: f64| -> f64 {
        let harmonic = |k: f64| (-(TAU * k * noise).powi(2)).exp() / (k * k);
        (1..=HARMONICS).map(|k| harmonic(f64::from(k))).sum()
    };
    harmonics(noise) / harmonics(0.0)
}

/// The gaps in which the input is not known: it differs at both ends, or it may have changed twice in between. Of changes at any time that
/// has a chance of `(gap / mean time between changes)^2 / 2`, which has to be below 5 %. All of them if the others are longer than what
/// was recorded: that would be a grid of holes.
fn unknown_gaps(signals: &Signals<'_>) -> Vec<usize> {
    const SHORT: f64 = 0.3;
    let (input, time_s) = (signals.input, signals.time_s);
    let [Some(first_s), Some(last_s)] = [time_s.first(), time_s.last()] else {
        return vec![];
    };
    let levels = input.chunk_by(|a, b| a == b).count();
    let short_s = SHORT * (last_s - first_s) / levels as f64;
    let length_s = |at: &usize| time_s[*at] - time_s[*at - 1];
    let is_known = |at: &usize| input[*at] == input[*at - 1] && length_s(at) < short_s;
    let (known, unknown): (Vec<usize>, Vec<usize>) =
        signals.breaks.iter().copied().partition(is_known);
    let total_s = |gaps: &[usize]| gaps.iter().map(length_s).sum::<f64>();
    let recorded_s = last_s - first_s - total_s(signals.breaks);
    if total_s(&known) > recorded_s {
        return signals.breaks.to_vec();
    }
    unknown
}

/// The longest run of indices of `asked` between gaps.
fn longest_part(asked: &Range<usize>, breaks: &[usize]) -> Range<usize> {
    let inside = breaks.iter().copied().filter(|at| asked.contains(at));
    let mut start = asked.start;
    let mut longest = start..start;
    for end in inside.chain([asked.end]) {
        if end - start > longest.len() {
            longest = start..end;
        }
        start = end;
    }
    longest
}

/// Rest before the record: under the input that the user has `stated`; for an input that never changes under zero, as before a step in the
/// first row. `None`: not known.
fn before(input: &[f64], output: &[f64], stated: Option<f64>) -> Result<Option<Rest>, Verdict> {
    let rest = stated.or(is_constant(input).then_some(0.0));
    if is_constant(input) && (rest == Some(input[0]) || is_constant(output)) {
        return Err(Verdict::ConstantInput);
    }
    Ok(rest.map(|input| Rest {
        input,
        may_drift: false,
    }))
}

fn check(input: &[f64], output: &[f64]) -> Result<(), Verdict> {
    if is_constant(output) {
        return Err(Verdict::ConstantOutput);
    }
    let size = |values: &[f64]| values.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    let usable = |values: &[f64]| (1e-100..=1e100).contains(&size(values));
    if usable(input) && usable(output) {
        Ok(())
    } else {
        Err(Verdict::Units)
    }
}

/// Samples on an even grid, with absent samples if time stamps are missing from it; or with their uneven time stamps.
fn gridded(times_s: &[f64], input: &[f64], output: &[f64], usable: &[bool]) -> Record {
    let mut steps: Vec<f64> = times_s.windows(2).map(|t| t[1] - t[0]).collect();
    let mean = (times_s[times_s.len() - 1] - times_s[0]) / steps.len() as f64;
    let is_even = steps
        .iter()
        .all(|step| (step - mean).abs() < EVEN * mean + 2e-9);
    steps.sort_by(f64::total_cmp);
    let mut record = Record {
        uneven_s: vec![],
        dt_s: mean,
        input: input.to_vec(),
        output: output.to_vec(),
        present: usable.to_vec(),
        hold: Hold::Held,
        rest: None,
        forces: Forces::default(),
        floor: 0.0,
    };
    if is_even {
        return record;
    }
    let median = steps[steps.len() / 2];
    let on_grid = (1..=4).find_map(|part| {
        let (indices, step_s) = indices(times_s, median / f64::from(part))?;
        let between = if part == 1 {
            Between::Lost
        } else {
            Between::Never
        };
        Some(spread(&indices, step_s, (input, output, usable), between))
    });
    if let Some(record) = on_grid {
        return record;
    }
    record.dt_s = median;
    record.uneven_s = times_s.iter().map(|t| t - times_s[0]).collect();
    record.rounded(STAMP)
}

/// Index of each time stamp on a grid of steps near `step_s`, and the step (s). `None` if the stamps do not fit one.
fn indices(times_s: &[f64], step_s: f64) -> Option<(Vec<usize>, f64)> {
    // Increment by increment, so that an error of the step does not add up; then the step that fits all stamps best.
    let mut indices = vec![0_usize];
    for pair in times_s.windows(2) {
        let steps = ((pair[1] - pair[0]) / step_s).round() as usize;
        indices.push(indices[indices.len() - 1] + steps);
    }
    let stamps = || {
        indices
            .iter()
            .zip(times_s)
            .map(|(k, t)| (*k as f64, t - times_s[0]))
    };
    let (products, squares) = stamps().fold((0.0, 0.0), |(p, s), (k, t)| (p + k * t, s + k * k));
    let step_s = products / squares;
    // From stamp to stamp: a clock that wanders, or a tick that slips by a part of a step, moves input and output alike.
    let off = || {
        let steps = indices.windows(2).map(|pair| (pair[1] - pair[0]) as f64);
        (times_s.windows(2).zip(steps))
            .map(|(pair, steps)| ((pair[1] - pair[0]) / step_s - steps).abs())
    };
    let mean = off().sum::<f64>() / indices.len() as f64;
    let most = off().fold(0.0, f64::max);
    let rises = indices.windows(2).all(|pair| pair[1] > pair[0]);
    let is_dense = indices
        .last()
        .is_some_and(|last| *last < SPARSE * indices.len());
    (rises && is_dense && mean < OFF_GRID.0 && most < OFF_GRID.1).then_some((indices, step_s))
}

/// What a point of the grid without a sample means.
#[derive(Clone, Copy, PartialEq)]
enum Between {
    /// The sample was lost. Its input is most likely on the line between its neighbours: a switch of the input in between
    /// is then neither early nor late on average.
    Lost,
    /// There was none: the increments are multiples of a shorter step, and the input keeps its value.
    Never,
}

/// Samples at their indices on a grid; the others are absent.
fn spread(
    indices: &[usize],
    step_s: f64,
    (input, output, usable): (&[f64], &[f64], &[bool]),
    between: Between,
) -> Record {
    let count = indices[indices.len() - 1] + 1;
    let mut record = Record {
        uneven_s: vec![],
        dt_s: step_s,
        input: Vec::with_capacity(count),
        output: Vec::with_capacity(count),
        present: Vec::with_capacity(count),
        hold: Hold::Held,
        rest: None,
        forces: Forces::default(),
        floor: 0.0,
    };
    let mut sample = 0;
    for index in 0..count {
        let is_next = indices.get(sample + 1).is_some_and(|next| *next <= index);
        sample += usize::from(is_next);
        let value = match (between, indices.get(sample + 1)) {
            (Between::Lost, Some(next)) => {
                let passed = (index - indices[sample]) as f64 / (next - indices[sample]) as f64;
                input[sample] + passed * (input[sample + 1] - input[sample])
            }
            _ => input[sample],
        };
        record.input.push(value);
        record.output.push(output[sample]);
        record
            .present
            .push(indices[sample] == index && usable[sample]);
    }
    record
}

#[cfg(test)]
mod tests {
    use onecycle_plant::{Noise, NoiseSource};
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::*;

    fn ramp(count: usize) -> Vec<f64> {
        (0..count).map(|k| (k as f64 * 0.37).sin()).collect()
    }

    fn prepared(times_s: &[f64], output: &[f64], breaks: &[usize]) -> Prepared {
        let signals = Signals {
            time_s: times_s,
            input: &ramp(times_s.len()),
            output,
            samples_per_point: 1,
            sample_period_s: 0.01,
            breaks,
        };
        prepare(&signals, &Options::default(), FLOOR).unwrap()
    }

    // Stamps 10 ms apart with jitter of 0.2 ms, and every seventh sample missing: 350 steps, 300 present.
    #[test]
    fn missing_samples_leave_holes_in_the_grid() {
        let kept = (0..350).filter(|k| k % 7 != 3);
        let times_s: Vec<f64> = kept
            .map(|k| 0.01 * f64::from(k) + 2e-4 * f64::from(k).sin())
            .collect();
        let found = prepared(&times_s, &ramp(times_s.len()), &[]).record;
        assert!(found.uneven_s.is_empty() && (found.dt_s - 0.01).abs() < 1e-6);
        assert_eq!(found.len(), 350);
        assert_eq!(found.present.iter().filter(|p| **p).count(), 300);
        let middle = 0.5 * (found.input[2] + found.input[4]);
        assert!(!found.present[3] && (found.input[3] - middle).abs() < 1e-12);
    }

    // Increments of 10 and 15 ms in turn: a grid of 5 ms.
    #[test]
    fn the_input_is_held_between_samples_of_uneven_increments() {
        let mut times_s = vec![0.0];
        for k in 0..200 {
            times_s.push(times_s[k] + [0.01, 0.015][k % 2]);
        }
        let found = prepared(&times_s, &ramp(times_s.len()), &[]).record;
        assert!((found.dt_s - 0.005).abs() < 1e-9);
        assert!(!found.present[1] && found.input[1] == found.input[0]);
    }

    // Steps of 1, with three samples on each: sqrt(2/12); with one: none.
    #[test]
    fn samples_that_share_a_level_share_its_rounding_error() {
        let times_s: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
        let staircase: Vec<f64> = (0..300).map(|k| f64::from(k / 3)).collect();
        let floor = |output: &[f64]| {
            let record = gridded(&times_s, &ramp(300), output, &[true; 300]);
            let (deviation, sharing) = rounding(&record);
            (deviation, deviation * sharing.sqrt())
        };
        assert!((floor(&staircase).1 - (2_f64 / 12.0).sqrt()).abs() < 1e-12);
        let rising: Vec<f64> = (0..300).map(f64::from).collect();
        assert_eq!(floor(&rising), (1.0 / 12_f64.sqrt(), 0.0));
    }

    // The true output x is read as the number of edges between levels that x plus noise is above, so the mean of the readings is the sum
    // of the probabilities. Its error, squared, is averaged over x.
    #[test]
    fn noise_leaves_the_mean_of_a_rounding_error_to_the_samples_in_common() {
        for noise in [0.05, 0.1, 0.2, 0.4] {
            let normal = Normal::new(0.0, noise).unwrap();
            let error = |x: f64| {
                (-4..4)
                    .map(|k| normal.cdf(x - f64::from(k) - 0.5))
                    .sum::<f64>()
                    - 4.0
                    - x
            };
            let squares = (0..1000).map(|k| error(f64::from(k) / 1000.0).powi(2));
            let square = squares.sum::<f64>() / 1000.0;
            assert!((12.0 * square - shared(noise)).abs() < 2e-3, "{noise}");
        }
    }

    // A ramp of 20 samples a level, with noise of an eighth of a step.
    #[test]
    fn levels_that_flicker_share_less() {
        let times_s: Vec<f64> = (0..20_000).map(|k| 0.01 * f64::from(k)).collect();
        let mut noise = Noise::from_seed(7);
        let read = |k: i32| (f64::from(k) / 20.0 + 0.125 * noise.standard_normal()).round();
        let output: Vec<f64> = (0..20_000).map(read).collect();
        let record = gridded(&times_s, &ramp(20_000), &output, &[true; 20_000]);
        let (deviation, sharing) = rounding(&record);
        assert_eq!(deviation, 1.0 / 12_f64.sqrt());
        let changes = output.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let each = 20_000.0 / (changes as f64 + 1.0) - 1.0;
        assert!((sharing / each / shared(0.125) - 1.0).abs() < 0.2);
    }

    // Two changes in 3.2 s, and a gap of 0.2 s that begins and ends under one input: its samples are absent. In one of 1 s the input may have
    // changed twice.
    #[test]
    fn a_gap_under_one_input_is_a_hole_in_the_grid() {
        let of_gap = |gap_s: f64| {
            let mut times_s: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
            times_s[100..].iter_mut().for_each(|t| *t += gap_s);
            let signals = Signals {
                time_s: &times_s,
                input: &(0..300)
                    .map(|k| f64::from(k % 180 / 150))
                    .collect::<Vec<f64>>(),
                output: &ramp(300),
                samples_per_point: 1,
                sample_period_s: 0.01,
                breaks: &[100],
            };
            prepare(&signals, &Options::default(), FLOOR).unwrap()
        };
        let found = of_gap(0.2);
        assert_eq!(found.record.len(), 320);
        assert_eq!(found.record.present_outputs().count(), 300);
        assert_eq!(found.record.input[100..120], [0.0; 20]);
        assert_eq!(found.part_used, 1.0);
        assert_eq!(of_gap(1.0).record.len(), 200);
    }

    // Bursts of 50 samples at 1 kHz every hour under one input: 14 million steps of the grid.
    #[test]
    fn bursts_are_no_grid_of_holes() {
        let times_s: Vec<f64> = (0..200)
            .map(|k| 0.001 * f64::from(k) + 3600.0 * f64::from(k / 50))
            .collect();
        let signals = Signals {
            time_s: &times_s,
            input: &[1.0; 200],
            output: &ramp(200),
            samples_per_point: 1,
            sample_period_s: 0.001,
            breaks: &[50, 100, 150],
        };
        let record = prepare(&signals, &Options::default(), FLOOR)
            .unwrap()
            .record;
        assert_eq!(record.len(), 50);
    }

    #[test]
    fn the_longest_part_without_a_gap_is_used() {
        let mut times_s: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
        times_s[100..].iter_mut().for_each(|t| *t += 1.0);
        let found = prepared(&times_s, &ramp(300), &[100]);
        assert_eq!(found.record.len(), 200);
        assert_eq!(found.start_s, 2.0);
        assert!((found.part_used - 2.0 / 3.0).abs() < 1e-12);
    }
}
