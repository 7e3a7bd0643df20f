//! The likelihood by brute force: the full covariance matrix of all samples, no filter.
//!
//! The initial state is unknown; whatever covariance is added to it, the likelihood of the data given that it is unknown
//! stays the same. Here it is zero, and the columns of the state are regressors.

use onecycle_design::Structure;
use onecycle_design::matrix::{Matrix, add, congruent, identity, product, times};
use onecycle_design::state_space::StateSpace;

use super::likelihood::{Memory, evaluate};
use super::orthogonal::Orthogonal;
use super::record::{Blocks, Record};
use super::response::sums;
use super::theta::{NoiseKind, Theta};
use super::vectors::data;

const SKIP_S: f64 = 0.1;
/// Pole of an unstable process (1/s).
const GROWS: f64 = -4.0;

/// Lower triangular root of a covariance matrix.
fn root(a: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut l = vec![vec![0.0; a.len()]; a.len()];
    for i in 0..a.len() {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            l[i][j] = if i == j {
                (a[i][i] - sum).sqrt()
            } else {
                (a[i][j] - sum) / l[j][j]
            };
        }
    }
    l
}

/// Solution of `L x = b`.
fn forward(l: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let mut x: Vec<f64> = Vec::new();
    for i in 0..b.len() {
        let sum: f64 = (0..i).map(|k| l[i][k] * x[k]).sum();
        x.push((b[i] - sum) / l[i][i]);
    }
    x
}

fn log_determinant(l: &[Vec<f64>]) -> f64 {
    2.0 * (0..l.len()).map(|i| l[i][i].ln()).sum::<f64>()
}

/// Covariance of all samples over the variance of the white noise, and the columns of unit initial states.
fn covariance<const N: usize>(
    model: &StateSpace<N>,
    intensity: &Matrix<N>,
    record: &Record,
) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let count = record.len();
    let phi = model.step(record.dt_s).phi;
    let q = model.covariance(intensity, record.dt_s);
    let mut full = vec![vec![0.0; count]; count];
    let mut states = vec![vec![0.0; count]; N];
    let (mut p, mut power) = ([[0.0; N]; N], identity::<N>());
    for k in 0..count {
        let mut column: [f64; N] = std::array::from_fn(|i| p[i][model.output]);
        for l in k..count {
            full[k][l] = column[model.output] + f64::from(u8::from(k == l));
            full[l][k] = full[k][l];
            column = times(&phi, &column);
        }
        (0..N).for_each(|i| states[i][k] = power[model.output][i]);
        power = product(&phi, &power);
        p = congruent(&phi, &p);
        add(&mut p, &q);
    }
    (full, states)
}

/// Logarithm of the likelihood and the gain.
fn brute_force<const N: usize>(record: &Record, theta: &Theta, samples: usize) -> (f64, f64) {
    let model = StateSpace::<N>::new(&theta.process(1.0));
    let behind = theta.structure.stages().behind_the_lags() as i32;
    let [w1, w0, wy] = NoiseKind::ALL.map(|kind| theta.noise(kind));
    let mut intensity = [[0.0; N]; N];
    intensity[N - 1][N - 1] = record.dt_s * w1.powi(2 * behind + 2);
    let entry = model.entry.iter().position(|v| *v > 0.0).unwrap();
    intensity[entry][entry] += record.dt_s * w0.powi(2 * behind);
    intensity[model.output][model.output] += record.dt_s * wy * wy;
    let (full, states) = covariance(&model, &intensity, record);
    let every = Record {
        present: vec![true; record.len()],
        ..record.clone()
    };
    let g = sums(&model, &Blocks::new(&every, 1, 0.0), theta.tau_s());
    // The unit of the flat prior: an unstable pole is mirrored.
    let mirrored = StateSpace::<N>::new(&theta.mirrored().process(1.0));
    let (_, of_prior) = covariance(&mirrored, &intensity, record);
    let g_of_prior = sums(&mirrored, &Blocks::new(&every, 1, 0.0), theta.tau_s());
    // Rows: sums of the samples present in a block.
    let first = record.index_at(SKIP_S);
    let rows: Vec<Vec<usize>> = (0..(record.len() - first) / samples)
        .map(|b| {
            (first + b * samples..first + (b + 1) * samples)
                .filter(|k| record.present[*k])
                .collect()
        })
        .filter(|row: &Vec<usize>| !row.is_empty())
        .collect();
    let summed = |column: &[f64]| -> Vec<f64> {
        rows.iter()
            .map(|row| row.iter().map(|k| column[*k]).sum())
            .collect()
    };
    let s: Vec<Vec<f64>> = (rows.iter())
        .map(|a| {
            let entry =
                |b: &Vec<usize>| a.iter().flat_map(|k| b.iter().map(|l| full[*k][*l])).sum();
            rows.iter().map(entry).collect()
        })
        .collect();
    let l = root(&s);
    let y = forward(&l, &summed(&record.output));
    let with = |g: Vec<f64>, states: Vec<Vec<f64>>| -> Vec<Vec<f64>> {
        let columns = std::iter::once(g).chain(states);
        columns.map(|column| summed(&column)).collect()
    };
    let (columns, of_prior) = (with(g, states), with(g_of_prior, of_prior));
    let white: Vec<Vec<f64>> = columns.iter().map(|column| forward(&l, column)).collect();
    // Gram-Schmidt and not normal equations, whose rounding would be larger than the difference to be tested.
    let white = Orthogonal::new(&white).unwrap();
    let (residual, coefficients) = white.solve(&y);
    let freedom = (rows.len() - columns.len()) as f64;
    let variance = residual.iter().map(|v| v * v).sum::<f64>() / freedom;
    let before = Orthogonal::new(&of_prior).unwrap().log_determinant();
    let determinants = log_determinant(&l) + 2.0 * (white.log_determinant() - before);
    let two_pi = std::f64::consts::TAU;
    let likelihood = -0.5 * (freedom * (two_pi * variance).ln() + freedom + determinants);
    // The prior is one of the state at the first row, until which a mirrored pole decays and does not grow.
    let pole = |theta: &Theta| theta.process(1.0).pole_per_s();
    let until = (pole(&theta.mirrored()) - pole(theta)) * SKIP_S;
    (likelihood + until, coefficients[0])
}

