//! What is known of a recording before any fit.

use super::orthogonal::{Orthogonal, dot};
use super::prepare::{FLOOR, Prepared, prepare};
use super::record::Blocks;
use super::{ROWS, outliers, validate};
use crate::excitation::Recorded;
use crate::settings::Options;
use crate::signals::{Signals, range};
use crate::thresholds::BELIEVED_LESS;

/// What is known of a recording. `None` if no fit can be made.
pub(crate) fn recorded(signals: &Signals<'_>, options: &Options) -> Option<Recorded> {
    let mut prepared = prepare(signals, options, FLOOR).ok()?;
    let outliers = outliers::mark_far(&mut prepared.record);
    Some(describe(&prepared, outliers))
}

/// What `ask` answers for the rows of a recording. `None` if no fit can be made.
fn of_rows<T>(
    signals: &Signals<'_>,
    options: &Options,
    ask: impl FnOnce(&Blocks<'_>) -> T,
) -> Option<T> {
    let record = prepare(signals, options, FLOOR).ok()?.record;
    let samples = (record.len() / ROWS).max(1);
    Some(ask(&Blocks::new(&record, samples, 0.0)))
}

/// Whether past outputs explain the input, as they do that of a relay in a loop, and not a test signal of two levels.
pub(crate) fn input_follows(signals: &Signals<'_>, options: &Options) -> bool {
    of_rows(signals, options, validate::follows) == Some(true)
}

/// Time (s) from the first change of the input to that of the output, of a record that begins with both at rest: a dead time is not
/// longer. `None` for another record.
pub(super) fn first_answer_s(signals: &Signals<'_>, options: &Options) -> Option<f64> {
    of_rows(signals, options, answer_of_rows_s)?
}

fn answer_of_rows_s(blocks: &Blocks<'_>) -> Option<f64> {
    /// Share of the range of the output over which its fastest movement would have shown while it was at rest.
    const SHOWN: f64 = 1.0 / 3.0;
    // An output at rest that repeats its value has no new samples.
    let known = (0..blocks.len()).find_map(|row| blocks.mean_output(row))?;
    let of_row = |last: &mut f64, row: usize| {
        *last = blocks.mean_output(row).unwrap_or(*last);
        Some(*last)
    };
    let outputs: Vec<f64> = (0..blocks.len()).scan(known, of_row).collect();
    let left = |values: &[f64]| {
        let (low, high) = range(values);
        let is_left = |value: &f64| (value - values[0]).abs() > BELIEVED_LESS * (high - low);
        values.iter().position(is_left)
    };
    let (changed, answered) = (left(&blocks.mean_inputs())?, left(&outputs)?);
    let (low, high) = range(&outputs);
    let moved = outputs
        .windows(answered + 1)
        .map(|part| (part[answered] - part[0]).abs());
    let is_at_rest = moved.fold(0.0, f64::max) > SHOWN * (high - low);
    (changed < answered && is_at_rest).then(|| (answered - changed + 1) as f64 * blocks.block_s())
}

/// Whether the output moves before it answers, `tau_s` after the first change of the input: a straight line through these rows has a slope
/// beyond three of its deviations, of neighbours that are correlated (G. E. P. Box, G. M. Jenkins, "Time Series Analysis" (1976), first
/// order). Rows that are too few show nothing.
pub(super) fn moves_before_answer(signals: &Signals<'_>, tau_s: f64) -> bool {
    const FEWEST: usize = 4;
    let (input, time_s) = (signals.input, signals.time_s);
    let first = input.iter().take_while(|value| **value == input[0]).count();
    let Some(changed_s) = time_s.get(first) else {
        return false;
    };
    let count = first.max(time_s.partition_point(|time_s| *time_s < changed_s + tau_s));
    if count < FEWEST {
        return false;
    }
    let times = validate::centred(time_s[..count].iter().copied());
    let outputs = validate::centred(signals.output[..count].iter().copied());
    let square = dot(&times, &times);
    let (left, slopes) = Orthogonal::independent(&[times]).solve(&outputs);
    let size = dot(&left, &left);
    let correlation = (dot(&left[1..], &left[..count - 1]) / size).max(0.0);
    let variance = size / (count - 2) as f64 / square * (1.0 + correlation) / (1.0 - correlation);
    slopes[0].powi(2) > 9.0 * variance
}

/// Time (s) after which the input is its own negative, over two periods or more, as that of a square wave or a sine: half a period, of which
/// the dead time is the other sign of the gain. `None` of another input.
pub(super) fn mirrored_s(signals: &Signals<'_>, options: &Options) -> Option<f64> {
    of_rows(signals, options, |blocks| {
        let inputs = validate::centred(blocks.mean_inputs().into_iter());
        let correlation = |lag: usize| {
            let (later, earlier) = (&inputs[lag..], &inputs[..inputs.len() - lag]);
            dot(later, earlier) / (dot(later, later) * dot(earlier, earlier)).sqrt()
        };
        let lag = (1..=inputs.len() / 4).find(|lag| correlation(*lag) < BELIEVED_LESS - 1.0)?;
        Some(lag as f64 * blocks.block_s())
    })?
}

/// Measured properties of a record without its `outliers`.
pub(super) fn describe(prepared: &Prepared, outliers: usize) -> Recorded {
    let record = &prepared.record;
    let deviation = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let squares = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>();
        (squares / values.len() as f64).sqrt()
    };
    let outputs: Vec<f64> = record.present_outputs().collect();
    let present = outputs.len();
    Recorded {
        start_s: prepared.start_s,
        end_s: prepared.start_s + record.time_s(record.len() - 1),
        sample_s: record.dt_s,
        samples: present,
        absent: record.len() - present - outliers,
        outliers,
        samples_per_row: 1,
        hold: record.hold,
        input_deviation: deviation(&record.input),
        output_deviation: deviation(&outputs),
        informative_rad_per_s: None,
        excited_rad_per_s: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of<T>(signals: [&dyn Fn(i32) -> f64; 2], ask: impl Fn(&Signals<'_>, &Options) -> T) -> T {
        let time_s: Vec<f64> = (0..1000).map(|row| 0.1 * f64::from(row)).collect();
        let [input, output] = signals.map(|of| (0..1000).map(of).collect::<Vec<f64>>());
        let signals = Signals {
            time_s: &time_s,
            input: &input,
            output: &output,
            samples_per_point: 1,
            sample_period_s: 0.1,
            breaks: &[],
        };
        ask(&signals, &Options::default())
    }

    // A step in row 200, a dead time of 15 rows, and a lag of 30, which leaves 3 % in a row: the answer shows between row 215 and 217.
    // Without rest before it, or with an output that moves before the input, nothing shows.
    #[test]
    fn the_first_answer_is_later_than_the_dead_time() {
        let step = |row: i32| f64::from(row >= 200);
        let answer = |row: i32| 1.0 - (-f64::from((row - 215).max(0)) / 30.0).exp();
        let answer_s = of([&step, &answer], first_answer_s).unwrap();
        assert!((1.5..=1.8).contains(&answer_s), "{answer_s}");
        let moving = |row: i32| (0.05 * f64::from(row)).sin();
        assert_eq!(of([&step, &moving], first_answer_s), None);
        let early = |row: i32| answer(row + 50);
        assert_eq!(of([&step, &early], first_answer_s), None);
    }

    // Rest, under noise that is correlated or not, and a drift of 0.02 a row, which 90 rows show and three do not, unless the dead time adds
    // to them.
    #[test]
    fn an_output_that_moves_before_it_answers_was_not_at_rest() {
        let noise = |row: i32| (12.9898 * f64::from(row)).sin() + (0.3 * f64::from(row)).sin();
        let moves = |rows: i32, drift: f64, tau_s: f64| {
            let input = move |row: i32| f64::from(row >= rows);
            let output = move |row: i32| 0.1 * noise(row) + drift * f64::from(row);
            of([&input, &output], |signals, _| {
                moves_before_answer(signals, tau_s)
            })
        };
        for rows in [1, 3, 20, 90] {
            assert!(!moves(rows, 0.0, 0.0), "{rows}");
        }
        assert!(!moves(3, 0.02, 0.0) && moves(90, 0.02, 0.0) && moves(3, 0.02, 9.0));
    }

    #[test]
    fn a_square_wave_mirrors_itself() {
        let output = |row: i32| (0.05 * f64::from(row)).sin();
        let square = |row: i32| f64::from(row % 200 < 100);
        let half_s = of([&square, &output], mirrored_s).unwrap();
        assert!((half_s - 10.0).abs() < 0.2, "{half_s}");
        let step = |row: i32| f64::from(row >= 500);
        assert_eq!(of([&step, &output], mirrored_s), None);
        let uneven = |row: i32| f64::from(row % 200 < 100 && row < 500 || row % 90 < 30);
        assert_eq!(of([&uneven, &output], mirrored_s), None);
    }
}
