//! Tests of a fit: innovations, prediction of data that it was not fitted to.

use std::ops::Range;

use super::choose::Limits;
use super::descent::Patience;
use super::likelihood::Evaluation;
use super::orthogonal::Orthogonal;
use super::prediction::{Filtering, predict};
use super::record::{Blocks, Record};
use super::search;
use super::theta::Theta;
use crate::outcome::{InnovationTests, Prediction};
use crate::signals::range;
use crate::thresholds::{ANOTHER_KIND, CALM_END, COLOURED, FED_BACK, LEFT};

/// Lags of the tests.
pub(super) const LAGS: usize = 20;

/// Whether the innovations are coloured: the largest of twenty autocorrelations exceeds what chance explains. Of white
/// innovations it exceeds 3.5 standard deviations once in a hundred records.
pub(super) fn is_coloured(tests: &InnovationTests) -> bool {
    tests.autocorrelation > COLOURED.max(3.5 / (tests.rows as f64).sqrt())
}

/// Whether the input explains a part of the innovations that chance does not.
pub(crate) fn is_left_to_the_input(tests: &InnovationTests) -> bool {
    tests.input_share > LEFT.0 && tests.input_f > LEFT.1
}

/// Tests of the innovations against whiteness and against the input.
pub(super) fn tests(blocks: &Blocks<'_>, at: &Evaluation) -> InnovationTests {
    tests_above(blocks.record.floor, blocks, at)
}

/// The same with samples that are believed to `floor` (output unit).
pub(super) fn tests_above(floor: f64, blocks: &Blocks<'_>, at: &Evaluation) -> InnovationTests {
    let innovations = at.innovations();
    let count = innovations.len();
    let least = floor.powi(2) / at.variance;
    let square: f64 = innovations.iter().map(|e| e * e).sum();
    let square = square.max(count as f64 * least);
    let correlation = |lag: usize| {
        let pairs = innovations[lag..].iter().zip(&innovations);
        pairs.map(|(a, b)| a * b).sum::<f64>() / square
    };
    let lags = LAGS.min(count / 4);
    let correlations: Vec<f64> = (1..=lags).map(correlation).collect();
    let n = count as f64;
    let sum: f64 = (correlations.iter().zip(1..))
        .map(|(r, lag)| r * r / (n - f64::from(lag)))
        .sum();
    let (input_share, input_f) = of_input(blocks, &innovations, least);
    InnovationTests {
        autocorrelation: correlations
            .iter()
            .fold(0.0, |most: f64, r| most.max(r.abs())),
        ljung_box: n * (n + 2.0) * sum / lags.max(1) as f64,
        input_share,
        input_f,
        rows: count,
    }
}

/// Whether what was found under feedback is the controller, read backwards: it has neither a dead time nor a lag of a sample.
pub(super) fn is_of_controller(blocks: &Blocks<'_>, theta: &Theta) -> bool {
    let comes_to_rest = theta.structure.stages().integrators == 0;
    comes_to_rest && theta.span_s() < blocks.record.dt_s && follows(blocks)
}

/// Share of the innovations that later inputs explain beyond earlier ones, where chance does not: the input was logged late. Under feedback
/// they do in any case, and tell nothing.
pub(super) fn leads(blocks: &Blocks<'_>, at: &Evaluation) -> Option<f64> {
    /// Later blocks.
    const LEADS: usize = 4;
    let inputs = blocks.mean_inputs();
    let whole = LAGS..blocks.len().saturating_sub(LEADS);
    let rows = (0..blocks.len()).filter(|block| blocks.present(*block) > 0);
    let used: Vec<(usize, f64)> = (rows.zip(at.innovations()))
        .filter(|(row, _)| whole.contains(row))
        .collect();
    let count = used.len() as f64;
    if count < 4.0 * LAGS as f64 {
        return None;
    }
    let target = centred(used.iter().map(|(_, e)| *e));
    let last: Vec<usize> = used.iter().map(|(row, _)| row + LEADS).collect();
    let before_last = |lags| lagged(&last, lags, |row| inputs[row]);
    // Those of the same block are earlier ones: an input that switched between two samples is logged with the later one.
    let earlier = before_last((LEADS..LEADS + LAGS).rev());
    let later = before_last((0..LEADS).rev());
    let least = blocks.record.floor.powi(2) / at.variance * count;
    let (share, f) = explained_beyond(&target, &earlier, &later, least)?;
    let is_late = share > ANOTHER_KIND.0 && f > ANOTHER_KIND.1;
    (is_late && !follows(blocks)).then_some(share)
}

