//! Frequencies: of the input, and those that a record tells about.

use std::f64::consts::{PI, SQRT_2, TAU};

use super::descent::Found;
use super::likelihood::input_innovations;
use super::orthogonal::Orthogonal;
use super::record::{Blocks, Rest};
use super::validate::{LAGS, mean};
use crate::signals::begins_with_a_step;

/// Frequencies of the spectrum of an input or of the information.
const FREQUENCIES: usize = 120;

/// Order of persistent excitation of the input, at most [`LAGS`]: that of one sine is two. `least`: share of its power that
/// counts. Reference: L. Ljung, "System Identification" (1999), section 13.2.
pub(super) fn order_of_excitation(blocks: &Blocks<'_>, least: f64) -> usize {
    /// Lags in a period of the excitation.
    const IN_A_PERIOD: f64 = 8.0;
    let inputs = blocks.mean_inputs();
    let lag_s = period_s(blocks).unwrap_or(0.0) / IN_A_PERIOD;
    let longest = inputs.len() / (2 * LAGS);
    let rows = ((lag_s / blocks.block_s()).round() as usize).clamp(1, longest.max(1));
    let count = inputs.len().saturating_sub(LAGS * rows);
    let mean = mean(&inputs);
    let lagged = |lag: usize| inputs[lag * rows..][..count].iter();
    let columns: Vec<Vec<f64>> = (0..LAGS)
        .map(|lag| lagged(lag).map(|v| v - mean).collect())
        .collect();
    Orthogonal::independent(&columns).rank(least.sqrt())
}

/// Frequencies that a record tells about.
#[derive(Clone, Copy, Debug)]
pub(super) struct Informative {
    /// Band (rad/s) with the central 90 % of the information on the gain.
    pub(super) band_rad_per_s: (f64, f64),
    /// Highest frequency (rad/s) up to which the record shows the response without a break. See [`highest`].
    pub(super) highest_rad_per_s: f64,
}

/// Frequencies that the record tells about: the spectrum of what tells the gain. `None` if the input has no effect.
pub(super) fn informative(blocks: &Blocks<'_>, found: &Found) -> Option<Informative> {
    let filtered = input_innovations(blocks, &found.theta)?;
    let at = &found.at;
    let [low, _, high] = quantiles(&filtered, blocks.block_s())?;
    let lines = lines(filtered, blocks.block_s());
    // Information on the logarithm of the gain.
    let scale = at.gain * at.gain / at.variance;
    let lines: Vec<(f64, f64)> = (lines.into_iter())
        .map(|(omega, sum)| (omega, scale * sum))
        .collect();
    Some(Informative {
        band_rad_per_s: (low, high),
        highest_rad_per_s: highest(&lines).unwrap_or(high),
    })
}

/// Highest frequency of an unbroken row of half octaves in each of which the information on the logarithm of the gain, in
/// `lines` of frequency (rad/s) and information, is at least 25 (a deviation of 20 %), and a share of that in the best half
/// octave. A resonance in between would show.
fn highest(lines: &[(f64, f64)]) -> Option<f64> {
    const LEAST: f64 = 25.0;
    const LEAST_SHARE: f64 = 1e-4;
    /// Share of a half octave's information in a line that counts as its highest.
    const LINE: f64 = 0.05;
    let window = |high: f64| {
        let inside = move |omega: f64| omega > high / SQRT_2 && omega <= high * (1.0 + 1e-9);
        lines.iter().filter(move |line| inside(line.0))
    };
    let sum = |high: f64| {
        window(high)
            .map(|(_, information)| information)
            .sum::<f64>()
    };
    let sums: Vec<f64> = lines.iter().map(|(omega, _)| sum(*omega)).collect();
    let best = (0..lines.len()).max_by(|a, b| sums[*a].total_cmp(&sums[*b]))?;
    let least = LEAST.max(LEAST_SHARE * sums[best]);
    let last = (best..lines.len())
        .take_while(|index| sums[*index] >= least)
        .last()?;
    let strong = LINE * sums[last];
    let mut highest = window(lines[last].0).filter(|(_, information)| *information >= strong);
    highest.next_back().map(|(omega, _)| *omega)
}

/// Frequencies (rad/s) of the Fourier sums of `rows`, with their shares of the sum of squares: under a Hann window, which
/// keeps the power of a line where the line is. Of more than 2,000 rows the first ones.
fn lines(mut rows: Vec<f64>, row_s: f64) -> Vec<(f64, f64)> {
    const MOST_ROWS: usize = 2000;
    let whole = rows.len();
    rows.truncate(MOST_ROWS);
    let count = rows.len();
    let mean = mean(&rows);
    for (row, value) in rows.iter_mut().enumerate() {
        *value = (*value - mean) * (PI * row as f64 / count as f64).sin().powi(2);
    }
    // The mean square of the window is 3/8, and each line stands for its negative frequency too.
    let scale = 2.0 / (0.375 * count as f64) * whole as f64 / count as f64;
    let line = TAU / (count as f64 * row_s);
    (1..=count / 2)
        .map(|index| index as f64 * line)
        .map(|omega| (omega, scale * power(&rows, omega * row_s)))
        .collect()
}

