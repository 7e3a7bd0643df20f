//! Matrices of `f32`, row by row, and their products on as many threads as the caller has.
//!
//! A row is a sample; a product of `batch x in` by the transpose of `out x in` weights is
//! `batch x out`. Products have the same bits on any number of threads: every element is one chain
//! of fused multiply-adds in the order of its terms; `few_rows` has another order, as fixed.

use std::sync::{Mutex, PoisonError};

use super::kernel::{View, multiply};
use crate::workers::Workers;

/// A matrix, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    rows: usize,
    columns: usize,
    values: Vec<f32>,
}

/// Multiply-adds below which a product is not divided: some 0.1 ms on one thread, ten times what
/// handing over a part costs.
pub(super) const LEAST_DIVIDED: usize = 1 << 22;

/// Parts are multiples of this many rows or columns, so that none but the last has a ragged edge:
/// two vectors of 16, and four tiles of eight rows.
const PART_MULTIPLE: usize = 32;

/// Rows transposed at a time: a cache line of 64 bytes in the result.
const BAND: usize = 16;

impl Matrix {
    /// Zeros.
    #[must_use]
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            values: vec![0.0; rows * columns],
        }
    }

    /// From its rows one after another; `None` where their number is not `rows * columns`.
    #[must_use]
    pub fn from_rows(rows: usize, columns: usize, values: Vec<f32>) -> Option<Self> {
        (rows.checked_mul(columns) == Some(values.len())).then_some(Self {
            rows,
            columns,
            values,
        })
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// All elements, row by row.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// All elements, row by row.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// Row `i` of those there are.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f32] {
        &self.values[i * self.columns..(i + 1) * self.columns]
    }

    /// Row `i` of those there are.
    pub fn row_mut(&mut self, i: usize) -> &mut [f32] {
        &mut self.values[i * self.columns..(i + 1) * self.columns]
    }

    /// Each row, also where there are no columns.
    pub fn iter_rows(&self) -> impl Iterator<Item = &[f32]> {
        (0..self.rows).map(|i| self.row(i))
    }

    /// Takes this shape; what the elements are is left open.
    pub fn reshape(&mut self, rows: usize, columns: usize) {
        self.rows = rows;
        self.columns = columns;
        self.values.resize(rows * columns, 0.0);
    }

    /// Takes the shape and the elements of another, in the memory there is.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.reshape(other.rows, other.columns);
        self.values.copy_from_slice(&other.values);
    }

    /// Sum of every column, in `f64`.
    pub(super) fn column_sums(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.columns];
        for row in self.iter_rows() {
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum += f64::from(*value);
            }
        }
        sums
    }

    /// `self * right`, `m x k` by `k x n`; `None` where the shapes do not fit.
    #[must_use]
    pub fn times(&self, right: &Self, workers: &dyn Workers) -> Option<Self> {
        let mut result = Self::default();
        product((self.view(), right.view()), workers, &mut result).then_some(result)
    }

    /// `self^T * right`, `k x m` and `k x n`; `None` where the shapes do not fit.
    #[must_use]
    pub fn transposed_times(&self, right: &Self, workers: &dyn Workers) -> Option<Self> {
        let mut result = Self::default();
        self.transposed_times_into(right, workers, &mut result)
            .then_some(result)
    }

    /// As [`Self::transposed_times`], in the memory of another matrix; whether the shapes fit.
    pub(super) fn transposed_times_into(
        &self,
        right: &Self,
        workers: &dyn Workers,
        result: &mut Self,
    ) -> bool {
        product((self.view().transposed(), right.view()), workers, result)
    }

    /// `self * right^T`, `m x k` and `n x k`; `None` where the shapes do not fit.
    ///
    /// Worked out as the transpose of `right * self^T`: that reads the weights of a layer, `n x k`,
    /// once and where they are.
    #[must_use]
    pub fn times_transposed(&self, right: &Self, workers: &dyn Workers) -> Option<Self> {
        let mut result = Self::default();
        product(
            (right.view(), self.view().transposed()),
            workers,
            &mut result,
        )
        .then(|| result.transposed())
    }

    pub(super) fn transposed(&self) -> Self {
        let mut result = Self::zeros(self.columns, self.rows);
        if self.rows > 0 && self.columns > 0 {
            // By bands of rows, so that what is written to stays in the cache.
            for (band, rows) in self.values.chunks(BAND * self.columns).enumerate() {
                for (j, to) in result.values.chunks_mut(self.rows).enumerate() {
                    let from = rows[j..].iter().step_by(self.columns);
                    for (to, from) in to[band * BAND..].iter_mut().zip(from) {
                        *to = *from;
                    }
                }
            }
        }
        result
    }

    fn view(&self) -> View<'_> {
        View {
            values: &self.values,
            rows: self.rows,
            columns: self.columns,
            row_stride: self.columns,
            column_stride: 1,
        }
    }
}

