//! Linear least squares in blocks of time, with a standard error that holds for correlated errors.
//!
//! ```text
//! t = sum_k theta_k x_k + (constant of the block) + e
//! cov theta = (X'X)^-1 (sum_b X_b' e_b e_b' X_b) (X'X)^-1
//! ```
//!
//! All columns pass the same low-pass filter first, which keeps the relation and removes what slow logging distorts. The
//! covariance is that of errors which are independent between blocks only. Reference: K.-Y. Liang, S. L. Zeger,
//! Biometrika 73 (1986), 13.

/// Length of a block (s). The integral term must move within it; the trim of a hover hardly does.
const BLOCK_S: f64 = 4.0;
/// Fewest rows of a block.
const BLOCK_ROWS: usize = 12;
/// Fewest blocks: the covariance needs several.
const BLOCKS: usize = 4;
/// A longer step of time (s) starts a new block.
const PAUSE_S: f64 = 0.25;
/// Time constant (s) of each of the two filters: 8 Hz.
const SMOOTHING_S: f64 = 0.02;

/// Columns on one clock.
#[derive(Debug)]
pub(super) struct Rows<'a> {
    pub(super) time_s: &'a [f64],
    /// Rows that count; the others are read by the filters only.
    pub(super) counts: &'a [bool],
}

/// A solution.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fit {
    /// Value and standard error of each column.
    pub(super) values: Vec<(f64, f64)>,
    /// Share of the variance of the target within blocks that the columns explain.
    pub(super) explained: f64,
    /// Rows used.
    pub(super) rows: usize,
}

impl Rows<'_> {
    /// Blocks of rows that count, without pauses.
    fn blocks(&self) -> Vec<Vec<usize>> {
        let mut blocks: Vec<Vec<usize>> = Vec::new();
        let mut start_s = f64::NEG_INFINITY;
        let mut before_s = f64::NEG_INFINITY;
        for (row, &time_s) in self.time_s.iter().enumerate() {
            if !self.counts[row] {
                continue;
            }
            if time_s - start_s > BLOCK_S || time_s - before_s > PAUSE_S {
                blocks.push(Vec::new());
                start_s = time_s;
            }
            before_s = time_s;
            if let Some(block) = blocks.last_mut() {
                block.push(row);
            }
        }
        blocks.retain(|block| block.len() >= BLOCK_ROWS);
        blocks
    }

    /// Filtered twice by `1/(T s + 1)`; starts again after a pause.
    fn smoothed(&self, column: &[f64]) -> Vec<f64> {
        let once = filtered(self.time_s, column, SMOOTHING_S);
        filtered(self.time_s, &once, SMOOTHING_S)
    }

    /// Least squares. `None`: too few blocks, a column without variation, or columns that depend on each other.
    pub(super) fn fit(&self, target: &[f64], columns: &[&[f64]]) -> Option<Fit> {
        let blocks = self.blocks();
        if blocks.len() < BLOCKS {
            return None;
        }
        let mut all: Vec<Vec<f64>> = columns.iter().map(|column| self.smoothed(column)).collect();
        all.push(self.smoothed(target));
        for column in &mut all {
            for block in &blocks {
                let mean = block.iter().map(|&row| column[row]).sum::<f64>() / block.len() as f64;
                block.iter().for_each(|&row| column[row] -= mean);
            }
        }
        let used = || blocks.iter().flatten().copied();
        let count = used().count();
        let power = |column: &[f64]| used().map(|row| column[row] * column[row]).sum::<f64>();
        let target = all.pop()?;
        let scales: Vec<f64> = all.iter().map(|column| power(column).sqrt()).collect();
        if !scales.iter().all(|scale| scale.is_normal()) {
            return None;
        }
        let size = all.len();
        let x = |column: usize, row: usize| all[column][row] / scales[column];
        let mut normal = vec![vec![0.0; size]; size];
        let mut right = vec![0.0; size];
        for row in used() {
            for i in 0..size {
                right[i] += x(i, row) * target[row];
                for j in 0..size {
                    normal[i][j] += x(i, row) * x(j, row);
                }
            }
        }
        let inverse = inverse(normal)?;
        let times = |matrix: &[Vec<f64>], vector: &[f64]| -> Vec<f64> {
            let of = |line: &Vec<f64>| line.iter().zip(vector).map(|(a, b)| a * b).sum();
            matrix.iter().map(of).collect()
        };
        let theta = times(&inverse, &right);
        let error = |row: usize| target[row] - (0..size).map(|i| theta[i] * x(i, row)).sum::<f64>();
        let mut variances = vec![0.0; size];
        for block in &blocks {
            let score: Vec<f64> = (0..size)
                .map(|i| block.iter().map(|&row| x(i, row) * error(row)).sum())
                .collect();
            for (variance, moved) in variances.iter_mut().zip(times(&inverse, &score)) {
                *variance += moved * moved;
            }
        }
        let correction = blocks.len() as f64 / (blocks.len() - 1) as f64;
        let residual: f64 = used().map(|row| error(row).powi(2)).sum();
        let values = (0..size).map(|i| {
            let std = (variances[i] * correction).sqrt();
            (theta[i] / scales[i], std / scales[i])
        });
        let values: Vec<(f64, f64)> = values.collect();
        let total = power(&target);
        (total > 0.0 && values.iter().all(|(a, b)| a.is_finite() && b.is_finite())).then(|| Fit {
            values,
            explained: 1.0 - residual / total,
            rows: count,
        })
    }
}

