//! Products of matrices: exact where sums are exact, the same bits on any number of threads.

use onecycle_lab::learn::train::{Layer, Matrix, Network};
use onecycle_lab::workers::{OneThread, Workers};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::dense;
use crate::common::Threads;

fn filled(rows: usize, columns: usize, mut value: impl FnMut() -> f32) -> Matrix {
    let values = (0..rows * columns).map(|_| value());
    Matrix::from_rows(rows, columns, values.collect()).unwrap()
}

fn drawn(rows: usize, columns: usize, seed: u64) -> Matrix {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    filled(rows, columns, || rng.random_range(-1.0..1.0))
}

fn transposed(matrix: &Matrix) -> Matrix {
    let mut result = Matrix::zeros(matrix.columns(), matrix.rows());
    for (i, row) in matrix.iter_rows().enumerate() {
        for (j, value) in row.iter().enumerate() {
            result.row_mut(j)[i] = *value;
        }
    }
    result
}

// Whole numbers up to 8: sums of 600 products stay below 2^16 and are exact in any order.
#[test]
fn products_of_whole_numbers_are_exact() {
    for (rows, terms, columns) in [
        (1, 1, 1),
        (1, 0, 3),
        (0, 3, 2),
        (3, 5, 7),
        (8, 256, 32),
        (9, 257, 33),
        (193, 600, 65),
        (300, 130, 128),
    ] {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let mut whole = || f32::from(rng.random_range(-8..=8_i8));
        let (a, b) = (
            filled(rows, terms, &mut whole),
            filled(terms, columns, &mut whole),
        );
        let mut expected = Matrix::zeros(rows, columns);
        for i in 0..rows {
            for j in 0..columns {
                expected.row_mut(i)[j] = (0..terms).map(|p| a.row(i)[p] * b.row(p)[j]).sum();
            }
        }
        let expected = Some(expected);
        for workers in [&OneThread as &dyn Workers, &Threads(2)] {
            assert_eq!(a.times(&b, workers), expected);
            assert_eq!(transposed(&a).transposed_times(&b, workers), expected);
            assert_eq!(a.times_transposed(&transposed(&b), workers), expected);
        }
    }
}

// Both products have more than 2^22 multiply-adds; the first is split by rows, the second by columns,
// into parts of unequal size.
#[test]
fn threads_do_not_change_a_bit() {
    for (rows, columns) in [(300, 128), (128, 300)] {
        let (a, b) = (drawn(rows, 130, 3), drawn(130, columns, 4));
        assert!(rows * columns * 130 > 1 << 22);
        let alone = a.times(&b, &OneThread);
        assert!(alone.is_some());
        for count in [2, 3, 64] {
            assert_eq!(a.times(&b, &Threads(count)), alone);
        }
    }
}

// One sample takes its own path through a layer, several samples the general one. Two layers of sums of
// 70 and 40 terms of the order of 1, each rounded to about 6e-8.
#[test]
fn one_sample_evaluates_as_several_do() {
    let kinds = [dense(40), Layer::Tanh, dense(3)];
    let network = Network::new(70, &kinds, &mut Pcg64Mcg::seed_from_u64(7)).unwrap();
    let samples = drawn(9, 70, 8);
    let first = |count: usize| {
        let values = samples.values()[..count * 70].to_vec();
        let samples = Matrix::from_rows(count, 70, values).unwrap();
        network.evaluate(&samples, &OneThread).unwrap()
    };
    let (one, two, all) = (first(1), first(2), first(9));
    assert_eq!(two.row(0), all.row(0));
    for (one, of_all) in one.values().iter().zip(all.row(0)) {
        assert!(
            (one - of_all).abs() <= 1e-5 * of_all.abs().max(1.0),
            "{one} {of_all}"
        );
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
