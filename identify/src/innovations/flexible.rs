//! How near the loop comes to instability by what the model lacks: the frequency response of a prediction from many past inputs
//! and outputs, beside that of the model.
//!
//! ```text
//! A(q) y(k) = B(q) u(k) + e(k),      G = B / A,      A = 1 - a1 q^-1 - ... - aN q^-N,      B = b0 + b1 q^-1 + ... + bN q^-N
//! ```
//!
//! over the means of rows of a twelfth of lags and dead time: N rows reach beyond both, whatever the process is. The loop of the model
//! `M` and a controller `C` is stable, and stays so with `G` unless `|C (G - M)|` is as large as `|1 + C M|` at some frequency (theorem of
//! Rouche); `1 - |C (G - M)| / |1 + C M|` of the distance is left. Means of input and output over a row keep their ratio at all
//! frequencies that are slow over it. Reference: L. Ljung, "System Identification" (1999), sections 7.3 and 9.4.

use std::f64::consts::PI;

use num_complex::Complex64;
use onecycle_design::{Controller, Model};

use super::orthogonal::Orthogonal;
use super::record::{Blocks, Hold, Record};
use super::search;
use super::{spectrum, validate};

/// Past rows of input and output.
const LAGS: usize = 20;
/// Rows in the lags and the dead time.
const ROWS: f64 = 12.0;
/// Fewest and most rows of the fit.
const FEWEST: usize = 6 * LAGS;
const MOST: usize = 20_000;
/// Frequencies.
const FREQUENCIES: usize = 200;
/// Highest frequency, as a share of that of two rows.
const HIGHEST: f64 = 0.6;
/// Deviations of the response that are not held against the model.
const DEVIATIONS: f64 = 2.0;

/// Largest share of the distance from instability, `|1 + C M|`, that the difference of the two responses takes for certain, of a
/// process whose lags and dead time last `span_s`. Zero if the record is too short to tell, or its rows are uneven.
pub(super) fn distance_taken(
    record: &Record,
    span_s: f64,
    model: &Model,
    controller: &Controller,
) -> f64 {
    let found = Flexible::of(record, span_s).map(|flexible| {
        let taken = flexible.frequencies().into_iter().map(|omega| {
            let (response, deviation) = flexible.response(omega);
            let (c, m) = (
                controller.frequency_response(omega),
                model.frequency_response(omega),
            );
            let certain = (response - m).norm() - DEVIATIONS * deviation;
            c.norm() * certain / (1.0 + c * m).norm()
        });
        taken.fold(0.0, f64::max)
    });
    found.unwrap_or(0.0)
}

/// The prediction.
struct Flexible {
    row_s: f64,
    length_s: f64,
    /// Time (s) by which the output of a row is measured before the middle of the time for which its input acts.
    early_s: f64,
    columns: Orthogonal,
    /// `a1 ... aN, b0 ... bN`; under feedback without `b0`, which the innovation of the row acts on.
    coefficients: Vec<f64>,
    /// First lag of the input.
    first: usize,
    /// Standard deviation of the part of the output that the prediction does not explain.
    deviation: f64,
}

