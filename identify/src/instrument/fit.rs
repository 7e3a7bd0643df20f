//! Fit of a structure to cross-spectra, and the posterior about it.
//!
//! Minimises the sum of the squared errors of [`Bin::errors`], in which the deviations move with the response
//! (continuously updated). Its excess over the minimum tests a process; at the true process the sum is chi-squared. Both hold
//! for a set-point that hardly moves the input, where the ratio of the spectra is biased towards the controller.
//! References: T. W. Anderson, H. Rubin, Ann. Math. Stat. 20 (1949); L. P. Hansen, J. Heaton, A. Yaron, J. Bus. Econ. Stat.
//! 14 (1996); J. H. Stock, J. H. Wright, Econometrica 68 (2000).
//!
//! [`Bin::errors`]: super::spectra::Bin::errors

use std::ops::Range;

use num_complex::Complex64;
use onecycle_design::matrix::{cholesky, identity};
use onecycle_design::{Linear, Structure};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::spectra::Spectra;
use crate::descent::{LeastSquares, Normal, Patience, descend};

/// Most unknowns: gain, two lags or a lag and a pair, a pole, dead time.
const MOST: usize = 6;
/// Starts from which a structure is fitted.
const MOST_STARTS: usize = 10;
const PATIENCE: Patience = Patience {
    steps: 60,
    decrease: 1e-7,
};
/// Largest change of a gain's logarithm: the errors of a response of any gain are finite.
const FARTHEST: f64 = 5.0;
/// Steps of the chain that are not used, and that are.
const BURN_IN: usize = 2000;
const CHAIN: usize = 16_000;
const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// Unknowns in their coordinates: logarithm of the gain's size, of the lags, pole, second-order stage, dead time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    structure: Structure,
    sign: f64,
    values: [f64; MOST],
}

impl Point {
    fn count(structure: Structure) -> usize {
        let stages = structure.stages();
        2 + stages.lags + stages.poles + 2 * stages.pairs
    }

    /// Unknowns that are not below zero.
    fn poles_and_pairs(&self) -> Range<usize> {
        let stages = self.structure.stages();
        let first = 1 + stages.lags;
        first..first + stages.poles + 2 * stages.pairs
    }

    pub(super) fn process(&self) -> Linear {
        let stages = self.structure.stages();
        let mut values = self.values.iter().copied();
        let mut next = || values.next().unwrap_or(0.0);
        let gain = self.sign * next().exp();
        let mut lags_s = [1.0; 2];
        for lag in &mut lags_s[..stages.lags] {
            *lag = next().exp();
        }
        let mut process = Linear::new(self.structure)
            .with_gain(gain)
            .with_lags_s(lags_s);
        if stages.poles > 0 {
            process = process.with_pole_per_s(next());
        }
        if stages.pairs > 0 {
            process = process.with_pair(next(), next());
        }
        process.with_tau_s(next())
    }
}

/// Structure with its best point.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) point: Point,
    /// Sum of the squared errors.
    pub(super) cost: f64,
}

impl Candidate {
    pub(super) fn structure(&self) -> Structure {
        self.point.structure
    }

    /// Degrees of freedom of the sum.
    pub(super) fn freedom(&self, spectra: &Spectra) -> f64 {
        2.0 * spectra.bins.len() as f64 - Point::count(self.structure()) as f64
    }
}

/// Spectra with what lies between the process and the recorded signals.
pub(super) struct Problem<'a> {
    pub(super) spectra: &'a Spectra,
    /// Response of hold and filter at each frequency.
    pub(super) around: Vec<Complex64>,
}