// Each structure, stable or growing, with each noise, with one and four samples a row, with and without absent samples: to 1e-6.
#[test]
fn the_filter_gives_the_likelihood_of_the_full_covariance() {
    use Structure::{
        DoubleIntegratorLag, Foptd, IntegratorLag, Iptd, ResonantLag, Soiptd, Soptd, Toiptd,
    };
    let ln = f64::ln;
    let cases: [(Structure, Vec<f64>); 10] = [
        (Iptd, vec![]),
        (Foptd, vec![3.0]),
        (IntegratorLag, vec![ln(0.05)]),
        (Soptd, vec![ln(0.05), 2.0]),
        (DoubleIntegratorLag, vec![ln(0.05)]),
        (Soiptd, vec![ln(0.05), 0.5]),
        (Toiptd, vec![ln(0.05), ln(0.02), 0.4]),
        (ResonantLag, vec![ln(0.05), 1.0, 30.0]),
        (Foptd, vec![GROWS]),
        (Soptd, vec![ln(0.05), GROWS]),
    ];
    for (structure, process) in cases {
        for noises in [
            [3.0, 0.0, 0.0],
            [0.0, 4.0, 0.0],
            [2.0, 2.0, 0.0],
            [0.0, 0.0, 5.0],
            [0.0; 3],
        ] {
            let grows = process.last() == Some(&GROWS);
            // Without an integrator the walk of the output is a state of its own. Nothing that acts on the process keeps the
            // filter of one that grows stable.
            let is_left_out = noises[2] > 0.0 || grows && noises == [0.0; 3];
            if is_left_out && structure.stages().integrators == 0 {
                continue;
            }
            let mut theta = Theta::new(structure);
            theta.grows = grows;
            theta.values[..process.len()].copy_from_slice(&process);
            theta.values[theta.layout().tau()] = 0.033;
            for (kind, frequency) in NoiseKind::ALL.into_iter().zip(noises) {
                theta.set_noise(kind, frequency);
            }
            for (samples, absent) in [(1, &[][..]), (4, &[37, 60, 61][..])] {
                let mut record = data(120);
                absent
                    .iter()
                    .for_each(|k: &usize| record.present[*k] = false);
                let blocks = Blocks::new(&record, samples, SKIP_S);
                let found = evaluate(&blocks, &theta, &mut Memory::default()).unwrap();
                let (likelihood, gain) = match structure.stages().states() + 1 {
                    2 => brute_force::<2>(&record, &theta, samples),
                    3 => brute_force::<3>(&record, &theta, samples),
                    4 => brute_force::<4>(&record, &theta, samples),
                    _ => brute_force::<5>(&record, &theta, samples),
                };
                let case = format!("{} {noises:?} {samples}", structure.name());
                let error = (found.log_likelihood_in_output_units - likelihood).abs();
                assert!(error < 1e-6 * likelihood.abs(), "{case}: {error}");
                assert!((found.gain / gain - 1.0).abs() < 1e-6, "{case}: {gain}");
            }
        }
    }
}