impl Flexible {
    fn of(record: &Record, span_s: f64) -> Option<Self> {
        let most = (record.len() / FEWEST).max(1);
        let samples = ((span_s / ROWS / record.dt_s).round() as usize).clamp(1, most);
        let (coarse, _) = search::coarse(record, samples);
        if !coarse.uneven_s.is_empty() {
            return None;
        }
        let blocks = Blocks::new(&coarse, 1, 0.0);
        let inputs = blocks.mean_inputs();
        let outputs: Vec<Option<f64>> = (0..blocks.len())
            .map(|row| blocks.mean_output(row))
            .collect();
        let first = usize::from(validate::is_fed_back(&blocks));
        let rows: Vec<usize> = (LAGS.max(outputs.len().saturating_sub(MOST))..outputs.len())
            .filter(|row| outputs[row - LAGS..=*row].iter().all(Option::is_some))
            .collect();
        let output = |row: usize| outputs[row].unwrap_or(0.0);
        let mut columns = validate::lagged(&rows, 1..=LAGS, output);
        columns.extend(validate::lagged(&rows, first..=LAGS, |row| inputs[row]));
        let target = validate::centred(rows.iter().map(|row| output(*row)));
        let freedom = rows.len().checked_sub(columns.len());
        let freedom = freedom.filter(|freedom| *freedom >= LAGS)?;
        let columns = Orthogonal::new(&columns)?;
        let (rest, coefficients) = columns.solve(&target);
        let square = rest.iter().map(|e| e * e).sum::<f64>() / freedom as f64;
        Some(Self {
            row_s: coarse.dt_s,
            length_s: coarse.time_s(coarse.len() - 1),
            early_s: match record.hold {
                Hold::Held => 0.5 * record.dt_s,
                Hold::Interpolated => 0.0,
            },
            columns,
            coefficients,
            first,
            deviation: square.sqrt().max(coarse.floor),
        })
    }

    fn frequencies(&self) -> Vec<f64> {
        let ends = [2.0 * PI / self.length_s, HIGHEST * PI / self.row_s];
        spectrum::spaced(ends, FREQUENCIES)
    }

    /// Frequency response, and its standard deviation: that of its linear part in the coefficients.
    fn response(&self, omega: f64) -> (Complex64, f64) {
        let back = |lag: usize| Complex64::cis(-omega * self.row_s * lag as f64);
        let (past, of_input) = self.coefficients.split_at(LAGS);
        let a = 1.0
            - (past.iter().zip(1..))
                .map(|(a, lag)| a * back(lag))
                .sum::<Complex64>();
        let b: Complex64 = (of_input.iter().zip(self.first..))
            .map(|(b, lag)| b * back(lag))
            .sum();
        let gradient = (1..=LAGS)
            .map(|lag| b / (a * a) * back(lag))
            .chain((self.first..=LAGS).map(|lag| back(lag) / a));
        let (re, im): (Vec<f64>, Vec<f64>) = gradient.map(|d| (d.re, d.im)).unzip();
        let deviation = self
            .columns
            .deviation(&re)
            .hypot(self.columns.deviation(&im));
        (
            b / a * Complex64::cis(omega * self.early_s),
            self.deviation * deviation,
        )
    }
}

#[cfg(test)]
mod tests {
    use onecycle_design::{Linear, Pid, Structure};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// Samples of the response of `gain / (10 s + 1)` to levels of ten samples, with noise of a hundredth.
    fn record(gain: f64) -> Record {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let levels: Vec<f64> = (0..300).map(|_| random.random_range(-1.0..1.0)).collect();
        let input: Vec<f64> = (0..3000).map(|k| levels[k / 10]).collect();
        let (keep, mut state) = ((-0.1_f64).exp(), 0.0);
        let output = (input.iter())
            .map(|u| {
                let y = state + 0.01 * random.random_range(-1.0..1.0);
                state = keep * state + gain * (1.0 - keep) * u;
                y
            })
            .collect();
        Record::even(1.0, input, output)
    }

    // With C = kp and M = 1 / (10 s + 1), a gain that is larger by d takes |kp d M| / |1 + kp M| of the distance, which is largest at
    // low frequencies: kp d / (1 + kp).
    #[test]
    fn the_share_of_an_error_of_the_gain() {
        let lag = Linear::new(Structure::Foptd)
            .with_gain(0.1)
            .with_pole_per_s(0.1);
        let controller = Controller::from(Pid::new(3.0, 0.0, 0.0));
        let taken =
            |gain: f64| distance_taken(&record(gain), 10.0, &Model::Linear(lag), &controller);
        assert!(taken(1.0) < 0.05, "{}", taken(1.0));
        assert!((taken(1.5) - 0.375).abs() < 0.03, "{}", taken(1.5));
    }
}