impl Problem<'_> {
    /// Errors at every frequency.
    pub(super) fn errors(&self, process: &Linear) -> Vec<f64> {
        let bins = self.spectra.bins.iter().zip(&self.around);
        bins.flat_map(|(bin, around)| {
            bin.errors(process.frequency_response(bin.omega_rad_per_s) * around)
        })
        .collect()
    }

    /// Sum of the squared errors; infinite for a process without a response.
    pub(super) fn cost(&self, process: &Linear) -> f64 {
        let sum: f64 = self.errors(process).iter().map(|error| error * error).sum();
        if sum.is_finite() { sum } else { f64::INFINITY }
    }

    /// The best fit of a structure, which starts from fits of others too. `None` if no start has a response.
    pub(super) fn fit(&self, structure: Structure, others: &[Candidate]) -> Option<Candidate> {
        let from_others = others
            .iter()
            .map(|other| self.lifted(&other.point, structure));
        let all = from_others.chain(self.starts(structure));
        let mut starts: Vec<Candidate> = all
            .map(|point| Candidate {
                cost: self.cost(&point.process()),
                point,
            })
            .filter(|start| start.cost.is_finite())
            .collect();
        starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        starts.truncate(MOST_STARTS);
        let ends = starts.into_iter().map(|start| {
            let mut descent = Descent {
                problem: self,
                from: start.point,
            };
            descend(&mut descent, start, PATIENCE)
        });
        ends.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// A point of `structure` near another structure's: lags that it lacks are short, and poles slow.
    fn lifted(&self, from: &Point, structure: Structure) -> Point {
        let (low, high) = self.spectra.band_rad_per_s();
        let (own, other) = (structure.stages(), from.structure.stages());
        let mut values = vec![from.values[0]];
        let known = &from.values[1..=other.lags];
        values.extend(
            (0..own.lags).map(|lag| known.get(lag).copied().unwrap_or(-(10.0 * high).ln())),
        );
        if own.poles > 0 {
            values.push(from.process().pole_per_s().max(0.01 * low));
        }
        if own.pairs > 0 {
            values.extend([0.1 * low, 0.01 * low * low]);
        }
        values.push(from.process().tau_s());
        let mut point = Point {
            values: [0.0; MOST],
            structure,
            ..*from
        };
        point.values[..values.len()].copy_from_slice(&values);
        point
    }

    /// Lags, poles and dead times on a grid over the band, each with the gain of the measured response.
    fn starts(&self, structure: Structure) -> Vec<Point> {
        let (low, high) = self.spectra.band_rad_per_s();
        let stages = structure.stages();
        let at = |share: f64| low.powf(1.0 - share) * high.powf(share);
        let mut grids: Vec<Vec<f64>> = vec![vec![0.0]];
        for _ in 0..stages.lags {
            grids.push([0.2, 0.5, 0.8].map(|share| -at(share).ln()).to_vec());
        }
        for _ in 0..stages.poles {
            grids.push(vec![0.1 * low, at(0.3)]);
        }
        for _ in 0..stages.pairs {
            grids.push(vec![0.1 * low, at(0.5)]);
            grids.push(vec![0.01 * low * low, at(0.3).powi(2), at(0.6).powi(2)]);
        }
        grids.push([0.05, 0.3, 1.0].map(|turns| turns / at(0.5)).to_vec());
        let mut points = vec![[0.0; MOST]];
        for (index, grid) in grids.iter().enumerate() {
            points = (points.iter())
                .flat_map(|point| {
                    grid.iter().map(move |value| {
                        let mut point = *point;
                        point[index] = *value;
                        point
                    })
                })
                .collect();
        }
        let with_sign = |sign: f64| points.iter().map(move |values| (sign, *values));
        (with_sign(1.0).chain(with_sign(-1.0)))
            .map(|(sign, values)| {
                let mut point = Point {
                    structure,
                    sign,
                    values,
                };
                point.values[0] = self.gain(&point.process());
                point
            })
            .collect()
    }

    /// Logarithm of the gain for which a process of gain one has the measured response: the median over the frequencies at
    /// which it is certain.
    fn gain(&self, process: &Linear) -> f64 {
        let mut ratios: Vec<(f64, f64)> = (self.spectra.bins.iter().zip(&self.around))
            .map(|(bin, around)| {
                let model = process.frequency_response(bin.omega_rad_per_s) * around;
                let (measured, deviation) = bin.response();
                (deviation, (measured / model).norm().ln())
            })
            .filter(|(_, ratio)| ratio.is_finite())
            .collect();
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        ratios.truncate((ratios.len() / 4).max(3));
        ratios.sort_by(|a, b| a.1.total_cmp(&b.1));
        ratios.get(ratios.len() / 2).map_or(0.0, |ratio| ratio.1)
    }

    /// Whether a point is one that the band can tell: lags from a twentieth of the period of the highest frequency to twenty
    /// of the lowest, a dead time of at most a period of the lowest, a gain not too far from that of the start.
    fn is_inside(&self, point: &Point, from: &Point) -> bool {
        let (low, high) = self.spectra.band_rad_per_s();
        let process = point.process();
        let stages = point.structure.stages();
        let lags = &point.values[1..=stages.lags];
        let is_lag = |lag: &f64| (0.05 / high..20.0 / low).contains(&lag.exp());
        let slack = -0.5 / high;
        (point.values[0] - from.values[0]).abs() < FARTHEST
            && lags.iter().all(is_lag)
            // The same process in another order would be a second maximum.
            && lags.is_sorted_by(|a, b| a >= b)
            && (lags.iter()).all(|lag| lag.exp() * process.pole_per_s() <= 1.0)
            && process.pole_per_s() >= 0.0
            && process.pair().iter().all(|c| *c >= 0.0)
            && (slack..6.0 / low).contains(&process.tau_s())
    }

    /// Steps for differences.
    fn steps(&self, structure: Structure) -> Vec<f64> {
        let (low, high) = self.spectra.band_rad_per_s();
        let stages = structure.stages();
        let mut steps = vec![1e-5; 1 + stages.lags];
        steps.extend(vec![1e-5 * low; stages.poles]);
        for _ in 0..stages.pairs {
            steps.extend([1e-5 * low, 1e-5 * low * low]);
        }
        steps.push(1e-5 / high);
        steps
    }

    /// Normal equations in the units of [`Self::steps`].
    fn normal(&self, point: &Point) -> Normal {
        let errors = self.errors(&point.process());
        let steps = self.steps(point.structure);
        let columns: Vec<Vec<f64>> = (steps.iter().enumerate())
            .map(|(index, step)| {
                let mut moved = *point;
                moved.values[index] += step;
                let moved = self.errors(&moved.process());
                moved.iter().zip(&errors).map(|(a, b)| a - b).collect()
            })
            .collect();
        Normal::new(&columns, &errors)
    }

    /// Processes drawn from the posterior about a fit, for flat priors of the unknowns: a Metropolis chain with steps of the
    /// size of the fit's covariance. `temper` divides the costs.
    pub(super) fn draws(&self, best: &Candidate, temper: f64, count: usize) -> Vec<Linear> {
        let structure = best.structure();
        let unknowns = Point::count(structure);
        let normal = self.normal(&best.point);
        let mut matrix = identity();
        for (row, known) in matrix.iter_mut().zip(&normal.matrix) {
            row[..unknowns].copy_from_slice(known);
        }
        let Some(root) = cholesky(&matrix).filter(|root| (0..MOST).all(|i| root[i][i] > 0.0))
        else {
            return vec![];
        };
        let steps = self.steps(structure);
        let mut size = 2.4 * (temper / unknowns as f64).sqrt();
        let mut rng = Pcg64Mcg::seed_from_u64(SEED);
        let mut here = best.clone();
        let mut draws = Vec::with_capacity(count);
        for k in 0..BURN_IN + CHAIN {
            let normal: [f64; MOST] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
            // With M = L L', the solution x of L' x = z has the covariance M^-1.
            let change = backwards(&root, &normal);
            let mut point = here.point;
            for ((value, change), step) in point.values.iter_mut().zip(change).zip(&steps) {
                *value += size * change * step;
            }
            let cost = match self.is_inside(&point, &best.point) {
                true => self.cost(&point.process()),
                false => f64::INFINITY,
            };
            let is_taken = rng.random::<f64>() < (0.5 * (here.cost - cost) / temper).exp();
            if is_taken {
                here = Candidate { point, cost };
            }
            if k < BURN_IN {
                // Towards an acceptance of a quarter.
                size *= if is_taken { 1.03 } else { 0.99 };
            } else if (k - BURN_IN).is_multiple_of(CHAIN / count) && draws.len() < count {
                draws.push(here.point.process());
            }
        }
        draws
    }
}

