//! The product of a few rows by the transpose of a matrix of `f32`: a network asked about one sample,
//! or a handful.
//!
//! ```text
//! s_l  = fma chain of a_ip b_jp over p = l, l + 32, l + 64, ..           l = 0..31
//! c_ij = s_0 + .. + s_31, in halves: s_l + s_(l+16), of those l and l + 8, and so on
//! ```
//!
//! Where a matrix of weights meets one row, every weight is read for a single multiply-add, and the
//! time is that of reading them. One chain would wait for each addition instead; 32 do not, on
//! vectors of any width up to 16, and a few rows of weights at a time keep more reads under way.
//! The order is fixed, so vector widths, threads and the number of rows never change a bit; the
//! bits are not those of the one chain in `kernel`, which many rows share.

use std::sync::{Mutex, PoisonError};

use pulp::{Arch, Scalar, Simd, WithSimd};

use super::matrix::{LEAST_DIVIDED, Matrix};
use crate::workers::Workers;

/// Chains of a sum: two vectors of 16.
const CHAINS: usize = 32;

/// Most rows that are few: the tiles of `kernel` are 16 or 32 columns wide, filled or not, and a
/// row's chains here cost some two of those columns.
pub(super) const FEW: usize = 8;

/// `few * weights^T`, `m x k` and `n x k`; `None` where the shapes do not fit.
pub(super) fn times_transposed(
    few: &Matrix,
    weights: &Matrix,
    workers: &dyn Workers,
) -> Option<Matrix> {
    if few.columns() != weights.columns() {
        return None;
    }
    let (rows, terms, outputs) = (few.rows(), few.columns(), weights.rows());
    // Transposed, so that whoever has some of the weights has its elements side by side.
    let mut result = Matrix::zeros(outputs, rows);
    if result.values().is_empty() || terms == 0 {
        return Some(Matrix::zeros(rows, outputs));
    }
    let work = rows.saturating_mul(outputs).saturating_mul(terms);
    let parts = match workers.count() {
        count if count < 2 || work < LEAST_DIVIDED => 1,
        count => count.min(outputs),
    };
    let part = outputs.div_ceil(parts);
    let blocks: Vec<_> = (result.values_mut().chunks_mut(part * rows))
        .zip(weights.values().chunks(part * terms))
        .map(|(result, weights)| {
            Mutex::new(Products {
                few: few.values(),
                weights,
                terms,
                result,
            })
        })
        .collect();
    let multiply = |i: usize| {
        let mut block = blocks[i].lock().unwrap_or_else(PoisonError::into_inner);
        Arch::new().dispatch(&mut *block);
    };
    if let [_] = blocks[..] {
        multiply(0);
    } else {
        workers.each(blocks.len(), &multiply);
    }
    drop(blocks);
    Some(result.transposed())
}

/// Some rows of weights with every one of the few.
struct Products<'a> {
    few: &'a [f32],
    weights: &'a [f32],
    terms: usize,
    /// For each row of weights, an element for each of the few.
    result: &'a mut [f32],
}

impl WithSimd for &mut Products<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // As many sums as there are registers for, the vectors of both factors besides.
        match S::F32_LANES {
            16 => self.by_rows::<S, 4, 2>(simd),
            8 => self.by_rows::<S, 2, 4>(simd),
            4 => self.by_rows::<S, 2, 8>(simd),
            _ => self.by_rows::<Scalar, 1, CHAINS>(Scalar::new()),
        }
    }
}

impl Products<'_> {
    /// `ROWS` rows of weights at a time; `VECTORS` make up the chains.
    #[inline(always)]
    fn by_rows<S: Simd, const ROWS: usize, const VECTORS: usize>(&mut self, simd: S) {
        let count = self.few.len() / self.terms;
        let rows = self.weights.chunks(ROWS * self.terms);
        for (weights, result) in rows.zip(self.result.chunks_mut(ROWS * count)) {
            // The last row again where there are no more.
            let last = weights.len() / self.terms - 1;
            let weights: [&[f32]; ROWS] =
                std::array::from_fn(|row| &weights[row.min(last) * self.terms..][..self.terms]);
            for (i, few) in self.few.chunks_exact(self.terms).enumerate() {
                let sums = dots::<S, ROWS, VECTORS>(simd, &weights, few);
                for (result, sum) in result.chunks_exact_mut(count).zip(sums) {
                    result[i] = sum;
                }
            }
        }
    }
}