/// Share of `target` beyond the columns `first` that the columns `more` explain, and its F statistic. `least`: the least sum of squares
/// that is believed to be left. `None` if nothing is left, or if `more` are combinations of `first`.
fn explained_beyond(
    target: &[f64],
    first: &[Vec<f64>],
    more: &[Vec<f64>],
    least: f64,
) -> Option<(f64, f64)> {
    let mut columns = Orthogonal::independent(first);
    let (before, own) = (columns.left(target), columns.len());
    columns.extend(more);
    let (after, all) = (columns.left(target), columns.len());
    let freedom = target.len() as f64 - all as f64 - 1.0;
    let f = (before - after) / (all - own) as f64 / (after.max(least) / freedom);
    (before > 0.0 && all > own).then_some((1.0 - after / before, f))
}

/// Share of the innovations that the input of the blocks before explains, and its F statistic. The input of the same
/// block is left out: under feedback it contains the innovation. `least`: the least variance of them
/// that is believed.
fn of_input(blocks: &Blocks<'_>, innovations: &[f64], least: f64) -> (f64, f64) {
    let inputs = blocks.mean_inputs();
    let rows: Vec<usize> = (0..blocks.len())
        .filter(|block| blocks.present(*block) > 0)
        .collect();
    let used: Vec<(usize, f64)> = (rows.into_iter().zip(innovations.iter().copied()))
        .filter(|(row, _)| *row >= LAGS)
        .collect();
    let count = used.len() as f64;
    if count < 4.0 * LAGS as f64 {
        return (0.0, 0.0);
    }
    let target = centred(used.iter().map(|(_, e)| *e));
    let rows: Vec<usize> = used.iter().map(|(row, _)| *row).collect();
    let columns = lagged(&rows, 1..=LAGS, |row| inputs[row]);
    // A lag that repeats those before it (a slow input) tells nothing new.
    let orthogonal = Orthogonal::independent(&columns);
    let (rest, _) = orthogonal.solve(&target);
    let size = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
    let (all, rest) = (size(&target), size(&rest));
    let number = orthogonal.len() as f64;
    let freedom = count - number - 1.0;
    let f = (all - rest) / number / (rest / freedom).max(least);
    // What the input explains counts where its mean square is above the variance that is believed.
    let counts = all - rest > count * least;
    (1.0 - rest / all, if counts { f } else { f.min(1.0) })
}

/// A column for each lag: the values at so many rows before each of `rows`, less their mean.
pub(super) fn lagged(
    rows: &[usize],
    lags: impl IntoIterator<Item = usize>,
    value: impl Fn(usize) -> f64,
) -> Vec<Vec<f64>> {
    let column = |lag: usize| centred(rows.iter().map(|row| value(row - lag)));
    lags.into_iter().map(column).collect()
}

/// Values less their mean.
pub(super) fn centred(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut column: Vec<f64> = values.collect();
    let mean = mean(&column);
    column.iter_mut().for_each(|v| *v -= mean);
    column
}

/// Whether the input may follow the output: it switches between two levels, as that of a relay does, or past outputs explain it
/// beyond what past inputs do.
/// Reference: C. W. J. Granger, Econometrica 37 (1969).
pub(super) fn is_fed_back(blocks: &Blocks<'_>) -> bool {
    switches(&blocks.record.input) || follows(blocks)
}

/// Whether past outputs explain the input beyond what past inputs do.
pub(super) fn follows(blocks: &Blocks<'_>) -> bool {
    let inputs = blocks.mean_inputs();
    let outputs: Vec<f64> = (0..blocks.len())
        .map(|block| blocks.mean_output(block).unwrap_or(0.0))
        .collect();
    let rows: Vec<usize> = (LAGS..blocks.len()).collect();
    if rows.len() < 4 * LAGS {
        return false;
    }
    let target = centred(rows.iter().map(|row| inputs[*row]));
    let of_past = |values: &[f64]| lagged(&rows, 1..=LAGS, |row| values[row]);
    let explained = explained_beyond(&target, &of_past(&inputs), &of_past(&outputs), 0.0);
    explained.is_some_and(|(_, f)| f > FED_BACK)
}

/// Whether an input switches between two levels at least four times: twice from each.
fn switches(input: &[f64]) -> bool {
    /// Distance from a level, as a share of that between the levels.
    const NEAR: f64 = 0.1;
    const FEWEST: usize = 4;
    /// Share of the samples off both levels: a test may begin and end between them.
    const MOST_BETWEEN: f64 = 0.05;
    let (low, high) = range(input);
    let share = |value: &f64| (value - low) / (high - low);
    let is_level = |value: &f64| !(NEAR..=1.0 - NEAR).contains(&share(value));
    let changes = input
        .windows(2)
        .filter(|pair| (share(&pair[0]) > 0.5) != (share(&pair[1]) > 0.5));
    let between = input.iter().filter(|value| !is_level(value)).count();
    high > low && between as f64 <= MOST_BETWEEN * input.len() as f64 && changes.count() >= FEWEST
}

