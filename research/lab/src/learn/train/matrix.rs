//! Matrices of `f32`, row by row, and their products on the caller's threads.
//!
//! A row is a sample; the product of inputs `batch x in` by the transpose of weights `out x in` is
//! `batch x out`. Products are those of `ndarray`, on one thread each: a product is divided into parts
//! of its rows or columns, and an element has the same bits in any part, so results do not depend on the
//! number of threads.

use std::sync::{Mutex, PoisonError};

use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayView2, ArrayViewMut2, Axis};

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
const LEAST_DIVIDED: usize = 1 << 22;

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

    /// From its rows one after another; `None` if there are not `rows * columns` values.
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

    /// Row `i`; panics if there is none.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f32] {
        &self.values[i * self.columns..(i + 1) * self.columns]
    }

    /// Row `i`; panics if there is none.
    pub fn row_mut(&mut self, i: usize) -> &mut [f32] {
        &mut self.values[i * self.columns..(i + 1) * self.columns]
    }

    /// Each row, also if there are no columns.
    pub fn iter_rows(&self) -> impl Iterator<Item = &[f32]> {
        (0..self.rows).map(|i| self.row(i))
    }

    /// Takes this shape; the elements are unspecified.
    pub fn reshape(&mut self, rows: usize, columns: usize) {
        self.rows = rows;
        self.columns = columns;
        self.values.resize(rows * columns, 0.0);
    }

    /// Takes the shape and the elements of another matrix and keeps its own memory.
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

    /// `self * right`, `m x k` by `k x n`; `None` if the shapes do not fit.
    #[must_use]
    pub fn times(&self, right: &Self, workers: &dyn Workers) -> Option<Self> {
        let mut result = Self::default();
        product((self.view(), right.view()), workers, &mut result).then_some(result)
    }

    /// `self^T * right`, `k x m` and `k x n`; `None` if the shapes do not fit.
    #[must_use]
    pub fn transposed_times(&self, right: &Self, workers: &dyn Workers) -> Option<Self> {
        let mut result = Self::default();
        self.transposed_times_into(right, workers, &mut result)
            .then_some(result)
    }

    /// As [`Self::transposed_times`], in the memory of `result`; whether the shapes fit.
    pub(super) fn transposed_times_into(
        &self,
        right: &Self,
        workers: &dyn Workers,
        result: &mut Self,
    ) -> bool {
        product((self.view().reversed_axes(), right.view()), workers, result)
    }

    /// `self * right^T`, `m x k` and `n x k`; `None` if the shapes do not fit.
    #[must_use]
    pub fn times_transposed(&self, right: &Self, workers: &dyn Workers) -> Option<Self> {
        let mut result = Self::default();
        product(
            (self.view(), right.view().reversed_axes()),
            workers,
            &mut result,
        )
        .then_some(result)
    }

    /// As [`Self::times_transposed`] for evaluation: a single row is multiplied by reading `right` once
    /// instead of rearranging it, so that its sums may be rounded differently.
    pub(super) fn times_transposed_once(
        &self,
        right: &Self,
        workers: &dyn Workers,
    ) -> Option<Self> {
        if self.rows != 1 || self.columns != right.columns {
            return self.times_transposed(right, workers);
        }
        let products = right.view().dot(&self.view().row(0));
        Self::from_rows(1, right.rows, products.to_vec())
    }

    fn view(&self) -> ArrayView2<'_, f32> {
        ArrayView2::from_shape((self.rows, self.columns), &self.values)
            .expect("there are rows times columns values")
    }

    fn view_mut(&mut self) -> ArrayViewMut2<'_, f32> {
        ArrayViewMut2::from_shape((self.rows, self.columns), &mut self.values)
            .expect("there are rows times columns values")
    }
}

/// Whether the shapes fit; if so, the product is in `result`.
fn product(
    (left, right): (ArrayView2<'_, f32>, ArrayView2<'_, f32>),
    workers: &dyn Workers,
    result: &mut Matrix,
) -> bool {
    if left.ncols() != right.nrows() {
        return false;
    }
    let (rows, columns) = (left.nrows(), right.ncols());
    result.reshape(rows, columns);
    let mut result = result.view_mut();
    let work = rows.saturating_mul(columns).saturating_mul(left.ncols());
    if workers.count() < 2 || work < LEAST_DIVIDED {
        general_mat_mul(1.0, &left, &right, 0.0, &mut result);
        return true;
    }
    let by_rows = rows >= columns;
    let axis = Axis(usize::from(!by_rows));
    let length = rows.max(columns).div_ceil(workers.count());
    let parts: Vec<_> = result
        .axis_chunks_iter_mut(axis, length)
        .map(Mutex::new)
        .collect();
    workers.each(parts.len(), &|i| {
        let mut part = parts[i].lock().unwrap_or_else(PoisonError::into_inner);
        let here = i * length..i * length + part.len_of(axis);
        let (mut left, mut right) = (left, right);
        let whole = if by_rows { &mut left } else { &mut right };
        whole.slice_axis_inplace(axis, here.into());
        general_mat_mul(1.0, &left, &right, 0.0, &mut *part);
    });
    true
}