/// The dot products of `ROWS` rows with one, all as long.
#[inline(always)]
fn dots<S: Simd, const ROWS: usize, const VECTORS: usize>(
    simd: S,
    rows: &[&[f32]; ROWS],
    one: &[f32],
) -> [f32; ROWS] {
    let mut sums = [[simd.splat_f32s(0.0); VECTORS]; ROWS];
    let (whole, rest) = one.as_chunks::<CHAINS>();
    let wholes: [&[[f32; CHAINS]]; ROWS] =
        std::array::from_fn(|row| &rows[row].as_chunks().0[..whole.len()]);
    for (p, one) in whole.iter().enumerate() {
        for row in 0..ROWS {
            go_on::<S, VECTORS>(simd, &mut sums[row], one, &wholes[row][p]);
        }
    }
    if !rest.is_empty() {
        let one = filled_up(rest);
        for row in 0..ROWS {
            let row_rest = filled_up(&rows[row][rows[row].len() - rest.len()..]);
            go_on::<S, VECTORS>(simd, &mut sums[row], &one, &row_rest);
        }
    }
    sums.map(|sums| {
        let mut chains = [0.0; CHAINS];
        let (vectors, _) = S::as_mut_simd_f32s(&mut chains);
        vectors.copy_from_slice(&sums);
        in_halves(chains)
    })
}

/// One more term for every chain.
#[inline(always)]
fn go_on<S: Simd, const VECTORS: usize>(
    simd: S,
    sums: &mut [S::f32s; VECTORS],
    a: &[f32; CHAINS],
    b: &[f32; CHAINS],
) {
    let ((a, _), (b, _)) = (S::as_simd_f32s(a), S::as_simd_f32s(b));
    for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
        *sum = simd.mul_add_f32s(*a, *b, *sum);
    }
}

/// Zeros behind the terms that are left.
#[inline(always)]
fn filled_up(rest: &[f32]) -> [f32; CHAINS] {
    let mut terms = [0.0; CHAINS];
    terms[..rest.len()].copy_from_slice(rest);
    terms
}