/// Whether the shapes fit.
fn product(
    (left, right): (View<'_>, View<'_>),
    workers: &dyn Workers,
    result: &mut Matrix,
) -> bool {
    if left.columns != right.rows {
        return false;
    }
    let (rows, columns, terms) = (left.rows, right.columns, left.columns);
    result.reshape(rows, columns);
    if rows == 0 || columns == 0 || terms == 0 {
        result.values.fill(0.0);
        return true;
    }
    let count = workers.count();
    let work = rows.saturating_mul(columns).saturating_mul(terms);
    if count < 2 || work < LEAST_DIVIDED {
        multiply(left, right, &mut result.values);
    } else if rows >= columns {
        let part = rows.div_ceil(count).next_multiple_of(PART_MULTIPLE);
        let blocks: Vec<_> = (result.values.chunks_mut(part * columns))
            .map(Mutex::new)
            .collect();
        workers.each(blocks.len(), &|i| {
            let mut block = blocks[i].lock().unwrap_or_else(PoisonError::into_inner);
            let here = block.len() / columns;
            multiply(left.row_range(i * part, here), right, &mut block);
        });
    } else {
        let part = columns.div_ceil(count).next_multiple_of(PART_MULTIPLE);
        let blocks: Vec<_> = (0..columns.div_ceil(part))
            .map(|i| Mutex::new(Matrix::zeros(rows, part.min(columns - i * part))))
            .collect();
        workers.each(blocks.len(), &|i| {
            let mut block = blocks[i].lock().unwrap_or_else(PoisonError::into_inner);
            let right = right.column_range(i * part, block.columns);
            multiply(left, right, &mut block.values);
        });
        for (i, block) in blocks.into_iter().enumerate() {
            let block = block.into_inner().unwrap_or_else(PoisonError::into_inner);
            for row in 0..rows {
                result.row_mut(row)[i * part..][..block.columns].copy_from_slice(block.row(row));
            }
        }
    }
    true
}

#[cfg(test)]
pub(crate) mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::workers::OneThread;

    /// As many threads as it says.
    pub(crate) struct Threads(pub(crate) usize);

    impl Workers for Threads {
        fn count(&self) -> usize {
            self.0
        }

        fn each(&self, parts: usize, part: &(dyn Fn(usize) + Sync)) {
            std::thread::scope(|scope| {
                for i in 0..parts {
                    scope.spawn(move || part(i));
                }
            });
        }
    }

    pub(crate) fn random(rows: usize, columns: usize, seed: u64) -> Matrix {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let values = (0..rows * columns).map(|_| rng.random_range(-1.0..1.0));
        Matrix::from_rows(rows, columns, values.collect()).unwrap()
    }

    // Each element is the chain the kernel promises: bit for bit, at every edge of tile and block.
    #[test]
    fn elements_are_chains_of_fused_multiply_adds() {
        for (rows, terms, columns) in [
            (1, 1, 1),
            (1, 0, 3),
            (3, 5, 7),
            (8, 256, 32),
            (9, 257, 33),
            (6, 255, 16),
            (193, 513, 65),
            (128, 66, 9),
        ] {
            let (a, b) = (random(rows, terms, 1), random(terms, columns, 2));
            let mut expected = Matrix::zeros(rows, columns);
            for i in 0..rows {
                for j in 0..columns {
                    expected.row_mut(i)[j] =
                        (0..terms).fold(0.0, |sum, p| a.row(i)[p].mul_add(b.row(p)[j], sum));
                }
            }
            assert_eq!(a.times(&b, &OneThread).as_ref(), Some(&expected));
            let a_t = a.transposed();
            assert_eq!(
                a_t.transposed_times(&b, &OneThread).as_ref(),
                Some(&expected)
            );
            let b_t = b.transposed();
            assert_eq!(a.times_transposed(&b_t, &OneThread), Some(expected));
        }
    }

    // Divided by rows (first) and by columns (second), into parts of unequal size.
    #[test]
    fn threads_do_not_change_a_bit() {
        for (rows, columns) in [(300, 128), (128, 300)] {
            let (a, b) = (random(rows, 130, 3), random(130, columns, 4));
            assert!(rows * columns * 130 > LEAST_DIVIDED);
            let alone = a.times(&b, &OneThread);
            assert!(alone.is_some());
            for count in [2, 3, 64] {
                assert_eq!(a.times(&b, &Threads(count)), alone);
            }
        }
    }

    #[test]
    fn shapes_that_do_not_fit_have_no_product() {
        let a = Matrix::zeros(2, 3);
        assert_eq!(a.times(&a, &OneThread), None);
        assert_eq!(a.transposed_times(&Matrix::zeros(3, 1), &OneThread), None);
        assert_eq!(a.times_transposed(&Matrix::zeros(1, 2), &OneThread), None);
        assert_eq!(Matrix::from_rows(2, 2, vec![0.0; 3]), None);
    }
}