/// Share of the power of the input in a band of frequencies (rad/s), a quarter wider on both sides, over the first 2,000
/// rows. A step before the first row is not among these, one in the first rows is under the end of the window, and both have power at
/// all frequencies.
pub(super) fn input_share(blocks: &Blocks<'_>, (low, high): (f64, f64)) -> f64 {
    let input = &blocks.record.input;
    let is_step = |rest: Rest| rest.input != input[0] || begins_with_a_step(input);
    if blocks.record.rest.is_some_and(is_step) {
        return 1.0;
    }
    let lines = lines(blocks.mean_inputs(), blocks.block_s());
    let line = lines.first().map_or(0.0, |(omega, _)| *omega);
    let (mut inside, mut total) = (0.0, 0.0);
    for (omega, power) in lines {
        total += power;
        if omega > 0.8 * low - 2.0 * line && omega < 1.25 * high + 2.0 * line {
            inside += power;
        }
    }
    if total > 0.0 { inside / total } else { 0.0 }
}

/// Squared magnitude of the Fourier sum of `rows` at a phase step (rad).
fn power(rows: &[f64], step: f64) -> f64 {
    let (sin, cos) = step.sin_cos();
    let (mut re, mut im) = (0.0, 0.0);
    let (mut c, mut s) = (1.0, 0.0);
    for value in rows {
        re += value * c;
        im += value * s;
        (c, s) = (c * cos - s * sin, s * cos + c * sin);
    }
    re * re + im * im
}

/// Period of the frequency (s) below and above which the input has half of its power each.
pub(super) fn period_s(blocks: &Blocks<'_>) -> Option<f64> {
    let inputs = blocks.mean_inputs();
    let [_, median, _] = quantiles(&inputs, blocks.block_s())?;
    Some(TAU / median)
}

/// Inverse of the frequency (s) below which the input has 5 % of its power; of what differs from the input at rest, if that is
/// known: a step in the first rows is nearly its own mean.
pub(super) fn slowest_s(blocks: &Blocks<'_>) -> Option<f64> {
    let inputs = blocks.mean_inputs();
    let middle = (blocks.record.rest).map_or_else(|| mean(&inputs), |rest| rest.input);
    let [low, _, _] = quantiles_about(middle, &inputs, blocks.block_s())?;
    Some(1.0 / low)
}

/// Period of the frequency (s) above which the input has 5 % of its power.
pub(super) fn shortest_period_s(blocks: &Blocks<'_>) -> Option<f64> {
    let [_, _, high] = quantiles(&blocks.mean_inputs(), blocks.block_s())?;
    Some(TAU / high)
}

/// So many frequencies at equal ratios, with both ends.
pub(super) fn spaced([lowest, highest]: [f64; 2], count: usize) -> Vec<f64> {
    let share = |i: usize| i as f64 / (count - 1) as f64;
    (0..count)
        .map(|i| lowest * (highest / lowest).powf(share(i)))
        .collect()
}

/// Frequencies (rad/s) below which 5, 50 and 95 % of the power of `rows` about their mean lie. `None` without power.
fn quantiles(rows: &[f64], row_s: f64) -> Option<[f64; 3]> {
    quantiles_about(mean(rows), rows, row_s)
}

/// The same about another value.
fn quantiles_about(middle: f64, rows: &[f64], row_s: f64) -> Option<[f64; 3]> {
    let length_s = row_s * rows.len() as f64;
    let frequencies = spaced([TAU / length_s, PI / row_s], FREQUENCIES);
    let rows: Vec<f64> = rows.iter().map(|value| value - middle).collect();
    let power = |omega: f64| power(&rows, omega * row_s);
    // On a logarithmic grid a frequency stands for a band as wide as itself.
    let powers: Vec<f64> = (frequencies.iter())
        .map(|omega| power(*omega) * omega)
        .collect();
    let total: f64 = powers.iter().sum();
    let quantile = |part: f64| {
        let mut sum = 0.0;
        let index = powers.iter().position(|power| {
            sum += power;
            sum >= part * total
        });
        frequencies[index.unwrap_or(FREQUENCIES - 1)]
    };
    (total > 0.0 && total.is_finite()).then(|| [0.05, 0.5, 0.95].map(quantile))
}

#[cfg(test)]
mod tests {
    use super::super::record::Record;
    use super::*;

    // A sine of 5 rad/s has all of its power there; a square wave has 8/(9 pi^2) = 9.0 % in its third harmonic.
    #[test]
    fn power_of_the_input_in_a_band() {
        let times: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let sine: Vec<f64> = times.iter().map(|t| (5.0 * t).sin()).collect();
        let square = sine.iter().map(|v| v.signum()).collect();
        let share = |input: Vec<f64>, band| {
            let record = Record::even(0.01, input, vec![0.0; 2000]);
            input_share(&Blocks::new(&record, 1, 0.0), band)
        };
        assert!(share(sine.clone(), (4.0, 6.0)) > 0.999);
        assert!(share(sine, (50.0, 300.0)) < 1e-9);
        assert!((share(square, (14.0, 16.0)) - 0.09).abs() < 0.005);
    }
}
