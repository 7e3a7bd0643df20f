//! The product of two matrices of `f32`, at any strides, on one thread.
//!
//! ```text
//! c_ij = fma(a_i(k-1), b_(k-1)j, .. fma(a_i1, b_1j, fma(a_i0, b_0j, 0)) ..)
//! ```
//!
//! Every element is this one chain, from the first term to the last: blocks, vector widths and
//! threads change when it is worked off, never its bits, and a processor without a fused
//! multiply-add gives the same ones, slowly.
//!
//! Blocked as in K. Goto, R. A. van de Geijn, "Anatomy of high-performance matrix multiplication",
//! ACM Transactions on Mathematical Software 34 (2008): slices of `a` and `b` are copied into
//! panels in the order in which the innermost loop reads them, and that loop keeps its tile of `c`
//! in registers. Rows of `a` whose terms lie side by side are read where they are.

use pulp::{Arch, Simd, WithSimd};

/// Terms of a chain between two visits to `c`: a panel of `b`, two vectors of 16 wide, is then
/// 32 kB, what the first-level cache holds.
const DEPTH: usize = 256;

/// Rows of `a` that are packed at a time: 192 kB with [`DEPTH`], a part of the second-level cache.
/// A multiple of either height of a tile.
const HEIGHT: usize = 192;

/// Numbers of the largest tile: eight rows of two vectors of 16.
const WIDEST_TILE: usize = 256;

/// A matrix within a slice: element `(i, j)` stands at `i * row_stride + j * column_stride`.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) values: &'a [f32],
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) row_stride: usize,
    pub(super) column_stride: usize,
}

impl<'a> View<'a> {
    pub(super) fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }

    /// `count` rows from the `first`.
    pub(super) fn row_range(self, first: usize, count: usize) -> Self {
        Self {
            values: &self.values[first * self.row_stride..],
            rows: count,
            ..self
        }
    }

    /// `count` columns from the `first`.
    pub(super) fn column_range(self, first: usize, count: usize) -> Self {
        self.transposed().row_range(first, count).transposed()
    }

    /// `ROWS` rows from `row`, the terms `start..start + depth` of each, the last row again where
    /// there are no more. Expects terms side by side.
    #[inline(always)]
    fn rows_from<const ROWS: usize>(
        &self,
        row: usize,
        (start, depth): (usize, usize),
    ) -> [&'a [f32]; ROWS] {
        std::array::from_fn(|i| {
            let row = (row + i).min(self.rows - 1);
            &self.values[row * self.row_stride + start..][..depth]
        })
    }

    /// Copies `height` rows from `first`, the terms `start..start + depth` of each, to `panels`:
    /// `width` rows a panel, term by term, and zeros below the last row.
    #[inline(always)]
    fn pack(self, panels: &mut [f32], width: usize, rows: (usize, usize), terms: (usize, usize)) {
        let ((first, height), (start, depth)) = (rows, terms);
        for (number, panel) in panels.chunks_exact_mut(width * depth).enumerate() {
            let row = first + number * width;
            let filled = width.min(first + height - row);
            let corner = row * self.row_stride + start * self.column_stride;
            if filled < width {
                panel.fill(0.0);
            }
            if self.row_stride == 1 {
                for (term, to) in panel.chunks_exact_mut(width).enumerate() {
                    let from = &self.values[corner + term * self.column_stride..];
                    copy(&mut to[..filled], &from[..filled]);
                }
            } else {
                for i in 0..filled {
                    let from = &self.values[corner + i * self.row_stride..];
                    let to = panel[i..].iter_mut().step_by(width);
                    for (to, from) in to.zip(from.iter().step_by(self.column_stride)) {
                        *to = *from;
                    }
                }
            }
        }
    }
}

/// A loop, not `memcpy`: panels are a few numbers wide, and a call would cost more.
#[inline(always)]
fn copy(to: &mut [f32], from: &[f32]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

/// `result = left * right`, row by row, whatever `result` was. Expects shapes that fit, and at
/// least one row, one column and one term.
pub(super) fn multiply(left: View<'_>, right: View<'_>, result: &mut [f32]) {
    Arch::new().dispatch(Multiplication {
        left,
        right,
        result,
    });
}

struct Multiplication<'a> {
    left: View<'a>,
    right: View<'a>,
    result: &'a mut [f32],
}

impl WithSimd for Multiplication<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // Two vectors a row of the tile, two for `b` and one for `a` fit into the registers.
        if S::REGISTER_COUNT >= 32 {
            self.by_tiles::<S, 8>(simd);
        } else {
            self.by_tiles::<S, 6>(simd);
        }
    }
}

