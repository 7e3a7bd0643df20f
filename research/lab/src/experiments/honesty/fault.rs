//! Faults of a recording or of its plant, each with one strength.
//!
//! `T` and `a` are period and amplitude of the relay oscillation of the process without the fault, `h` is the amplitude of
//! the test signal. A fault of the log leaves the experiment as it was and spoils the file; the others act in the loop.
//!
//! | fault | what happens | strength |
//! |-------|--------------|----------|
//! | `input_late`, `output_late` | a column is logged late, by whole samples, one at least | T |
//! | `clock_drift` | the clock of the output column runs fast | delay at the end, in T |
//! | `corrupt_input`, `corrupt_output` | cells with a wrong value, 3 to 9 h or a away | number of cells |
//! | `corrupt_start` | the same in the input, in the first tenth | number of cells |
//! | `held_output` | the log repeats each output | repetitions |
//! | `decimated` | the relay runs faster than the log | steps of the relay for each row |
//! | `jitter` | the samples jitter, their stamps do not | standard deviation in sample periods |
//! | `dropped_rows` | rows are lost in groups of 1 to 5 and the time is closed up | share of the rows |
//! | `filtered_output` | low-pass of first order in the log | time constant in T |
//! | `wrong_sign`, `swapped_columns` | the output has the wrong sign, or is the input | |
//! | `quantised` | resolution of the sensor | a |
//! | `gain_drift` | the gain falls during the recording and stays there | share of the gain |
//! | `wind_steps` | three steps of a disturbance at the input | h |
//! | `unlogged_feedback` | another loop adds `-gain y` to the input and is not logged | h / a |
//! | `dead_zone`, `saturation`, `saturation_one_side`, `backlash`, `sticking`, `stick_slip` | see [`Actuator`] | h |

use rand::{Rng, RngExt};
use serde::Deserialize;

use super::Columns;
use crate::experiments::actuator::Actuator;
use crate::experiments::oscillation::Oscillation;

/// Kind of a fault. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
#[expect(missing_docs, reason = "the table of the module")]
pub enum Fault {
    InputLate,
    OutputLate,
    ClockDrift,
    CorruptInput,
    CorruptOutput,
    CorruptStart,
    HeldOutput,
    Decimated,
    Jitter,
    DroppedRows,
    FilteredOutput,
    WrongSign,
    SwappedColumns,
    Quantised,
    GainDrift,
    WindSteps,
    UnloggedFeedback,
    DeadZone,
    Saturation,
    SaturationOneSide,
    Backlash,
    Sticking,
    StickSlip,
}

impl Fault {
    /// Whether the fault has a strength.
    pub(super) fn has_strength(self) -> bool {
        !matches!(self, Self::WrongSign | Self::SwappedColumns)
    }
}

/// A fault with its strength. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnFault {
    /// Kind.
    pub fault: Fault,
    /// Strength, in the unit of the kind.
    pub strength: f64,
}

/// Largest number of consecutive rows that are lost at once.
const MOST_LOST: usize = 5;
/// Range of the error of a corrupt cell, in amplitudes.
const CORRUPT: std::ops::RangeInclusive<f64> = 3.0..=9.0;

impl DrawnFault {
    /// The strength of this kind. Zero if the fault is another one.
    pub(super) fn of(&self, fault: Fault) -> f64 {
        if self.fault == fault {
            self.strength
        } else {
            0.0
        }
    }

    /// The actuator.
    #[must_use]
    pub fn actuator(&self) -> Actuator {
        let strength = self.strength;
        match self.fault {
            Fault::DeadZone => Actuator::DeadZone {
                half_width: strength,
            },
            Fault::Saturation => Actuator::Saturation {
                low: -strength,
                high: strength,
            },
            Fault::SaturationOneSide => Actuator::Saturation {
                low: f64::NEG_INFINITY,
                high: strength,
            },
            Fault::Backlash => Actuator::Backlash {
                half_width: strength,
            },
            Fault::Sticking => Actuator::Sticking { band: strength },
            Fault::StickSlip => Actuator::StickSlip { band: strength },
            _ => Actuator::Ideal,
        }
    }