/// A descent from a point, which it does not leave too far.
struct Descent<'a> {
    problem: &'a Problem<'a>,
    from: Point,
}

impl LeastSquares for Descent<'_> {
    type Point = Candidate;

    fn normal(&mut self, at: &Candidate) -> Option<Normal> {
        Some(self.problem.normal(&at.point))
    }

    /// A pole or a second-order stage is not below zero.
    fn is_held(&self, at: &Candidate, index: usize, gradient: f64) -> bool {
        at.point.poles_and_pairs().contains(&index)
            && at.point.values[index] <= 0.0
            && gradient > 0.0
    }

    fn moved(&mut self, from: &Candidate, change: &[f64]) -> Option<Candidate> {
        let mut point = from.point;
        let steps = self.problem.steps(point.structure);
        for ((value, change), step) in point.values.iter_mut().zip(change).zip(steps) {
            *value += change * step;
        }
        let bounded = point.poles_and_pairs();
        for value in &mut point.values[bounded] {
            *value = value.max(0.0);
        }
        let cost = self.problem.cost(&point.process());
        let is_inside = self.problem.is_inside(&point, &self.from);
        is_inside.then_some(Candidate { point, cost })
    }

    fn decrease(&self, from: &Candidate, to: &Candidate) -> f64 {
        (from.cost - to.cost) / from.cost
    }
}

/// Solution of `L' x = right`.
fn backwards(root: &[[f64; MOST]; MOST], right: &[f64; MOST]) -> [f64; MOST] {
    let mut x = *right;
    for i in (0..MOST).rev() {
        for j in i + 1..MOST {
            x[i] -= root[j][i] * x[j];
        }
        x[i] /= root[i][i];
    }
    x
}