impl Multiplication<'_> {
    #[inline(always)]
    fn by_tiles<S: Simd, const ROWS: usize>(mut self, simd: S) {
        let width = 2 * S::F32_LANES;
        let (rows, columns, terms) = (self.left.rows, self.right.columns, self.left.columns);
        let is_packed = self.left.column_stride > 1;
        let deepest = DEPTH.min(terms);
        let mut right = vec![0.0; columns.next_multiple_of(width) * deepest];
        let mut left = Vec::new();
        if is_packed {
            left.resize(HEIGHT.min(rows.next_multiple_of(ROWS)) * deepest, 0.0);
        }
        for start in (0..terms).step_by(DEPTH) {
            let depth = DEPTH.min(terms - start);
            let right = &mut right[..columns.next_multiple_of(width) * depth];
            let across = self.right.transposed();
            across.pack(right, width, (0, columns), (start, depth));
            for top in (0..rows).step_by(HEIGHT) {
                let height = HEIGHT.min(rows - top);
                if is_packed {
                    let left = &mut left[..height.next_multiple_of(ROWS) * depth];
                    self.left.pack(left, ROWS, (top, height), (start, depth));
                }
                for (j, b) in right.chunks_exact(width * depth).enumerate() {
                    for row in (top..top + height).step_by(ROWS) {
                        let at = (row, j * width, start > 0);
                        if is_packed {
                            let a = &left[(row - top) * depth..][..ROWS * depth];
                            let (a, _) = a.as_chunks::<ROWS>();
                            self.one_tile::<S, ROWS>(simd, at, b, |i, p| a[p][i]);
                        } else {
                            let a = self.left.rows_from::<ROWS>(row, (start, depth));
                            self.one_tile::<S, ROWS>(simd, at, b, |i, p| a[i][p]);
                        }
                    }
                }
            }
        }
    }

    /// Starts or continues the chains of the tile at a row and a column: in place, or where it
    /// reaches beyond the last row or column, in a copy.
    #[inline(always)]
    fn one_tile<S: Simd, const ROWS: usize>(
        &mut self,
        simd: S,
        (row, column, is_continued): (usize, usize, bool),
        b: &[f32],
        a: impl Fn(usize, usize) -> f32,
    ) {
        let width = 2 * S::F32_LANES;
        let columns = self.right.columns;
        let filled = ROWS.min(self.left.rows - row);
        let filled_width = width.min(columns - column);
        let corner = &mut self.result[row * columns + column..];
        if filled == ROWS && filled_width == width {
            return tile::<S, ROWS>(simd, (corner, columns), is_continued, b, a);
        }
        let mut edge = [0.0; WIDEST_TILE];
        for i in 0..filled {
            copy(
                &mut edge[i * width..],
                &corner[i * columns..][..filled_width],
            );
        }
        tile::<S, ROWS>(simd, (&mut edge, width), is_continued, b, a);
        for i in 0..filled {
            copy(
                &mut corner[i * columns..][..filled_width],
                &edge[i * width..],
            );
        }
    }
}

/// Starts or continues the chains of `ROWS` rows and two vectors of columns of `c`, whose rows are
/// `stride` apart, by the terms of a panel `b` and `a(row, term)`.
#[inline(always)]
fn tile<S: Simd, const ROWS: usize>(
    simd: S,
    (c, stride): (&mut [f32], usize),
    is_continued: bool,
    b: &[f32],
    a: impl Fn(usize, usize) -> f32,
) {
    let width = 2 * S::F32_LANES;
    let mut sums = [[simd.splat_f32s(0.0); 2]; ROWS];
    if is_continued {
        for i in 0..ROWS {
            let (row, _) = S::as_simd_f32s(&c[i * stride..][..width]);
            sums[i] = [row[0], row[1]];
        }
    }
    let (b, _) = S::as_simd_f32s(b);
    let (b, _) = b.as_chunks::<2>();
    for (p, b) in b.iter().enumerate() {
        for i in 0..ROWS {
            let factor = simd.splat_f32s(a(i, p));
            sums[i][0] = simd.mul_add_f32s(factor, b[0], sums[i][0]);
            sums[i][1] = simd.mul_add_f32s(factor, b[1], sums[i][1]);
        }
    }
    for i in 0..ROWS {
        let (row, _) = S::as_mut_simd_f32s(&mut c[i * stride..][..width]);
        row[0] = sums[i][0];
        row[1] = sums[i][1];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Tiles of 6 x 2 and, on a processor that has them, of 6 x 16 and 8 x 32: the same bits.
    #[test]
    fn vector_widths_do_not_change_a_bit() {
        let (rows, terms, columns) = (13, 300, 37);
        let numbers =
            |n: usize| -> Vec<f32> { (0..n).map(|i| ((i * 7919) % 1013) as f32 / 512.0).collect() };
        let (a, b) = (numbers(rows * terms), numbers(terms * columns));
        let view = |values, rows, columns| View {
            values,
            rows,
            columns,
            row_stride: columns,
            column_stride: 1,
        };
        let (left, right) = (view(&a, rows, terms), view(&b, terms, columns));
        let mut widest = vec![f32::NAN; rows * columns];
        multiply(left, right, &mut widest);
        let mut result = vec![f32::NAN; rows * columns];
        let mut again = |dispatch: &dyn Fn(Multiplication<'_>)| {
            result.fill(f32::NAN);
            dispatch(Multiplication {
                left,
                right,
                result: &mut result,
            });
            assert_eq!(result, widest);
        };
        again(&|product| product.with_simd(pulp::Scalar::new()));
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = pulp::x86::V3::try_new() {
            again(&|product| Simd::vectorize(avx2, product));
        }
    }
}