/// `column` behind `1/(T s + 1)`, held between rows; starts again after a pause.
pub(super) fn filtered(time_s: &[f64], column: &[f64], filter_s: f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(column.len());
    let mut state = column.first().copied().unwrap_or(0.0);
    let mut before_s = f64::NEG_INFINITY;
    for (&time_s, &value) in time_s.iter().zip(column) {
        let step_s = time_s - before_s;
        state = if step_s > PAUSE_S {
            value
        } else {
            state + (value - state) * step_s / (step_s + filter_s)
        };
        before_s = time_s;
        out.push(state);
    }
    out
}

/// Integral and derivative of a column from row to row; a pause adds nothing.
pub(super) fn integral(time_s: &[f64], column: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut before_s = f64::NEG_INFINITY;
    let step = |(&time_s, &value): (&f64, &f64)| {
        let step_s = time_s - before_s;
        before_s = time_s;
        if step_s <= PAUSE_S {
            sum += value * step_s;
        }
        sum
    };
    time_s.iter().zip(column).map(step).collect()
}

/// See [`integral`].
pub(super) fn derivative(time_s: &[f64], column: &[f64]) -> Vec<f64> {
    let mut before = (f64::NEG_INFINITY, 0.0);
    let step = |(&time_s, &value): (&f64, &f64)| {
        let (step_s, step) = (time_s - before.0, value - before.1);
        before = (time_s, value);
        if step_s <= PAUSE_S {
            step / step_s
        } else {
            0.0
        }
    };
    time_s.iter().zip(column).map(step).collect()
}

/// Inverse of a symmetric matrix with ones on its diagonal. `None` if it is nearly singular.
fn inverse(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let size = matrix.len();
    for (row, line) in matrix.iter_mut().enumerate() {
        line.extend((0..size).map(|column| f64::from(u8::from(row == column))));
    }
    for pivot in 0..size {
        let divisor = matrix[pivot][pivot];
        // The share of the column that the others do not explain.
        if divisor.is_nan() || divisor < 1e-6 {
            return None;
        }
        matrix[pivot].iter_mut().for_each(|cell| *cell /= divisor);
        let line = matrix[pivot].clone();
        for (row, other) in matrix.iter_mut().enumerate() {
            if row != pivot {
                let factor = other[pivot];
                other
                    .iter_mut()
                    .zip(&line)
                    .for_each(|(a, b)| *a -= factor * b);
            }
        }
    }
    Some(
        matrix
            .into_iter()
            .map(|line| line[size..].to_vec())
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    // Two sines and a constant for each block: exact, so the coefficients return to rounding and the errors vanish. A
    // column without variation, and a column twice, have no solution.
    #[test]
    fn exact_relations() {
        let time_s: Vec<f64> = (0..4000).map(|row| 0.01 * f64::from(row)).collect();
        let sine = |omega: f64| -> Vec<f64> { time_s.iter().map(|t| (omega * t).sin()).collect() };
        let [a, b] = [sine(3.0), sine(7.1)];
        let target: Vec<f64> = (a.iter().zip(&b))
            .map(|(a, b)| 2.0 * a - 0.5 * b + 9.0)
            .collect();
        let counts = vec![true; time_s.len()];
        let rows = Rows {
            time_s: &time_s,
            counts: &counts,
        };
        let fit = rows.fit(&target, &[&a, &b]).unwrap();
        for ((value, std), truth) in fit.values.iter().zip([2.0, -0.5]) {
            assert!((value - truth).abs() < 1e-12 && *std < 1e-12, "{fit:?}");
        }
        assert!((fit.explained - 1.0).abs() < 1e-12);
        assert_eq!(rows.fit(&target, &[&a, &a]), None);
        assert_eq!(rows.fit(&target, &[&a, &vec![1.0; 4000]]), None);
        let none = vec![false; time_s.len()];
        let rows = Rows {
            counts: &none,
            ..rows
        };
        assert_eq!(rows.fit(&target, &[&a, &b]), None);
    }

    // The integral of 2 over 3 steps of 0.1 s, and its derivative; a pause adds nothing.
    #[test]
    fn integral_and_derivative() {
        let time_s = [0.0, 0.1, 0.2, 5.0];
        let sum = integral(&time_s, &[2.0; 4]);
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(close(&sum, &[0.0, 0.2, 0.4, 0.4]));
        assert!(close(&derivative(&time_s, &sum), &[0.0, 2.0, 2.0, 0.0]));
    }
}