/// Prediction of the last third of the record from a fit to the first two thirds. `None` if a third is too short.
pub(super) fn prediction(
    record: &Record,
    theta: &Theta,
    limits: &Limits,
    samples: usize,
    horizon_s: f64,
) -> Option<Prediction> {
    const WARM: Patience = Patience {
        steps: 12,
        decrease: 1e-5,
    };
    let skip_s = limits.skip_s;
    let split = record.len() - (record.len() - record.skipped(skip_s)) / 3;
    let early = record.part(0..split);
    let blocks = Blocks::new(&early, samples, skip_s);
    if blocks.len() < 40 {
        return None;
    }
    let fitted = search::warm(&blocks, theta, limits.longest_tau_s, WARM)?;
    let whole = Blocks::new(record, samples, skip_s);
    let ahead = ((horizon_s / whole.block_s()).round() as usize).clamp(1, whole.len() / 6);
    let filtering = Filtering {
        ahead,
        ..Filtering::default()
    };
    let found = predict(&whole, &fitted.theta, &fitted.at, filtering)?;
    let measured = |row: usize| whole.mean_output(row);
    let later = blocks.len()..whole.len().saturating_sub(ahead);
    let pairs: Vec<(f64, f64)> = later
        .clone()
        .filter_map(|row| {
            let predicted = found.ahead[row] + found.forced[row + ahead];
            measured(row + ahead).map(|value| (value, predicted))
        })
        .collect();
    let count = pairs.len() as f64;
    if count < 10.0 {
        return None;
    }
    // Where the input hardly moves the output any more, since it has settled or is too fast, nothing is left to predict: what the
    // whole record moves by is the measure then. Blocks without a sample have no response.
    let forced = |rows: Range<usize>| -> f64 {
        let present = rows.filter(|row| whole.present(*row) > 0);
        variance(&present.map(|row| found.forced[row]).collect::<Vec<f64>>())
    };
    let is_calm = forced(later.start + ahead..whole.len()) < CALM_END * forced(0..whole.len());
    let every: Vec<f64> = match is_calm {
        true => (0..whole.len()).filter_map(measured).collect(),
        false => pairs.iter().map(|(value, _)| *value).collect(),
    };
    let error: f64 = pairs
        .iter()
        .map(|(value, predicted)| (value - predicted).powi(2))
        .sum();
    Some(Prediction {
        horizon_s: ahead as f64 * whole.block_s(),
        explained: 1.0 - error / (count * variance(&every)),
        error_ratio: error / (count * found.ahead_variance),
    })
}

pub(super) fn mean(rows: &[f64]) -> f64 {
    rows.iter().sum::<f64>() / rows.len() as f64
}

fn variance(rows: &[f64]) -> f64 {
    let mean = mean(rows);
    rows.iter().map(|row| (row - mean).powi(2)).sum::<f64>() / rows.len() as f64
}

#[cfg(test)]
mod tests {
    use onecycle_design::Structure;

    use super::*;

    // A lag of 10 rows that answers 10 steps, and rests from 50 rows after the split on: nothing is left to predict 100 rows ahead, and the
    // movement of the whole record is the measure.
    #[test]
    fn an_end_at_rest_is_predicted() {
        let input: Vec<f64> = (0..1500)
            .map(|row| f64::from(u8::from(row < 1000 && row / 100 % 2 == 0)))
            .collect();
        let decay = (-0.1_f64).exp();
        let lagged = input.iter().scan(0.0, |state, input| {
            let last = *state;
            *state = input + (*state - input) * decay;
            Some(if last < 1e-3 { 0.0 } else { last })
        });
        let output = lagged.collect();
        let record = Record {
            floor: 1e-3,
            ..Record::even(1.0, input, output)
        };
        let mut theta = Theta::new(Structure::Foptd);
        theta.values[..2].copy_from_slice(&[0.1, 0.0]);
        let limits = Limits {
            skip_s: 0.0,
            longest_tau_s: 100.0,
            slowest_s: f64::INFINITY,
            period_s: f64::INFINITY,
            structure: None,
            fewest_samples: 1,
        };
        let found = prediction(&record, &theta, &limits, 1, 100.0).unwrap();
        assert!(found.explained > 0.99, "{found:?}");
    }
}