    /// Spoils the file of an experiment.
    pub(super) fn spoil(&self, log: &mut Columns, oscillation: Oscillation, rng: &mut impl Rng) {
        let Oscillation {
            period_s,
            amplitude,
        } = oscillation;
        let rows = log.time_s.len();
        let sample_s = log.sample_s;
        let late = (self.strength * period_s / sample_s).ceil().max(1.0) as usize;
        match self.fault {
            Fault::InputLate => delay(&mut log.input, late),
            Fault::OutputLate => delay(&mut log.output, late),
            Fault::ClockDrift => drift(&mut log.output, self.strength * period_s / sample_s),
            Fault::CorruptInput => corrupt(&mut log.input, self.strength, 1.0, rng),
            Fault::CorruptOutput => corrupt(&mut log.output, self.strength, amplitude, rng),
            Fault::CorruptStart => {
                corrupt(&mut log.input[..rows / 10], self.strength, 1.0, rng);
            }
            Fault::HeldOutput => {
                let held = self.strength.max(1.0) as usize;
                for row in 0..rows {
                    log.output[row] = log.output[row - row % held];
                }
            }
            Fault::Decimated => log.keep_every(self.strength.max(1.0) as usize),
            Fault::DroppedRows => log.lose(self.strength, rng),
            Fault::FilteredOutput => {
                let keep = (-sample_s / (self.strength * period_s)).exp();
                let mut filtered = log.output.first().copied().unwrap_or(0.0);
                for value in &mut log.output {
                    filtered = keep * filtered + (1.0 - keep) * *value;
                    *value = filtered;
                }
            }
            Fault::WrongSign => log.output.iter_mut().for_each(|value| *value = -*value),
            Fault::SwappedColumns => std::mem::swap(&mut log.input, &mut log.output),
            _ => {}
        }
    }
}

/// Delays a column by rows; its first value fills the start.
fn delay(column: &mut [f64], rows: usize) {
    let rows = rows.min(column.len());
    let first = column.first().copied().unwrap_or(0.0);
    column.copy_within(..column.len() - rows, rows);
    column[..rows].fill(first);
}

/// A column whose clock runs fast: the row `k` of `n` shows what belongs `rows k / n` rows later.
fn drift(column: &mut [f64], rows: f64) {
    let true_column = column.to_vec();
    let last = column.len().saturating_sub(1);
    for (row, value) in column.iter_mut().enumerate() {
        let at = (row as f64 * (1.0 + rows / (last + 1) as f64)).min(last as f64);
        let (whole, part) = (at as usize, at.fract());
        let next = true_column[(whole + 1).min(last)];
        *value = (1.0 - part) * true_column[whole] + part * next;
    }
}

/// Wrong values in `cells` random rows.
fn corrupt(column: &mut [f64], cells: f64, unit: f64, rng: &mut impl Rng) {
    if column.is_empty() {
        return;
    }
    for _ in 0..cells as usize {
        let size = unit * rng.random_range(CORRUPT);
        let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        column[rng.random_range(0..column.len())] += sign * size;
    }
}

impl Columns {
    /// Keeps every `n`-th row.
    fn keep_every(&mut self, n: usize) {
        self.sample_s *= n as f64;
        for column in [&mut self.time_s, &mut self.input, &mut self.output] {
            let mut row = 0;
            column.retain(|_| {
                row += 1;
                (row - 1) % n == 0
            });
        }
    }

    /// Loses groups of rows and closes the time up.
    fn lose(&mut self, share: f64, rng: &mut impl Rng) {
        let group = 0.5 * (1.0 + MOST_LOST as f64);
        let mut lost = 0;
        let kept: Vec<bool> = (self.time_s.iter())
            .map(|_| {
                if lost == 0 && rng.random_bool((share / group).clamp(0.0, 1.0)) {
                    lost = rng.random_range(1..=MOST_LOST);
                }
                let is_kept = lost == 0;
                lost = lost.saturating_sub(1);
                is_kept
            })
            .collect();
        for column in [&mut self.input, &mut self.output] {
            let mut kept = kept.iter();
            column.retain(|_| kept.next().copied().unwrap_or(true));
        }
        self.time_s.truncate(self.input.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_by_hand() {
        let mut column = [1.0, 2.0, 3.0, 4.0];
        delay(&mut column, 1);
        assert_eq!(column, [1.0, 1.0, 2.0, 3.0]);
        delay(&mut column, 9);
        assert_eq!(column, [1.0; 4]);
        // Row k of 4 shows what belongs to row 1.5 k.
        let mut column = [0.0, 10.0, 20.0, 30.0];
        drift(&mut column, 2.0);
        assert_eq!(column, [0.0, 15.0, 30.0, 30.0]);
        let column: Vec<f64> = (0..7).map(f64::from).collect();
        let mut log = Columns {
            sample_s: 0.1,
            time_s: column.clone(),
            input: column.clone(),
            output: column,
        };
        log.keep_every(3);
        assert_eq!(log.output, [0.0, 3.0, 6.0]);
        assert!((log.sample_s - 0.3).abs() < 1e-15);
    }
}