#[inline(always)]
fn in_halves(mut chains: [f32; CHAINS]) -> f32 {
    let mut width = CHAINS / 2;
    while width > 0 {
        for l in 0..width {
            chains[l] += chains[l + width];
        }
        width /= 2;
    }
    chains[0]
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::learn::train::matrix::tests::{Threads, random};
    use crate::learn::train::{Layer, Network};
    use crate::workers::OneThread;

    // 1/2 (1 + 2 + .. + 70) = 1242.5: halves of whole numbers, exact in any order.
    #[test]
    fn whole_numbers_are_exact() {
        let few = Matrix::from_rows(1, 70, (1..=70).map(|i| i as f32).collect()).unwrap();
        let weights = Matrix::from_rows(2, 70, [[0.5; 70], [-1.0; 70]].concat()).unwrap();
        let product = times_transposed(&few, &weights, &OneThread).unwrap();
        assert_eq!(product.values(), [1242.5, -2485.0]);
    }

    // Each order is off by a random walk of k roundings (6e-8) of partial sums of some sqrt(k)/3, so
    // by 6e-8 k/3 where the magnitudes add up to k/4: 1e-7 of them. A term left out is 1/k.
    #[test]
    fn as_in_the_general_product() {
        for (rows, terms, outputs) in [
            (1, 1, 1),
            (1, 31, 3),
            (1, 32, 4),
            (1, 33, 5),
            (2, 64, 9),
            (8, 100, 13),
            (3, 4520, 7),
        ] {
            let (few, weights) = (random(rows, terms, 1), random(outputs, terms, 2));
            let general = few.times_transposed(&weights, &OneThread).unwrap();
            let found = times_transposed(&few, &weights, &OneThread).unwrap();
            assert_eq!((found.rows(), found.columns()), (rows, outputs));
            for i in 0..rows {
                for j in 0..outputs {
                    let magnitude: f32 = (few.row(i).iter().zip(weights.row(j)))
                        .map(|(a, b)| (a * b).abs())
                        .sum();
                    let difference = (found.row(i)[j] - general.row(i)[j]).abs();
                    assert!(
                        difference <= 1e-6 * magnitude,
                        "{rows} {terms} {outputs}: {difference}"
                    );
                }
            }
        }
    }

    // 32 scalars, 4 vectors of 8 or 2 of 16, in tiles of other heights: the same bits.
    #[test]
    fn vector_widths_do_not_change_a_bit() {
        let (terms, outputs) = (203, 7);
        let (few, weights) = (random(2, terms, 3), random(outputs, terms, 4));
        let mut result = vec![f32::NAN; 2 * outputs];
        let mut with = |dispatch: &dyn Fn(&mut Products<'_>)| {
            result.fill(f32::NAN);
            dispatch(&mut Products {
                few: few.values(),
                weights: weights.values(),
                terms,
                result: &mut result,
            });
            result.clone()
        };
        let widest = with(&|products| Arch::new().dispatch(products));
        assert!(widest.iter().all(|value| value.is_finite()));
        assert_eq!(with(&|products| products.with_simd(Scalar::new())), widest);
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = pulp::x86::V3::try_new() {
            assert_eq!(with(&|products| Simd::vectorize(avx2, products)), widest);
        }
    }

    // 1 x 2100 x 2001 is divided, into unequal parts; two rows together are as each alone.
    #[test]
    fn threads_and_company_do_not_change_a_bit() {
        let (few, weights) = (random(2, 2100, 5), random(2001, 2100, 6));
        const { assert!(2001 * 2100 > LEAST_DIVIDED) };
        let together = times_transposed(&few, &weights, &OneThread);
        assert!(together.is_some());
        for count in [2, 3, 64] {
            assert_eq!(times_transposed(&few, &weights, &Threads(count)), together);
        }
        for (i, row) in few.iter_rows().enumerate() {
            let one = Matrix::from_rows(1, 2100, row.to_vec()).unwrap();
            let alone = times_transposed(&one, &weights, &Threads(2)).unwrap();
            assert_eq!(alone.row(0), together.as_ref().unwrap().row(i));
        }
    }

    // Nine samples take the general path, fewer this one: two layers of some 6e-8 each.
    #[test]
    fn networks_evaluate_few_samples_as_many() {
        let kinds = [
            Layer::Dense { outputs: 40 },
            Layer::Tanh,
            Layer::Dense { outputs: 3 },
        ];
        let network = Network::new(70, &kinds, &mut Pcg64Mcg::seed_from_u64(7)).unwrap();
        let samples = random(FEW + 1, 70, 8);
        let first = |count: usize| {
            let values = samples.values()[..count * 70].to_vec();
            let samples = Matrix::from_rows(count, 70, values).unwrap();
            network.evaluate(&samples, &OneThread).unwrap()
        };
        let (one, few, many) = (first(1), first(FEW), first(FEW + 1));
        assert_eq!(one.row(0), few.row(0));
        for (few, many) in few.values().iter().zip(many.values()) {
            assert!(
                (few - many).abs() <= 1e-5 * many.abs().max(1.0),
                "{few} {many}"
            );
        }
        assert_ne!(few.values(), &many.values()[..FEW * 3]);
    }

    #[test]
    fn shapes_at_the_edge() {
        let two = Matrix::zeros(2, 3);
        assert_eq!(
            times_transposed(&two, &Matrix::zeros(1, 2), &OneThread),
            None
        );
        let of_nothing = times_transposed(&Matrix::zeros(2, 0), &Matrix::zeros(3, 0), &OneThread);
        assert_eq!(of_nothing, Some(Matrix::zeros(2, 3)));
        let none = times_transposed(&Matrix::zeros(0, 3), &two, &OneThread);
        assert_eq!(none, Some(Matrix::zeros(0, 2)));
    }
}
