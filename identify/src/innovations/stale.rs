//! Outputs that repeat: stale where the sensor is slower than the recording or an update was lost, measured where the process is at rest or
//! the sensor coarse.

use super::record::Record;
use crate::signals::smallest_step;

/// An output that repeats the one before is stale if at least this share of all other outputs is distinct, or if this
/// share of the runs of equal outputs has one length: the sensor is slower than the recording. A coarse sensor has few
/// distinct values and runs of all lengths, and its repetitions are measurements.
const ALIKE: f64 = 0.9;

/// Marks stale outputs as absent: the sensor is slower than the recording, or an update was lost.
pub(super) fn mark_stale(record: &mut Record) {
    let present: Vec<usize> = (0..record.len()).filter(|i| record.present[*i]).collect();
    let runs = present.chunk_by(|a, b| record.output[*a] == record.output[*b]);
    let runs: Vec<&[usize]> = runs.collect();
    let mut values: Vec<u64> = present
        .iter()
        .map(|i| record.output[*i].to_bits())
        .collect();
    values.sort_unstable();
    values.dedup();
    let is_distinct = values.len() as f64 >= ALIKE * runs.len() as f64;
    let seems_stale = is_distinct || is_regular(&runs);
    if !seems_stale || is_staircase(record) {
        return;
    }
    let rests = rests(record, &runs);
    for (run, rest) in runs.iter().zip(rests) {
        for &index in &run[rest.max(1)..] {
            record.present[index] = false;
        }
    }
}

/// Samples at the start of each run of equal outputs in which the process is at rest: under one input, for longer than between two
/// updates of a sensor, from the first sample on or after a change of one step of its resolution, as at the end of a response.
fn rests(record: &Record, runs: &[&[usize]]) -> Vec<usize> {
    let outputs: Vec<f64> = record.present_outputs().collect();
    let one_step = 1.5 * resolution(&outputs);
    let updates = 2 * median_length(runs);
    let mut before = None;
    let rest = |run: &&[usize]| {
        let output = record.output[run[0]];
        let is_reached = before
            .replace(output)
            .is_none_or(|before: f64| (output - before).abs() < one_step);
        let is_held = |index: &&usize| record.input[**index] == record.input[run[0]];
        let held = run.iter().take_while(is_held).count();
        if is_reached && held > updates {
            held
        } else {
            0
        }
    };
    runs.iter().map(rest).collect()
}

/// The smallest change of an output, if nearly all others are multiples of it; zero for others: a response that stops where it moves has a
/// smallest change too.
fn resolution(outputs: &[f64]) -> f64 {
    let step = smallest_step(outputs);
    let changes = changes(outputs);
    let steps = changes.iter().map(|size| size / step);
    let whole = steps.filter(|steps| (steps - steps.round()).abs() < 0.2);
    match whole.count() as f64 >= ALIKE * changes.len() as f64 {
        true => step,
        false => 0.0,
    }
}

/// Sizes of the changes from one output to the next, without those of zero.
fn changes(outputs: &[f64]) -> Vec<f64> {
    let sizes = outputs.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    sizes.filter(|size| *size > 0.0).collect()
}

fn median_length(runs: &[&[usize]]) -> usize {
    let mut lengths: Vec<usize> = runs.iter().map(|run| run.len()).collect();
    let count = lengths.len();
    *lengths.select_nth_unstable(count / 2).1
}

/// Whether most changes of the output are of its smallest step: then what repeats is rounded, and not stale.
fn is_staircase(record: &Record) -> bool {
    let outputs: Vec<f64> = record.present_outputs().collect();
    // Two steps at once are the next larger change.
    let one_step = 1.5 * smallest_step(&outputs);
    let changes = changes(&outputs);
    let small = changes.iter().filter(|size| **size < one_step);
    2 * small.count() > changes.len()
}

/// Whether most runs of equal outputs have one length, or a multiple of it, above one sample.
fn is_regular(runs: &[&[usize]]) -> bool {
    let median = median_length(runs);
    let alike = runs.iter().filter(|run| run.len() % median == 0).count();
    median > 1 && alike as f64 >= ALIKE * runs.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Vec<f64> {
        (0..300).map(|k| (f64::from(k) * 0.37).sin()).collect()
    }

    /// Number of outputs that are marked, of 300 samples every 10 ms.
    fn absent(input: Vec<f64>, output: Vec<f64>) -> usize {
        let mut record = Record::even(0.01, input, output);
        mark_stale(&mut record);
        record.present.iter().filter(|present| !**present).count()
    }

    #[test]
    fn stale_outputs_are_absent_but_those_of_a_coarse_sensor_are_not() {
        let mut output = ramp();
        output[100..110].fill(0.5);
        let coarse = output.iter().map(|y| (2.0 * y).round()).collect();
        assert_eq!(absent(ramp(), output), 9);
        assert_eq!(absent(ramp(), coarse), 0);
    }

    // Before a step, and after its response has come to rest within the resolution, all outputs are equal. A sensor that stops while
    // the output moves is stale, as is one under an input that changes.
    #[test]
    fn an_output_at_rest_is_not_stale() {
        let response = |k: i32| 1.0 - (-f64::from(k.max(100) - 100) / 12.0).exp();
        let absent = |step: f64, last: i32, input: &dyn Fn(i32) -> f64| {
            let output = |k: i32| (response(k.min(last)) / step).round() * step;
            absent(
                (0..300).map(input).collect(),
                (0..300).map(output).collect(),
            )
        };
        let step = |k: i32| f64::from(k >= 100);
        assert!(
            absent(1e-3, 300, &step) < 100,
            "{}",
            absent(1e-3, 300, &step)
        );
        // What repeats of the 190 after the last change, and the first sample of the step.
        assert_eq!(absent(1e-3, 110, &step), 190);
        assert!(absent(1e-3, 300, &|k| f64::from(k % 2)) > 150);
    }

    // A temperature that rises by 1 degree every few samples never shows one twice.
    #[test]
    fn a_staircase_is_not_stale() {
        let rising: Vec<f64> = (0..300).map(|k| f64::from(k / 4)).collect();
        let slow = rising.iter().map(|k| (0.37 * k).sin()).collect();
        assert_eq!(absent(ramp(), rising), 0);
        assert_eq!(absent(ramp(), slow), 300 - 75);
    }
}
